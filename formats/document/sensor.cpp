#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "accel/range.h"
#include "core/text_cursor.h"
#include "formats/document/builder.h"
#include "formats/document/plugins.h"

namespace ambilux::document {

/// Tangents of half a field of view: its square is a density, and its inverse too.
static constexpr double kLeastTangent = 1e-9, kMostTangent = 1e9;

Vec2f field_of_view(Reader& in, double aspect) {
    if (in.has("fov") && in.has("focal_length"))
        in.fail(in.where("focal_length"), "both 'fov' and 'focal_length' are given");
    std::string axis = "diagonal";
    double t = 0;
    if (in.has("fov")) {
        axis = in.text("fov_axis", "x");
        const double fov = in.number("fov", 0);
        if (!(fov > 0 && fov < 180)) in.fail(in.where("fov"), "fov must lie between 0 and 180 degrees");
        t = std::tan(fov * (M_PI / 360));
    } else {
        const std::string text = in.text("focal_length", "50mm");
        TextCursor cursor(text);
        double focal = 0;
        const bool ok = cursor.number(focal);
        if (!ok || !(focal > 0) || (!cursor.done() && cursor.word() != "mm"))
            in.fail(in.where("focal_length"), "'" + text + "' is not a focal length in mm");
        t = std::sqrt(36.0 * 36 + 24 * 24) / (2 * focal);
        in.leave({{"fov_axis", "diagonal"}}, "a focal length is that of the diagonal");
    }
    if (axis == "smaller") axis = aspect > 1 ? "y" : "x";
    if (axis == "larger") axis = aspect > 1 ? "x" : "y";
    double tx = 0;
    if (axis == "x")
        tx = t;
    else if (axis == "y")
        tx = t * aspect;
    else if (axis == "diagonal")
        tx = t * aspect / std::sqrt(aspect * aspect + 1);
    else
        in.fail(in.where("fov_axis"), "unknown fov_axis '" + axis + "'");
    for (const double tangent : {tx, tx / aspect})
        if (!(tangent >= kLeastTangent && tangent <= kMostTangent))
            in.fail(in.where(in.has("fov") ? "fov" : "focal_length"),
                    fmt::format("the tangent of half the field of view is {:g}; it must lie between {:g} and {:g}",
                                tangent, kLeastTangent, kMostTangent));
    return {float(tx), float(tx / aspect)};
}

namespace {

constexpr uint64_t kMostPixels = 0xffffffff;

/// A length of the sensor; fails outside of the range of the tracers.
float range_parameter(Reader& in, const char* name, double fallback) {
    const double value = in.number(name, fallback);
    if (!(std::fabs(value) <= double(kMostCoordinate)))
        in.fail(in.where(name), fmt::format("{} is {:g}; it may be {:g} at most", name, value, kMostCoordinate));
    return float(value);
}

void read_filter(Builder& builder, Reader& film, Sensor& sensor) {
    const Object* object = film.take("rfilter");
    sensor.filter = FilterType::gaussian;
    sensor.filter_radius = 2;
    if (!object) return;  // Mitsuba's default
    Reader in(builder, *object);
    if (object->type == "box") {
        sensor.filter = FilterType::box;
        sensor.filter_radius = float(in.number("radius", 0.5));
    } else if (object->type == "tent") {
        sensor.filter = FilterType::tent;
        sensor.filter_radius = float(in.number("radius", 1));
    } else if (object->type == "gaussian") {
        sensor.filter_radius = float(4 * in.number("stddev", 0.5));
    } else if (object->type == "mitchell" || object->type == "catmullrom" || object->type == "lanczos") {
        // Filters are sampled, which needs them to be nowhere negative.
        builder.note(object->where, "reconstruction filter '" + object->type +
                                        "' has negative lobes; a gaussian with a standard deviation of 0.5 is used");
        in.ignore({"b", "c", "a", "lobes"});
        return in.finish();
    } else {
        builder.refuse(
            object->where,
            "reconstruction filter '" + object->type + "' is not supported" + what_is_meant("rfilter", object->type),
            "gaussian is used");
        return;
    }
    if (!(sensor.filter_radius > 0)) in.fail("the radius of the reconstruction filter must be positive");
    in.finish();
}

uint32_t size_parameter(Reader& in, const char* name, int64_t fallback, int64_t lowest) {
    const int64_t n = in.integer(name, fallback);
    if (n < lowest || n > 65536)
        in.fail(in.where(name),
                std::string("'") + name + "' must lie between " + std::to_string(lowest) + " and 65536");
    return uint32_t(n);
}

/// Size of the film, and the part of it that is rendered.
void read_film_size(const Builder& builder, Reader& in, Sensor& sensor) {
    sensor.film_width = size_parameter(in, "width", 768, 1);
    sensor.film_height = size_parameter(in, "height", 576, 1);
    sensor.crop_x = size_parameter(in, "crop_offset_x", 0, 0);
    sensor.crop_y = size_parameter(in, "crop_offset_y", 0, 0);
    sensor.crop_width = size_parameter(in, "crop_width", int64_t(sensor.film_width) - sensor.crop_x, 1);
    sensor.crop_height = size_parameter(in, "crop_height", int64_t(sensor.film_height) - sensor.crop_y, 1);
    if (sensor.crop_x + sensor.crop_width > sensor.film_width ||
        sensor.crop_y + sensor.crop_height > sensor.film_height)
        in.fail(in.where("crop_width"), "the crop window is not inside of the film");
    const uint64_t pixels = uint64_t(sensor.crop_width) * sensor.crop_height, most = builder.options.limits.pixels;
    if (!builder.options.width && pixels > std::min(most, kMostPixels))
        in.fail(in.where("width"),
                fmt::format("a film of {}x{} has more pixels than {}", sensor.crop_width, sensor.crop_height,
                            pixels > most ? fmt::format("--limits pixels={}; --size gives it another size", most)
                                          : "can be numbered"));
}

/// Gives the film another size; the crop window is scaled with it.
void resize_film(uint32_t width, uint32_t height, Sensor& sensor) {
    const auto rescale = [](uint32_t& offset, uint32_t& size, uint32_t from, uint32_t to) {
        const double s = double(to) / from;
        const uint32_t begin = std::min(uint32_t(std::lround(offset * s)), to - 1),
                       end = std::min(uint32_t(std::lround((double(offset) + size) * s)), to);
        offset = begin;
        size = std::max(end, begin + 1) - begin;
    };
    rescale(sensor.crop_x, sensor.crop_width, sensor.film_width, width);
    rescale(sensor.crop_y, sensor.crop_height, sensor.film_height, height);
    sensor.film_width = width;
    sensor.film_height = height;
}

void read_film(Builder& builder, const Object* object, Sensor& sensor) {
    static const Object default_film = make_object("film", "hdrfilm", {});
    Reader in(builder, object ? *object : default_film);
    const std::string& type = in.object().type;
    const bool known = is_one_of(film_plugins(), type);
    // One of another program: how it keeps what it sees does not matter here, its size does.
    const bool foreign = !known && type != "specfilm";
    if (foreign) builder.note(in.where(), "film type '" + type + "' is not known; it is read as hdrfilm");
    if (type == "specfilm") builder.refuse(in.where(), "film type 'specfilm' is not supported", "hdrfilm is used");
    if (known && type != "hdrfilm")
        builder.note(in.where(), "a film of type '" + type + "' gets linear values, as hdrfilm does");
    read_film_size(builder, in, sensor);
    read_filter(builder, in, sensor);
    const bool wide = sensor.filter != FilterType::box || sensor.filter_radius > 0.5f;
    const char* const edges = wide ? "true" : "true|false";
    in.leave({{"sample_border", edges}, {"high_quality_edges", edges}}, "filters reach beyond the edges of the film");
    in.leave({{"pixel_format", "rgb"}}, "images have the channels R, G and B");
    in.leave({{"file_format", "openexr"}, {"component_format", "float16|float32"}, {"compensate", "true|false"}},
             "images are OpenEXR files of floats");
    const std::string shown = "images hold linear values";
    // The note on such a type says so.
    if (known && type != "hdrfilm")
        in.ignore({"exposure", "key", "burn", "tonemap_method", "label", "digits", "variable", "gamma", "tonemap"});
    in.leave({{"banner", "false"}, {"attach_log", "false"}}, shown);
    for (const char* name : {"gamma", "exposure", "key", "burn", "tonemap_method", "label", "digits", "variable",
                             "tonemap", "fps", "cache", "reinhard_key", "mode", "filename"})
        in.leave({{name}}, shown);
    if (known) in.finish();
    if (builder.options.width) resize_film(builder.options.width, builder.options.height, sensor);
}

void read_sampler(Builder& builder, const Object* object) {
    if (!object) return;
    Reader in(builder, *object);
    const bool known = is_one_of(sampler_plugins(), object->type);
    // Every sampler has the same expected image; ours is independent.
    if (object->type != "independent")
        builder.note(object->where, "sampler type '" + object->type + "' is " + (known ? "not followed" : "not known") +
                                        "; samples are independent");
    const int64_t spp = in.integer("sample_count", 4);
    if (spp < 1 || spp > 1000000000) in.fail(in.where("sample_count"), "sample_count must be positive");
    builder.scene.integrator.spp = int(spp);
    in.leave({{"seed", "0"}}, "--seed has the last word");
    in.ignore({"scramble", "jitter", "dimension", "strength"});
    if (known) in.finish();
}

/// Fails unless all rays of a perspective sensor can be traced.
void check_rays(Reader& in, const Sensor& sensor) {
    const double focus = has_lens(sensor.type) ? sensor.focus_distance : 1, lens = sensor.aperture_radius;
    const auto slope = [&](float tangent, float offset) {
        return tangent * (1 + 2 * std::fabs(offset)) + lens / focus;
    };
    const double steepest = std::max(slope(sensor.tan_half_fov.x, sensor.principal_offset.x),
                                     slope(sensor.tan_half_fov.y, sensor.principal_offset.y));
    if (!(steepest <= kMostTangent))
        in.fail(fmt::format("rays of the sensor leave its axis by {:g} times their way; {:g} is possible", steepest,
                            kMostTangent));
    const double reach = lens + steepest * sensor.near_clip;
    if (!(reach <= double(kMostCoordinate)))
        in.fail(fmt::format("rays of the sensor begin up to {:g} from it; {:g} is possible", reach, kMostCoordinate));
}

/// How a sensor with a view axis projects.
void read_lens(Reader& in, Sensor& sensor, double aspect) {
    if (!is_parallel(sensor.type)) {
        sensor.tan_half_fov = field_of_view(in, aspect);
        sensor.principal_offset = {range_parameter(in, "principal_point_offset_x", 0),
                                   range_parameter(in, "principal_point_offset_y", 0)};
    }
    sensor.near_clip = range_parameter(in, "near_clip", 1e-2);
    sensor.far_clip = float(in.number("far_clip", 1e4));
    if (!(sensor.near_clip > 0 && sensor.near_clip < sensor.far_clip))
        in.fail(in.where("near_clip"), "near_clip must be positive and smaller than far_clip");
    sensor.focus_distance = float(in.number("focus_distance", sensor.far_clip));
    if (has_lens(sensor.type)) {
        if (!in.has("aperture_radius")) in.fail_without("aperture_radius", "thinlens has no aperture_radius");
        sensor.aperture_radius = range_parameter(in, "aperture_radius", 0);
        if (!(sensor.aperture_radius >= 0))
            in.fail(in.where("aperture_radius"), "aperture_radius must not be negative");
        if (!(sensor.focus_distance > 0)) in.fail(in.where("focus_distance"), "focus_distance must be positive");
        range_parameter(in, "focus_distance", std::min(sensor.far_clip, kMostCoordinate));
    }
    if (!is_parallel(sensor.type)) check_rays(in, sensor);
}

/// The sensor of that plugin; perspective, and false, if there is none.
bool find_sensor(const std::string& plugin, SensorType& type) {
    type = SensorType::perspective;
    bool known = false;
    SensorModels::for_each([&](auto model) {
        using Model = typename decltype(model)::type;
        if (plugin != Model::plugin) return;
        type = SensorType(SensorModels::index<Model>());
        known = true;
    });
    return known;
}

}  // namespace

void build_sensor(Builder& builder, const Object& object) {
    Reader in(builder, object);
    Sensor& sensor = builder.scene.sensor;
    const std::string& type = object.type;
    read_film(builder, in.take("film"), sensor);
    read_sampler(builder, in.take("sampler"));

    const bool known = find_sensor(type, sensor.type);
    if (!known)
        builder.refuse(object.where, "sensor type '" + type + "' is not supported" + what_is_meant("sensor", type),
                       "perspective is used");

    const double aspect = double(sensor.film_width) / sensor.film_height;
    Matrix to_world = builder.to_scene * in.transform("to_world");
    if (!(std::fabs(determinant(to_world)) > 0)) in.fail(in.where("to_world"), "the sensor's transform is singular");
    bool problem = false;
    if (is_parallel(sensor.type)) {
        // The film spans [-1,1] in x; scale in the transform sizes it. Scale moves from the transform to the extent.
        if (!is_orthogonal(to_world, 1e-3))
            builder.refuse(in.where("to_world"), "the sensor's transform must not shear", "shear is left out");
        double lengths[3];
        for (int j = 0; j < 3; ++j) {
            lengths[j] = length(column(to_world, j));
            for (int i = 0; i < 3; ++i) to_world.m[i][j] /= lengths[j];
            if (!(lengths[j] >= double(kLeastExtent) && lengths[j] <= double(kMostCoordinate)))
                in.fail(in.where("to_world"), fmt::format("the transform scales the film by {:g}", lengths[j]));
        }
        to_world = rigid_part(to_world, problem);
        sensor.tan_half_fov = {float(lengths[0]), float(lengths[1] / aspect)};
    } else {
        to_world = rigid_part(to_world, problem);
        if (problem)
            builder.refuse(in.where("to_world"), "the sensor's transform must not scale or shear",
                           "scale and shear are left out");
    }
    builder.check_range(in.where("to_world"), "the sensor", {column(to_world, 3)});
    sensor.to_world = to_affine(to_world);
    if (is_latlong(sensor.type)) {
        sensor.near_clip = 0;
        sensor.far_clip = kInfinity;
    } else {
        read_lens(in, sensor, aspect);
    }
    in.leave({{"shutter_open", "0"}, {"shutter_close", "0"}}, "nothing moves");
    if (known) in.finish();
}

const Plugins& sensor_plugins() {
    static const Plugins known = with_plugins_of<SensorModels>();
    return known;
}

const Plugins& film_plugins() {
    static const Plugins known = {"hdrfilm", "tiledhdrfilm", "ldrfilm", "mfilm"};
    return known;
}

const Plugins& filter_plugins() {
    static const Plugins known = {"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"};
    return known;
}

const Plugins& sampler_plugins() {
    static const Plugins known = {"independent", "stratified", "multijitter", "orthogonal",
                                  "ldsampler",   "halton",     "hammersley",  "sobol"};
    return known;
}

}  // namespace ambilux::document
