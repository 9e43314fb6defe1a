// The BSDFs there are: the only list of them.
#pragma once

#include "models/bsdf/conductor.h"
#include "models/bsdf/dielectric.h"
#include "models/bsdf/diffuse.h"
#include "models/bsdf/diffuse_transmitter.h"
#include "models/bsdf/phong.h"
#include "models/bsdf/plastic.h"
#include "models/bsdf/principled.h"
#include "models/bsdf/principled_thin.h"
#include "models/bsdf/rough_conductor.h"
#include "models/bsdf/rough_dielectric.h"
#include "models/bsdf/rough_diffuse.h"
#include "models/bsdf/rough_plastic.h"
#include "models/bsdf/thin_dielectric.h"
#include "models/bsdf/ward.h"

/// X(model, name): the struct and the name in messages and files.
#define AMBILUX_BSDFS(X)                       \
    X(Diffuse, diffuse)                        \
    X(RoughDiffuse, rough_diffuse)             \
    X(Conductor, conductor)                    \
    X(RoughConductor, rough_conductor)         \
    X(Dielectric, dielectric)                  \
    X(ThinDielectric, thin_dielectric)         \
    X(RoughDielectric, rough_dielectric)       \
    X(Plastic, plastic)                        \
    X(RoughPlastic, rough_plastic)             \
    X(Phong, phong)                            \
    X(Ward, ward)                              \
    X(DiffuseTransmitter, diffuse_transmitter) \
    X(Principled, principled)                  \
    X(PrincipledThin, principled_thin)

namespace ambilux {

AMBILUX_MODEL_ENUM(BsdfType, AMBILUX_BSDFS)

template <class, BsdfModel... Models>
using BsdfModelsOf = ModelList<Models...>;
using BsdfModels = BsdfModelsOf<void AMBILUX_BSDFS(AMBILUX_MODEL_TYPE)>;

template <class Model>
constexpr BsdfType kBsdfType = BsdfType(BsdfModels::index<Model>());

namespace detail {

constexpr uint32_t kSmoothBsdfs = BsdfModels::mask([](auto m) { return decltype(m)::type::smooth; });
constexpr uint32_t kDeltaOnlyBsdfs = BsdfModels::kAll & ~kSmoothBsdfs;
constexpr uint32_t kTransmittingBsdfs = BsdfModels::mask([](auto m) { return decltype(m)::type::transmits; });
constexpr uint32_t kTabulatedBsdfs = BsdfModels::mask([](auto m) { return decltype(m)::type::tabulated; });

template <class... Models>
OneOf<Textured<Models>...> textured_of(ModelList<Models...>);
template <class... Models>
OneOf<typename Models::Constants...> constants_of(ModelList<Models...>);

}  // namespace detail

/// Those of one of the models.
using BsdfParameters = decltype(detail::textured_of(BsdfModels{}));
using BsdfConstants = decltype(detail::constants_of(BsdfModels{}));

/// True if light can pass to the other side.
AMBILUX_HD constexpr bool bsdf_transmits(BsdfType type) {
    // The last one without a branch of its own: one more reorders operands in the kernels of diffuse scenes, whose code
    // is to stay (docs/performance.md).
    constexpr uint32_t kLast = std::bit_floor(detail::kTransmittingBsdfs);
    return BsdfModels::contains < detail::kTransmittingBsdfs & ~kLast > (uint32_t(type)) |
           BsdfModels::contains<kLast>(uint32_t(type));
}
/// True if there is a lobe that is not a delta, so that connecting to other vertices can give light.
AMBILUX_HD constexpr bool bsdf_is_smooth(BsdfType type) {
    return !BsdfModels::contains<detail::kDeltaOnlyBsdfs>(uint32_t(type));
}

/// What bump and normal maps do besides (transport/map_rules.h).
enum MapRules : uint32_t {
    kTurnNormals = 1,  ///< turn normals that face away from where light goes
    kShadowBumps = 2,  ///< darken light that grazes them
};

/// Parameters of one BSDF as a scene has them, the maps that change its frame and the coating above it.
struct BsdfRecord {
    BsdfType type = BsdfType::diffuse;
    uint32_t map_rules = 0;   ///< MapRules
    uint32_t coat = kNone;    ///< place of a Coat in SceneView::tables (transport/bsdf/coating.h)
    int32_t normal_map = -1;  ///< texture of tangent-space normals, or -1
    int32_t bump_map = -1;    ///< texture of heights, or -1
    float bump_scale = 1;
    BsdfParameters parameters;

    BsdfRecord() { parameters.set(Textured<Diffuse>{}); }
    /// Parameters of the model, which must be `Model`.
    template <class Model>
    AMBILUX_HD const Textured<Model>& as() const {
        return parameters.ref<Textured<Model>>();
    }
};

/// True if any parameter of the record comes from a texture.
inline bool is_textured(const BsdfRecord& record) {
    return BsdfModels::visit<BsdfModels::kAll>(uint32_t(record.type), false, [&](auto model) {
        using Model = typename decltype(model)::type;
        BsdfInputs inputs;
        bool textured = false;
        for_each_input(record.as<Model>(), inputs,
                       [&](const auto& parameter, auto&) { textured |= parameter.texture >= 0; });
        if constexpr (HasSlots<Model>) textured |= in_slots(record.as<Model>());
        return textured;
    });
}

/// True if its microfacets are of that distribution.
inline bool has_microfacets(const BsdfRecord& record, Microfacets distribution) {
    return BsdfModels::visit<BsdfModels::kAll>(uint32_t(record.type), false, [&](auto model) {
        const auto& parameters = record.as<typename decltype(model)::type>();
        if constexpr (requires { parameters.distribution; })
            return parameters.distribution == distribution;
        else
            return false;
    });
}

template <class Model>
BsdfRecord bsdf_record(const Textured<Model>& parameters) {
    BsdfRecord record;
    record.type = kBsdfType<Model>;
    record.parameters.set(parameters);
    return record;
}

}  // namespace ambilux
