#include "render/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/seconds.h"
#include "integrators/reachability.h"
#include "integrators/registry.h"
#include "render/by_pixel.h"
#include "render/chosen.h"
#include "render/head_start.h"
#include "render/measured.h"

namespace ambilux {
namespace {

/// Where the ratio of times does not follow from the work: candidates whose product of variance and work is within this
/// factor of the best are timed.
constexpr double kDoubt = 1.3;
/// Others whose product is within this factor may be as good.
constexpr double kNear = 1.6;
/// In a render of so many seconds or more the best of up to so many families are tried out, each for this share of it.
constexpr double kLongRender = 10, kTrialShare = 0.005;
constexpr size_t kTried = 3;
/// A trial of so many times the pilot's paths knows variances better than the pilot, but for those that it finds to be
/// less than predicted by more than this factor.
constexpr double kManyPaths = 16, kHidden = 2;
constexpr uint32_t kFirstTimedSample = 0xff000000u;  ///< far from those of the image

std::string joined(const SettingTexts& settings) {
    std::string text;
    for (const auto& [key, value] : settings) text += (text.empty() ? "" : " ") + key + "=" + value;
    return text;
}

/// Eye subpaths of a pilot: a few hundredths of the time of a render that ends by the clock, on 2 cores and on the 16
/// beside a GPU. With half of the most for a device, one seed in ten (water-caustic) or two (veach-ajar) put a
/// candidate first that is 1.1 to 1.5 times worse.
uint32_t pilot_samples(const RenderSettings& settings, bool cuda) {
    const double most = cuda ? 32768 : 8192, for_seconds = cuda ? 2 : 4, least = 4096;
    if (settings.expected_samples > 0 || !(settings.expected_seconds > 0)) return uint32_t(most);
    return uint32_t(std::clamp(most * settings.expected_seconds / for_seconds, least, most));
}

bool learns(const SelectionCandidate& c) { return c.offer.least_subpaths > 0; }

/// Candidates of one family do the same but for the numbers of light subpaths and draws, so that the time of one tells
/// that of the others.
uint32_t family(const SelectionCandidate& c) {
    return (c.pilot.light_subpaths != 0.0f ? 1 : 0) + (c.pilot.connect ? 2 : 0) + (c.pilot.draws ? 4 : 0) +
           (learns(c) ? 8 : 0);
}

/// Seconds per sample of every pixel. On a device: of about one full wave, smaller than a render's for the sake of
/// time. What launches cost beside their items is then more than it will be, and for cheap samples most: so the path
/// tracer's wave holds more of them, and takes about as long as others.
double timed(const Scene& scene, RenderSettings settings, bool cuda, const MakeRenderer& make) {
    constexpr double kLongEnough = 0.05;
    const VariantTraits& traits = variant_of(settings).traits;
    const uint32_t paths_per_wave = traits.light_subpaths ? 1u << 21 : 1u << 22;
    const uint32_t pixels = scene.sensor.crop_width * scene.sensor.crop_height;
    if (settings.memory)
        settings.expected_samples = std::max(1u, paths_per_wave / std::max(1u, pixels));  // fewer where memory is short
    else if (cuda && settings.wave_size == 0 && !traits.streams)
        settings.wave_size = paths_per_wave;
    const std::unique_ptr<Renderer> renderer = make(settings);
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

/// One selection: a pilot predicts, what it cannot tell apart is timed, and the best that finds memory is made.
class Selection {
public:
    Selection(const Scene& scene, const RenderSettings& settings, bool cuda, const MakeRenderer& make)
        : scene_(scene), settings_(settings), cuda_(cuda), make_(make),
          candidates_(selection_candidates(settings, cuda)), seconds_(candidates_.size(), 0.0) {
        const uint32_t allowed = kAllStrategies | (settings.allow == Allow::consistent ? kMergeStrategies : 0u);
        for (const SelectionCandidate& c : candidates_) {
            const std::string path = unreachable_path(scene.features, sampled_strategies(settings_of(settings, c)),
                                                      allowed, settings.max_depth);
            excluded_.push_back(path.empty() ? "" : "cannot find paths such as " + path);
            if (c.offer.measured && settings.deterministic) excluded_.back() = "is compared by the clock";
        }
    }

    std::unique_ptr<Renderer> run(SharedAccels& accels, bool cwbvh) {
        // A budget holds one renderer at a time.
        const bool ahead = cuda_ && settings_.memory == 0 && settings_.expected_seconds > 0;
        if (ahead && settings_.expected_samples == 0 && excluded_[0].empty())
            head_start_.emplace(settings_of(settings_, candidates_[0]), make_);
        std::vector<PilotCandidate> predicted;
        for (const SelectionCandidate& c : candidates_)
            if (c.predicted()) predicted.push_back(c.pilot);
        Pilot pilot = run_pilot(scene_, settings_, cuda_, cwbvh, accels, predicted, pilot_samples(settings_, cuda_));
        if (head_start_) head_start_->stop();
        for (size_t c = 0; c < candidates_.size(); ++c)
            if (eye_subpaths(pilot) < candidates_[c].offer.least_subpaths)
                excluded_[c] = "has too few samples to learn from";
        for (const SelectionCandidate& c : candidates_) work_.push_back(selection_work(pilot.work, c, cuda_));
        choose_by_pixel(pilot);
        variance_ = selection_variances(pilot, excluded_);
        variance_.resize(candidates_.size(), double(kInfinity));
        cost_ = work_;
        rank();
        if (const std::optional<size_t> rival = doubtful_rival()) {
            time(ranked_[0], *rival);
            rank();
        }
        for (size_t c = predicted.size(); c < candidates_.size(); ++c)
            if (candidates_[c].offer.measured && excluded_[c].empty())
                measure_beside(ranked_[0], c, pilot.expected_samples);
        try_out(worth_a_trial(pilot), pilot);
        rank();

        choosing_ = seconds_since(start_);
        std::unique_ptr<Renderer> renderer = take_head_start();
        const uint32_t ready = renderer ? head_start_->samples() : 0;
        head_start_.reset();  // and with it the memory of a path tracer that is not wanted
        size_t chosen = ranked_[0];
        if (!renderer) renderer = make_best(chosen);
        return std::make_unique<Chosen>(std::move(renderer), ready, describe(pilot, chosen));
    }

private:
    /// Of the whole render.
    double eye_subpaths(const Pilot& pilot) const { return pilot.expected_samples * pixels(); }
    double pixels() const { return double(scene_.sensor.crop_width) * scene_.sensor.crop_height; }
    double score(size_t c) const { return variance_[c] * cost_[c]; }

    /// Candidates with a number of connections for each pixel.
    void choose_by_pixel(Pilot& pilot) {
        const std::vector<std::vector<double>> of = possible_variances(pilot, excluded_);
        const double unseen = of.empty() ? 0.0 : unseen_variance(trimmed_means(of));
        for (size_t c = 0; c < candidates_.size(); ++c) {
            if (!candidates_[c].offer.by_pixel) continue;
            work_[c] = set_connections_map(candidates_[c], candidates_, excluded_, cuda_, unseen, pilot);
            if (work_[c] == 0.0) excluded_[c] = "has no pixels that differ";
        }
    }

    void rank() {
        ranked_.resize(candidates_.size());
        for (size_t i = 0; i < ranked_.size(); ++i) ranked_[i] = i;
        std::stable_sort(ranked_.begin(), ranked_.end(), [&](size_t a, size_t b) { return score(a) < score(b); });
    }

    /// The best of another family than the best, if work cannot tell them apart. Times follow from the work to 15 %
    /// (docs/performance.md), closer than waves tell that are short enough to be timed; but not for variants of other
    /// schedules.
    std::optional<size_t> doubtful_rival() const {
        const VariantTraits& asked = variant_of(settings_).traits;
        const bool doubtful = !asked.selects_any && !asked.draws;
        if (!doubtful || settings_.deterministic) return {};
        const size_t best = ranked_[0];
        const auto rival = std::find_if(ranked_.begin(), ranked_.end(),
                                        [&](size_t i) { return family(candidates_[i]) != family(candidates_[best]); });
        if (rival == ranked_.end() || !(score(*rival) < kDoubt * score(best))) return {};
        return *rival;
    }

    /// Replaces work by time for the families of both.
    void time(size_t best, size_t rival) {
        for (const size_t i : {best, rival}) {
            if (i == 0 && head_start_ && head_start_->seconds_per_sample() > 0) {
                seconds_[i] = head_start_->seconds_per_sample();
                continue;
            }
            seconds_[i] = timed_or_none(candidates_[i]);
            if (seconds_[i] > 0 || !head_start_) continue;
            head_start_.reset();  // a small device has no room for two
            seconds_[i] = timed_or_none(candidates_[i]);
        }
        if (!(seconds_[best] > 0 && seconds_[rival] > 0)) return;
        for (size_t c = 0; c < candidates_.size(); ++c) {
            const size_t like = family(candidates_[c]) == family(candidates_[rival]) ? rival : best;
            cost_[c] = seconds_[like] * work_[c] / work_[like];
            // Families that work has put behind both need not win by the error of its estimate.
            if (family(candidates_[c]) != family(candidates_[like])) cost_[c] *= kDoubt;
        }
    }

    /// The best of each family that is near the best, where a render is long and a pilot, with its few subpaths, may
    /// have missed what decides: bright hits that all candidates have, and times of a device.
    std::vector<size_t> worth_a_trial(const Pilot& pilot) const {
        std::vector<size_t> found;
        const bool is_long = settings_.expected_seconds >= kLongRender && pilot.expected_samples * kTrialShare >= 4;
        if (!is_long || settings_.deterministic || settings_.expected_samples > 0) return found;
        std::set<uint32_t> families;
        for (const size_t c : ranked_)
            if (score(c) < kNear * score(ranked_[0]) && found.size() < kTried && !candidates_[c].offer.measured &&
                families.insert(family(candidates_[c])).second)
                found.push_back(c);
        return found;
    }

    /// Replaces work by time for those that are tried and do not spend a trial on learning, and predicted variances by
    /// what many more paths than the pilot's have. A variance that is much less than predicted stays, but for the ratio
    /// of measured to predicted ones: the pilot knows of light that single hits bring.
    void try_out(const std::vector<size_t>& tried, const Pilot& pilot) {
        if (tried.size() < 2) return;
        std::vector<Measured> of;
        std::vector<std::vector<double>> variances;
        for (const size_t c : tried) {
            const std::optional<Measured> m = measured(c, kFirstTimedSample, kTrialShare * settings_.expected_seconds);
            if (!m) return;
            of.push_back(*m);
            variances.push_back(m->variance);
        }
        // Of one whose time is not learning.
        const size_t clock = learns(candidates_[tried[0]]) ? 1 : 0;
        const double rays_per_second = work_[tried[clock]] / of[clock].seconds, before = variance_[tried[0]];
        const std::vector<double> seen = trimmed_means(variances);
        double fewest = kInfinity, unit = 0;  // logarithm of measured over predicted variance
        for (const Measured& m : of) fewest = std::min(fewest, m.samples * pixels());
        std::vector<size_t> known, kept;  // places in `tried`
        for (size_t i = 0; i < tried.size(); ++i) {
            const size_t c = tried[i];
            seconds_[c] = of[i].seconds;
            if (!learns(candidates_[c])) cost_[c] = of[i].seconds * rays_per_second;
            (fewest >= kManyPaths * pilot.samples && variance_[c] < kHidden * seen[i] ? known : kept).push_back(i);
        }
        for (const size_t i : known) unit += std::log(seen[i] / variance_[tried[i]]) / double(known.size());
        for (const size_t i : known) variance_[tried[i]] = seen[i];
        for (const size_t i : kept) variance_[tried[i]] *= std::exp(unit);
        // Others stay where they were beside the one that was the best.
        for (size_t c = 0; c < candidates_.size(); ++c)
            if (std::find(tried.begin(), tried.end(), c) == tried.end()) variance_[c] *= variance_[tried[0]] / before;
    }

    /// Nothing where the device has no room for it.
    std::optional<Measured> measured(size_t c, uint32_t first, double seconds) const {
        try {
            return measure(settings_of(settings_, candidates_[c]), make_, first, seconds);
        } catch (const Error& error) {
            if (error.code != ExitCode::device) throw;
            return {};
        }
    }

    /// Scales what is known of the best to a candidate that was not predicted. Where a few samples show much less than
    /// predicted, single hits bring the rest: merging finds such light at all times, so that its samples show all of
    /// its variance. Of samples behind those that are expected: a radius that shrinks is smallest there, and variance
    /// greatest.
    void measure_beside(size_t best, size_t other, double behind) {
        if (!excluded_[best].empty()) return void(variance_[other] = 1.0);
        const std::optional<Measured> a = measured(best, uint32_t(behind), 0),
                                      b = a ? measured(other, uint32_t(behind), 0) : a;
        if (!b) return void(excluded_[other] = "found no room to be measured");
        const std::vector<double> seen = trimmed_means({a->variance, b->variance});
        variance_[other] = seen[1] * (variance_[best] < kHidden * seen[0] ? variance_[best] / seen[0] : 1.0);
        cost_[other] = cost_[best] * b->seconds / a->seconds;
        seconds_[other] = b->seconds;
    }

    /// 0: the device has no room for it.
    double timed_or_none(const SelectionCandidate& candidate) const {
        try {
            return timed(scene_, settings_of(settings_, candidate), cuda_, make_);
        } catch (const Error& error) {
            if (error.code != ExitCode::device) throw;
            return 0.0;
        }
    }

    /// The path tracer, if it is the best and has begun.
    std::unique_ptr<Renderer> take_head_start() {
        if (!head_start_ || ranked_[0] != 0) return nullptr;
        std::unique_ptr<Renderer> renderer = head_start_->take();
        // Building it is no cost of the selection either: any render does.
        if (renderer) choosing_ = std::max(0.0, choosing_ - head_start_->build_seconds());
        return renderer;
    }

    std::unique_ptr<Renderer> make_best(size_t& chosen) const {
        for (size_t rank = 0;; ++rank) {
            chosen = ranked_[rank];
            try {
                return make_(settings_of(settings_, candidates_[chosen]));
            } catch (const Error& error) {
                // What is next may need less memory.
                if (error.code != ExitCode::device || rank + 1 == ranked_.size() ||
                    !std::isfinite(variance_[ranked_[rank + 1]]))
                    throw;
            }
        }
    }

    SelectionStats describe(const Pilot& pilot, size_t chosen) const {
        SelectionStats selection;
        selection.name = candidates_[chosen].name;
        selection.settings = candidates_[chosen].settings;
        selection.seconds = choosing_;
        selection.pilot_samples = pilot.samples;
        selection.expected_samples = pilot.expected_samples;
        for (size_t c = 0; c < candidates_.size(); ++c)
            selection.candidates.push_back(
                {candidates_[c].name, joined(candidates_[c].settings), variance_[c], work_[c], seconds_[c],
                 std::isfinite(variance_[c]) ? score(chosen) / score(c) : 0.0, excluded_[c]});
        return selection;
    }

    const Scene& scene_;
    const RenderSettings& settings_;
    const bool cuda_;
    const MakeRenderer& make_;
    const Clock::time_point start_ = Clock::now();
    std::vector<SelectionCandidate> candidates_;
    std::optional<HeadStart> head_start_;
    // By candidate.
    std::vector<std::string> excluded_;  ///< why; empty if it is not
    std::vector<double> variance_, work_;
    std::vector<double> cost_;     ///< of a sample, in any unit; smaller is better in product with the variance
    std::vector<double> seconds_;  ///< of a sample, where it was timed
    std::vector<size_t> ranked_;   ///< candidates, the best first
    double choosing_ = 0;          ///< seconds
};

}  // namespace

std::unique_ptr<Renderer> make_automatic(const Scene& scene, const RenderSettings& settings, bool cuda,
                                         SharedAccels& accels, const MakeRenderer& make) {
    // Any render builds this, and wakes the device: it is no cost of the selection.
    if (cuda) cuda_device_present();
    const bool cwbvh = cuda || settings.accel == AccelKind::cwbvh;
    if (cwbvh)
        accels.get<CwbvhAccel>();
    else
        accels.get<EmbreeAccel>();
    return Selection(scene, settings, cuda, make).run(accels, cwbvh);
}

}  // namespace ambilux
