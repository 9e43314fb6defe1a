// The sensors there are: the only list of them, and what each says of itself.
//
// - plugin: its name in Mitsuba's scene files;
// - parallel: all rays have one direction;
// - lens: rays start on an aperture, which may be of size 0; else, unless they are parallel, at one point;
// - latlong: the film is all directions by longitude and colatitude (transport/sensor/latlong.h).
#pragma once

#include <concepts>

#include "models/model_list.h"

namespace ambilux {

struct PerspectiveSensor {
    static constexpr const char* plugin = "perspective";
    static constexpr bool parallel = false, lens = false, latlong = false;
};
struct ThinLensSensor {
    static constexpr const char* plugin = "thinlens";
    static constexpr bool parallel = false, lens = true, latlong = false;
};
struct OrthographicSensor {
    static constexpr const char* plugin = "orthographic";
    static constexpr bool parallel = true, lens = false, latlong = false;
};
struct SphericalSensor {
    static constexpr const char* plugin = "spherical";
    static constexpr bool parallel = false, lens = false, latlong = true;
};

}  // namespace ambilux

/// X(model, name): the struct and the name in messages and files.
#define AMBILUX_SENSORS(X)              \
    X(PerspectiveSensor, perspective)   \
    X(ThinLensSensor, thin_lens)        \
    X(OrthographicSensor, orthographic) \
    X(SphericalSensor, spherical)

namespace ambilux {

AMBILUX_MODEL_ENUM(SensorType, AMBILUX_SENSORS)

/// What a member of the list must say of itself.
template <class Model>
concept SensorModel = requires {
    { (Model::plugin) } -> std::same_as<const char* const&>;
    { (Model::parallel) } -> std::same_as<const bool&>;
    { (Model::lens) } -> std::same_as<const bool&>;
    { (Model::latlong) } -> std::same_as<const bool&>;
    requires Model::parallel + Model::lens + Model::latlong <= 1;
};
template <class, SensorModel... Models>
using SensorModelsOf = ModelList<Models...>;
using SensorModels = SensorModelsOf<void AMBILUX_SENSORS(AMBILUX_MODEL_TYPE)>;

/// Its name in Mitsuba's scene files.
inline const char* plugin_of(SensorType type) {
    const char* plugin = "";
    SensorModels::for_each([&](auto m) {
        if (SensorModels::index<typename decltype(m)::type>() == uint32_t(type)) plugin = decltype(m)::type::plugin;
    });
    return plugin;
}
AMBILUX_HD constexpr bool is_parallel(SensorType type) {
    return SensorModels::contains<SensorModels::mask([](auto m) { return decltype(m)::type::parallel; })>(
        uint32_t(type));
}
AMBILUX_HD constexpr bool has_lens(SensorType type) {
    return SensorModels::contains<SensorModels::mask([](auto m) { return decltype(m)::type::lens; })>(uint32_t(type));
}
AMBILUX_HD constexpr bool is_latlong(SensorType type) {
    return SensorModels::contains<SensorModels::mask([](auto m) { return decltype(m)::type::latlong; })>(
        uint32_t(type));
}

}  // namespace ambilux
