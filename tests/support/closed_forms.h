// Images whose pixels are known, and the question whether a render has them as its expectation.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/support/enough_samples.h"

namespace ambilux {

/// One way to estimate the same light.
struct EstimatorCase {
    const char* name;
    Estimator estimator;
    MisHeuristic heuristic;
};

constexpr EstimatorCase kEstimators[] = {{"naive", Estimator::naive, MisHeuristic::balance},
                                         {"nee", Estimator::nee, MisHeuristic::balance},
                                         {"mis, balance", Estimator::mis, MisHeuristic::balance},
                                         {"mis, power", Estimator::mis, MisHeuristic::power}};

inline RenderSettings case_settings(const Scene& scene, const EstimatorCase& e, uint64_t seed = 1) {
    RenderSettings s = cpu_settings(scene, e.estimator, seed);
    s.heuristic = e.heuristic;
    return s;
}

/// Image whose pixel (x,y) is the mean of `radiance(film x, film y)`, in pixels from the top left, over a box filter: 6
/// x 6 Gauss points.
template <class Function>
Image image_of(uint32_t width, uint32_t height, Rgb color, Function radiance) {
    constexpr double at[3] = {0.2386191860831969, 0.6612093864662645, 0.9324695142031521},
                     weight[3] = {0.4679139345726910, 0.3607615730481386, 0.1713244923791704};
    Image image{width, height, std::vector<float>(size_t(width) * height * 3)};
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            double sum = 0;
            for (int i = 0; i < 6; ++i)
                for (int j = 0; j < 6; ++j)
                    sum += weight[i / 2] * weight[j / 2] / 4 *
                           radiance(x + 0.5 + (i % 2 ? 0.5 : -0.5) * at[i / 2],
                                    y + 0.5 + (j % 2 ? 0.5 : -0.5) * at[j / 2]);
            for (int c = 0; c < 3; ++c)
                image.rgb[(size_t(y) * width + x) * 3 + size_t(c)] = float(sum * double(color[c]));
        }
    return image;
}

inline Image constant_image(uint32_t width, uint32_t height, Rgb color) {
    return image_of(width, height, color, [](double, double) { return 1.0; });
}

/// Largest relative difference of a pixel.
inline double worst_difference(const FilmMoments& film, const Image& expected) {
    double worst = 0;
    for (size_t i = 0; i < expected.rgb.size(); ++i)
        worst = std::max(worst, std::abs(film.mean(i) - double(expected.rgb[i])) /
                                    std::max(1e-30, std::abs(double(expected.rgb[i]))));
    return worst;
}

/// Fails unless renders of `scene` have `expected` as their expectation; takes as many samples as it needs to see a
/// mean that is 0.9% off. A pilot of 128 samples tells roughly how many, and is not part of the comparison.
inline void check_expectation(const Scene& scene, const RenderSettings& settings, const Image& expected) {
    ZTestOptions options;
    options.block = 4;
    options.rounding = 1e-5;
    constexpr uint32_t kPilot = 128, kMost = 45000;
    constexpr double kAim = 0.009, kSees = 0.01;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    REQUIRE(renderer->render(0, kPilot) == kPilot);
    REQUIRE(renderer->film().width == expected.width);
    REQUIRE(renderer->film().height == expected.height);
    const bool exact =
        worst_difference(renderer->film(), expected) < 2e-5;  // an estimator without variance: rounding is all there is
    if (!exact) {
        const Estimate truth = exact_estimate(expected);
        const ZTestResult pilot = z_test(to_estimate(renderer->film()), truth, options);
        const double samples = kPilot * std::pow(pilot.detectable / kAim, 2);
        renderer->clear_film();
        const auto n = uint32_t(std::clamp(samples, double(kPilot), double(kMost)));
        const Estimate image = until_seen(n, kMost, truth, kSees, options, [&](uint32_t done, uint32_t more) {
            REQUIRE(renderer->render(kPilot + done, more) == more);
            return to_estimate(renderer->film());
        });
        const ZTestResult z = z_test(image, truth, options);
        INFO(image.samples << " samples: " << z.report());
        // Almost without variance: the few subpaths that met roulette are too few to be tested, and together may matter
        // one in 1000 at most.
        if (z.undecided) {
            CHECK(std::abs(z.relative_difference) < kNoVariance);
        } else {
            CHECK(z.pass);
            CHECK(sees_bias(image, truth, kSees, options));
        }
        CHECK(z.detectable < kSees);
    }
    CHECK(renderer->stats().invalid.total() == 0);
}

/// `limit`: largest sum of samples that rounding may leave.
inline void check_black(const RenderResult& render, double limit = 0) {
    CHECK(*std::max_element(render.film.sum.begin(), render.film.sum.end()) <= limit);
    CHECK(render.stats.invalid.total() == 0);
}

/// Compares all estimators. `hits`: rays can find the light; if not, the naive image must be black.
inline void check_all_estimators(const Scene& scene, const Image& expected, bool hits = true) {
    uint64_t seed = 1;
    for (const EstimatorCase& e : kEstimators) {
        INFO(e.name);
        const RenderSettings settings = case_settings(scene, e, seed++);
        if (e.estimator == Estimator::naive && !hits)
            check_black(render_scene(scene, settings, 64));
        else
            check_expectation(scene, settings, expected);
    }
}

/// Film of `size` x `size` pixels with a box filter.
inline std::string square_film(uint32_t size) {
    const std::string n = std::to_string(size);
    return "<film type='hdrfilm'><integer name='width' value='" + n + "'/><integer name='height' value='" + n +
           "'/><rfilter type='box'/></film>";
}

inline std::string scene_xml(int max_depth, const std::string& body, const std::string& integrator = "") {
    return "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='" +
           std::to_string(max_depth) + "'/>" + integrator + "</integrator>" + body + "</scene>";
}

inline std::string rgb(const char* name, Rgb v) {
    return std::string("<rgb name='") + name + "' value='" + std::to_string(v.x) + "," + std::to_string(v.y) + "," +
           std::to_string(v.z) + "'/>";
}

inline std::string diffuse(Rgb reflectance) {
    return "<bsdf type='diffuse'>" + rgb("reflectance", reflectance) + "</bsdf>";
}
inline std::string area_light(Rgb radiance) {
    return "<emitter type='area'>" + rgb("radiance", radiance) + "</emitter>";
}

/// An emitter of the radiance that a test asks for; `visible`: from above.
struct SeenEmitter {
    std::string body;
    bool visible;
};
inline const std::string kTurnedUp = "<transform name='to_world'><scale value='2'/></transform>";
inline const std::string kTurnedDown =
    "<transform name='to_world'><scale value='2'/><rotate x='1' angle='180'/></transform>";
inline std::vector<SeenEmitter> emitters_seen_from_above(Rgb radiance) {
    const std::string light = area_light(radiance) + "</shape>", rectangle = "<shape type='rectangle'>",
                      flipped = rectangle + "<boolean name='flip_normals' value='true'/>";
    return {
        {rectangle + kTurnedUp + light, true},
        {"<shape type='disk'>" + kTurnedUp + light, true},
        {"<shape type='sphere'><point name='center' x='0' y='0' z='-3'/><float name='radius' value='2.5'/>" + light,
         true},
        {"<shape type='cylinder'><float name='radius' value='2'/><point name='p0' x='-2' y='0' z='-2.5'/><point "
         "name='p1' x='2' y='0' z='-2.5'/>" +
             light,
         true},
        {"<emitter type='constant'>" + rgb("radiance", radiance) + "</emitter>", true},
        {rectangle + kTurnedDown + light, false},
        {flipped + kTurnedUp + light, false},
        {flipped + kTurnedDown + light, true},
    };
}

}  // namespace ambilux
