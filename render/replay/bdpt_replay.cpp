#include <fmt/format.h>

#include <map>
#include <mutex>

#include "core/error.h"
#include "core/parallel.h"
#include "render/replay/connect.h"
#include "render/replay/film_share.h"
#include "render/replay/make.h"
#include "render/wave_plan.h"

namespace ambilux {
namespace {

using Eye = ReplayEye<BidirectionalMis>;
using Path = Subpath<BidirectionalMis>;

/// Caches that were made last: samples of one wave share theirs.
class CacheMemory {
public:
    template <class Make>
    std::shared_ptr<const ReplayVertices> get(uint32_t first_tile, uint32_t sample, Make make) {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (made_.size() >= kMost) made_.clear();
        std::shared_ptr<const ReplayVertices>& cache = made_[{first_tile, sample}];
        if (!cache) cache = make();
        return cache;
    }

private:
    static constexpr size_t kMost = 64;
    std::mutex mutex_;
    std::map<std::pair<uint32_t, uint32_t>, std::shared_ptr<const ReplayVertices>> made_;
};

class BdptReplay final : public Replay {
public:
    BdptReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer, const BdptPolicy& policy,
               ReplayPairing pairing)
        : seed_(settings.seed), policy_(policy), pairing_(pairing) {
        ctx_.view = scene.view();
        ctx_.tracer = tracer;
        ctx_.rules = policy_.rules;
        ctx_.cull = policy_.waves.cull;
        ctx_.radiance_first = pairing_ == ReplayPairing::registers;
        if (!policy_.rules.connect) pairing_ = ReplayPairing::none;
        wave_ = host_wave(scene, settings, uint32_t(tbb::task_arena().max_concurrency()));
        const Ordering ordering = settings.queues.ordering;
        cache_known_ = settings.backend != Backend::cuda && settings.memory == 0 &&
                       (ordering == Ordering::automatic || ordering == Ordering::none);
    }

    ReplaySample sample(const ReplayRequest& request) const override {
        ReplaySample out = blank_sample(request, seed_);
        const uint32_t pixel = request.y * wave_.width + request.x;
        Eye::At connect;
        std::shared_ptr<const ReplayVertices> lights;
        switch (pairing_) {
            case ReplayPairing::no_replay:
            case ReplayPairing::none: break;
            case ReplayPairing::own_subpath:
            case ReplayPairing::registers: lights = own_subpath(request, pixel, out); break;
            case ReplayPairing::own_vertex: connect = for_vertices(request, out); break;
            case ReplayPairing::cache: lights = cached(request, out); break;
        }
        if (lights) connect = with(*lights, request);
        replay_eye<BidirectionalMis>(ctx_, sample_emitter_, connect, request.details, out);
        if (request.light_subpath && pairing_ != ReplayPairing::cache) {
            std::vector<ReplayCandidate> splats;
            if (out.lights.empty() || out.lights[0].number != *request.light_subpath)
                out.lights.push_back(light_subpath(*request.light_subpath, request.sample, true, splats));
        }
        if (ctx_.rules.splat && request.splats) gather_splats(request, out);
        finish(out);
        return out;
    }

    uint32_t light_subpaths() const override {
        return policy_.light_subpaths() ? wave_.width * wave_.height * policy_.waves.light_rounds() : 0;
    }

    bool has_light_subpath(uint32_t number) const override { return exists(number); }

    ReplaySubpath light_subpath(uint32_t number, uint32_t sample, bool details,
                                std::vector<ReplayCandidate>& splats) const override {
        if (!exists(number))
            throw Error(ExitCode::usage,
                        fmt::format("--light-subpath {}: {}", number,
                                    light_subpaths() == 0
                                        ? "no strategy of this render needs light subpaths"
                                        : fmt::format("those of a sample have numbers below {}", light_subpaths())));
        ReplayLightRequest request = light(number, sample);
        request.details = details;
        ReplayLight found = replay_light(ctx_, request);
        splats = std::move(found.splats);
        return std::move(found.subpath);
    }

private:
    /// True if a light subpath of this number starts in every sample.
    bool exists(uint32_t number) const {
        const uint32_t pixels = wave_.width * wave_.height, pixel = number % pixels;
        if (number >= light_subpaths()) return false;
        const uint32_t slot = slot_in_tile(pixel % wave_.width, pixel / wave_.width);
        return number / pixels < light_subpaths_of(slot, policy_.waves.light_subpaths_per_tile);
    }
    ReplayLightRequest light(uint32_t number, uint32_t sample) const {
        ReplayLightRequest r;
        r.seed = seed_;
        r.number = number;
        r.sample = sample;
        r.longest = ctx_.rules.longest(Side::light);
        return r;
    }
    /// What waves keep of light subpaths.
    ReplayLightRequest for_connections(uint32_t number, const ReplayRequest& request) const {
        ReplayLightRequest r = light(number, request.sample);
        r.splats = false;
        r.details = request.details;
        r.keeps = [most = ctx_.rules.max_depth](const BidirectionalVertex&, uint32_t depth) {
            return depth + 2 <= most;
        };
        return r;
    }

    std::shared_ptr<const ReplayVertices> own_subpath(const ReplayRequest& request, uint32_t number,
                                                      ReplaySample& out) const {
        if (!exists(number)) return nullptr;
        ReplayLight found = replay_light(ctx_, for_connections(number, request));
        const std::vector<uint32_t> owners(found.vertices.size(), number);
        out.lights.push_back(std::move(found.subpath));
        return std::make_shared<const ReplayVertices>(std::move(found.vertices), owners, true);
    }

    std::shared_ptr<const ReplayVertices> cached(const ReplayRequest& request, ReplaySample& out) const {
        if (request.light_subpath) {
            if (!exists(*request.light_subpath)) light_subpath(*request.light_subpath, 0, false, out.splats);
            out.complete = false;
            out.notes.push_back(
                "connections: every eye vertex with every vertex of the light subpath that was given, each worth what "
                "one draw of it is on average; the render drew from a cache");
            return own_subpath(request, *request.light_subpath, out);
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
        return caches_.get(first, request.sample, [&] {
            ReplayLightRequest r = for_connections(0, request);
            return std::shared_ptr<const ReplayVertices>(replay_cache(
                ctx_, wave_, first, policy_.waves.light_subpaths_per_tile, policy_.waves.light_rounds(), r));
        });
    }
    uint32_t first_tile(const ReplayRequest& request) const {
        const uint32_t tile = request.y / kTileSide * wave_.tiles_x + request.x / kTileSide;
        return tile / wave_.tiles * wave_.tiles;
    }

    Eye::At with(const ReplayVertices& lights, const ReplayRequest& request) const {
        return [this, &lights, request](Eye& eye, const BidirectionalVertex& z, const Path& path) {
            const bool drawn = pairing_ == ReplayPairing::cache && !request.light_subpath;
            ReplayConnections c = {eye, z, path, lights, lights.source(drawn ? policy_.cache_draws : 0)};
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
    }

    /// Variant streaming: a light subpath for every eye vertex.
    Eye::At for_vertices(const ReplayRequest& request, ReplaySample& out) const {
        return [this, request, &out](Eye& eye, const BidirectionalVertex& z, const Path& path) {
            const uint32_t most = ctx_.rules.max_depth, depth = path.depth;
            if (depth + 2 > most) return;
            const uint32_t pixel = request.y * wave_.width + request.x;
            const ConnectionVertex<BidirectionalMis> waiting = pack_connection_vertex(z, path, 0);
            ReplayLightRequest r = for_connections(pixel, request);
            r.part = depth - 1;
            if (!(ctx_.rules.splat && r.part == 0)) r.longest = most - 1 - depth;
            r.keeps = [&](const BidirectionalVertex& y, uint32_t light_depth) {
                return light_depth + depth + 1 <= most && may_connect(waiting.front, y);
            };
            ReplayLight found = replay_light(ctx_, r);
            const std::vector<uint32_t> owners(found.vertices.size(), pixel);
            if (request.details) out.lights.push_back(std::move(found.subpath));
            const ReplayVertices lights(std::move(found.vertices), owners, true);
            const ReplayConnections c = {eye, z, path, lights, lights.source(0)};
            c.all_forwards(c.packed_end());
        };
    }

    /// Splats of all light subpaths of the sample that reach the pixel.
    void gather_splats(const ReplayRequest& request, ReplaySample& out) const {
        PixelSplats pixel(ctx_.view, request.x, request.y);
        std::vector<uint32_t> numbers;
        std::mutex mutex;
        const auto reaching = [&](uint32_t number, bool details) {
            ReplayLightRequest r = light(number, request.sample);
            r.details = details;
            r.matters = [&](Vec2f film) { return pixel.reached(film); };
            return replay_light(ctx_, r);
        };
        parallel_for(
            light_subpaths(),
            [&](uint32_t number) {
                if (!exists(number) || reaching(number, false).splats.empty()) return;
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

    uint64_t seed_;
    ReplayContext<BidirectionalMis> ctx_{};
    BdptPolicy policy_;
    ReplayPairing pairing_;
    Wave wave_{};
    bool cache_known_ = true;
    Eye::SampleEmitter sample_emitter_ = sample_next_event<BidirectionalMis>;
    mutable CacheMemory caches_;
};

}  // namespace

std::unique_ptr<Replay> make_bdpt_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
                                         const BdptPolicy& policy, ReplayPairing pairing) {
    return std::make_unique<BdptReplay>(scene, settings, tracer, policy, pairing);
}

}  // namespace ambilux
