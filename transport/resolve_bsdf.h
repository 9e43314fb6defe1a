// A BSDF at a surface point as data: its model and parameters. How it scatters is in transport/bsdf.h, which few need.
#pragma once

#include <bit>

#include "scene/view.h"
#include "transport/texture.h"

namespace ambilux {

/// A BSDF at one surface point: the model and its parameters, textures looked up.
struct Bsdf {
    BsdfType type;
    BsdfInputs inputs;
    BsdfConstants constants;
    const float32* tables;  ///< SceneView::tables for the models that read them
    const float32* coat;    ///< the Coat above it, or null

    /// Parameters of the model, which must be `Model`.
    template <class Model>
    AMBILUX_HD Resolved<Model> as() const {
        return resolved<Model>(inputs, constants.get<typename Model::Constants>());
    }
};

template <class Model>
AMBILUX_HD Bsdf bsdf_of(const Resolved<Model>& parameters, const float32* tables = nullptr) {
    Bsdf b = {};
    b.type = kBsdfType<Model>;
    b.inputs = inputs_of(parameters);
    b.constants.set<typename Model::Constants>(parameters);
    b.tables = tables;
    return b;
}

AMBILUX_HD bool bsdf_is_smooth(const Bsdf& b) { return bsdf_is_smooth(b.type); }

/// `op` with the model of that type; `otherwise` when kernels of features F do not know it.
template <Features F, class Result, class Op>
AMBILUX_HD Result visit_bsdf(BsdfType type, Result otherwise, Op op) {
    return BsdfModels::visit<F.bsdfs>(uint32_t(type), otherwise, op);
}

/// Looks up inputs at texture coordinates `uv`.
template <Features F>
struct InputsAt {
    const SceneView& scene;
    Vec2f uv;

    template <class Model>
    AMBILUX_HD void operator()(const Textured<Model>& parameters, BsdfInputs& inputs) const {
        for_each_input(parameters, inputs, [&](const auto& parameter, auto& value) {
            if constexpr (std::is_same_v<decltype(value), Rgb&>)
                value = eval_rgb<F>(scene, parameter, uv);
            else
                value = eval_float<F>(scene, parameter, uv);
        });
        if constexpr (F.textures && HasSlots<Model>)
            if (in_slots(parameters)) inputs.colors[1].y = uv.x, inputs.colors[1].z = uv.y;
    }
};

/// Constants of a record with slots where texture coordinates are `uv`.
template <Features F, class Model>
AMBILUX_HD_APART typename Model::Constants constants_from_slots(const SceneView& scene,
                                                                typename Model::Constants record, Vec2f uv) {
    static_assert(detail::InputCount<Model>::colors == 1, "inputs have room for coordinates");
    const float32* at = scene.tables + slots_at(record);
    float numbers[kSlotsOf<Model>];
    for (uint32_t i = 0; i < kSlotsOf<Model>; ++i)
        numbers[i] = eval_float<F>(scene, {at[2 * i], __builtin_bit_cast(int32_t, at[2 * i + 1])}, uv);
    typename Model::template Slots<float> slots;
    memcpy(&slots, numbers, sizeof slots);
    return Model::with_slots(record, slots);
}

/// The BSDF of `record`; `find_inputs(parameters, inputs)` sets what textures may set.
template <Features F, class FindInputs>
AMBILUX_HD Bsdf make_bsdf(const SceneView& scene, const BsdfRecord& record, const FindInputs& find_inputs) {
    Bsdf b = {};
    b.type = F.several_bsdfs() ? record.type : BsdfType(std::countr_zero(F.bsdfs));
    if constexpr (F.bsdfs & detail::kTabulatedBsdfs) b.tables = scene.tables;
    if constexpr (F.coats) b.coat = record.coat != kNone ? scene.tables + record.coat : nullptr;
    visit_bsdf<F>(b.type, false, [&](auto model) {
        using Model = typename decltype(model)::type;
        const Textured<Model>& parameters = record.as<Model>();
        find_inputs(parameters, b.inputs);
        b.constants.set<typename Model::Constants>(parameters);
        if constexpr (F.textures && HasSlots<Model>)
            if (in_slots(parameters))
                b.constants.set(
                    constants_from_slots<F, Model>(scene, parameters, {b.inputs.colors[1].y, b.inputs.colors[1].z}));
        return true;
    });
    return b;
}

/// The BSDF of `record` at texture coordinates `uv`.
template <Features F>
AMBILUX_HD Bsdf resolve_bsdf(const SceneView& scene, const BsdfRecord& record, Vec2f uv) {
    return make_bsdf<F>(scene, record, InputsAt<F>{scene, uv});
}

/// The BSDF of `record` with inputs that are known.
template <Features F>
AMBILUX_HD Bsdf resolve_bsdf(const SceneView& scene, const BsdfRecord& record, const BsdfInputs& known) {
    return make_bsdf<F>(scene, record, [&](const auto&, BsdfInputs& inputs) { inputs = known; });
}

}  // namespace ambilux
