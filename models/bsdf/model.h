// What every BSDF model is made of. A model is a struct without members:
//
// - plugin: its name in Mitsuba's scene files;
// - smooth: it has a lobe that is not a delta, so that connecting to other vertices can give light;
// - delta: it has lobes that are deltas;
// - transmits: light can pass to the other side;
// - tabulated: its functions read SceneView::tables;
// - Inputs<Color, Number>: parameters that textures may set, first the colours, then the numbers;
// - Constants: parameters that are the same at all points of a surface.
//
// Its functions are in transport/bsdf/, its plugin in formats/document/bsdf_plugins.cpp.
#pragma once

#include <concepts>
#include <utility>

#include "models/model_list.h"
#include "models/parameters.h"

namespace ambilux {

/// Distributions of microfacet normals. Kernels without Features::phong_facets do not know the last one.
enum class Microfacets : uint16_t { beckmann, ggx, phong };

/// Parameters of a model as a scene has them, and at one point, textures looked up.
template <class M>
struct Textured : M::template Inputs<ParamRgb, ParamFloat>, M::Constants {
    using Model = M;
};
template <class M>
struct Resolved : M::template Inputs<Rgb, float>, M::Constants {
    using Model = M;
};

/// What textures may have set at a point: colours and numbers in the order of the model's Inputs. Vertices in queues
/// keep it. The third number of a model with one colour is the first component of the second one; of a record with
/// slots (models/bsdf/slots.h) the others are the texture coordinates.
struct BsdfInputs {
    Rgb colors[2];
    float numbers[2];
};

namespace detail {

/// How many colours and numbers a model's Inputs are: 3c+n words at a point, 4c+2n in a scene.
template <class Model>
struct InputCount {
    using Values = typename Model::template Inputs<Rgb, float>;
    using Parameters = typename Model::template Inputs<ParamRgb, ParamFloat>;
    static constexpr uint32_t words = std::is_empty_v<Values> ? 0 : sizeof(Values) / sizeof(float),
                              all = std::is_empty_v<Values> ? 0 : sizeof(Parameters) / sizeof(float) - words,
                              colors = (words - all) / 2, numbers = all - colors,
                              plain_numbers = numbers < 2 ? numbers : 2;  ///< those of BsdfInputs::numbers
};

/// True if colours come first and numbers after them, not more than vertices in queues can keep.
template <class Model>
constexpr bool inputs_in_order() {
    using Count = InputCount<Model>;
    using Values = typename Count::Values;
    if constexpr (Count::colors > 2 || Count::numbers > (Count::colors < 2 ? 3 : 2))
        return false;
    else
        return []<size_t... C, size_t... N>(std::index_sequence<C...>, std::index_sequence<N...>) {
            return requires { Values{(void(C), Rgb{})..., (void(N), 0.0f)...}; };
        }(std::make_index_sequence<Count::colors>{}, std::make_index_sequence<Count::numbers>{});
}

template <class T, class Value>
concept ConstantOf = std::same_as<T, const Value&>;

}  // namespace detail

/// op(parameter, value) for all inputs of a model in a scene and their places in `inputs`.
template <class Model, class Op>
AMBILUX_HD void for_each_input(const Textured<Model>& parameters, BsdfInputs& inputs, Op op) {
    using Count = detail::InputCount<Model>;
    const typename Count::Parameters& first = parameters;
    const ParamRgb* colors = reinterpret_cast<const ParamRgb*>(&first);
    const ParamFloat* numbers = reinterpret_cast<const ParamFloat*>(colors + Count::colors);
    if constexpr (Count::colors > 0) op(colors[0], inputs.colors[0]);
    if constexpr (Count::colors > 1) op(colors[1], inputs.colors[1]);
    if constexpr (Count::numbers > 0) op(numbers[0], inputs.numbers[0]);
    if constexpr (Count::numbers > 1) op(numbers[1], inputs.numbers[1]);
    if constexpr (Count::numbers > 2) op(numbers[2], inputs.colors[1].x);
}

/// Parameters of a model at a point from its inputs and constants. By memcpy: a visitor with a count of inputs made the
/// shading kernel of diffuse scenes spill (ptxas, sm_90: 76 bytes instead of 8).
template <class Model>
AMBILUX_HD Resolved<Model> resolved(const BsdfInputs& inputs, const typename Model::Constants& constants) {
    using Count = detail::InputCount<Model>;
    typename Count::Values values;
    if constexpr (Count::colors > 0) memcpy(&values, inputs.colors, Count::colors * sizeof(Rgb));
    if constexpr (Count::numbers > 0)
        memcpy(reinterpret_cast<char*>(&values) + Count::colors * sizeof(Rgb), inputs.numbers,
               Count::plain_numbers * sizeof(float));
    if constexpr (Count::numbers > 2)
        memcpy(reinterpret_cast<char*>(&values) + Count::colors * sizeof(Rgb) + 2 * sizeof(float), &inputs.colors[1].x,
               sizeof(float));
    return {values, constants};
}

template <class Model>
AMBILUX_HD BsdfInputs inputs_of(const Resolved<Model>& parameters) {
    using Count = detail::InputCount<Model>;
    const typename Count::Values& values = parameters;
    BsdfInputs inputs = {};
    if constexpr (Count::colors > 0) memcpy(inputs.colors, &values, Count::colors * sizeof(Rgb));
    if constexpr (Count::numbers > 0)
        memcpy(inputs.numbers, reinterpret_cast<const char*>(&values) + Count::colors * sizeof(Rgb),
               Count::plain_numbers * sizeof(float));
    if constexpr (Count::numbers > 2)
        memcpy(&inputs.colors[1].x,
               reinterpret_cast<const char*>(&values) + Count::colors * sizeof(Rgb) + 2 * sizeof(float), sizeof(float));
    return inputs;
}

/// What a member of the list must say of itself.
template <class Model>
concept BsdfModel = requires {
    { (Model::plugin) } -> detail::ConstantOf<const char*>;
    { (Model::smooth) } -> detail::ConstantOf<bool>;
    { (Model::delta) } -> detail::ConstantOf<bool>;
    { (Model::transmits) } -> detail::ConstantOf<bool>;
    { (Model::tabulated) } -> detail::ConstantOf<bool>;
    typename Model::template Inputs<Rgb, float>;
    typename Model::Constants;
    requires(Model::smooth || Model::delta);
    requires detail::inputs_in_order<Model>();
    requires std::is_trivially_copyable_v<Resolved<Model>>;
};

}  // namespace ambilux
