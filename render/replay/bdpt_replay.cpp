#include "render/replay/bdpt_replay.h"

#include "render/replay/guide.h"
#include "render/replay/light_cache.h"
#include "render/replay/make.h"

namespace ambilux {
namespace {

template <class Mis>
class PairReplay : public BdptReplay<BdptPolicyOf<Mis>> {
protected:
    using Base = BdptReplay<BdptPolicyOf<Mis>>;
    using Base::ctx_, Base::policy_, Base::wave_, Base::light, Base::has_light_subpath, Base::light_subpath;
    using typename Base::Context, typename Base::Joins;
    using Eye = ReplayEye<Mis>;
    using Path = Subpath<Mis>;
    using LightRequest = ReplayLightRequest<Mis>;
    using Vertices = ReplayVertices<Mis>;
    using Connections = ReplayConnections<LightVertexSource<Mis>, Vertices>;

public:
    PairReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
               const BdptPolicyOf<Mis>& policy, ReplayPairing pairing)
        : Base(scene, settings, tracer, policy), pairing_(policy.rules.connect ? pairing : ReplayPairing::none) {
        ctx_.radiance_first = pairing == ReplayPairing::registers;
        const Ordering ordering = settings.queues.ordering;
        cache_known_ = settings.backend != Backend::cuda && settings.memory == 0 &&
                       (ordering == Ordering::automatic || ordering == Ordering::none);
    }

protected:
    Joins joins(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const override {
        switch (pairing_) {
            case ReplayPairing::no_replay:
            case ReplayPairing::iteration:
            case ReplayPairing::none: break;
            case ReplayPairing::own_subpath:
            case ReplayPairing::registers:
                return with(own_subpath(ctx, request, request.y * wave_.width + request.x, out), request);
            case ReplayPairing::own_vertex: return for_vertices(ctx, request, out);
            case ReplayPairing::cache: return with(cached(ctx, request, out), request);
        }
        return {};
    }

private:
    /// What waves keep of light subpaths.
    LightRequest for_connections(uint32_t number, const ReplayRequest& request) const {
        LightRequest r = light(number, request.sample);
        r.splats = false;
        r.details = request.details;
        r.keeps = [most = ctx_.rules.max_depth](const Vertex<Mis>&, uint32_t depth) { return depth + 2 <= most; };
        return r;
    }

    std::shared_ptr<const Vertices> own_subpath(const Context& ctx, const ReplayRequest& request, uint32_t number,
                                                ReplaySample& out) const {
        if (!has_light_subpath(number)) return nullptr;
        ReplayLight<Mis> found = replay_light(ctx, for_connections(number, request));
        const std::vector<uint32_t> owners(found.vertices.size(), number);
        out.lights.push_back(std::move(found.subpath));
        return std::make_shared<const Vertices>(std::move(found.vertices), owners, true);
    }

    std::shared_ptr<const Vertices> cached(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const {
        if (request.light_subpath) {
            if (!has_light_subpath(*request.light_subpath)) light_subpath(*request.light_subpath, 0, false, out.splats);
            out.complete = false;
            out.notes.push_back(
                "connections: every eye vertex with every vertex of the light subpath that was given, each worth what "
                "one draw of it is on average; the render drew from a cache");
            return own_subpath(ctx, request, *request.light_subpath, out);
        }
        if (!cache_known_) {
            out.complete = false;
            out.notes.push_back(
                "connections are missing: which light vertices were drawn depends on the order of the cache, which is "
                "known on the CPU without ordering and without a budget of memory only; --light-subpath N connects "
                "with those of one light subpath");
            return nullptr;
        }
        out.notes.push_back(fmt::format("connections: with draws from the cache of a render on the CPU with {} threads",
                                        tbb::task_arena().max_concurrency()));
        const uint32_t first = first_tile(request);
        return caches_.get({first, request.sample}, [&] {
            LightRequest r = for_connections(0, request);
            return std::shared_ptr<const Vertices>(replay_cache(
                ctx, wave_, first, policy_.waves.light_subpaths_per_tile, policy_.waves.light_rounds(), r));
        });
    }
    uint32_t first_tile(const ReplayRequest& request) const {
        const uint32_t tile = request.y / kTileSide * wave_.tiles_x + request.x / kTileSide;
        return tile / wave_.tiles * wave_.tiles;
    }

    Joins with(std::shared_ptr<const Vertices> lights, const ReplayRequest& request) const {
        if (!lights) return {};
        const auto connect = [this, lights, request](Eye& eye, const Vertex<Mis>& z, const Path& path) {
            const bool drawn = pairing_ == ReplayPairing::cache && !request.light_subpath;
            Connections c = {eye, z, path, *lights, lights->source(drawn ? policy_.cache_draws : 0)};
            if (drawn)
                c.state.light_subpaths =
                    light_subpaths_in(wave_, first_tile(request), wave_.tiles, policy_.waves.light_subpaths_per_tile);
            else if (pairing_ == ReplayPairing::cache)
                c.scale = 1.0f / ctx_.rules.mis.connections;
            if (pairing_ == ReplayPairing::registers)
                c.all_backwards(c.exact_end());
            else
                c.searched();
        };
        return {connect, {}, {}};
    }

    /// Variant streaming: a light subpath for every eye vertex.
    Joins for_vertices(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const {
        const auto connect = [this, &ctx, request, &out](Eye& eye, const Vertex<Mis>& z, const Path& path) {
            const uint32_t most = ctx_.rules.max_depth, depth = path.depth;
            if (depth + 2 > most) return;
            const uint32_t pixel = request.y * wave_.width + request.x;
            const ConnectionVertex<Mis> waiting = pack_connection_vertex(z, path, 0);
            LightRequest r = for_connections(pixel, request);
            r.part = depth - 1;
            if (!(ctx_.rules.splat && r.part == 0)) r.longest = most - 1 - depth;
            r.keeps = [&](const Vertex<Mis>& y, uint32_t light_depth) {
                return light_depth + depth + 1 <= most && may_connect(waiting.front, y);
            };
            ReplayLight<Mis> found = replay_light(ctx, r);
            const std::vector<uint32_t> owners(found.vertices.size(), pixel);
            if (request.details) out.lights.push_back(std::move(found.subpath));
            const Vertices lights(std::move(found.vertices), owners, true);
            const Connections c = {eye, z, path, lights, lights.source(0)};
            c.all_forwards(c.packed_end());
        };
        return {connect, {}, {}};
    }

    ReplayPairing pairing_;
    bool cache_known_ = true;
    mutable ReplayMemory<std::pair<uint32_t, uint32_t>, Vertices, 64> caches_;
};

/// Variant guided: as lvc, by the trees of the iteration.
class GuidedPairReplay final : public PairReplay<GuidedMis<BidirectionalMis>> {
    using Base = PairReplay<GuidedMis<BidirectionalMis>>;

public:
    GuidedPairReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
                     const BdptPolicyOf<GuidedMis<BidirectionalMis>>& policy, const GuidePolicy& guide)
        : Base(scene, settings, tracer, policy, ReplayPairing::cache), guide_(scene, settings, guide) {}

    uint32_t iteration_samples() const override { return guide_.iteration_samples(); }
    std::shared_ptr<const KeptGuide> guide(uint32_t sample) const override { return guide_.at(sample); }

private:
    std::shared_ptr<const Context> context(uint32_t sample) const override {
        return guided_context(ctx_, guide_, sample);
    }
    Joins joins(const Context& ctx, const ReplayRequest& request, ReplaySample& out) const override {
        Joins all = Base::joins(ctx, request, out);
        all.start = guided_start(ctx, guide_, request);
        return all;
    }

    ReplayedGuide guide_;
};

}  // namespace

std::unique_ptr<Replay> make_bdpt_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
                                         const BdptPolicy& policy, ReplayPairing pairing) {
    return std::make_unique<PairReplay<BidirectionalMis>>(scene, settings, tracer, policy, pairing);
}

std::unique_ptr<Replay> make_guided_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
                                           const BdptPolicyOf<GuidedMis<BidirectionalMis>>& policy,
                                           const GuidePolicy& guide) {
    return std::make_unique<GuidedPairReplay>(scene, settings, tracer, policy, guide);
}

}  // namespace ambilux
