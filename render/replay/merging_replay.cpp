#include <set>

#include "render/replay/bdpt_replay.h"
#include "render/replay/make.h"
#include "render/replay/merging.h"

namespace ambilux {
namespace {

/// Light subpaths of a sample that are described, those whose vertices bring most.
constexpr size_t kDescribed = 3;

class MergingReplay final : public BdptReplay<VcmPolicy> {
public:
    using BdptReplay::BdptReplay;

    ReplaySample sample(const ReplayRequest& request) const override {
        ReplaySample out = BdptReplay::sample(request);
        if (request.details) describe_lights(out);
        return out;
    }
    uint32_t iteration_samples() const override { return policy_.vcm.samples; }

private:
    /// With the radius of the iteration.
    std::shared_ptr<const Context> context(uint32_t sample) const override {
        struct Whole {
            Context ctx;
            MergeNow now;
        };
        const auto whole = std::make_shared<Whole>(Whole{ctx_, {}});
        WaveState state{};
        state.iteration = sample / policy_.vcm.samples;
        SetRadius{&state, &whole->now, policy_.first_radius, policy_.vcm.alpha, policy_.subpaths(), nullptr}(0);
        whole->ctx.rules.mis.now = &whole->now;
        return {whole, &whole->ctx};
    }

    Joins joins(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const override {
        if (!policy_.keeps_vertices) return {};
        const uint32_t samples = policy_.vcm.samples, first = request.sample / samples * samples;
        const auto lights = iterations_.get(first, [&] { return light_vertices(ctx, first); });
        const std::string shared = samples > 1 ? fmt::format(", of samples {} to {}", first, first + samples - 1) : "";
        out.notes.push_back(fmt::format("iteration {}{}: {} light vertices, radius {:.6g}", first / samples, shared,
                                        lights->size(), ctx.rules.mis.now->radius));
        Joins joins;
        joins.merge = [lights](ReplayEye<Mis>& eye) { replay_merges(eye, *lights); };
        if (policy_.rules.connect)
            joins.connect = [lights](ReplayEye<Mis>& eye, const Vertex<Mis>& z, const Subpath<Mis>& path) {
                ReplayConnections<VcmSource, ReplayIteration>{eye, z, path, *lights, lights->source()}.searched();
            };
        return joins;
    }

    /// Those of the iteration that begins with sample `first`.
    std::shared_ptr<const ReplayIteration> light_vertices(const Context& ctx, uint32_t first) const {
        constexpr uint32_t kTogether = 1024;
        const uint32_t of_sample = light_subpaths(), all = of_sample * policy_.vcm.samples;
        std::vector<std::vector<KeptVertex>> kept((all + kTogether - 1) / kTogether);
        // A thread that waits takes no other sample, which would want this iteration too.
        tbb::this_task_arena::isolate([&] {
            parallel_for(uint32_t(kept.size()), [&](uint32_t part) {
                for (uint32_t i = part * kTogether; i < std::min(all, (part + 1) * kTogether); ++i)
                    if (has_light_subpath(i % of_sample)) keep(ctx, i % of_sample, first + i / of_sample, kept[part]);
            });
        });
        std::shared_ptr<const ReplayIteration> made;
        tbb::this_task_arena::isolate(
            [&] { made = std::make_shared<const ReplayIteration>(policy_, first, of_sample, std::move(kept)); });
        return made;
    }
    void keep(const Context& ctx, uint32_t number, uint32_t sample, std::vector<KeptVertex>& kept) const {
        Wave wave = wave_;
        const uint32_t pixel = number % (wave.width * wave.height), x = pixel % wave.width, y = pixel / wave.width;
        WaveState state{};
        state.first_tile = y / kTileSide * wave.tiles_x + x / kTileSide;
        state.first_sample = sample;
        state.samples = 1;
        state.iteration = sample / policy_.vcm.samples;
        wave.state = &state;
        wave.first_key = number - pixel;
        keep_light_subpath(ctx, policy_, wave, slot_in_tile(x, y), light(number, sample), kept);
    }

    /// Those that brought most to the sample, beside one that was asked for.
    void describe_lights(ReplaySample& out) const {
        std::vector<const ReplayCandidate*> joined;
        for (const ReplayCandidate& c : out.candidates)
            if (c.light_subpath != kNone && c.fate == ReplayFate::arrived) joined.push_back(&c);
        std::stable_sort(joined.begin(), joined.end(), [](const ReplayCandidate* a, const ReplayCandidate* b) {
            return largest(a->contribution) > largest(b->contribution);
        });
        std::set<std::pair<uint32_t, uint32_t>> described;
        for (const ReplayCandidate* c : joined) {
            if (described.size() == kDescribed) return;
            const uint32_t sample = c->light_sample == kNone ? out.sample : c->light_sample;
            if (!described.emplace(sample, c->light_subpath).second) continue;
            const auto same = [&](const ReplaySubpath& s) {
                return s.number == c->light_subpath && sample == out.sample;
            };
            if (std::any_of(out.lights.begin(), out.lights.end(), same)) continue;
            std::vector<ReplayCandidate> splats;
            out.lights.push_back(light_subpath(c->light_subpath, sample, true, splats));
            out.lights.back().sample = c->light_sample;
        }
    }

    mutable ReplayMemory<uint32_t, ReplayIteration, 1> iterations_;
};

}  // namespace

std::unique_ptr<Replay> make_merging_replay(const Scene& scene, const RenderSettings& settings,
                                            const HostTracer& tracer, const VcmPolicy& policy) {
    return std::make_unique<MergingReplay>(scene, settings, tracer, policy);
}

}  // namespace ambilux
