#include "session/reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "integrators/registry.h"
#include "integrators/setting.h"
#include "session/state.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

/// Attributes that must be equal for samples to be added.
constexpr const char* kIdentity[] = {"kind",   "scene_hash", "max_depth",  "rr_depth",
                                     "rr_cap", "seed",       "integrator", "reference_settings"};

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

void check_settings(const RenderSettings& settings) {
    if (settings.sampler == Sampler::sobol)
        throw Error(ExitCode::usage,
                    "sampler=sobol: a reference states standard errors, which samples that depend on each other do not "
                    "tell; leave the setting out");
    const auto& all = general_settings();
    const bool partial =
        std::any_of(all.begin(), all.end(), [&](const Setting& s) { return s.partial && !s.is_default(settings); });
    if (partial || !makes_references(settings.integrator))
        throw Error(ExitCode::usage,
                    fmt::format("a reference is made by integrator {} with all that it has (estimator mis, all "
                                "strategies)",
                                fmt::join(reference_integrators(), " or ")));
}

/// The settings that make a reference another one than the path tracer's; empty for it. Part of its identity.
std::string making(const RenderSettings& settings) {
    const bool plain = variant_of(settings).traits.references == References::plain;
    std::string text;
    const auto add = [&](const std::string& key, const std::string& value) {
        text += (text.empty() ? "" : " ") + key + "=" + value;
    };
    for (const Setting& s : general_settings())
        if (s.place != InExperiment::experiment && !s.is_default(settings) && (!plain || s.what.key == "precision"))
            add(s.what.key, s.text(settings));
    if (!plain)
        for (const auto& [key, value] : settings.own) add(key, value);
    return text;
}

/// A reference that is begun or continued.
class ReferenceRender {
public:
    ReferenceRender(const Scene& scene, const ReferenceRequest& request, const RenderSettings& settings)
        : scene_(scene), request_(request), settings_(settings), sums_path_(request.path + ".sums") {
        for (const char* name : kIdentity) identity_[name] = text(attributes_of({}, 0), name);
    }

    /// What the image file holds; true if that is enough.
    bool read_image() {
        if (!std::filesystem::exists(request_.path)) return false;
        result_.reference = read_reference_exr(request_.path, &result_.attributes);
        // The seed comes back as an integer or, where it does not fit, as text; so does the wanted one after this
        // round.
        check_same(request_.path, result_.attributes, result_.reference, attributes_of({}, 0), scene_);
        if (result_.reference.samples >= request_.spp) {
            result_.continued_from = result_.reference.samples;
            return true;
        }
        total_ = to_moments(result_.reference);
        if (const auto s = result_.attributes.find("seconds"); s != result_.attributes.end() && s->is_number())
            earlier_seconds_ = s->get<double>();
        return false;
    }

    /// Sums that were saved last are as many as those of the image or more; older ones are left over from something
    /// else.
    void read_sums() {
        auto sums = read_state(sums_path_);
        if (sums && sums->notes["identity"] == identity_ && sums->moments.samples >= total_.samples &&
            sums->moments.width == scene_.sensor.crop_width && sums->moments.height == scene_.sensor.crop_height) {
            total_ = std::move(sums->moments);
            devices_ = std::move(sums->devices);
            earlier_seconds_ = sums->notes["seconds"].get<double>();
            result_.reference = to_reference(total_);
        }
        result_.continued_from = total_.samples;
    }

    void render(Renderer& renderer) {
        if (devices_) load_devices(renderer, *devices_, sums_path_);  // an image that is extended learns anew
        RenderPosition position{total_.samples, 0, false};
        while (position.samples < request_.spp && !position.interrupted) {
            const uint64_t before = position.samples;
            // A checkpoint's time ends drive(); it makes at least one iteration.
            const double due =
                position.seconds + std::max({request_.checkpoint_seconds, 1e-3, position.per_iteration()});
            position = drive(renderer, position, {request_.spp, due}, request_.interrupt, request_.on_batch);
            if (position.samples == before) continue;
            total_.add(renderer.film());
            result_.stats = renderer.stats();
            devices_ = save_devices(renderer);
            renderer.clear_film();
            write(earlier_seconds_ + position.seconds);
        }
        if (std::error_code ignored; total_.samples >= request_.spp) std::filesystem::remove(sums_path_, ignored);
        result_.interrupted = position.interrupted;
    }

    const ReferenceResult& result() const { return result_; }

private:
    Attributes attributes_of(const RenderStats& stats, double seconds) const {
        Attributes a = image_attributes(scene_, settings_, stats);
        a["kind"] = "reference";
        a["seed"] = request_.settings.seed;
        a["seconds"] = seconds;
        if (!request_.settings_text.empty()) a["reference_settings"] = request_.settings_text;
        return a;
    }

    void write(double seconds) {
        result_.reference = to_reference(total_);
        RenderStats stated = result_.stats;
        stated.samples = total_.samples;
        result_.attributes = attributes_of(stated, seconds);
        if (total_.samples < 2) return;
        if (total_.samples < request_.spp)
            write_state(sums_path_, {total_, {{"identity", identity_}, {"seconds", seconds}}, *devices_});
        write_reference_exr(request_.path, result_.reference, result_.attributes);
    }

    const Scene& scene_;
    const ReferenceRequest& request_;
    const RenderSettings& settings_;
    const std::string sums_path_;
    nlohmann::json identity_;
    FilmMoments total_;
    std::optional<DeviceStates> devices_;  ///< of the sums beside the image
    double earlier_seconds_ = 0;
    ReferenceResult result_;
};

}  // namespace

uint64_t reference_seed(uint64_t seed) {
    uint64_t z = seed + 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

ReferenceRequest reference_request(const std::string& path, uint64_t spp, const RenderSettings& settings) {
    for (const char* key : {"variant", "estimator"})
        if (variant_of(settings).traits.references == References::plain &&
            !find_general_setting(key)->is_default(settings))
            throw Error(ExitCode::usage,
                        fmt::format("a reference by integrator {} is made by its first variant with estimator mis: "
                                    "leave these settings out",
                                    settings.integrator));
    ReferenceRequest request;
    request.path = path;
    request.spp = spp;
    request.settings = settings;
    request.settings_text = making(settings);
    return request;
}

ReferenceResult make_reference(const Scene& scene, const ReferenceRequest& request, const Hooks& hooks) {
    if (request.spp < 2)
        throw Error(ExitCode::usage, "a reference needs at least 2 samples per pixel: one has no standard error");
    RenderSettings settings = request.settings;
    check_settings(settings);
    settings.seed = reference_seed(request.settings.seed);
    ReferenceRender reference(scene, request, settings);
    if (reference.read_image()) return reference.result();
    reference.read_sums();
    check_writable(request.path);
    reference.render(*hooks.make_renderer(scene, settings));
    return reference.result();
}

}  // namespace ambilux
