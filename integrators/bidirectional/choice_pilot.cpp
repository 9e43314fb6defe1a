#include "integrators/bidirectional/choice_pilot.h"

#include <algorithm>
#include <array>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "core/parallel.h"
#include "integrators/bidirectional/choice_judge.h"
#include "integrators/bidirectional/wave.h"
#include "render/feature_levels.h"
#include "transport/sensor/camera.h"

namespace ambilux {
namespace {

/// Samples of one pixel: their products estimate its squared mean.
constexpr uint32_t kPixelSamples = 4;
constexpr uint32_t kMostBlocks = 32;    ///< a side
constexpr uint32_t kSmallestBlock = 4;  ///< pixels
constexpr uint32_t kWalksPerTask = 32;

/// Sets of strategies whose sums walks carry along: hits and next event estimation; light tracing besides; connections
/// besides. The rest follows by differences, since the sums of the balance heuristic are linear in the densities.
constexpr uint32_t kSets = 3;
using SetSums = std::array<MisSums, kSets>;

/// From `others` of each set; `own`: the first set that has the strategy itself.
PilotShares shares_of(const float (&others)[kSets], uint32_t own) {
    float sum[kSets];
    for (uint32_t m = 0; m < kSets; ++m) sum[m] = others[m] + (m >= own ? 1.0f : 0.0f);
    return {sum[0], std::max(0.0f, sum[1] - sum[0]), std::max(0.0f, sum[2] - sum[1])};
}

struct PilotWalk {
    Walk walk;
    SetSums sums;
};

struct PilotVertex {
    WalkVertex vertex;
    SetSums sums;
    Rgb throughput;
    uint32_t depth;
};

struct LightTask {
    std::vector<PilotVertex> vertices;
    std::vector<uint32_t> ends;  ///< of the walks' vertices
    std::vector<PilotSplat> splats;
    double rays = 0, splat_rays = 0;
};

template <Features F, class Tracer>
class Pilot {
public:
    Pilot(const Scene& scene, const RenderSettings& settings, bool cuda, const Tracer& tracer,
          const std::vector<PilotCandidate>& candidates, uint32_t samples)
        : view_(scene.view()), settings_(settings), cuda_(cuda), tracer_(tracer), moments_{candidates} {
        RenderSettings all = settings;
        all.integrator = "bdpt";
        all.variant = "wavefront";
        all.heuristic = MisHeuristic::balance;
        all.strategies = kAllStrategies;
        all.singles = {};
        policy_ = make_bidirectional_policy(scene, all);
        const uint32_t sets[kSets] = {kHitStrategies | kNextEventStrategies,
                                      kHitStrategies | kNextEventStrategies | kLightStrategies, kAllStrategies};
        for (uint32_t m = 0; m < kSets; ++m) {
            mis_[m] = policy_.mis;
            mis_[m].strategies = sets[m];
        }
        const Sensor& sensor = view_.sensor;
        const auto blocks = [](uint32_t pixels) { return std::clamp(pixels / kSmallestBlock, 1u, kMostBlocks); };
        result_.blocks_x = blocks(sensor.crop_width);
        result_.blocks_y = blocks(sensor.crop_height);
        const uint32_t count = result_.blocks_x * result_.blocks_y;
        pixels_ = std::max(1u, (samples / kPixelSamples + count / 2) / count);
        result_.samples = moments_.samples = count * pixels_ * kPixelSamples;
        moments_.filter_energy = filter_energy();
        delta_emitters_ = std::any_of(scene.emitters.begin(), scene.emitters.end(),
                                      [](const Emitter& e) { return is_delta(e.type); });
    }

    ChoicePilot run() {
        const uint32_t count = result_.blocks_x * result_.blocks_y, n = result_.samples;
        tasks_.resize((n + kWalksPerTask - 1) / kWalksPerTask);
        if (policy_.light_walks)
            parallel_for(uint32_t(tasks_.size()), [&](uint32_t t) {
                for (uint32_t i = t * kWalksPerTask; i < std::min(n, (t + 1) * kWalksPerTask); ++i) {
                    light_walk(i, tasks_[t]);
                    tasks_[t].ends.push_back(uint32_t(tasks_[t].vertices.size()));
                }
            });
        gather();
        std::vector<PilotSums> pixels(size_t(count) * pixels_);
        std::vector<PilotWork> work(count);
        parallel_for(count, [&](uint32_t b) { eye_block(b, &pixels[size_t(b) * pixels_], work[b]); });
        for (const PilotWork& w : work) {
            result_.work.eye_rays += w.eye_rays / n;
            result_.work.next_events += w.next_events / n;
            result_.work.vertices += w.vertices / n;
            result_.work.pairs += w.pairs / n;
            result_.work.pair_rays += w.pair_rays / n;
            result_.work.draws += w.draws / n;
            result_.work.draw_rays += w.draw_rays / n;
        }
        result_.light_vertices = double(vertices_.size()) / n;
        result_.expected_samples = expected_samples(
            settings_, result_.work, uint64_t(view_.sensor.crop_width) * view_.sensor.crop_height, cuda_);
        judge_candidates(moments_, {pixels, splats_, pixels_, kPixelSamples, delta_emitters_, result_.expected_samples},
                         result_);
        return result_;
    }

private:
    /// Mean over places on the film of the sum of squares of what a splat counts for its pixels.
    float filter_energy() const {
        constexpr int kSteps = 64;
        const float r = view_.sensor.filter_radius;
        double sum = 0;
        for (int y = 0; y < kSteps; ++y)
            for (int x = 0; x < kSteps; ++x) {
                const float value = filter_value(view_, {r * (2.0f * (float(x) + 0.5f) / kSteps - 1.0f),
                                                         r * (2.0f * (float(y) + 0.5f) / kSteps - 1.0f)});
                sum += double(value) * double(value);
            }
        return float(std::min(1.0, sum * 4.0 * double(r) * double(r) / (kSteps * kSteps)));
    }

    /// Sum of the filters of the film's pixels at a place; less than one along the edges.
    float coverage(Vec2f film) const {
        const Sensor& s = view_.sensor;
        const float x = film.x - float(s.crop_x), y = film.y - float(s.crop_y), r = s.filter_radius;
        if (x >= r && y >= r && x <= float(s.crop_width) - r && y <= float(s.crop_height) - r) return 1.0f;
        float sum = 0.0f;
        for (float py = max(0.0f, ceilf(y - r - 0.5f)); py <= y + r - 0.5f && py < float(s.crop_height); py += 1.0f)
            for (float px = max(0.0f, ceilf(x - r - 0.5f)); px <= x + r - 0.5f && px < float(s.crop_width); px += 1.0f)
                sum += filter_value(view_, {x - (px + 0.5f), y - (py + 0.5f)});
        return min(sum, 1.0f);
    }

    uint32_t block_at(Vec2f film) const {
        const Sensor& s = view_.sensor;
        const auto index = [](float at, uint32_t pixels, uint32_t blocks) {
            return uint32_t(
                std::clamp(int64_t(std::floor(double(at) * blocks / pixels)), int64_t(0), int64_t(blocks) - 1));
        };
        return index(film.y - float(s.crop_y), s.crop_height, result_.blocks_y) * result_.blocks_x +
               index(film.x - float(s.crop_x), s.crop_width, result_.blocks_x);
    }

    /// Scatters with the sums of all sets; the same numbers give the same ray each time.
    bool scatter(PilotVertex& x, Vec4f u, TransportMode mode, PilotWalk& w) const {
        const Walk before = w.walk;
        for (uint32_t m = 0; m < kSets; ++m) {
            x.vertex.sums = x.sums[m];
            w.walk = before;
            if (!scatter_walk<F>(mis_[m], x.vertex, u, mode, policy_.rr_depth, w.walk)) return false;
            w.sums[m] = w.walk.sums;
        }
        return is_finite(w.walk.throughput) && min_component(w.walk.throughput) >= 0.0f;
    }

    bool closest(const Walk& w, float tmax, const RngKey& key, Hit& hit) const {
        return tracer_.template closest<F>(view_, Ray{w.o, tmax, w.d, F.opacity ? alpha_seed(key, w.depth, false) : 0},
                                           hit);
    }

    /// Without its sums.
    PilotVertex vertex_at(const PilotWalk& w, const Hit& hit) const {
        return {
            walk_vertex<F>(view_, w.walk.d, w.walk.depth, hit.prim, hit.u, hit.v), {}, w.walk.throughput, w.walk.depth};
    }

    bool free(const WalkConnection& c, const RngKey& key, uint32_t which) const {
        if (!is_finite(c.o) || !is_finite(c.d)) return false;
        return !tracer_.template occluded<F>(view_,
                                             Ray{c.o, c.tmax, c.d, F.opacity ? alpha_seed(key, which, true) : 0});
    }

    static bool counts(Rgb value) { return is_finite(value) && min_component(value) >= 0.0f && !is_zero(value); }

    void light_walk(uint32_t i, LightTask& task) const {
        const RngKey key = {settings_.seed, i, 2, Stream::pilot};
        const Vec4f direction = random_floats(key, kEmissionBlock + 1);
        EmissionSample e;
        if (!sample_emission<F>(view_, random_floats(key, kEmissionBlock), {direction.x, direction.y}, e)) return;
        PilotWalk w{start_light_walk(e), {}};
        WalkConnection c;
        Vec2f film;
        // `which`: 0 is the emitter itself.
        const auto splat = [&](const float(&others)[kSets], uint32_t which) {
            if (!counts(c.value)) return;
            task.splat_rays += 1;
            if (free(c, key, which))
                task.splats.push_back(
                    {{c.value, shares_of(others, 1), coverage(film)}, block_at(film), which == 0, e.radiance});
        };
        float others[kSets];
        if (policy_.splat && !policy_.hide_emitters &&
            connect_visible_light<F>(view_, mis_[0], e, {direction.z, direction.w}, c, film)) {
            std::fill(others, others + kSets, c.others);
            splat(others, 0);
        }
        while (policy_.max_depth >= 2 && is_finite(w.walk.throughput)) {
            Hit hit;
            task.rays += 1;
            if (!closest(w.walk, kInfinity, key, hit)) return;
            PilotVertex y = vertex_at(w, hit);
            for (uint32_t m = 0; m < kSets; ++m) {
                w.walk.sums = w.sums[m];
                y.sums[m] = light_sums<F>(view_, mis_[m], w.walk, y.vertex.point);
            }
            if (bsdf_is_smooth(y.vertex.scattering.bsdf)) {
                if (policy_.splat && y.depth < policy_.max_depth) {
                    const Vec4f u = random_floats(key, lens_block(y.depth));
                    bool made = true;
                    for (uint32_t m = 0; m < kSets && made; ++m) {
                        y.vertex.sums = y.sums[m];
                        made = connect_camera<F>(view_, mis_[m], y.vertex, y.throughput, {u.x, u.y}, c, film);
                        others[m] = c.others;
                    }
                    if (made) splat(others, y.depth);
                }
                if (policy_.connect_vertices && y.depth + 2 <= policy_.max_depth) task.vertices.push_back(y);
            }
            if (y.depth + 1 >= policy_.max_depth) return;
            if (!scatter(y, random_floats(key, light_scatter_block(y.depth)), TransportMode::importance, w)) return;
        }
    }

    /// Vertices and splats stay where they are: they are large.
    void gather() {
        first_.reserve(result_.samples + 1);
        first_.push_back(0);
        for (const LightTask& t : tasks_) {
            for (const uint32_t end : t.ends) first_.push_back(uint32_t(vertices_.size()) + end);
            for (const PilotVertex& v : t.vertices) vertices_.push_back(&v);
            for (const PilotSplat& e : t.splats) splats_.push_back(&e);
            result_.work.light_rays += t.rays / result_.samples;
            result_.work.splats += t.splat_rays / result_.samples;
        }
        first_.resize(result_.samples + 1, uint32_t(vertices_.size()));
        moments_.light_vertices = vertices_.size();
    }

    /// What the eye walk of one sample brings to a candidate. The product of `first` and `second` without `own` is what
    /// contributions of one sample have in common.
    struct EyeSums {
        double first[3] = {},
               second[3] = {};  ///< with the first and the second draw of every vertex; the same for paired walks
        double own[3] = {};     ///< products of contributions with themselves

        /// `share`: of the product that belongs to single contributions.
        void add(Rgb a, Rgb b, double share) {
            for (int k = 0; k < 3; ++k) {
                first[k] += double(a[k]);
                second[k] += double(b[k]);
                own[k] += double(a[k]) * double(b[k]) * share;
            }
        }
    };

    /// An eye walk and where its results go.
    struct Eye {
        uint32_t number;
        RngKey key;
        PilotSums& pixel;
        PilotWork& work;
        EyeSums sums[kMostCandidates];
    };

    /// The pilot's pixels of a block, with all but (18) of the variance (equation 19).
    void eye_block(uint32_t b, PilotSums* pixels, PilotWork& work) const {
        const Sensor& sensor = view_.sensor;
        const auto edge = [](uint32_t at, uint32_t size, uint32_t blocks) {
            return uint32_t(uint64_t(at) * size / blocks);
        };
        const uint32_t bx = b % result_.blocks_x, by = b / result_.blocks_x;
        const uint32_t x0 = edge(bx, sensor.crop_width, result_.blocks_x),
                       x1 = edge(bx + 1, sensor.crop_width, result_.blocks_x);
        const uint32_t y0 = edge(by, sensor.crop_height, result_.blocks_y),
                       y1 = edge(by + 1, sensor.crop_height, result_.blocks_y);
        for (uint32_t p = 0; p < pixels_; ++p) {
            const uint32_t first = (b * pixels_ + p) * kPixelSamples;
            const Uint4 place = random_bits({settings_.seed, first, 3, Stream::pilot}, 0);
            const uint32_t x = x0 + mul_hi(place.x, x1 - x0), y = y0 + mul_hi(place.y, y1 - y0);
            double sum[kMostCandidates][3] = {}, squares[kMostCandidates][3] = {};
            for (uint32_t s = 0; s < kPixelSamples; ++s) {
                Eye eye{first + s, {settings_.seed, first + s, 1, Stream::pilot}, pixels[p], work, {}};
                eye_walk(eye, x, y);
                for (uint32_t c = 0; c < moments_.candidates.size(); ++c)
                    for (int k = 0; k < 3; ++k) {
                        const EyeSums& e = eye.sums[c];
                        pixels[p].variance[c][k] += e.first[k] * e.second[k] - e.own[k];
                        const double value = 0.5 * (e.first[k] + e.second[k]);
                        sum[c][k] += value;
                        squares[c][k] += value * value;
                    }
            }
            // Products of different samples: the squared mean, without bias.
            for (uint32_t c = 0; c < moments_.candidates.size(); ++c)
                for (int k = 0; k < 3; ++k)
                    pixels[p].variance[c][k] -= (sum[c][k] * sum[c][k] - squares[c][k]) / (kPixelSamples - 1);
        }
    }

    /// A hit or a sample of next event estimation.
    void found(Eye& eye, const PilotEvent& e) const {
        moments_.add(e, eye.pixel);
        for (uint32_t c = 0; c < moments_.candidates.size(); ++c) {
            const Rgb value = e.value * (1.0f / moments_.sum_of(c, e.shares));
            eye.sums[c].add(value, value, 1.0);
        }
    }

    void found_by_hit(Eye& eye, Rgb value, uint32_t depth, const float (&others)[kSets]) const {
        if (depth == 1)
            for (int k = 0; k < 3; ++k) eye.pixel.seen[k] = std::max(eye.pixel.seen[k], double(value[k]));
        found(eye, {value, shares_of(others, 0)});
    }

    void eye_walk(Eye& eye, uint32_t x, uint32_t y) const {
        if (policy_.max_depth == 0) return;
        const Vec4f u = random_floats(eye.key, kCameraBlock);
        const CameraSample camera =
            sample_camera_ray(view_.sensor, sample_film_position(view_, x, y, {u.x, u.y}), {u.z, u.w});
        PilotWalk w{start_eye_walk(view_, mis_[0], camera), {}};
        for (uint32_t m = 0; m < kSets; ++m) w.sums[m] = start_eye_walk(view_, mis_[m], camera).sums;
        float others[kSets];
        for (float tmax = camera.tmax;; tmax = kInfinity) {
            const uint32_t depth = w.walk.depth;
            const bool visible = !(policy_.hide_emitters && depth == 1);
            Hit hit;
            eye.work.eye_rays += 1;
            if (!closest(w.walk, tmax, eye.key, hit)) {
                if constexpr (F.has_environment()) {
                    if (!policy_.counts_environment(depth) || !visible) return;
                    const Rgb value = w.walk.throughput * environment_radiance<F>(view_, w.walk.d);
                    for (uint32_t m = 0; m < kSets; ++m)
                        others[m] = others_of_escape<F>(view_, mis_[m], w.sums[m], depth, w.walk.d);
                    if (counts(value)) found_by_hit(eye, value, depth, others);
                }
                return;
            }
            PilotVertex z = vertex_at(w, hit);
            for (uint32_t m = 0; m < kSets; ++m) {
                w.walk.sums = w.sums[m];
                z.sums[m] = eye_sums(view_, mis_[m], w.walk, z.vertex.point);
            }
            const uint32_t emitter = view_.shapes[z.vertex.point.shape].emitter;
            if (policy_.count_hits && visible && emitter != kNone) {
                const Rgb value = z.throughput * emitted_radiance<F>(view_, emitter, z.vertex.point, -w.walk.d);
                if (counts(value)) {
                    for (uint32_t m = 0; m < kSets; ++m)
                        others[m] = others_of_hit<F>(view_, mis_[m], w.sums[m], depth, emitter, w.walk.o, w.walk.d,
                                                     w.walk.start_distance, z.vertex.point);
                    found_by_hit(eye, value, depth, others);
                }
            }
            if (depth >= policy_.max_depth) return;
            if (bsdf_is_smooth(z.vertex.scattering.bsdf)) {
                if (policy_.next_event) next_event(eye, z);
                if (policy_.connect_vertices && !vertices_.empty()) connect(eye, z);
            }
            if (depth + 1 == policy_.max_depth && !policy_.counts_last_segment()) return;
            if (!scatter(z, random_floats(eye.key, scatter_block(depth)), TransportMode::radiance, w)) return;
        }
    }

    void next_event(Eye& eye, PilotVertex& z) const {
        const Vec4f u = random_floats(eye.key, emitter_block(z.depth));
        float others[kSets];
        WalkConnection c;
        for (uint32_t m = 0; m < kSets; ++m) {
            z.vertex.sums = z.sums[m];
            if (!connect_next_event<F>(view_, mis_[m], z.vertex, z.throughput, u, c)) return;
            others[m] = c.others;
        }
        if (!counts(c.value)) return;
        eye.work.next_events += 1;
        if (free(c, eye.key, z.depth)) found(eye, {c.value, shares_of(others, 0)});
    }

    /// The connection of two vertices; false if it brings nothing.
    bool connection(const Eye& eye, const PilotVertex& y, const PilotVertex& z, uint32_t which, PilotEvent& e,
                    double& tried, double& rays) const {
        if (z.depth + y.depth + 1 > policy_.max_depth) return false;
        WalkConnection c;
        ConnectionDensities p;
        tried += 1;
        if (!connect_unweighted<F>(y.vertex, y.throughput, z.vertex, z.throughput, c, p) || !counts(c.value))
            return false;
        rays += 1;
        if (!free(c, eye.key, z.depth + (which << WalkBits::kDepthBits))) return false;
        float others[kSets];
        for (uint32_t m = 0; m < kSets; ++m)
            others[m] = others_of_connection(mis_[m], y.sums[m], y.vertex.first, z.sums[m], z.vertex.first, p);
        e = {c.value, shares_of(others, 2)};
        return true;
    }

    void connect(Eye& eye, const PilotVertex& z) const {
        PilotWork& work = eye.work;
        work.vertices += 1;
        const Uint4 bits = random_bits(eye.key, cache_block(z.depth, 0));
        const PilotVertex* drawn_vertices[2] = {vertices_[mul_hi(bits.x, uint32_t(vertices_.size()))],
                                                vertices_[mul_hi(bits.y, uint32_t(vertices_.size()))]};
        for (const PilotVertex* v : drawn_vertices)
            for (uint32_t at = 0; at < sizeof(PilotVertex); at += 64)
                __builtin_prefetch(reinterpret_cast<const char*>(v) + at);
        PilotEvent e;
        for (uint32_t v = first_[eye.number]; v < first_[eye.number + 1]; ++v) {
            if (!connection(eye, *vertices_[v], z, vertices_[v]->depth, e, work.pairs, work.pair_rays)) continue;
            moments_.add(e, eye.pixel);
            for (uint32_t c = 0; c < moments_.candidates.size(); ++c) {
                if (!moments_.candidates[c].connect || moments_.candidates[c].draws > 0) continue;
                const Rgb value = e.value * (1.0f / moments_.sum_of(c, e.shares));
                eye.sums[c].add(value, value, 1.0);
            }
        }
        PilotEvent drawn[2];
        bool made[2];
        double tried = 0, rays = 0;
        for (uint32_t d = 0; d < 2; ++d)
            made[d] = connection(eye, *drawn_vertices[d], z, WalkBits::kMaxDepth + d, drawn[d], tried, rays);
        work.draws += tried / 2;
        work.draw_rays += rays / 2;
        if (!made[0] && !made[1]) return;
        for (uint32_t c = 0; c < moments_.candidates.size(); ++c) {
            if (moments_.candidates[c].draws == 0) continue;
            // Each draw stands for all k of its vertex.
            Rgb value[2];
            for (uint32_t d = 0; d < 2; ++d)
                value[d] = made[d] ? drawn[d].value *
                                         (float(moments_.candidates[c].draws) / moments_.sum_of(c, drawn[d].shares))
                                   : Rgb{0.0f, 0.0f, 0.0f};
            eye.sums[c].add(value[0], value[1], 1.0 / double(moments_.candidates[c].draws));
        }
    }

    ChoicePilot result_;
    SceneView view_;
    const RenderSettings& settings_;
    const bool cuda_;
    const Tracer tracer_;
    SecondMoments moments_;
    BidirectionalPolicy policy_{};
    BidirectionalMis mis_[kSets] = {};
    uint32_t pixels_ = 0;  ///< of a block
    bool delta_emitters_ = false;
    std::vector<LightTask> tasks_;
    std::vector<const PilotVertex*> vertices_;  ///< of all tasks
    std::vector<const PilotSplat*> splats_;
    std::vector<uint32_t> first_;  ///< vertex of each light walk
};

}  // namespace

double expected_samples(const RenderSettings& settings, const PilotWork& work, uint64_t pixels, bool cuda) {
    constexpr double kFewest = 64, kUsual = 1000, kMost = 1e6;
    // Rays of walks per second: of an H200, within a factor of two for the scenes of docs/performance.md; of some
    // cores.
    const double rate = cuda ? 5e9 : 1e7;
    const double asked = double(settings.expected_samples);
    const double in_time =
        settings.expected_seconds * rate /
        (std::max(1.0, work.eye_rays + kShadowWork * work.next_events) * double(std::max<uint64_t>(1, pixels)));
    return asked > 0 || in_time > 0 ? std::clamp(std::max(asked, in_time), kFewest, kMost) : kUsual;
}

ChoicePilot run_choice_pilot(const Scene& scene, const RenderSettings& settings, bool cuda, bool cwbvh,
                             SharedAccels& accels, const std::vector<PilotCandidate>& candidates, uint32_t samples) {
    return with_feature_level(scene.features, settings.specialise, [&](auto level) {
        constexpr Features F = decltype(level)::value;
        const auto run = [&](auto accel) {
            const auto tracer = accel->tracer();
            return Pilot<F, std::remove_cv_t<decltype(tracer)>>(scene, settings, cuda, tracer, candidates, samples)
                .run();
        };
        return cwbvh ? run(accels.get<CwbvhAccel>()) : run(accels.get<EmbreeAccel>());
    });
}

}  // namespace ambilux
