// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// data: tagged
// labels: long
// timeout: 3600
// Every mask of strategies that can sample a scene, both heuristics, every variant and the light tracer against the
// path tracer, on the project's scenes and on published ones.
#include <algorithm>
#include <cstdio>
#include <map>

#include "tests/support/bidirectional_images.h"
#include "transport/emitter.h"

using namespace ambilux;

namespace {

struct Comparison {
    const char* name;
    bool published;
    uint32_t width, height;
    int max_depth;  ///< 0: the scene's own
    bool deltas;  ///< mirrors, glass or plastic: paths through them to a lamp and to the camera are found by hits alone
    uint32_t path, sampled;      ///< samples per pixel
    double all_sees, mask_sees;  ///< bounds of ZTestResult::detectable, for all strategies and for any mask
    const char* why_not;  ///< why masks other than those with all of hits and next event estimation are not compared
    bool hides = false;   ///< emitters are hidden from the camera
};

constexpr Comparison kComparisons[] = {
    {"furnace", false, 48, 32, 0, false, 512, 256, 0.02, 0.06, nullptr},
    {"textured", false, 48, 32, 0, false, 4096, 1024, 0.01, 0.03, nullptr},
    {"materials", false, 48, 32, 0, true, 1024, 256, 0.05, 0.1, nullptr},
    {"lights", false, 48, 32, 0, false, 4096, 1024, 0.02, 0.05, nullptr},
    {"cornell", false, 48, 32, 0, false, 1024, 256, 0.02, 0.06, nullptr},
    {"glass", false, 48, 32, 0, true, 4096, 512, 0.1, 0.2, nullptr},
    {"cornell-box", true, 48, 32, 5, false, 1024, 256, 0.02, 0.08, nullptr},
    // Lamps are smaller than a pixel here: seen directly they would make nearly all of the variance.
    {"veach-mis", true, 48, 32, 3, false, 4096, 2048, 0.05, 0.15, nullptr, true},
    {"veach-bidir", true, 32, 32, 3, true, 2048, 256, 0.1, 0.1,
     "its lamps are met by so few rays that masks of hits alone stay undecided"},
    // Two segments: its lamp is too small for rays of the path tracer, which therefore misses caustics, from three
    // segments on, and the lamp as the camera sees it.
    {"water-caustic", true, 32, 32, 2, true, 1024, 256, 0.1, 0.1, "hits of its lamp are too rare to be tested alone"},
    {"veach-ajar", true, 48, 32, 4, true, 1024, 128, 0.2, 0.2, "hits of its lamp are too rare to be tested alone"},
    {"glass-and-ice", true, 48, 32, 5, true, 1024, 128, 0.05, 0.1, nullptr},
    {"living-room", true, 32, 18, 3, true, 1024, 256, 0.12, 0.12, "hits of its lamps are too rare to be tested alone"},
    {"staircase", true, 32, 32, 3, true, 1024, 128, 0.1, 0.1, "hits of its lamps are too rare to be tested alone"},
};

std::string mask_name(uint32_t bits) {
    constexpr const char* kNames[] = {"hits", "next_event", "connections", "light"};
    std::string name;
    for (uint32_t b = 0; b < 4; ++b) {
        if (!(bits >> b & 1)) continue;
        if (!name.empty()) name += '+';
        name += kNames[b];
    }
    return name;
}

/// Whether some strategy of the mask finds every path that the path tracer finds, emitters seen directly aside.
/// Connections have three segments at least and never do by themselves.
bool samples_all(const Scene& scene, const Comparison& c, uint32_t bits) {
    const bool delta_lights =
        std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return is_delta(e.type); });
    if (c.deltas && !(bits & kHitStrategies)) return false;
    if (c.why_not && !((bits & kHitStrategies) && (bits & kNextEventStrategies))) return false;
    if (delta_lights && !(bits & (kNextEventStrategies | kLightStrategies))) return false;
    return bits & (kHitStrategies | kNextEventStrategies | kLightStrategies);
}

/// Compares renders of one scene with those of the path tracer. Where no strategy sees emitters directly, or only light
/// subpaths do, they are hidden from both.
class Comparator {
public:
    Comparator(Scene scene, const Comparison& c) : scene_(std::move(scene)), c_(c) {
        if (c_.max_depth) scene_.integrator.max_depth = c_.max_depth;
    }
    const Scene& scene() const { return scene_; }
    const Comparison& c() const { return c_; }

    void check(const Method& m, bool hidden, double sees) {
        scene_.integrator.hide_emitters = hidden;
        if (!path_.contains(hidden)) path_[hidden] = render_path(scene_, c_.path);
        const Estimate image = render_batches(scene_, method_settings(scene_, m, 1), c_.sampled);
        const ZTestResult z = z_test(image, path_[hidden]);
        const std::string what = std::string(c_.name) + ", " + m.name +
                                 (m.heuristic == MisHeuristic::power ? ", power" : "") +
                                 (m.variant == "wavefront" ? "" : ", " + m.variant);
        std::printf("%-70s z %+5.2f, p %.2g, sees %.3f%s\n", what.c_str(), z.worst_z, z.p_worst, z.detectable,
                    z.undecided ? ", undecided" : "");
        std::fflush(stdout);
        INFO(what << ": " << z.report());
        CHECK(z.pass);
        CHECK(z.detectable < sees);
        CHECK(sees_bias(image, path_[hidden], sees));
    }

private:
    Scene scene_;
    Comparison c_;
    std::map<bool, Estimate> path_;
};

void compare_masks(Comparator& comparator) {
    const Comparison& c = comparator.c();
    for (uint32_t bits = 1; bits <= kAllStrategies; ++bits) {
        if (!samples_all(comparator.scene(), c, bits)) continue;
        const bool hidden = c.hides || c.why_not || !(bits & (kHitStrategies | kLightStrategies));
        comparator.check({mask_name(bits)}, hidden, bits == kAllStrategies ? c.all_sees : c.mask_sees);
    }
    comparator.check({"all", MisHeuristic::power}, c.hides || c.why_not, c.all_sees);
    if (samples_all(comparator.scene(), c, kLightStrategies)) comparator.check({"-i light"}, c.hides, c.mask_sees);
}

void compare_variants(Comparator& comparator) {
    for (const char* variant : {"megakernel", "lvc", "streaming"})
        comparator.check({"all", MisHeuristic::balance, variant}, comparator.c().hides || comparator.c().why_not,
                         comparator.c().all_sees);
}

template <class Compare>
void on_project_scenes(Compare compare) {
    for (const Comparison& c : kComparisons) {
        if (c.published) continue;
        Comparator comparator(project_scene(c.name, c.width, c.height), c);
        compare(comparator);
    }
}

template <class Compare>
void on_published_scenes(Compare compare) {
    for (const Comparison& c : kComparisons) {
        if (!c.published) continue;
        std::optional<Scene> scene = published_scene(c.name, c.width, c.height);
        if (!scene) return;
        Comparator comparator(std::move(*scene), c);
        compare(comparator);
    }
}

}  // namespace

TEST_CASE("Masks of strategies agree with the path tracer on the project's scenes", "[bidirectional]") {
    on_project_scenes(compare_masks);
}

TEST_CASE("Masks of strategies agree with the path tracer on the published scenes", "[bidirectional][data]") {
    on_published_scenes(compare_masks);
}

TEST_CASE("Variants agree with the path tracer on the project's scenes", "[bidirectional]") {
    on_project_scenes(compare_variants);
}

TEST_CASE("Variants agree with the path tracer on the published scenes", "[bidirectional][data]") {
    on_published_scenes(compare_variants);
}
