// What a scene contains, as bits. Kernels are specialised by a constexpr Features, so that what a scene lacks is not in
// them.
#pragma once

#include <cstdint>

#include "models/bsdf_list.h"
#include "models/emitter_list.h"
#include "models/primitive_list.h"

namespace ambilux {

/// Set of features. Structural, so that it can be a template argument.
struct Features {
    uint32_t bsdfs = 0;         ///< bit per BsdfType
    uint32_t emitters = 0;      ///< bit per EmitterType
    uint32_t primitives = 0;    ///< bit per PrimitiveType
    bool textures = false;      ///< any parameter comes from a texture
    bool bumps = false;         ///< any bump or normal map
    bool opacity = false;       ///< any surface that lets rays pass at random
    bool blends = false;        ///< any surface of two materials
    bool coats = false;         ///< any coating
    bool map_rules = false;     ///< any map with MapRules
    bool instances = false;     ///< any group of triangles in several places (scene/view.h, Instance)
    bool latlong = false;       ///< a sensor of all directions (models/sensor_list.h)
    bool phong_facets = false;  ///< any BSDF with Microfacets::phong
    bool sampling = false;      ///< not of a scene, but of kernels: next event estimation may pick lights by a tree
                                ///< (scene/light_tree.h), and numbers may be Sobol' points (core/sobol.h)

    constexpr bool has(BsdfType t) const { return bsdfs >> uint32_t(t) & 1u; }
    constexpr bool has(EmitterType t) const { return emitters >> uint32_t(t) & 1u; }
    constexpr bool has(PrimitiveType t) const { return primitives >> uint32_t(t) & 1u; }
    constexpr bool several_bsdfs() const { return bsdfs & (bsdfs - 1); }
    constexpr bool has_quadrics() const { return primitives & ~1u; }
    constexpr bool has_environment() const { return emitters & detail::kEnvironmentEmitters; }
    constexpr bool has_beams() const { return emitters & detail::kBeamEmitters; }

    /// True if kernels built for *this can render a scene that needs `other`.
    constexpr bool covers(const Features& other) const {
        return !(other.bsdfs & ~bsdfs) && !(other.emitters & ~emitters) && !(other.primitives & ~primitives) &&
               (textures || !other.textures) && (bumps || !other.bumps) && (opacity || !other.opacity) &&
               (blends || !other.blends) && (coats || !other.coats) && (map_rules || !other.map_rules) &&
               (instances || !other.instances) && (latlong || !other.latlong) &&
               (phong_facets || !other.phong_facets) && (sampling || !other.sampling);
    }
    constexpr bool operator==(const Features&) const = default;
};

constexpr uint32_t bit(BsdfType t) { return 1u << uint32_t(t); }
constexpr uint32_t bit(EmitterType t) { return 1u << uint32_t(t); }
constexpr uint32_t bit(PrimitiveType t) { return 1u << uint32_t(t); }

/// All that a scene can have.
constexpr Features kAllFeatures = {BsdfModels::kAll,
                                   EmitterModels::kAll,
                                   (1u << uint32_t(PrimitiveType::count)) - 1,
                                   true,
                                   true,
                                   true,
                                   true,
                                   true,
                                   true,
                                   true,
                                   true,
                                   true};

}  // namespace ambilux
