#include "formats/document/coatings.h"

#include <algorithm>
#include <cmath>

#include "formats/document/bsdf_plugins.h"
#include "transport/bsdf/coating.h"
#include "transport/bsdf/precompute.h"

namespace ambilux::document {

bool is_coating(const std::string& type) { return type == "coating" || type == "roughcoating"; }

CoatPlace read_coat(Builder& builder, Reader& in) {
    CoatPlace place{0, in.object().type == "roughcoating"};
    const float ior = in.ior("int_ior", "bk7") / in.ior("ext_ior", "air");
    if (ior == 1) in.fail("interior and exterior index of a coating must differ");
    const double thickness = in.number("thickness", 1);
    if (!(thickness >= 0)) in.fail(in.where("thickness"), "the thickness of a coating must not be negative");
    const Rgb absorption = in.color("sigma_a", {0, 0, 0}, SpectrumUse::unbounded) * float(thickness);
    if (!(min_component(absorption) >= 0)) in.fail(in.where("sigma_a"), "sigma_a must not be negative");
    const Rgb specular = in.color("specular_reflectance", splat(1), SpectrumUse::reflectance);
    float alpha = 0;
    Microfacets distribution = Microfacets::beckmann;
    if (place.rough) {
        alpha = float(in.number("alpha", 0.1));
        if (!(alpha >= 0)) in.fail(in.where("alpha"), "roughness must not be negative");
        alpha = std::max(alpha, 1e-4f);
        distribution = read_distribution(builder, in);
        if (distribution == Microfacets::phong) {
            builder.refuse(in.where("distribution"), "microfacets of phong in a roughcoating are not supported",
                           "beckmann is used");
            distribution = Microfacets::beckmann;
        }
        in.ignore({"sample_visible"});
        builder.note(in.where(),
                     "the base below a roughcoating is as bright as below a smooth one; Mitsuba 0.6 darkens it by "
                     "cos/cos' of the viewing direction before and behind the boundary");
    }
    if (builder.validate_only) return place;
    // Of the light that enters, what the layer lets pass twice stands against all that is reflected (Mitsuba 0.6).
    const float passes = (std::exp(-2 * absorption.x) + std::exp(-2 * absorption.y) + std::exp(-2 * absorption.z)) / 3;
    std::vector<float> table;
    for (float f : {ior, alpha, distribution == Microfacets::ggx ? 1.0f : 0.0f, 1 / (1 + passes), specular.x,
                    specular.y, specular.z, absorption.x, absorption.y, absorption.z, 0.0f, 0.0f})
        table.push_back(f);
    if (place.rough) {
        table.resize(table.size() + kTransmittanceTableSize);
        rough_transmittance_table(distribution, alpha, ior, table.data() + Coat::kFloats);
    }
    place.table = uint32_t(builder.scene.tables.size());
    builder.scene.tables.append(table.data(), table.size());
    return place;
}

}  // namespace ambilux::document
