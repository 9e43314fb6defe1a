// Rough plastic: a rough dielectric coating over a diffuse base, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

/// Size of the table of directional transmittance over cos(theta) in [0,1] at equal steps, both ends included.
constexpr uint32_t kTransmittanceTableSize = 64;

struct RoughPlastic {
    static constexpr const char* plugin = "roughplastic";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = true;

    template <class Color, class Number>
    struct Inputs {
        Color reflectance, specular_reflectance;
        Number alpha;  ///< roughness of the coating; of no texture, because of the table
    };

    struct Constants {
        float ior;                       ///< interior over exterior index of refraction
        float fdr_internal;              ///< mean diffuse Fresnel reflectance seen from inside
        float specular_sampling_weight;  ///< share of the specular lobe in sampling, before Fresnel
        uint32_t nonlinear;              ///< not 0: colour shifts by internal scattering
        Microfacets distribution;
        uint16_t sample_visible;       ///< not 0: sample visible normals (Heitz and d'Eon 2014)
        uint32_t transmittance_table;  ///< place of kTransmittanceTableSize floats in SceneView::tables
    };
};

}  // namespace ambilux
