// Replays of methods with light subpaths: what all of them do.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "core/error.h"
#include "core/parallel.h"
#include "render/replay/connect.h"
#include "render/replay/film_share.h"
#include "render/replay/light.h"
#include "render/wave_plan.h"

namespace ambilux {

/// What was made last: samples that share something find it again.
template <class Key, class Made, size_t kMost>
class ReplayMemory {
public:
    template <class Make>
    std::shared_ptr<const Made> get(const Key& key, Make make) {
        const std::lock_guard<std::mutex> lock(mutex_);
        const auto found = made_.find(key);
        if (found != made_.end()) return found->second;
        if (made_.size() >= kMost) made_.clear();
        return made_[key] = make();
    }

private:
    std::mutex mutex_;
    std::map<Key, std::shared_ptr<const Made>> made_;
};

/// Number of the slot of a pixel within its tile (queues/wave.h).
inline uint32_t slot_in_tile(uint32_t x, uint32_t y) {
    uint32_t z = 0;
    while (x_in_tile(z) != x % kTileSide || y_in_tile(z) != y % kTileSide) ++z;
    return z;
}

template <class Policy>
class BdptReplay : public Replay {
public:
    using Mis = decltype(Policy::rules.mis);
    using Context = ReplayContext<Mis>;
    using Joins = ReplayJoins<Mis>;

    BdptReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer, const Policy& policy)
        : seed_(settings.seed), policy_(policy),
          wave_(host_wave(scene, settings, uint32_t(tbb::task_arena().max_concurrency()))) {
        ctx_.view = scene.view();
        ctx_.tracer = tracer;
        ctx_.rules = policy_.rules;
        ctx_.cull = policy_.waves.cull;
    }

    ReplaySample sample(const ReplayRequest& request) const override {
        ReplaySample out = blank_sample(request, seed_);
        const std::shared_ptr<const Context> ctx = context(request.sample);
        replay_eye<Mis>(*ctx, sample_emitter_, joins(*ctx, request, out), request.details, out);
        const auto asked = [&](const ReplaySubpath& s) { return s.number == *request.light_subpath; };
        if (request.light_subpath && std::none_of(out.lights.begin(), out.lights.end(), asked)) {
            std::vector<ReplayCandidate> splats;
            out.lights.push_back(light_subpath(*request.light_subpath, request.sample, true, splats));
        }
        if (ctx->rules.splat && request.splats) gather_splats(*ctx, request, out);
        finish(out);
        return out;
    }

    uint32_t light_subpaths() const override {
        return policy_.light_subpaths() ? wave_.width * wave_.height * policy_.waves.light_rounds() : 0;
    }

    /// True if a light subpath of this number starts in every sample.
    bool has_light_subpath(uint32_t number) const override {
        const uint32_t pixels = wave_.width * wave_.height, pixel = number % pixels;
        if (number >= light_subpaths()) return false;
        const uint32_t slot = slot_in_tile(pixel % wave_.width, pixel / wave_.width);
        return number / pixels < light_subpaths_of(slot, policy_.waves.light_subpaths_per_tile);
    }

    ReplaySubpath light_subpath(uint32_t number, uint32_t sample, bool details,
                                std::vector<ReplayCandidate>& splats) const override {
        if (!has_light_subpath(number))
            throw Error(ExitCode::usage,
                        fmt::format("--light-subpath {}: {}", number,
                                    light_subpaths() == 0
                                        ? "no strategy of this render needs light subpaths"
                                        : fmt::format("those of a sample have numbers below {}", light_subpaths())));
        ReplayLightRequest<Mis> request = light(number, sample);
        request.details = details;
        ReplayLight<Mis> found = replay_light(*context(sample), request);
        splats = std::move(found.splats);
        return std::move(found.subpath);
    }

protected:
    /// What light and eye subpaths of a sample read.
    virtual std::shared_ptr<const Context> context(uint32_t) const { return {std::shared_ptr<const void>(), &ctx_}; }
    /// What the eye subpath of a sample is joined with, and in `out` what is to be said of that.
    virtual Joins joins(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const = 0;

    ReplayLightRequest<Mis> light(uint32_t number, uint32_t sample) const {
        ReplayLightRequest<Mis> r;
        r.seed = seed_;
        r.number = number;
        r.sample = sample;
        r.longest = policy_.rules.longest(Side::light);
        return r;
    }

    uint64_t seed_;
    Context ctx_{};
    Policy policy_;
    Wave wave_;

private:
    /// Splats of all light subpaths of the sample that reach the pixel.
    void gather_splats(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const {
        PixelSplats pixel(ctx.view, request.x, request.y);
        std::vector<uint32_t> numbers;
        std::mutex mutex;
        const auto reaching = [&](uint32_t number, bool details) {
            ReplayLightRequest<Mis> r = light(number, request.sample);
            r.details = details;
            r.matters = [&](Vec2f film) { return pixel.reached(film); };
            return replay_light(ctx, r);
        };
        parallel_for(
            light_subpaths(),
            [&](uint32_t number) {
                if (!has_light_subpath(number) || reaching(number, false).splats.empty()) return;
                const std::lock_guard<std::mutex> lock(mutex);
                numbers.push_back(number);
            },
            64u);
        std::sort(numbers.begin(), numbers.end());
        for (const uint32_t number : numbers)
            for (ReplayCandidate& c : reaching(number, request.details).splats) {
                // What was dropped before it had a place on the film belongs to no pixel.
                if (c.fate == ReplayFate::invalid && is_zero(c.value)) continue;
                pixel.add(c);
                out.splats.push_back(std::move(c));
            }
        std::copy_n(pixel.sum(), 3, out.splat_sum);
    }

    typename ReplayEye<Mis>::SampleEmitter sample_emitter_ = sample_next_event<Mis>;
};

}  // namespace ambilux
