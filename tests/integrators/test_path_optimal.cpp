// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// seconds: 20
// Optimal weights of the path tracer: what is solved is the least variance of integrals that are known; images have the
// expectation of the path tracer, and less variance where light is in proportion to densities.
#include <cmath>

#include "film/ztest.h"
#include "integrators/path/optimal/update.h"
#include "tests/support/enough_samples.h"
#include "tests/support/long_run.h"
#include "tests/support/optimal_settings.h"

using namespace ambilux;

namespace {

/// Integrals over [0,1) times the number of an emitter: next event estimation picks emitter k with probability P(k)
/// and samples x of density p(k, x) there; a hit finds emitter k at x with density q(k, x), and none with what is left
/// to one.
struct Toy {
    EmitterStrategies all;
    double hits;  ///< share of hits that find an emitter
    double (*of)(const Toy& toy, uint32_t k, double x);
    double light(uint32_t k, double x) const { return of(*this, k, x); }
    static double p(uint32_t k, double x) { return k == 0 ? 2 * x : 1; }
    double q(uint32_t, double x) const { return hits * (0.5 + x) / all.count; }

    static FoundLight found(double light, double own, double other) {
        const double y = light / (own + other);
        return {splat(float(y)), float(other / (own + other))};
    }
    FoundLight by_next_event(uint32_t k, double x) const {
        return found(light(k, x), double(all.probability[k]) * p(k, x), q(k, x));
    }
    FoundLight by_hit(uint32_t k, double x) const {
        return found(light(k, x), q(k, x), double(all.probability[k]) * p(k, x));
    }
    double truth() const {
        double sum = 0;
        constexpr int kSteps = 1 << 14;
        for (uint32_t k = 0; k < all.count; ++k)
            for (int i = 0; i < kSteps; ++i) sum += light(k, (i + 0.5) / kSteps) / kSteps;
        return sum;
    }
    VertexStrategies sample(uint32_t i, uint64_t seed) const {
        const Vec4f u = random_floats({seed, i, 0, Stream::test}, 0), w = random_floats({seed, i, 1, Stream::test}, 0);
        VertexStrategies v{};
        v.scale = 1;
        v.next_event_strategy = all.count > 1 && u.x >= all.probability[0];
        const double x = v.next_event_strategy == 0 ? std::sqrt(double(u.y)) : double(u.y);
        if (light(v.next_event_strategy, x) > 0) v.next_event = by_next_event(v.next_event_strategy, x);
        const double at = double(u.z) / hits * all.count;
        if (at < all.count) {
            v.hit_strategy = uint32_t(at);
            const double hit = (std::sqrt(0.25 + 2 * double(w.x)) - 0.5);
            if (light(v.hit_strategy, hit) > 0) v.hit = by_hit(v.hit_strategy, hit);
        }
        return v;
    }
    static double balanced(const VertexStrategies& v) {
        return double(v.next_event.weighted.x) + double(v.hit.weighted.x);
    }
    /// What so many samples teach.
    std::vector<Lane> learned(OptimalLearning by, uint32_t samples, uint64_t seed) const {
        const StrategyLearning learning = {all, by};
        std::vector<double> pixel(learning.words()), block(learning.words() + learning.lack_words());
        std::vector<float> lacks(learning.lack_words());
        for (uint32_t i = 0; i < samples; ++i) learning.add_sample(sample(i, seed), pixel.data(), lacks.data());
        learning.add_pixel(block.data(), pixel.data(), lacks.data());
        Rgb solution[EmitterStrategies::kMost];
        learning.solve(block.data(), solution);
        return lanes(solution);
    }
    std::vector<Lane> solved(const std::vector<double>& density_sums) const {
        Rgb solution[EmitterStrategies::kMost];
        DensitySums::solve(density_sums.data(), all, solution);
        return lanes(solution);
    }
    std::vector<Lane> lanes(const Rgb* solution) const {
        std::vector<Lane> lanes(all.count);
        for (uint32_t k = 0; k < all.count; ++k) set_start(lanes[k], solution[k]);
        return lanes;
    }
    /// Mean and variance of a sample.
    std::pair<double, double> moments(const std::vector<Lane>* advantages, uint32_t samples, uint64_t seed) const {
        double sum = 0, squares = 0;
        for (uint32_t i = 0; i < samples; ++i) {
            const VertexStrategies v = sample(i, seed);
            double value = balanced(v);
            if (advantages) value += double(optimal_difference(v, all, advantages->data()).x);
            sum += value, squares += value * value;
        }
        const double mean = sum / samples;
        return {mean, squares / samples - mean * mean};
    }
};

double of_next_event(const Toy&, uint32_t k, double x) { return k == 0 ? 3 * Toy::p(0, x) : 0.5 * Toy::p(1, x); }
double of_hits(const Toy& toy, uint32_t k, double x) { return 2 * toy.q(k, x); }
double of_both(const Toy& toy, uint32_t k, double x) { return (k == 0 ? 1.5 : 0.5) * Toy::p(k, x) + 2 * toy.q(k, x); }
double of_none(const Toy&, uint32_t k, double x) { return k == 0 ? sqr(std::sin(9 * x)) : (x < 0.4 ? 0.0 : 2 * x * x); }

constexpr EmitterStrategies kOne = {1, {}, {1.0f}}, kTwo = {2, {0}, {0.3f, 0.7f}};

/// Of hits and next event estimation by integrals, which need no samples.
std::vector<double> exact_sums(const Toy& toy) {
    std::vector<double> s(DensitySums::words(toy.all.count));
    constexpr int kSteps = 1 << 14;
    constexpr double kMany = 1e9;  // vertices, so that no prior counts
    s[DensitySums::kVertices] = s[DensitySums::kScaleSquared] = kMany;
    for (uint32_t k = 0; k < toy.all.count; ++k)
        for (int i = 0; i < kSteps; ++i) {
            const double x = (i + 0.5) / kSteps, n = double(toy.all.probability[k]) * Toy::p(k, x), h = toy.q(k, x),
                         dx = kMany / kSteps, f = toy.light(k, x);
            if (!(f > 0)) continue;
            s[DensitySums::overlap(k)] += dx * n * h / (n + h);
            for (int c = 0; c < 3; ++c) {
                s[DensitySums::kHit + c] += dx * f * h / (n + h);
                s[DensitySums::next_event(k) + c] += dx * f * n / (n + h);
            }
        }
    return s;
}

}  // namespace

TEST_CASE("Light in proportion to a combination of densities has no variance, and the solution is the combination") {
    for (const EmitterStrategies& all : {kOne, kTwo}) {
        for (const auto light : {of_next_event, of_hits, of_both}) {
            const Toy toy = {all, 1.0, light};
            const std::vector<Lane> solution = toy.solved(exact_sums(toy));
            for (uint32_t k = 0; k < all.count; ++k) {
                const double next_event = light == of_hits   ? 0
                                          : light == of_both ? (k == 0 ? 1.5 : 0.5)
                                                             : (k == 0 ? 3 : 0.5);
                const double hit = light == of_next_event ? 0 : 2;
                CHECK(double(start_of<Rgb>(solution[k]).x) ==
                      Approx(next_event / double(all.probability[k]) - hit).epsilon(1e-3));
            }
            const auto [mean, variance] = toy.moments(&solution, 20000, 3);
            const auto [balanced_mean, balanced_variance] = toy.moments(nullptr, 20000, 3);
            INFO(all.count << " strategies: variance " << variance << ", balanced " << balanced_variance);
            CHECK(mean == Approx(toy.truth()).epsilon(1e-3));
            CHECK(balanced_variance > 1e-4 * balanced_mean * balanced_mean);
            CHECK(variance < 1e-5 * balanced_variance);
        }
    }
}

TEST_CASE("What samples teach approaches the solution of the integrals, by densities and by least squares") {
    for (const EmitterStrategies& all : {kOne, kTwo})
        for (const auto light : {of_both, of_none}) {
            const Toy toy = {all, 0.8, light};
            const std::vector<Lane> exact = toy.solved(exact_sums(toy));
            for (const OptimalLearning by : {OptimalLearning::densities, OptimalLearning::least_squares}) {
                const std::vector<Lane> learned = toy.learned(by, 400'000, 1);
                for (uint32_t k = 0; k < all.count; ++k)
                    CHECK(double(start_of<Rgb>(learned[k]).x) ==
                          Approx(double(start_of<Rgb>(exact[k]).x)).margin(0.03));
            }
        }
}

TEST_CASE(
    "Least squares find a combination of densities from few samples, where those of densities are still far off") {
    for (const EmitterStrategies& all : {kOne, kTwo}) {
        const Toy toy = {all, 1.0, of_both};
        const auto variance = [&](OptimalLearning by) {
            double sum = 0;
            for (uint64_t seed = 10; seed < 20; ++seed) {
                const std::vector<Lane> few = toy.learned(by, 200, seed);
                sum += toy.moments(&few, 2000, 3).second / 10;
            }
            return sum;
        };
        const double squares = variance(OptimalLearning::least_squares),
                     densities = variance(OptimalLearning::densities), balanced = toy.moments(nullptr, 2000, 3).second;
        INFO("variance " << squares << " by least squares, " << densities << " by densities, balanced " << balanced);
        CHECK(squares < 2e-3 * balanced);  // the prior: (4 / 200)²
        CHECK(squares < densities);
    }
}

TEST_CASE("Before a rare hit or a rare pick was seen least squares do not take what was seen for all that there is") {
    constexpr double kRare = 1e-5;
    const auto check = [](const Toy& toy, uint64_t seed, auto of) {
        const std::vector<Lane> learned = toy.learned(OptimalLearning::least_squares, 200, seed);
        const double balanced = toy.moments(nullptr, 20000, 3).second, lambda = of(learned);
        CHECK(lambda * lambda * kRare < 0.01 * balanced);  // what the rare ones add to the variance
    };
    const auto at = [](const std::vector<Lane>& lanes, uint32_t k) { return double(start_of<Rgb>(lanes[k]).x); };
    const EmitterStrategies seldom = {2, {0}, {float(1 - kRare), float(kRare)}};
    for (uint64_t seed = 10; seed < 20; ++seed) {
        for (const EmitterStrategies& all : {kOne, kTwo})
            for (uint32_t k = 0; k < all.count; ++k)
                check({all, kRare, of_none}, seed, [&](const auto& lanes) { return at(lanes, k); });
        check({seldom, 0.8, of_none}, seed, [&](const auto& lanes) { return at(lanes, 1) - at(lanes, 0); });
    }
}

TEST_CASE("The solution has less variance than its neighbours, and any weights have the same mean") {
    constexpr uint32_t kSamples = 400'000;
    for (const EmitterStrategies& all : {kOne, kTwo}) {
        const Toy toy = {all, 0.8, of_none};
        const std::vector<Lane> best = toy.solved(exact_sums(toy));
        const double least = toy.moments(&best, kSamples, 2).second,
                     balanced = toy.moments(nullptr, kSamples, 2).second;
        CHECK(least < balanced);
        for (uint32_t k = 0; k < all.count; ++k)
            for (const float step : {-2.0f, -0.1f, 0.1f, 2.0f}) {
                std::vector<Lane> other = best;
                set_start(other[k], start_of<Rgb>(best[k]) + splat(step));
                const auto [mean, variance] = toy.moments(&other, kSamples, 2);
                CHECK(variance > least);
                CHECK(std::fabs(mean - toy.truth()) < 4 * std::sqrt(variance / kSamples));
            }
    }
}

TEST_CASE("Nothing found, nothing preferred; few samples and extreme sums stay finite") {
    Rgb solution[EmitterStrategies::kMost];
    std::vector<double> s(DensitySums::words(2));
    DensitySums::solve(s.data(), kTwo, solution);
    CHECK((is_zero(solution[0]) && is_zero(solution[1])));
    for (const double scale : {1e-30, 1.0, 1e15})
        for (const double overlap : {0.0, 0.2, 0.5, 5.0}) {
            s.assign(s.size(), 0);
            s[DensitySums::kVertices] = 2, s[DensitySums::kScaleSquared] = 2 * scale * scale;
            s[DensitySums::overlap(0)] = 2 * scale * scale * overlap;
            for (int c = 0; c < 3; ++c) s[DensitySums::next_event(0) + c] = scale;
            DensitySums::solve(s.data(), kTwo, solution);
            CHECK((is_finite(solution[0]) && is_finite(solution[1])));
        }
    const Toy toy = {kTwo, 0.8, of_none};
    for (const uint32_t samples : {0u, 1u, 2u, 3u, 4u})
        for (const Lane& lane : toy.learned(OptimalLearning::least_squares, samples, 5)) {
            CHECK(is_finite(start_of<Rgb>(lane)));
        }
}

TEST_CASE("Images with optimal weights have the expectation of the path tracer") {
    for (const char* name : first_or_all<const char*>(2, {"cornell", "lamps", "lights", "materials", "textured"})) {
        Scene scene = project_scene(name, 48, 32);
        scene.integrator.hide_emitters = true;
        const uint32_t most = is_long_run() ? 2048 : 512;  // rare bright samples of small emitters
        const Estimate path = to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis, 11), most).film);
        for (const SettingTexts& own : std::vector<SettingTexts>{{},
                                                                 {{"optimal_learning", "densities"},
                                                                  {"optimal_vertices", "3"},
                                                                  {"optimal_block", "3"},
                                                                  {"optimal_samples", "1"},
                                                                  {"rr_depth", "1"}}}) {
            const Estimate image = render_until_seen(scene, optimal(scene, 12, own), most, path, 0.05);
            const ZTestResult z = z_test(image, path);
            INFO(name << ": " << z.report());
            CHECK(z.pass);
            CHECK(sees_bias(image, path, 0.05));
        }
    }
}

TEST_CASE("What is learned depends on no thread and no size of waves, and a stopped render goes on as it would have") {
    const Scene scene = project_scene("materials", 40, 24);
    const RenderSettings s = optimal(scene, 5, {{"optimal_vertices", "2"}, {"optimal_block", "3"}});
    const RenderResult one = render_on(1, scene, s, 12);
    for (const int threads : {2, 7}) check_same_bits(render_on(threads, scene, s, 12), one);
    for (const uint32_t wave_size : {64u, 256u, 4096u}) {
        RenderSettings other = s;
        other.wave_size = wave_size;
        check_same_bits(render_scene(scene, other, 12), one);
    }
    CHECK(one.stats.memory_bytes == one.stats.memory_bytes_predicted);
    CHECK(one.stats.invalid.total() == 0);
    check_resumes_from_state(scene, s, one);
}

TEST_CASE("Stages of their own and fused ones make the same image") {
    const Scene scene = project_scene("lights", 32, 24);
    RenderSettings s = optimal(scene, 5);
    s.specialise = false;
    const RenderResult fused = render_scene(scene, s, 8);
    s.fuse = Fuse::none;
    CHECK(render_scene(scene, s, 8).film.sum == fused.film.sum);
}

TEST_CASE("Scenes without light and paths of few segments") {
    for (const int depth : {0, 1, 2, 3}) {
        const Scene scene = project_scene("cornell", 16, 16);
        RenderSettings s = optimal(scene, 5);
        s.max_depth = depth;
        CHECK(render_scene(scene, s, 8).stats.invalid.total() == 0);
    }
    const Scene dark = scene_from_text(
        "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'><integer "
        "name='width' value='8'/><integer name='height' value='8'/></film></sensor><shape type='sphere'/></scene>");
    const RenderResult r = render_scene(dark, optimal(dark, 1), 8);
    for (const double v : r.film.sum) CHECK(v == 0);
}

TEST_CASE("Under round lamps optimal weights have an eighth of the variance of the path tracer at most") {
    const Scene scene = project_scene("lamps", 48, 36);
    constexpr uint32_t kSamples = 256;
    // Of the later half, when most is learned.
    const auto variance = [&](const RenderSettings& s) {
        const auto renderer = make_renderer(scene, s);
        renderer->render(0, kSamples / 2);
        renderer->clear_film();
        renderer->render(kSamples / 2, kSamples / 2);
        const FilmMoments m = renderer->film();
        const double n = double(m.samples);
        double sum = 0;
        for (size_t i = 0; i < m.sum.size(); ++i) sum += m.sum_squares[i] / n - sqr(m.sum[i] / n);
        return sum / double(m.sum.size());
    };
    const double plain = variance(cpu_settings(scene, Estimator::mis, 1)), best = variance(optimal(scene, 2)),
                 one = variance(optimal(scene, 3, {{"optimal_strategies", "1"}}));
    INFO("variance of a sample: " << plain << " path, " << best << " optimal, " << one << " with one next event");
    CHECK(best < plain / 8);
    CHECK(one < plain);
    CHECK(best < one);
}

TEST_CASE("optimal has neither estimators nor heuristics to choose from") {
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = optimal(scene, 1);
    s.estimator = Estimator::nee;
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("estimator=nee"));
    s = optimal(scene, 1);
    s.heuristic = MisHeuristic::power;
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("heuristic=power"));
}
