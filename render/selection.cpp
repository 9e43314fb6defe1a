#include "render/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <thread>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

/// Pilots: a few hundredths of the shortest renders that are worth a choice, on 2 cores and on the 16 beside a GPU.
/// With half of the latter, one seed in ten (water-caustic) or two (veach-ajar) put a candidate first that is 1.1
/// to 1.5 times worse.
constexpr uint32_t kPilotSamplesCpu = 8192, kPilotSamplesCuda = 32768;
/// Share of the blocks that the comparison leaves out.
constexpr double kTrimmedBlocks = 0.01;
/// Where the ratio of times does not follow from the work: candidates whose product of variance and work is within this
/// factor of the best are timed.
constexpr double kDoubt = 1.3;
constexpr uint32_t kFirstTimedSample = 0xffff0000u;  ///< far from those of the image

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::string joined(const std::vector<std::pair<std::string, std::string>>& settings) {
    std::string text;
    for (const auto& [key, value] : settings) text += (text.empty() ? "" : " ") + key + "=" + value;
    return text;
}

RenderSettings settings_of(const RenderSettings& settings, const SelectionCandidate& candidate) {
    RenderSettings s = settings;
    s.automatic = false;
    for (const auto& [key, value] : candidate.settings) apply_setting(s, key, value);
    if (s.variant != "lvc") s.draws = CacheDraws::automatic;  // others have no draws to be set
    return s;
}

/// The variant of bdpt that leaves all variants to choose from.
const char* const kPaired = "wavefront";
bool is_paired(const RenderSettings& settings) { return &variant_of(settings) == find_variant("bdpt", kPaired); }

/// Candidates of one family do the same but for the numbers of light subpaths and draws, so that the time of one tells
/// that of the others.
uint32_t family(const SelectionCandidate& c) {
    return (c.pilot.light_subpaths > 0.0f ? 1 : 0) + (c.pilot.connect ? 2 : 0) + (c.pilot.draws ? 4 : 0);
}

/// Seconds per sample of every pixel. On a device: of about one full wave, smaller than a render's for the sake of
/// time. What launches cost beside their items is then more than it will be, and for cheap samples most: so the path
/// tracer's wave holds more of them, and takes about as long as others.
double timed(const Scene& scene, RenderSettings settings, bool cuda, const MakeRenderer& make) {
    constexpr double kLongEnough = 0.05;
    const VariantTraits& traits = variant_of(settings).traits;
    const uint32_t paths_per_wave = traits.light_subpaths ? 1u << 21 : 1u << 22;
    if (cuda && settings.wave_size == 0 && !traits.streams) settings.wave_size = paths_per_wave;
    const std::unique_ptr<Renderer> renderer = make(settings);
    const uint32_t pixels = scene.sensor.crop_width * scene.sensor.crop_height;
    const uint32_t count =
        cuda ? std::clamp(paths_per_wave / std::max(1u, pixels), 1u, renderer->preferred_batch()) : 1;
    const auto seconds_of = [&](uint32_t first, uint32_t samples) {
        const auto start = Clock::now();
        renderer->render(first, samples);
        return seconds_since(start);
    };
    // The first launch bears what later ones do not. It is short, and counts only where it was long enough for that not
    // to matter.
    const double once = seconds_of(kFirstTimedSample, 1);
    if (count == 1 && once >= kLongEnough) return once;
    return seconds_of(kFirstTimedSample + 1, count) / count;
}

/// The path tracer of a device, which has nothing else to do while the host runs the pilot. Its samples are those that
/// the render begins with if it is chosen: the pilot, on which that depends, has random numbers of its own. Otherwise
/// they are dropped. For renders that end by the clock: others gain nothing.
class HeadStart {
public:
    HeadStart(const RenderSettings& settings, const MakeRenderer& make)
        : thread_([this, settings, &make] {
              try {
                  const auto start = Clock::now();
                  renderer_ = make(settings);
                  build_seconds_ = seconds_since(start);
                  run();
              } catch (const std::exception&) {
                  samples_ = 0;
                  renderer_.reset();  // it is tried again, and complains, if it is chosen
              }
          }) {}
    ~HeadStart() { stop(); }

    void stop() {
        set_flag(&stop_);
        if (thread_.joinable()) thread_.join();
    }
    uint32_t samples() const { return samples_; }
    double build_seconds() const { return build_seconds_; }
    /// Of every pixel, while there was nothing else to do; 0: unknown.
    double seconds_per_sample() const { return seconds_per_sample_; }
    std::unique_ptr<Renderer> take() { return std::move(renderer_); }

private:
    void run() {
        constexpr double kBatchSeconds = 0.008;  // which the host may have to wait for
        for (uint32_t batch = 1; samples_ == 0 || !is_set(&stop_);) {
            const auto start = Clock::now();
            samples_ += renderer_->render(samples_, batch);
            const double seconds = seconds_since(start);
            if (seconds > 0.5 * kBatchSeconds && samples_ > batch)
                seconds_per_sample_ = seconds / batch;  // the first bears what later ones do not
            batch = std::clamp(uint32_t(kBatchSeconds / seconds * batch), 1u, 4 * batch);
        }
    }

    volatile bool stop_ = false;
    uint32_t samples_ = 0;
    double build_seconds_ = 0, seconds_per_sample_ = 0;
    std::unique_ptr<Renderer> renderer_;
    std::thread thread_;
};

/// A renderer that also tells how it was chosen. `ready`: samples that are in its film.
class Chosen final : public Renderer {
public:
    Chosen(std::unique_ptr<Renderer> renderer, uint32_t ready, SelectionStats choice)
        : renderer_(std::move(renderer)), ready_(ready), choice_(std::move(choice)) {}

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        if (first != 0 || count < ready_) drop();
        const uint32_t done = ready_;
        ready_ = 0;
        return done == count ? done : done + renderer_->render(first + done, count - done, interrupt);
    }
    FilmMoments film() override {
        drop();
        return renderer_->film();
    }
    void clear_film() override {
        ready_ = 0;
        renderer_->clear_film();
    }
    uint32_t ready() const override { return ready_; }
    RenderStats stats() override {
        RenderStats s = renderer_->stats();
        s.choice = choice_;
        return s;
    }
    std::vector<StrategyImage> strategy_images() override { return renderer_->strategy_images(); }
    uint32_t preferred_batch() const override { return renderer_->preferred_batch(); }

private:
    void drop() {
        if (ready_ > 0) clear_film();
    }

    std::unique_ptr<Renderer> renderer_;
    uint32_t ready_;
    SelectionStats choice_;
};

}  // namespace

std::vector<SelectionCandidate> selection_candidates(const RenderSettings& settings, bool cuda) {
    const VariantTraits& asked = variant_of(settings).traits;
    const std::string& variant = settings.variant;
    const bool paired = is_paired(settings);  // else the choice is restricted to the variant that was asked for
    std::vector<SelectionCandidate> all = {
        {"path", {0.0f, false, 0}, {{"integrator", "path"}, {"variant", "wavefront"}, {"estimator", "mis"}}}};
    const auto add = [&](std::string name, const PilotCandidate& pilot, const std::string& of,
                         const std::string& strategies) {
        all.push_back({std::move(name), pilot, {{"integrator", "bdpt"}, {"variant", of}, {"strategies", strategies}}});
        if (pilot.draws > 0) all.back().settings.emplace_back("connections", std::to_string(pilot.draws));
        if (pilot.light_subpaths != 1.0f) {
            all.back().name += fmt::format(", {} light paths per pixel", pilot.light_subpaths);
            all.back().settings.emplace_back("light_paths", fmt::format("{}", pilot.light_subpaths));
        }
    };
    const std::string plain = asked.draws ? kPaired : variant;
    // On a device the cache has another order in every run.
    const bool cache = asked.draws || (paired && !(cuda && settings.deterministic));
    for (const float light_paths : {0.25f, 1.0f, 4.0f}) {
        if (light_paths != 1.0f && !paired && !asked.draws) continue;
        add("bdpt without connections", {light_paths, false, 0}, plain, "hits+next_event+light");
        if (light_paths == 1.0f && !asked.draws) add("bdpt, " + variant, {1.0f, true, 0}, variant, "all");
        for (uint32_t k = 1; cache && k <= 16; k *= 2)
            add(fmt::format("bdpt, lvc, {} connection{}", k, k > 1 ? "s" : ""), {light_paths, true, k}, "lvc", "all");
    }
    return all;
}

double selection_work(const PilotWork& w, const SelectionCandidate& candidate, bool cuda) {
    // Fitted to renders (docs/performance.md): shadow rays and connections in rays of walks; what the longer records
    // and further launches of bidirectional methods cost.
    const double eye = w.eye_rays + kShadowWork * w.next_events,
                 light = double(candidate.pilot.light_subpaths) * (w.light_rays + kShadowWork * w.splats);
    const double pair = cuda ? 0.24 : 0.02, draw = cuda ? 0.12 : 0.07, ray = cuda ? 1.06 : 0.8,
                 bidirectional = cuda ? 1.2 : 1.0;
    const PilotCandidate& c = candidate.pilot;
    if (c.light_subpaths == 0.0f && !c.connect) return eye;
    double work = eye + light;
    if (c.connect && c.draws == 0) work += pair * w.pairs + ray * w.pair_rays;
    if (c.connect && c.draws > 0) work += c.draws * (draw * w.draws + ray * w.draw_rays);
    const bool streaming = variant_of(settings_of({}, candidate)).traits.streams;
    // A light subpath for every vertex of an eye subpath.
    if (c.connect && streaming) work += std::max(0.0, w.vertices - 1.0) * w.light_rays;
    return bidirectional * work;
}

std::vector<double> selection_variances(const Pilot& pilot) {
    const size_t blocks = pilot.variance[0].size();
    std::vector<std::pair<double, size_t>> worst(blocks);
    for (size_t b = 0; b < blocks; ++b) {
        worst[b] = {kInfinity, b};
        for (const std::vector<double>& of : pilot.variance) worst[b].first = std::min(worst[b].first, of[b]);
    }
    std::sort(worst.begin(), worst.end());
    const size_t kept = blocks - size_t(kTrimmedBlocks * double(blocks));
    std::vector<double> variances;
    for (size_t c = 0; c < pilot.variance.size(); ++c) {
        double sum = 0;
        for (size_t i = 0; i < kept; ++i) sum += pilot.variance[c][worst[i].second];
        variances.push_back(pilot.cannot_find_light[c] ? double(kInfinity) : std::max(sum / double(kept), 1e-12));
    }
    return variances;
}

std::unique_ptr<Renderer> make_automatic(const Scene& scene, const RenderSettings& settings, bool cuda,
                                         SharedAccels& accels, const MakeRenderer& make) {
    // Any render builds this, and wakes the device: it is no cost of the choice.
    if (cuda) cuda_device_present();
    const bool cwbvh = cuda || settings.accel == AccelKind::cwbvh;
    if (cwbvh)
        accels.get<CwbvhAccel>();
    else
        accels.get<EmbreeAccel>();
    const auto start = Clock::now();
    const std::vector<SelectionCandidate> candidates = selection_candidates(settings, cuda);
    std::vector<PilotCandidate> predicted;
    for (const SelectionCandidate& c : candidates) predicted.push_back(c.pilot);
    std::optional<HeadStart> head_start;
    if (cuda && settings.expected_seconds > 0 && settings.expected_samples == 0)
        head_start.emplace(settings_of(settings, candidates[0]), make);
    const Pilot pilot =
        run_pilot(scene, settings, cuda, cwbvh, accels, predicted, cuda ? kPilotSamplesCuda : kPilotSamplesCpu);
    if (head_start) head_start->stop();
    const std::vector<double> variance = selection_variances(pilot);
    std::vector<double> cost;  // of a sample, in any unit; smaller is better in product with the variance
    for (const SelectionCandidate& c : candidates) cost.push_back(selection_work(pilot.work, c, cuda));
    const std::vector<double> work = cost;

    // The best two families, if they cannot be told apart by work.
    const auto order = [&] {
        std::vector<size_t> of(candidates.size());
        for (size_t i = 0; i < of.size(); ++i) of[i] = i;
        std::stable_sort(of.begin(), of.end(),
                         [&](size_t a, size_t b) { return variance[a] * cost[a] < variance[b] * cost[b]; });
        return of;
    };
    std::vector<size_t> ranked = order();
    std::vector<double> seconds(candidates.size(), 0.0);
    const size_t best = ranked[0];
    const auto rival = std::find_if(ranked.begin(), ranked.end(),
                                    [&](size_t i) { return family(candidates[i]) != family(candidates[best]); });
    // 0: the device has no room for it.
    const auto timed_or_none = [&](const SelectionCandidate& candidate) {
        try {
            return timed(scene, settings_of(settings, candidate), cuda, make);
        } catch (const Error& error) {
            if (error.code != ExitCode::device) throw;
            return 0.0;
        }
    };
    // Times follow from the work to 15 % (docs/performance.md), closer than waves tell that are short enough to be
    // timed; but not for variants of other schedules.
    const bool doubtful = !is_paired(settings) && !variant_of(settings).traits.draws;
    if (doubtful && !settings.deterministic && rival != ranked.end() &&
        variance[*rival] * cost[*rival] < kDoubt * variance[best] * cost[best]) {
        for (const size_t i : {best, *rival}) {
            if (i == 0 && head_start && head_start->seconds_per_sample() > 0) {
                seconds[i] = head_start->seconds_per_sample();
                continue;
            }
            seconds[i] = timed_or_none(candidates[i]);
            if (seconds[i] > 0 || !head_start) continue;
            head_start.reset();  // a small device has no room for two
            seconds[i] = timed_or_none(candidates[i]);
        }
        for (size_t c = 0; c < candidates.size() && seconds[best] > 0 && seconds[*rival] > 0; ++c) {
            const size_t like = family(candidates[c]) == family(candidates[*rival]) ? *rival : best;
            cost[c] = seconds[like] * work[c] / work[like];
            // Families that work has put behind both need not win by the error of its estimate.
            if (family(candidates[c]) != family(candidates[like])) cost[c] *= kDoubt;
        }
        ranked = order();
    }

    double choosing = seconds_since(start);
    std::unique_ptr<Renderer> renderer;
    uint32_t ready = 0;
    if (head_start && ranked[0] == 0) {
        ready = head_start->samples();
        renderer = head_start->take();
        // Building it is no cost of the choice either: any render does.
        if (renderer) choosing = std::max(0.0, choosing - head_start->build_seconds());
    }
    head_start.reset();  // and with it the memory of a path tracer that is not wanted
    size_t chosen = ranked[0];
    for (size_t rank = 0; !renderer; ++rank) {
        chosen = ranked[rank];
        try {
            renderer = make(settings_of(settings, candidates[chosen]));
        } catch (const Error& error) {
            // What is next may need less memory.
            if (error.code != ExitCode::device || rank + 1 == ranked.size() ||
                !std::isfinite(variance[ranked[rank + 1]]))
                throw;
        }
    }

    SelectionStats choice;
    choice.name = candidates[chosen].name;
    choice.settings = candidates[chosen].settings;
    choice.seconds = choosing;
    choice.pilot_samples = pilot.samples;
    choice.expected_samples = pilot.expected_samples;
    for (size_t c = 0; c < candidates.size(); ++c)
        choice.candidates.push_back(
            {candidates[c].name, joined(candidates[c].settings), variance[c], work[c], seconds[c],
             std::isfinite(variance[c]) ? variance[chosen] * cost[chosen] / (variance[c] * cost[c]) : 0.0});
    return std::make_unique<Chosen>(std::move(renderer), ready, std::move(choice));
}

}  // namespace ambilux
