// All integrators and variants by name: the only place that knows them.
#pragma once

#include <string>

namespace ambilux {

struct PathFamily;
struct BdptFamily;

/// A variant of an integrator, and which settings have an effect on it.
struct VariantInfo {
    const char *integrator, *variant;
    bool bidirectional;    ///< has strategies (s,t); otherwise estimators
    bool draws;            ///< draws light vertices from a cache
    bool strategy_images;  ///< gathers images of single strategies
    bool sorts, compacts;  ///< has queues that can be sorted; whose items can lie by path
    bool repeats;          ///< on a device too, bits repeat with deterministic=true
    bool binary_bvh;       ///< has kernels for accel=bvh2
};

constexpr VariantInfo kVariants[] = {
    {"path", "wavefront", false, false, false, true, true, true, true},
    {"light", "wavefront", true, false, true, true, true, true, false},
    {"bdpt", "wavefront", true, false, true, true, true, true, false},
    {"bdpt", "lvc", true, true, true, true, true, false, false},
    {"bdpt", "streaming", true, false, true, true, false, true, false},
    {"bdpt", "megakernel", true, false, false, false, false, true, false},
};

/// Null if there is none of this name.
constexpr const VariantInfo* find_variant(const std::string& integrator, const std::string& variant) {
    for (const VariantInfo& v : kVariants)
        if (integrator == v.integrator && variant == v.variant) return &v;
    return nullptr;
}

/// f.template operator()<Family>() with what holds the variants of an integrator (integrators/NAME/variants.h).
template <class Function>
auto with_family(const std::string& integrator, Function f) {
    if (integrator == "path") return f.template operator()<PathFamily>();
    return f.template operator()<BdptFamily>();
}

}  // namespace ambilux
