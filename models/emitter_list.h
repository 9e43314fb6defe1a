// The emitters there are: the only list of them, and what each says of itself.
//
// - plugin: its name in Mitsuba's scene files;
// - surface: it is part of a shape, which rays can meet unless its position is a delta;
// - delta_position, delta_direction: its light starts at one point, or leaves in one direction, so that no ray finds it
//   by chance; a hidden area draws that point anew for each sample;
// - infinite: its light comes from outside of the scene;
// - start: where its light starts, by which the densities of one strategy follow from those of another
//   (transport/mis/bidirectional.h). It says no more than the four before, but a new emitter has to say it.
//
// Functions are in transport/emitter/, plugins in formats/document/emitters.cpp, powers in formats/finalize.cpp.
#pragma once

#include <concepts>

#include "models/model_list.h"

namespace ambilux {

enum class LightStart : uint32_t {
    surface,         ///< rays meet it by chance
    hidden_surface,  ///< a point of a surface that no ray meets
    point,
    distant,      ///< outside of the scene, in one direction
    environment,  ///< outside of the scene, in all directions
    beam,         ///< in one direction, from within the scene
};

struct AreaEmitter {
    static constexpr const char* plugin = "area";
    static constexpr bool surface = true, delta_position = false, delta_direction = false, infinite = false;
    static constexpr LightStart start = LightStart::surface;
};
struct PointEmitter {
    static constexpr const char* plugin = "point";
    static constexpr bool surface = false, delta_position = true, delta_direction = false, infinite = false;
    static constexpr LightStart start = LightStart::point;
};
struct SpotEmitter {
    static constexpr const char* plugin = "spot";
    static constexpr bool surface = false, delta_position = true, delta_direction = false, infinite = false;
    static constexpr LightStart start = LightStart::point;
};
struct ProjectorEmitter {
    static constexpr const char* plugin = "projector";
    static constexpr bool surface = false, delta_position = true, delta_direction = false, infinite = false;
    static constexpr LightStart start = LightStart::point;
};
struct DirectionalEmitter {
    static constexpr const char* plugin = "directional";
    static constexpr bool surface = false, delta_position = false, delta_direction = true, infinite = true;
    static constexpr LightStart start = LightStart::distant;
};
struct ConstantEmitter {
    static constexpr const char* plugin = "constant";
    static constexpr bool surface = false, delta_position = false, delta_direction = false, infinite = true;
    static constexpr LightStart start = LightStart::environment;
};
struct EnvmapEmitter {
    static constexpr const char* plugin = "envmap";
    static constexpr bool surface = false, delta_position = false, delta_direction = false, infinite = true;
    static constexpr LightStart start = LightStart::environment;
};
struct CollimatedEmitter {
    static constexpr const char* plugin = "collimated";
    static constexpr bool surface = false, delta_position = true, delta_direction = true, infinite = false;
    static constexpr LightStart start = LightStart::beam;
};
struct DirectionalAreaEmitter {
    static constexpr const char* plugin = "directionalarea";
    static constexpr bool surface = true, delta_position = false, delta_direction = true, infinite = false;
    static constexpr LightStart start = LightStart::beam;
};
struct HiddenAreaEmitter {
    static constexpr const char* plugin = "hiddenarea";
    static constexpr bool surface = true, delta_position = true, delta_direction = false, infinite = false;
    static constexpr LightStart start = LightStart::hidden_surface;
};

}  // namespace ambilux

/// X(model, name): the struct and the name in messages and files.
#define AMBILUX_EMITTERS(X)                     \
    X(AreaEmitter, area)                        \
    X(PointEmitter, point)                      \
    X(SpotEmitter, spot)                        \
    X(DirectionalEmitter, directional)          \
    X(ConstantEmitter, constant)                \
    X(EnvmapEmitter, envmap)                    \
    X(ProjectorEmitter, projector)              \
    X(CollimatedEmitter, collimated)            \
    X(DirectionalAreaEmitter, directional_area) \
    X(HiddenAreaEmitter, hidden_area)

namespace ambilux {

AMBILUX_MODEL_ENUM(EmitterType, AMBILUX_EMITTERS)

namespace detail {

constexpr LightStart light_start(bool surface, bool delta_position, bool delta_direction, bool infinite) {
    if (infinite) return delta_direction ? LightStart::distant : LightStart::environment;
    if (delta_direction) return LightStart::beam;
    if (surface) return delta_position ? LightStart::hidden_surface : LightStart::surface;
    return LightStart::point;
}

}  // namespace detail

/// What a member of the list must say of itself.
template <class Model>
concept EmitterModel = requires {
    { (Model::plugin) } -> std::same_as<const char* const&>;
    { (Model::surface) } -> std::same_as<const bool&>;
    { (Model::delta_position) } -> std::same_as<const bool&>;
    { (Model::delta_direction) } -> std::same_as<const bool&>;
    { (Model::infinite) } -> std::same_as<const bool&>;
    { (Model::start) } -> std::same_as<const LightStart&>;
    requires Model::start ==
                 detail::light_start(Model::surface, Model::delta_position, Model::delta_direction, Model::infinite);
    requires Model::infinite != (Model::surface || Model::delta_position);
};
template <class, EmitterModel... Models>
using EmitterModelsOf = ModelList<Models...>;
using EmitterModels = EmitterModelsOf<void AMBILUX_EMITTERS(AMBILUX_MODEL_TYPE)>;

template <class Model>
constexpr EmitterType kEmitterType = EmitterType(EmitterModels::index<Model>());
template <LightStart Start>
constexpr uint32_t kEmittersFrom = EmitterModels::mask([](auto m) { return decltype(m)::type::start == Start; });

namespace detail {

constexpr uint32_t kPositionEmitters = EmitterModels::mask([](auto m) { return decltype(m)::type::delta_position; });
constexpr uint32_t kDirectionEmitters = EmitterModels::mask([](auto m) { return decltype(m)::type::delta_direction; });
constexpr uint32_t kDeltaEmitters = kPositionEmitters | kDirectionEmitters;
constexpr uint32_t kInfiniteEmitters = EmitterModels::mask([](auto m) { return decltype(m)::type::infinite; });
constexpr uint32_t kEnvironmentEmitters = kEmittersFrom<LightStart::environment>;
constexpr uint32_t kSurfaceEmitters = EmitterModels::mask([](auto m) { return decltype(m)::type::surface; });
constexpr uint32_t kBeamEmitters = kEmittersFrom<LightStart::beam>;

}  // namespace detail

AMBILUX_HD constexpr bool has_delta_position(EmitterType type) {
    return EmitterModels::contains<detail::kPositionEmitters>(uint32_t(type));
}
AMBILUX_HD constexpr bool has_delta_direction(EmitterType type) {
    return EmitterModels::contains<detail::kDirectionEmitters>(uint32_t(type));
}
/// No ray meets it by chance.
AMBILUX_HD constexpr bool is_delta(EmitterType type) {
    return EmitterModels::contains<detail::kDeltaEmitters>(uint32_t(type));
}
/// Its light leaves places of the scene in one direction each: of all points that could ask for it, next event
/// estimation meets none on its way. Light subpaths alone carry it.
AMBILUX_HD constexpr bool is_beam(EmitterType type) {
    return EmitterModels::contains<detail::kBeamEmitters>(uint32_t(type));
}
constexpr bool is_on_surface(EmitterType type) {
    return EmitterModels::contains<detail::kSurfaceEmitters>(uint32_t(type));
}
AMBILUX_HD constexpr bool is_infinite(EmitterType type) {
    return EmitterModels::contains<detail::kInfiniteEmitters>(uint32_t(type));
}
/// It surrounds the scene: what rays that miss see. A scene has one at most.
constexpr bool is_environment(EmitterType type) {
    return EmitterModels::contains<detail::kEnvironmentEmitters>(uint32_t(type));
}

}  // namespace ambilux
