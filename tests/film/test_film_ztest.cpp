// libs: ambilux_film
// timeout: 120
// The statistical image comparison against data whose expectation is known.
#include <cmath>
#include <functional>
#include <random>

#include "core/error.h"
#include "film/ztest.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

using Sampler = std::function<double(std::mt19937_64&, size_t pixel)>;

/// `n` samples of every pixel; the channels are scaled copies, as fully correlated as they can be.
FilmMoments simulate(uint32_t width, uint32_t height, uint64_t n, uint64_t seed, const Sampler& sampler) {
    std::mt19937_64 rng(seed);
    const size_t pixels = size_t(width) * height;
    FilmMoments m{width, height, n, std::vector<double>(3 * pixels), std::vector<double>(3 * pixels)};
    for (size_t p = 0; p < pixels; ++p)
        for (uint64_t s = 0; s < n; ++s) {
            const double x = sampler(rng, p);
            for (size_t c = 0; c < 3; ++c) {
                const double v = x * (1.0 + double(c));
                m.sum[3 * p + c] += v;
                m.sum_squares[3 * p + c] += v * v;
            }
        }
    return m;
}

Sampler exponential(double mean) {
    return [mean](std::mt19937_64& rng, size_t) { return mean * std::exponential_distribution<double>()(rng); };
}

/// Rare equal hits, as naive path tracing with a small light.
Sampler rare(double mean, double probability) {
    return [=](std::mt19937_64& rng, size_t) {
        return std::uniform_real_distribution<double>()(rng) < probability ? mean / probability : 0.0;
    };
}

struct Rates {
    int failed = 0, runs = 0;
};

Rates failures(int runs, const Sampler& a, const Sampler& b, uint64_t n_a, uint64_t n_b, ZTestOptions options) {
    Rates r;
    for (int i = 0; i < runs; ++i) {
        const auto ma = simulate(40, 33, n_a, 2 * uint64_t(i), a), mb = simulate(40, 33, n_b, 2 * uint64_t(i) + 1, b);
        r.failed += !z_test(to_estimate(ma), to_estimate(mb), options).pass;
        ++r.runs;
    }
    return r;
}

/// Largest count of failures that a true rate of `alpha` explains with chance 1e-4.
int binomial_limit(int runs, double alpha) {
    double tail = 1, p = std::pow(1 - alpha, runs);
    int k = 0;
    for (; tail - p > 1e-4; ++k) {
        tail -= p;
        p *= double(runs - k) / double(k + 1) * alpha / (1 - alpha);
    }
    return k;
}

}  // namespace

TEST_CASE("equal expectations fail at no more than the nominal rate") {
    ZTestOptions options;
    options.significance = 0.05;
    const int runs = 120, limit = binomial_limit(runs, options.significance);
    SECTION("moderate tails") {
        const Rates r = failures(runs, exponential(0.5), exponential(0.5), 32, 32, options);
        INFO(r.failed);
        CHECK(r.failed <= limit);
    }
    SECTION("rare hits against a smooth image") {
        const Rates r = failures(runs, rare(0.5, 0.01), exponential(0.5), 64, 64, options);
        INFO(r.failed);
        CHECK(r.failed <= limit);
    }
    SECTION("rare bright samples on a smooth base, which hides them where there are none") {
        const Sampler glints = [](std::mt19937_64& rng, size_t) {
            return 1.0 + (std::uniform_real_distribution<double>()(rng) < 0.001 ? 100.0 : 0.0);
        };
        const Rates r = failures(runs, glints, exponential(1.1), 64, 64, options);
        INFO(r.failed);
        CHECK(r.failed <= limit);
    }
    SECTION("very rare hits against a converged image: blocks without hits do not fail") {
        const Rates r = failures(runs, rare(0.5, 0.002), exponential(0.5), 64, 256, options);
        INFO(r.failed);
        CHECK(r.failed <= limit);
    }
}

TEST_CASE("the test is not blunt: it fails at a fair share of its nominal rate") {
    ZTestOptions options;
    options.significance = 0.3;
    const Rates r = failures(100, exponential(0.5), exponential(0.5), 64, 64, options);
    INFO(r.failed);
    CHECK(r.failed >= 6);  // the scales overlap and channels are copies here, so the nominal 30 is not reached
    CHECK(r.failed <= binomial_limit(100, 0.3));
}

TEST_CASE("a bias of 2 % is found") {
    SECTION("everywhere") {
        const Rates r = failures(20, exponential(0.5 * 1.02), exponential(0.5), 256, 256, {});
        CHECK(r.failed == 20);
    }
    SECTION("everywhere, with rare hits") {
        // Standard error of the whole image: sqrt((1/0.3 - 1)/(1320 · 512)) = 0.19 %, of the other one 0.12 %.
        const Rates r = failures(20, rare(0.5 * 1.02, 0.3), exponential(0.5), 512, 512, {});
        CHECK(r.failed == 20);
    }
    SECTION("in one corner, that keeps the image's mean") {
        const Sampler corner = [](std::mt19937_64& rng, size_t p) {
            const bool inside = p % 40 < 8 && p / 40 < 8, outside = p % 40 >= 32 && p / 40 < 8;
            return (inside ? 1.15 : outside ? 0.85 : 1.0) * std::exponential_distribution<double>()(rng);
        };
        const Rates r = failures(10, corner, exponential(1), 256, 256, {});
        CHECK(r.failed == 10);
    }
    SECTION("in one corner, although the edge of a bright light holds nearly all of the variance") {
        const auto image = [](double corner) {
            return Sampler([corner](std::mt19937_64& rng, size_t p) {
                const double u = std::uniform_real_distribution<double>()(rng);
                if (p / 40 == 30 && p % 40 < 12) return u < 0.5 ? 1000.0 : 0.0;
                return (p % 40 < 8 && p / 40 < 8 ? corner : 1.0) * -std::log(1 - u);
            });
        };
        const Rates r = failures(10, image(1.15), image(1), 256, 256, {});
        CHECK(r.failed == 10);
    }
    SECTION("small differences of alternating sign in many blocks") {
        const Sampler tiles = [](std::mt19937_64& rng, size_t p) {
            const bool even = (p % 40 / 8 + p / 40 / 8) % 2 == 0;
            return (even ? 1.02 : 0.98) * std::exponential_distribution<double>()(rng);
        };
        const Rates r = failures(10, tiles, exponential(1), 256, 256, {});
        CHECK(r.failed == 10);
    }
}

TEST_CASE("missing light is found although the darker image shows no variance there") {
    const Sampler half_dark = [](std::mt19937_64& rng, size_t p) {
        return p % 40 < 20 ? 0.0 : std::exponential_distribution<double>()(rng);
    };
    const Rates r = failures(5, half_dark, exponential(1), 32, 32, {});
    CHECK(r.failed == 5);
    const auto dark = simulate(8, 8, 32, 1, [](std::mt19937_64&, size_t) { return 0.0; });
    const auto lit = simulate(8, 8, 32, 2, exponential(1));
    const auto result = z_test(to_estimate(dark), to_estimate(lit));
    CHECK_FALSE(result.pass);
    CHECK(result.undecided);
    CHECK(result.report().find("use more samples") != std::string::npos);
}

TEST_CASE("images without variance must agree up to float rounding") {
    const auto constant = [](double v) { return simulate(20, 20, 16, 0, [v](std::mt19937_64&, size_t) { return v; }); };
    const auto one = to_estimate(constant(1));
    CHECK(z_test(one, to_estimate(constant(1 + 1e-6))).pass);
    CHECK_FALSE(z_test(one, to_estimate(constant(1 + 1e-4))).pass);
    CHECK(z_test(to_estimate(constant(0)), to_estimate(constant(0))).pass);
    const Image known{20, 20, std::vector<float>(20 * 20 * 3, 0.0f)};
    CHECK(z_test(to_estimate(constant(0)), exact_estimate(known)).pass);
    CHECK_FALSE(z_test(to_estimate(constant(0.1)), exact_estimate(known)).pass);
}

TEST_CASE("one bad pixel is named") {
    auto a = simulate(40, 33, 64, 1, exponential(1)), b = simulate(40, 33, 64, 2, exponential(1));
    a.sum[(9 * 40 + 17) * 3 + 1] = std::nan("");
    const auto r = z_test(to_estimate(a), to_estimate(b));
    CHECK_FALSE(r.pass);
    CHECK(r.worst_x == 16);
    CHECK(r.worst_y == 8);
    CHECK(r.worst_channel == 1);
    CHECK(r.report().find("FAIL") == 0);
}

TEST_CASE("pooled variances guard a converged image against rare bright samples that the other side missed") {
    // 1 always, and 2000 once in 20000 samples: mean 1.1.
    const Sampler firefly = [](std::mt19937_64& rng, size_t) {
        return std::uniform_real_distribution<double>()(rng) < 5e-5 ? 2001.0 : 1.0;
    };
    ZTestOptions options;
    options.same_estimator = true;
    options.significance = 0.05;
    int failed = 0;
    for (uint64_t i = 0; i < 10; ++i) {
        const auto a = simulate(48, 48, 16, 2 * i, firefly), b = simulate(48, 48, 512, 2 * i + 1, firefly);
        const auto r = z_test(to_estimate(a), to_estimate(b), options);
        UNSCOPED_INFO(r.report());
        failed += !r.pass;
    }
    CHECK(failed <= binomial_limit(10, 0.05));
}

TEST_CASE("too few samples and different sizes are refused") {
    const auto few = to_estimate(simulate(8, 8, 4, 1, exponential(1)));
    const auto enough = to_estimate(simulate(8, 8, 16, 1, exponential(1)));
    const auto wide = to_estimate(simulate(9, 8, 16, 1, exponential(1)));
    CHECK_THROWS_AS(z_test(few, enough), Error);
    CHECK_THROWS_AS(z_test(enough, wide), Error);
    CHECK_THROWS_AS(to_estimate(simulate(8, 8, 1, 1, exponential(1))), Error);
}

TEST_CASE("a reference stands for the moments that it came from") {
    const auto a = simulate(24, 24, 64, 1, exponential(1)), b = simulate(24, 24, 64, 2, exponential(1.02));
    const auto direct = z_test(to_estimate(a), to_estimate(b)),
               stored = z_test(to_estimate(a), to_estimate(to_reference(b)));
    CHECK(stored.worst_z == Approx(direct.worst_z).epsilon(1e-4));
    CHECK(stored.pass == direct.pass);
}

TEST_CASE("Mitsuba's rule passes its own kind of noise and finds a bias") {
    // The reference is exact, the variance that of an exponential with mean 0.5 in all channels, in XYZ.
    const uint32_t w = 64, h = 64;
    const uint64_t spp = 256;
    std::mt19937_64 rng(7);
    std::normal_distribution<double> normal;
    const auto image = [&](double mean, double deviation) {
        Image m{w, h, std::vector<float>(w * h * 3)};
        for (size_t p = 0; p < size_t(w) * h; ++p) {
            const double value = mean + deviation * normal(rng);
            for (size_t c = 0; c < 3; ++c) m.rgb[3 * p + c] = float(value);
        }
        return m;
    };
    const Image ref = image(0.5, 0), var = image(0.25, 0);
    CHECK(mitsuba_z_test(image(0.5, 0.5 / 16), spp, ref, var).pass);
    CHECK_FALSE(mitsuba_z_test(image(0.5 * 1.2, 0.5 / 16), spp, ref, var).pass);
    Image broken = image(0.5, 0.5 / 16);
    for (size_t i = 0; i < 60; ++i) broken.rgb[i] = std::nanf("");  // 20 pixels of 4096: 0.5 %
    CHECK_FALSE(mitsuba_z_test(broken, spp, ref, var).pass);
    CHECK_THROWS_AS(mitsuba_z_test(image(0.5, 0), spp, Image{1, 1, {0, 0, 0}}, var), Error);
}

TEST_CASE("Images whose pixels depend on each other are compared by their batches") {
    // Every sample sends 64 walks of a geometrically distributed length that light one pixel per step: what walks do is
    // shared by many pixels.
    const auto walks = [](uint64_t seed, double brightness) {
        std::mt19937_64 rng(seed);
        std::vector<FilmMoments> batches;
        for (int k = 0; k < 32; ++k) {
            FilmMoments m{16, 16, 2, std::vector<double>(3 * 256), std::vector<double>(3 * 256)};
            for (int sample = 0; sample < 2; ++sample) {
                std::vector<double> value(256);
                for (int w = 0; w < 64; ++w) {
                    const double throughput = std::exponential_distribution<double>()(rng);
                    do value[rng() % 256] += brightness * throughput;
                    while (rng() % 10 != 0);
                }
                for (size_t i = 0; i < 3 * 256; ++i) {
                    m.sum[i] += value[i / 3];
                    m.sum_squares[i] += value[i / 3] * value[i / 3];
                }
            }
            batches.push_back(std::move(m));
        }
        return batches;
    };
    ZTestOptions options;
    options.significance = 0.02;
    const int runs = 150;
    int with = 0, without = 0, seen = 0;
    double detectable = 0;
    for (int i = 0; i < runs; ++i) {
        const Estimate a = to_estimate(walks(2 * uint64_t(i), 1)), b = to_estimate(walks(2 * uint64_t(i) + 1, 1));
        const ZTestResult z = z_test(a, b, options);
        with += !z.pass;
        detectable = z.detectable;
        Estimate plain_a = a, plain_b = b;
        plain_a.batches.clear();
        plain_b.batches.clear();
        without += !z_test(plain_a, plain_b, options).pass;
        seen += !z_test(a, to_estimate(walks(2 * uint64_t(i) + 1, 1 + 2 * detectable)), options).pass;
    }
    INFO("of " << runs << ": " << with << " fail with batches, " << without << " without, " << seen
               << " are seen at twice " << detectable);
    CHECK(with <= binomial_limit(runs, options.significance));
    CHECK(without > runs / 4);
    CHECK(seen > runs * 9 / 10);
    CHECK_THROWS_AS(to_estimate(std::vector<FilmMoments>(15, walks(1, 1)[0])), Error);
}

TEST_CASE("What a comparison of few batches says it would see is what it sees: Student's quantiles, not normal ones") {
    for (const int count : {16, 32}) {
        INFO(count << " batches");
        std::mt19937_64 rng(3);
        std::normal_distribution<double> normal;
        std::vector<FilmMoments> batches;
        for (int k = 0; k < count; ++k) {
            // All pixels share the noise of their batch, so that the whole image has the degrees of freedom of one.
            FilmMoments m{16, 16, 2, std::vector<double>(3 * 256), std::vector<double>(3 * 256)};
            const double noise = 0.005 * normal(rng);
            for (size_t i = 0; i < 3 * 256; ++i) {
                const double mean = 1 + double(i / 3) / 256 + noise;
                m.sum[i] = 2 * mean;
                m.sum_squares[i] = 2 * (mean * mean + 1e-4);
            }
            batches.push_back(std::move(m));
        }
        const Estimate a = to_estimate(batches);
        ZTestOptions options;
        options.block = 16;
        const auto against = [&](double relative) {
            Estimate b = a;
            b.samples = 0;
            b.batches.clear();
            for (size_t i = 0; i < b.mean.size(); ++i) b.mean[i] /= 1 + relative, b.variance_of_mean[i] = 0;
            return z_test(a, b, options);
        };
        const double detectable = against(1e-3).detectable;
        CHECK(against(0.97 * detectable).pass);
        CHECK_FALSE(against(1.03 * detectable).pass);
    }
}

TEST_CASE("what is dark in one half of an image leaves no block of the other half undecided") {
    // Blocks look at the larger block around them for the events to expect.
    const auto half = [](uint64_t seed) {
        std::mt19937_64 rng(seed);
        FilmMoments m{32, 8, 64, std::vector<double>(3 * 256), std::vector<double>(3 * 256)};
        for (size_t p = 0; p < 256; ++p)
            for (int k = 0; k < 64; ++k) {
                const double v = p % 32 < 16 ? 0 : std::exponential_distribution<double>()(rng);
                for (size_t c = 0; c < 3; ++c) m.sum[3 * p + c] += v, m.sum_squares[3 * p + c] += v * v;
            }
        return to_estimate(m);
    };
    const ZTestResult z = z_test(half(1), half(2));
    INFO(z.report());
    CHECK(z.pass);
    CHECK(z.inconclusive == 0);
}
