#include "experiments/reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "experiments/state.h"
#include "experiments/statistics.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

/// Attributes that must be equal for samples to be added.
constexpr const char* kIdentity[] = {"kind", "scene_hash", "max_depth", "seed", "integrator", "reference_settings"};

std::string text(const Attributes& attributes, const char* name) {
    const auto it = attributes.find(name);
    if (it == attributes.end()) return "(not stated)";
    return it->is_string() ? it->get<std::string>() : it->dump();
}

/// Throws if the file at `path` was made from something else than `wanted` describes.
void check_same(const std::string& path, const Attributes& stored, const Reference& image, const Attributes& wanted,
                const Scene& scene) {
    const auto refuse = [&](const std::string& what, const std::string& has, const std::string& asked) {
        throw input_error(
            path, 0,
            fmt::format(
                "cannot be continued: its {} is {}, asked for is {}. Give another file name, or remove the file", what,
                has, asked));
    };
    if (image.mean.width != scene.sensor.crop_width || image.mean.height != scene.sensor.crop_height)
        refuse("size", fmt::format("{}x{}", image.mean.width, image.mean.height),
               fmt::format("{}x{}", scene.sensor.crop_width, scene.sensor.crop_height));
    for (const char* name : kIdentity)
        if (text(stored, name) != text(wanted, name)) refuse(name, text(stored, name), text(wanted, name));
}

}  // namespace

uint64_t reference_seed(uint64_t seed) {
    uint64_t z = seed + 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

ReferenceResult make_reference(const Scene& scene, const ReferenceRequest& request, const Hooks& hooks) {
    if (request.spp < 2)
        throw Error(ExitCode::usage, "a reference needs at least 2 samples per pixel: one has no standard error");
    RenderSettings settings = request.settings;
    const auto& all = general_settings();
    const bool partial =
        std::any_of(all.begin(), all.end(), [&](const Setting& s) { return s.partial && !s.is_default(settings); });
    if (partial || !makes_references(settings.integrator))
        throw Error(ExitCode::usage,
                    fmt::format("a reference is made by integrator {} with all that it has (estimator mis, all "
                                "strategies)",
                                fmt::join(reference_integrators(), " or ")));
    settings.seed = reference_seed(request.settings.seed);

    const auto attributes_of = [&](const RenderStats& stats, double seconds) {
        Attributes a = image_attributes(scene, settings, stats);
        a["kind"] = "reference";
        a["seed"] = request.settings.seed;
        a["seconds"] = seconds;
        if (!request.settings_text.empty()) a["reference_settings"] = request.settings_text;
        return a;
    };

    ReferenceResult result;
    FilmMoments total;
    double earlier_seconds = 0;
    const std::string sums_path = request.path + ".sums";
    nlohmann::json identity;
    for (const char* name : kIdentity) identity[name] = text(attributes_of({}, 0), name);
    if (std::filesystem::exists(request.path)) {
        result.reference = read_reference_exr(request.path, &result.attributes);
        // The seed comes back as an integer or, where it does not fit, as text; so does the wanted one after this
        // round.
        check_same(request.path, result.attributes, result.reference, attributes_of({}, 0), scene);
        if (result.reference.samples >= request.spp) {
            result.continued_from = result.reference.samples;
            return result;
        }
        total = to_moments(result.reference);
        if (const auto s = result.attributes.find("seconds"); s != result.attributes.end() && s->is_number())
            earlier_seconds = s->get<double>();
    }
    // Sums that were saved last are as many as those of the image or more; older ones are left over from something
    // else.
    if (auto sums = read_state(sums_path);
        sums && sums->notes["identity"] == identity && sums->moments.samples >= total.samples &&
        sums->moments.width == scene.sensor.crop_width && sums->moments.height == scene.sensor.crop_height) {
        total = std::move(sums->moments);
        earlier_seconds = sums->notes["seconds"].get<double>();
        result.reference = to_reference(total);
    }
    result.continued_from = total.samples;
    check_writable(request.path);

    const std::unique_ptr<Renderer> renderer = hooks.make_renderer(scene, settings);
    RenderPosition position{total.samples, 0, false};
    while (position.samples < request.spp && !position.interrupted) {
        const uint64_t before = position.samples;
        // A checkpoint's time ends drive(); it makes at least one sample.
        const double due = position.seconds + std::max(request.checkpoint_seconds, 1e-3);
        position = drive(*renderer, position, {request.spp, due}, request.interrupt, request.on_batch);
        if (position.samples == before) continue;
        total.add(renderer->film());
        result.stats = renderer->stats();
        renderer->clear_film();
        result.reference = to_reference(total);
        RenderStats stated = result.stats;
        stated.samples = total.samples;
        result.attributes = attributes_of(stated, earlier_seconds + position.seconds);
        if (total.samples < 2) continue;
        if (total.samples < request.spp)
            write_state(sums_path, {total, {{"identity", identity}, {"seconds", earlier_seconds + position.seconds}}});
        write_reference_exr(request.path, result.reference, result.attributes);
    }
    if (std::error_code ignored; total.samples >= request.spp) std::filesystem::remove(sums_path, ignored);
    result.interrupted = position.interrupted;
    return result;
}

}  // namespace ambilux
