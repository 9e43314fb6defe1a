// What stands before WorldBegin: camera, film, filter, sampler, integrator.
#include <algorithm>
#include <cmath>

#include "formats/pbrt/names.h"
#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

struct Window {
    double x0, x1, y0, y1;  ///< on the plane at distance 1, in units of the shorter half axis

    double half_width() const { return (x1 - x0) / 2; }
    double half_height() const { return (y1 - y0) / 2; }
};

Window screen_window(SceneMaker& scene, const Parameters& in, double aspect) {
    const double frame = in.number("frameaspectratio", aspect);
    Window w = frame > 1 ? Window{-frame, frame, -1, 1} : Window{-1, 1, -1 / frame, 1 / frame};
    const std::vector<double>& given = in.numbers("screenwindow", 1);
    if (!given.empty() && given.size() != 4) fail(in.where_of("screenwindow"), "screenwindow must be four numbers");
    if (!given.empty()) w = {given[0], given[1], given[2], given[3]};
    if (!(w.x1 > w.x0 && w.y1 > w.y0)) fail(in.where_of("screenwindow"), "the screen window must not be empty");
    if (std::fabs(w.half_width() / w.half_height() - aspect) > 1e-3 * aspect)
        scene.report.refuse(in.where, "pixels that are not square are not supported",
                            "the height of the screen window follows from its width");
    return w;
}

/// A camera of all directions. pbrt's longitude begins at its x and counts to its z, Mitsuba's from -z to its own x.
Object& spherical_camera(SceneMaker& scene, const Parameters& in, const Options& options) {
    const std::string mapping = in.text("mapping", "equalarea");
    if (mapping != "equirectangular")
        scene.report.refuse(in.find("mapping") ? in.where_of("mapping") : in.where,
                            "mapping '" + mapping + "' of a spherical camera is not supported",
                            "equirectangular is used");
    Object& sensor = add_object(scene.document, "sensor", "spherical", in.where);
    const Matrix turn = from_columns({0, 0, 1}, {0, 1, 0}, {-1, 0, 0});
    set_transform(sensor, "to_world", unscaled(options.camera_to_world * turn));
    in.ignore({"lensradius", "focaldistance", "frameaspectratio", "screenwindow"});
    in.finish(scene.report);
    return sensor;
}

Object& camera(SceneMaker& scene, const Options& options, double aspect) {
    const Parameters in = options.camera.value_or(Parameters{"Camera", "perspective", {}, {}});
    if (in.type == "spherical") return spherical_camera(scene, in, options);
    const bool parallel = in.type == "orthographic";
    if (!parallel && in.type != "perspective")
        scene.report.refuse(in.where, not_supported("camera", in.type), "perspective is used");
    const double lens = in.number("lensradius", 0), focus = in.number("focaldistance", 1e6);
    if (parallel && lens > 0)
        scene.report.refuse(in.where_of("lensradius"), "a lens on an orthographic camera is not supported",
                            "it is left out");
    const bool thin = lens > 0 && !parallel;
    Object& sensor = add_object(scene.document, "sensor",
                                parallel ? "orthographic"
                                : thin   ? "thinlens"
                                         : "perspective",
                                in.where);
    const Window w = screen_window(scene, in, aspect);
    // pbrt's x points to the right of the image, Mitsuba's to its left.
    Matrix to_world = options.camera_to_world * scaling(-1, 1, 1);
    const double x = (w.x0 + w.x1) / 2, y = (w.y0 + w.y1) / 2;
    if (parallel) {
        to_world = to_world * translation(-x, y, 0) * scaling(w.half_width(), w.half_width(), 1);
    } else {
        const double fov = in.number("fov", 90);
        if (!(fov > 0 && fov < 180)) fail(in.where_of("fov"), "fov must lie between 0 and 180 degrees");
        set_number(sensor, "fov", 2 * (180 / M_PI) * std::atan(w.half_width() * std::tan(fov * (M_PI / 360))));
        set_text(sensor, "fov_axis", "x");
        if (x != 0) set_number(sensor, "principal_point_offset_x", x / (2 * w.half_width()));
        if (y != 0) set_number(sensor, "principal_point_offset_y", -y / (2 * w.half_height()));
    }
    // Scale of the world to that of the camera is nothing to a pinhole.
    if (!parallel) {
        const double scale = std::cbrt(std::fabs(determinant(to_world)));
        if (lens > 0 && std::fabs(scale - 1) > 1e-3)
            scene.report.refuse(in.where, "a lens on a camera that is scaled is not supported",
                                "its size is left as it is");
        to_world = unscaled(to_world);
    }
    set_transform(sensor, "to_world", to_world);
    // pbrt clips nothing.
    set_number(sensor, "near_clip", 1e-5);
    set_number(sensor, "far_clip", 1e10);
    if (thin) {
        set_number(sensor, "aperture_radius", lens);
        set_number(sensor, "focus_distance", focus);
    }
    if (in.type == "perspective" || parallel) in.finish(scene.report);
    return sensor;
}

Object& filter(SceneMaker& scene, const Options& options) {
    const Parameters in =
        options.filter.value_or(Parameters{"PixelFilter", "gaussian", scene.document.scene->where, {}});
    const bool is_tent = in.type == "triangle", is_box = in.type == "box";
    Object& out = add_object(scene.document, "rfilter", is_tent ? "tent" : is_box ? "box" : "gaussian", in.where);
    const double fallback = is_box ? 0.5 : is_tent ? 2 : in.type == "sinc" ? 4 : in.type == "mitchell" ? 2 : 1.5;
    const double x = in.number("xradius", fallback), y = in.number("yradius", fallback);
    if (!(x > 0 && y > 0)) fail(in.where, "radii of a filter must be positive");
    if (x != y) scene.report.refuse(in.where, "a filter with different radii is not supported", "xradius is used");
    if (is_box || is_tent) {
        set_number(out, "radius", x);
    } else {
        const double sigma = in.type == "gaussian" ? in.number("sigma", 0.5) : 0.5;
        set_number(out, "stddev", sigma);
        if (in.type == "mitchell" || in.type == "sinc") {
            scene.report.note(in.where, "filter '" + in.type +
                                            "' has negative lobes; a gaussian with a standard "
                                            "deviation of 0.5 is used");
            in.ignore({"B", "C", "tau"});
        } else if (in.type != "gaussian") {
            scene.report.refuse(in.where, not_supported("filter", in.type), "gaussian is used");
        } else if (std::fabs(x - 4 * sigma) > 1e-6) {
            scene.report.note(in.where, "gaussian filters end at four standard deviations, not at their radius");
        }
    }
    in.finish(scene.report);
    return out;
}

int64_t resolution(const Parameters& in, const char* name, int64_t fallback) {
    const int64_t n = in.integer(name, fallback);
    if (n < 1 || n > 65536) fail(in.where_of(name), std::string("'") + name + "' must lie between 1 and 65536");
    return n;
}

Object& film(SceneMaker& scene, const Parameters& in, const Options& options, double& aspect) {
    Object& out = add_object(scene.document, "film", "hdrfilm", in.where);
    const int64_t width = resolution(in, "xresolution", 1280), height = resolution(in, "yresolution", 720);
    aspect = double(width) / double(height);
    set_integer(out, "width", width);
    set_integer(out, "height", height);
    int64_t crop[4] = {0, width, 0, height};
    for (const char* name : {"cropwindow", "pixelbounds"}) {
        const std::vector<double>& given = in.numbers(name, 1);
        if (given.empty()) continue;
        if (given.size() != 4) fail(in.where_of(name), std::string("'") + name + "' must be four numbers");
        const bool shares = std::string(name) == "cropwindow";
        for (size_t i = 0; i < 4; ++i) {
            const int64_t size = i < 2 ? width : height;
            crop[i] = int64_t(std::clamp(std::ceil(shares ? given[i] * double(size) : given[i]), 0.0, double(size)));
        }
        if (!(crop[0] < crop[1] && crop[2] < crop[3])) fail(in.where_of(name), "the crop window is empty");
    }
    if (crop[0] != 0 || crop[1] != width || crop[2] != 0 || crop[3] != height) {
        set_integer(out, "crop_offset_x", crop[0]);
        set_integer(out, "crop_width", crop[1] - crop[0]);
        set_integer(out, "crop_offset_y", crop[2]);
        set_integer(out, "crop_height", crop[3] - crop[2]);
    }
    const std::string sensor = in.text("sensor", "cie1931");
    const double white = in.number("whitebalance", 0);
    if (sensor != "cie1931" || white != 0)
        scene.report.note(in.where, "colours are those of sensor cie1931 without white balance; '" + sensor +
                                        "' sets the exposure only");
    if (in.find("maxcomponentvalue"))
        scene.report.note(in.where_of("maxcomponentvalue"), "samples are not clamped: maxcomponentvalue is left out");
    in.ignore({"filename", "savefp16"});  // where the image goes; floats hold what halves do
    in.leave(scene.report, {"coordinatesystem", "lambdamin", "lambdamax", "nbuckets"},
             "images have the channels R, G and B");
    in.leave(scene.report, {"diagonal"}, "it is for lenses of glass");
    if (!is_known("film", in.type))
        scene.report.refuse(in.where, not_supported("film", in.type), "rgb is used");
    else if (in.type != "rgb")
        scene.report.note(in.where, "film '" + in.type + "' gets the channels of rgb");
    const Parameters* camera = options.camera ? &*options.camera : nullptr;
    const double seconds = camera ? camera->number("shutterclose", 1) - camera->number("shutteropen", 0) : 1.0;
    scene.exposure = seconds * in.number("iso", 100) / 100;
    if (!(scene.exposure > 0)) fail(in.where, "the film is exposed for no time, or has no iso");
    in.finish(scene.report);
    add_child(out, filter(scene, options));
    return out;
}

void add_integrator(SceneMaker& scene, const Options& options, const Where& where) {
    const Parameters in = options.integrator.value_or(Parameters{"Integrator", "volpath", where, {}});
    const bool light = in.type == "lightpath", bdpt = in.type == "bdpt";
    if (!is_known("integrator", in.type))
        scene.report.refuse(in.where, not_supported("integrator", in.type), "path is used");
    else if (in.type != "path" && in.type != "volpath" && !light && !bdpt)
        scene.report.note(in.where,
                          "integrator '" + in.type + "' converges to the image of the path tracer, which is used");
    Object& out = add_to_scene(scene.document, "integrator", light ? "ptracer" : bdpt ? "bdpt" : "path", in.where);
    const int64_t depth = in.integer("maxdepth", 5);
    if (depth < 0 || depth > (1 << 30)) fail(in.where_of("maxdepth"), "maxdepth must not be negative");
    // pbrt counts scattering, Mitsuba segments.
    set_integer(out, "max_depth", depth + 1);
    if (in.boolean("regularize", false))
        scene.report.note(in.where_of("regularize"), "regularization, a bias against noise, is left out");
    // How light is looked for; rrthreshold is of pbrt-v3.
    in.ignore({"lightsampler", "rrthreshold", "visualizestrategies", "visualizeweights", "samplebsdf", "samplelights",
               "bootstrapsamples", "chains", "mutationsperpixel", "largestepprobability", "sigma",
               "photonsperiteration", "radius", "seed"});
    in.finish(scene.report);
}

Object* sampler(SceneMaker& scene, const Options& options) {
    if (!options.sampler) return nullptr;
    const Parameters& in = *options.sampler;
    int64_t count = in.integer("pixelsamples", 16);
    if (in.type == "stratified") count = in.integer("xsamples", 4) * in.integer("ysamples", 4);
    if (count < 1) fail(in.where, "the number of samples must be positive");
    // Every sampler has the same expected image.
    if (!is_known("sampler", in.type))
        scene.report.refuse(in.where, not_supported("sampler", in.type), "samples are independent");
    else if (in.type != "independent")
        scene.report.note(in.where, "sampler '" + in.type + "' is not followed; samples are independent");
    in.ignore({"randomization", "jitter"});
    in.leave(scene.report, {"seed"}, "--seed has the last word");
    in.finish(scene.report);
    Object& out = add_object(scene.document, "sampler", "independent", in.where);
    set_integer(out, "sample_count", std::min<int64_t>(count, 1000000000));
    return &out;
}

}  // namespace

void add_options(SceneMaker& scene, const Options& options) {
    const Where& where = scene.document.scene->where;
    double aspect = 1;
    Object& picture = film(scene, options.film.value_or(Parameters{"Film", "rgb", where, {}}), options, aspect);
    Object& sensor = camera(scene, options, aspect);
    add_child(sensor, picture);
    if (const Object* samples = sampler(scene, options)) add_child(sensor, *samples);
    add_child(*scene.document.scene, sensor);
    add_integrator(scene, options, where);
}

}  // namespace ambilux::pbrt
