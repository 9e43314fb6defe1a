#include "integrators/auto/pilot.h"

#include <algorithm>
#include <array>

#include "accel/host_tracer.h"
#include "core/parallel.h"
#include "integrators/auto/film_footprint.h"
#include "integrators/auto/merging.h"
#include "integrators/auto/pilot_mis.h"
#include "integrators/auto/variance_prediction.h"
#include "integrators/bdpt/shared/policy.h"
#include "integrators/feature_levels.h"
#include "stages/cache_draw.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/start.h"
#include "transport/subpath/trace.h"

namespace ambilux {
namespace {

/// Samples of one pixel: their products estimate its squared mean.
constexpr uint32_t kPixelSamples = 4;
constexpr uint32_t kSubpathsPerTask = 32;

using PilotSubpath = Subpath<PilotMis>;
using PilotVertex = SubpathEnd<PilotMis>;
using PilotCandidatePath = Candidate<PilotMis>;

/// From the ratios of each set; `own`: the first set that has the strategy itself.
PilotShares shares_of(const PilotMis::Ratio& ratio, uint32_t own) {
    float sum[PilotMis::kSets];
    for (uint32_t m = 0; m < PilotMis::kSets; ++m) sum[m] = ratio.of[m] + (m >= own ? 1.0f : 0.0f);
    return {sum[0], std::max(0.0f, sum[1] - sum[0]), std::max(0.0f, sum[2] - sum[1])};
}

struct LightTask {
    std::vector<PilotVertex> vertices;
    std::vector<uint32_t> ends;  ///< of the subpaths' vertices
    std::vector<PilotSplat> splats;
    double rays = 0, splat_rays = 0;
};

/// What the eye subpath of one sample brings to a candidate. The product of `first` and `second` without `own` is what
/// contributions of one sample have in common.
struct EyeSums {
    double first[3] = {},
           second[3] = {};  ///< with the first and the second draw of every vertex; the same for paired subpaths
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

/// An eye subpath and where its results go.
struct Eye {
    uint32_t number;
    RandomNumbers numbers;
    PilotSums& pixel;
    PilotWork& work;
    EyeSums sums[kMostCandidates];
    uint32_t first_smooth = 0;  ///< depth of the first vertex that can be connected; 0: none yet
};

template <Features F>
class PilotRun {
public:
    PilotRun(const Scene& scene, const RenderSettings& settings, bool cuda, const HostTracer& tracer,
             const std::vector<PilotCandidate>& candidates, uint32_t samples)
        : view_(scene.view()), settings_(settings), cuda_(cuda), tracer_(tracer), moments_{candidates} {
        set_rules(scene);
        const Sensor& sensor = view_.sensor;
        blocks_ = FilmBlocks::of(sensor.crop_width, sensor.crop_height);
        result_.blocks_x = blocks_.x;
        result_.blocks_y = blocks_.y;
        pixels_ = std::max(1u, (samples / kPixelSamples + blocks_.count() / 2) / blocks_.count());
        result_.samples = moments_.samples = blocks_.count() * pixels_ * kPixelSamples;
        moments_.filter_energy = filter_energy(view_);
    }

    Pilot run() {
        const uint32_t count = blocks_.count();
        const double n = result_.samples;
        tasks_.resize((result_.samples + kSubpathsPerTask - 1) / kSubpathsPerTask);
        if (rules_.splat || rules_.connect)
            parallel_for(uint32_t(tasks_.size()), [&](uint32_t t) {
                for (uint32_t i = t * kSubpathsPerTask; i < std::min((t + 1) * kSubpathsPerTask, result_.samples);
                     ++i) {
                    light_subpath(i, tasks_[t]);
                    tasks_[t].ends.push_back(uint32_t(tasks_[t].vertices.size()));
                }
            });
        gather();
        std::vector<PilotSums> pixels(size_t(count) * pixels_);
        std::vector<PilotWork> work(count);
        parallel_for(count, [&](uint32_t b) { eye_block(b, &pixels[size_t(b) * pixels_], work[b]); });
        result_.block_work.assign(count, result_.work);  // of light subpaths, so far
        for (uint32_t b = 0; b < count; ++b) {
            result_.work.add_eye(work[b], 1.0 / n);
            result_.block_work[b].add_eye(work[b], count / n);
        }
        result_.light_vertices = double(vertices_.size()) / n;
        const uint64_t film = uint64_t(view_.sensor.crop_width) * view_.sensor.crop_height;
        result_.expected_samples = expected_samples(settings_, result_.work, film, cuda_);
        predict_variances(moments_, {pixels, splats_, pixels_, kPixelSamples, result_.expected_samples, film}, result_);
        return result_;
    }

private:
    /// Those of bdpt with all strategies, whatever the render uses.
    void set_rules(const Scene& scene) {
        RenderSettings all = settings_;
        all.integrator = "bdpt";
        all.variant = "wavefront";
        all.heuristic = MisHeuristic::balance;
        all.strategies = kAllStrategies;
        all.singles = {};
        rules_ = plan_bdpt<PilotMis>(scene, all).rules;
    }

    static bool counts(Rgb value) { return is_finite(value) && min_component(value) >= 0.0f && !is_zero(value); }

    /// `rays` are counted.
    template <class Sink>
    void trace(Side side, const PilotSubpath& first, float tmax, const RandomNumbers& numbers, const Sink& sink,
               double& rays) const {
        const auto extend = [&](const PilotSubpath& path, float at_most) {
            rays += 1;
            return end_of_ray<F>(view_, tracer_, path, at_most, numbers);
        };
        trace_subpath<F>(view_, rules_, side, rules_.longest(side), first, tmax, extend, sink);
    }
    bool is_free(const PilotCandidatePath& c, const RandomNumbers& numbers, uint32_t which) const {
        if (!is_finite(c.origin) || !is_finite(c.direction)) return false;
        const uint32_t seed = F.opacity ? numbers.shadow_seed(which) : 0;
        return !tracer_.occluded<F>(view_, Ray{c.origin, c.tmax, c.direction, seed});
    }

    // ---- light subpaths ----

    void splat(LightTask& task, const PilotCandidatePath& c, const RandomNumbers& numbers, uint32_t which,
               Rgb emitted) const {
        if (!counts(c.value)) return;
        task.splat_rays += 1;
        if (is_free(c, numbers, which))
            task.splats.push_back({{c.value, shares_of(c.ratio, 1), filter_coverage(view_, c.film)},
                                   blocks_.at(view_.sensor, c.film),
                                   which == 0,
                                   emitted});
    }

    struct LightSink {
        const PilotRun& pilot;
        LightTask& task;
        const RandomNumbers& subpath_numbers;
        const EmissionSample& start;

        RandomNumbers numbers() const { return subpath_numbers; }
        void add(const PilotCandidatePath& c) const { pilot.splat(task, c, subpath_numbers, 0, start.radiance); }
        void at(const Vertex<PilotMis>& y, const PilotSubpath& path, const RandomNumbers& numbers) const {
            const Vec4f u = numbers.lens(path.depth);
            PilotCandidatePath c;
            if (camera_connection<F>(pilot.view_, pilot.rules_, y, path.throughput, path.depth, {u.x, u.y}, c))
                pilot.splat(task, c, numbers, path.depth, start.radiance);
            if (pilot.rules_.connect && path.depth + 2 <= pilot.rules_.max_depth)
                task.vertices.push_back({y, path.throughput, path.depth});
        }
        bool valid(Rgb throughput) const { return is_finite(throughput) && min_component(throughput) >= 0.0f; }
    };

    void light_subpath(uint32_t i, LightTask& task) const {
        const RandomNumbers numbers = {{settings_.seed, i, 2, Stream::pilot}};
        EmissionSample e;
        PilotSubpath first;
        const LightSink sink = {*this, task, numbers, e};
        if (start_light_subpath<F>(view_, rules_, numbers, sink, e, first))
            trace(Side::light, first, kInfinity, numbers, sink, task.rays);
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
        hits_only_ = HitsOnlyLight<F>(rules_.mis, vertices_, result_.samples);
    }

    // ---- eye subpaths ----

    /// The pilot's pixels of a block, with all but (30) of the variance (equation 31).
    void eye_block(uint32_t b, PilotSums* pixels, PilotWork& work) const {
        const Sensor& sensor = view_.sensor;
        const uint32_t bx = b % blocks_.x, by = b / blocks_.x;
        const uint32_t x0 = FilmBlocks::edge(bx, sensor.crop_width, blocks_.x),
                       x1 = FilmBlocks::edge(bx + 1, sensor.crop_width, blocks_.x);
        const uint32_t y0 = FilmBlocks::edge(by, sensor.crop_height, blocks_.y),
                       y1 = FilmBlocks::edge(by + 1, sensor.crop_height, blocks_.y);
        for (uint32_t p = 0; p < pixels_; ++p) {
            const uint32_t first = (b * pixels_ + p) * kPixelSamples;
            const Uint4 place = random_bits({settings_.seed, first, 3, Stream::pilot}, 0);
            const uint32_t x = x0 + mul_hi(place.x, x1 - x0), y = y0 + mul_hi(place.y, y1 - y0);
            double sum[kMostCandidates][3] = {}, squares[kMostCandidates][3] = {};
            for (uint32_t s = 0; s < kPixelSamples; ++s) {
                Eye eye{first + s, {{settings_.seed, first + s, 1, Stream::pilot}}, pixels[p], work, {}};
                eye_subpath(eye, x, y);
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

    /// A hit or a sample of next event estimation. What hits alone find, seldom, is told by light nearby instead.
    void found(Eye& eye, const PilotEvent& e, uint32_t segments) const {
        const bool elsewhere = hits_only_.any() && HitsOnlyLight<F>::holds(eye.first_smooth, segments) &&
                               e.shares.light + e.shares.connections <= 1e-4f * e.shares.unidirectional;
        if (!elsewhere) moments_.add(e, eye.pixel);
        for (uint32_t c = 0; c < moments_.candidates.size(); ++c) {
            const Rgb value = e.value * (1.0f / moments_.sum_of(c, e.shares));
            eye.sums[c].add(value, value, 1.0);
        }
    }

    struct EyeSink {
        const PilotRun& pilot;
        Eye& eye;

        const RandomNumbers& numbers() const { return eye.numbers; }
        void add(const PilotCandidatePath& c) const {
            if (!counts(c.value)) return;
            if (c.strategy.segments() == 1)
                for (int k = 0; k < 3; ++k) eye.pixel.seen[k] = std::max(eye.pixel.seen[k], double(c.value[k]));
            pilot.found(eye, {c.value, shares_of(c.ratio, 0)}, c.strategy.segments());
        }
        void at(const Vertex<PilotMis>& z, const PilotSubpath& path, const RandomNumbers&) const {
            const PilotVertex end = {z, path.throughput, path.depth};
            if (eye.first_smooth == 0) pilot.first_smooth(eye, end);
            pilot.next_event(eye, end);
            if (pilot.rules_.connect && !pilot.vertices_.empty()) pilot.connect(eye, end);
        }
        bool valid(Rgb throughput) const { return is_finite(throughput) && min_component(throughput) >= 0.0f; }
    };

    void eye_subpath(Eye& eye, uint32_t x, uint32_t y) const {
        if (rules_.max_depth == 0) return;
        float tmax;
        const PilotSubpath first = start_eye_subpath<F>(view_, rules_.mis, x, y, eye.numbers, tmax);
        trace(Side::eye, first, tmax, eye.numbers, EyeSink{*this, eye}, eye.work.eye_rays);
    }

    void first_smooth(Eye& eye, const PilotVertex& z) const {
        eye.first_smooth = z.depth;
        if (!hits_only_.any() || !HitsOnlyLight<F>::begins_at(z.depth)) return;
        hits_only_.at(z, rules_.max_depth, [&](Rgb value, float ratio) {
            if (counts(value)) moments_.add({value, {ratio, 0.0f, 0.0f}, 1.0f, true}, eye.pixel);
        });
    }

    void next_event(Eye& eye, const PilotVertex& z) const {
        PilotCandidatePath c;
        if (!ambilux::next_event<F>(view_, rules_, z.vertex, z.throughput, z.depth, eye.numbers.next_event(z.depth), c))
            return;
        if (c.environment) c.value *= environment_radiance<F>(view_, c.direction);
        if (!counts(c.value)) return;
        eye.work.next_events += 1;
        if (is_free(c, eye.numbers, z.depth)) found(eye, {c.value, shares_of(c.ratio, 0)}, z.depth + 1);
    }

    /// The connection of two vertices; false if it brings nothing.
    bool connection(const Eye& eye, const PilotVertex& y, const PilotVertex& z, uint32_t which, PilotEvent& e,
                    double& tried, double& rays) const {
        if (z.depth + y.depth + 1 > rules_.max_depth) return false;
        PilotCandidatePath c;
        tried += 1;
        if (!ambilux::connection<F>(rules_, z, y, c) || !counts(c.value)) return false;
        rays += 1;
        if (!is_free(c, eye.numbers, connection_ray(z.depth, which))) return false;
        e = {c.value, shares_of(c.ratio, 2)};
        return true;
    }

    void connect(Eye& eye, const PilotVertex& z) const {
        PilotWork& work = eye.work;
        work.vertices += 1;
        const Uint4 bits = cache_draw(eye.numbers.key, z.depth, 0);
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
            made[d] = connection(eye, *drawn_vertices[d], z, kMaxDepth + d, drawn[d], tried, rays);
        work.draws += tried / 2;
        work.draw_rays += rays / 2;
        if (!made[0] && !made[1]) return;
        for (uint32_t c = 0; c < moments_.candidates.size(); ++c) {
            if (moments_.candidates[c].draws == 0) continue;
            const float draws = float(moments_.candidates[c].draws);  // each of the two stands for all of its vertex
            Rgb value[2];
            for (uint32_t d = 0; d < 2; ++d)
                value[d] = made[d] ? drawn[d].value * (draws / moments_.sum_of(c, drawn[d].shares)) : splat_none();
            eye.sums[c].add(value[0], value[1], 1.0 / double(draws));
        }
    }
    static Rgb splat_none() { return {0.0f, 0.0f, 0.0f}; }

    Pilot result_;
    SceneView view_;
    const RenderSettings& settings_;
    const bool cuda_;
    const HostTracer tracer_;
    SecondMoments moments_;
    Rules<PilotMis> rules_{};
    FilmBlocks blocks_;
    uint32_t pixels_ = 0;  ///< of a block
    std::vector<LightTask> tasks_;
    std::vector<const PilotVertex*> vertices_;  ///< of all tasks
    std::vector<const PilotSplat*> splats_;
    std::vector<uint32_t> first_;  ///< vertex of each light subpath
    HitsOnlyLight<F> hits_only_;
};

}  // namespace

void PilotWork::add_eye(const PilotWork& w, double share) {
    eye_rays += w.eye_rays * share;
    next_events += w.next_events * share;
    vertices += w.vertices * share;
    pairs += w.pairs * share;
    pair_rays += w.pair_rays * share;
    draws += w.draws * share;
    draw_rays += w.draw_rays * share;
}

double expected_samples(const RenderSettings& settings, const PilotWork& work, uint64_t pixels, bool cuda) {
    constexpr double kFewest = 64, kUsual = 1000, kMost = 1e6;
    // Rays of subpaths per second: of an H200, within a factor of two for the scenes of docs/performance.md; of some
    // cores.
    const double rate = cuda ? 5e9 : 1e7;
    const double asked = double(settings.expected_samples);
    const double rays = std::max(1.0, work.eye_rays + kShadowWork * work.next_events);
    const double in_time = settings.expected_seconds * rate / (rays * double(std::max<uint64_t>(1, pixels)));
    return asked > 0 || in_time > 0 ? std::clamp(std::max(asked, in_time), kFewest, kMost) : kUsual;
}

Pilot run_pilot(const Scene& scene, const RenderSettings& settings, bool cuda, bool cwbvh, SharedAccels& accels,
                const std::vector<PilotCandidate>& candidates, uint32_t samples) {
    const HostTracer tracer =
        cwbvh ? HostTracer(accels.get<CwbvhAccel>()->tracer()) : HostTracer(accels.get<EmbreeAccel>()->tracer());
    const auto run = [&]<Features F>() {
        return PilotRun<F>(scene, settings, cuda, tracer, candidates, samples).run();
    };
    // Three levels: the others' gain over them is not worth their compilation for what runs once.
    if (settings.specialise && kDiffuseFeatures.covers(scene.features)) return run.operator()<kDiffuseFeatures>();
    if (settings.specialise && kCommonFeatures.covers(scene.features)) return run.operator()<kCommonFeatures>();
    return run.operator()<kAllFeatures>();
}

}  // namespace ambilux
