// libs: ambilux_experiments
// timeout: 120
// References: what interruption and continuation leave, and that they share no random numbers with renders.
#include <sys/wait.h>

#include "core/log.h"
#include "film/ztest.h"
#include "session/reference.h"
#include "tests/support/experiment_fakes.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("the reference: a killed and continued one equals the uninterrupted one") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    const Hooks hooks = fake_hooks(world);
    const Scene scene = fake_scene(folder / "a.xml", {});
    ReferenceRequest whole;
    whole.path = folder / "whole.exr";
    whole.spp = 64;
    const auto complete = make_reference(scene, whole, hooks);
    CHECK(complete.reference.samples == 64);

    ReferenceRequest part = whole;
    part.path = folder / "part.exr";
    part.checkpoint_seconds = 0;  // after every batch
    world.stop_at = world.calls + 5;
    part.interrupt = &world.flag;
    const auto stopped = make_reference(scene, part, hooks);
    CHECK(stopped.interrupted);
    const uint64_t kept = read_reference_exr(part.path).samples;
    CHECK(kept >= 2);
    CHECK(kept < 64);
    CHECK(kept == stopped.reference.samples);
    world.flag = false;
    world.sleep_per_sample = 0.001;  // so that checkpoints fall between batches
    const auto continued = make_reference(scene, part, hooks);
    CHECK(continued.continued_from == kept);
    CHECK(continued.reference.samples == 64);
    for (size_t i = 0; i < complete.reference.mean.rgb.size(); ++i) {
        REQUIRE(continued.reference.mean.rgb[i] == Approx(complete.reference.mean.rgb[i]).epsilon(1e-6));
        REQUIRE(continued.reference.standard_error.rgb[i] ==
                Approx(complete.reference.standard_error.rgb[i]).epsilon(1e-5));
    }
    const uint64_t before = world.samples;
    CHECK(make_reference(scene, part, hooks).continued_from == 64);
    CHECK(world.samples == before);

    SECTION("what differs is named") {
        ReferenceRequest other = part;
        other.settings.max_depth = 3;
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }),
                       "part.exr: cannot be continued: its max_depth is -1, asked for is 3"));
        other = part;
        other.settings.rr_depth = 3;
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }), "its rr_depth is 5, asked for is 3"));
        other = part;
        other.settings.seed = 1ull << 40;
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }),
                       "its seed is 0, asked for is 1099511627776"));
        Scene changed = scene;
        changed.content_hash[0] ^= 1;
        CHECK(contains(error_of([&] { make_reference(changed, part, hooks); }), "its scene_hash is"));
        changed = scene;
        changed.sensor.crop_width = 8;
        CHECK(
            contains(error_of([&] { make_reference(changed, part, hooks); }), "its size is 16x12, asked for is 8x12"));
        write_exr(folder / "image.exr", complete.reference.mean);
        other = part;
        other.path = folder / "image.exr";
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }),
                       "its kind is (not stated), asked for is reference"));
        other.path = folder / "none/r.exr";
        error_of([&] { make_reference(scene, other, hooks); }, ExitCode::device);
    }
    SECTION("seeds beyond 32 bits come back") {
        ReferenceRequest big = whole;
        big.path = folder / "big.exr";
        big.settings.seed = ~0ull;
        make_reference(scene, big, hooks);
        CHECK(make_reference(scene, big, hooks).continued_from == 64);
    }
}

TEST_CASE("settings that make a reference another one than the path tracer's are part of what it is") {
    const auto text = [](const std::vector<std::pair<std::string, std::string>>& set) {
        RenderSettings settings;
        for (const auto& [key, value] : set) apply_setting(settings, key, value);
        return reference_request("r.exr", 8, settings).settings_text;
    };
    CHECK(text({}).empty());
    CHECK(text({{"max_depth", "4"}, {"seed", "3"}, {"connections", "7"}}).empty());
    CHECK(text({{"precision", "double"}}) == "precision=double");
    CHECK(text({{"integrator", "bdpt"}}) == "integrator=bdpt");
    CHECK(text({{"integrator", "bdpt"}, {"variant", "lvc"}, {"connections", "7"}, {"max_depth", "4"}}) ==
          "integrator=bdpt variant=lvc connections=7");
    for (const char* key : {"variant", "estimator"}) {
        const std::string value = std::string(key) == "variant" ? "ris" : "naive";
        CHECK(contains(error_of([&] { text({{key, value}}); }, ExitCode::usage), "leave these settings out"));
    }
    World world;
    ReferenceRequest one = reference_request("r.exr", 1, {});
    CHECK(
        contains(error_of([&] { make_reference({}, one, fake_hooks(world)); }, ExitCode::usage), "at least 2 samples"));
    one = reference_request("r.exr", 2, {});
    one.settings.estimator = Estimator::naive;
    CHECK(contains(error_of([&] { make_reference({}, one, fake_hooks(world)); }, ExitCode::usage), "all strategies"));
    CHECK(world.made == 0);
    CHECK(reference_seed(0) == 0xe220a8397b1dcdafull);  // splitmix64 (Vigna)
    CHECK(reference_seed(0x9e3779b97f4a7c15ull) == 0x6e789e6aa1b965f4ull);
}

TEST_CASE("a reference shares no random numbers with a render of the same seed") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    const Hooks hooks = fake_hooks(world);
    const Scene scene = fake_scene(folder / "a.xml", {});
    ReferenceRequest r;
    r.path = folder / "r.exr";
    r.spp = 64;
    const auto reference = make_reference(scene, r, hooks);
    FakeRenderer renderer(scene, {}, world);
    renderer.render(0, 64, nullptr);
    const Metrics m = compare_images(renderer.film(), reference.reference);
    // Independent: E (x-r)² is the sum of both variances; with shared samples it would be zero.
    CHECK(m.rmse_corrected == Approx(m.reference_noise).epsilon(0.25));
}

TEST_CASE("a reference that is killed and continued has the bits of one that is not") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    const Hooks hooks = fake_hooks(world);
    const Scene scene = fake_scene(folder / "a.xml", {});
    ReferenceRequest whole;
    whole.path = folder / "whole.exr";
    whole.spp = 64;
    const auto complete = make_reference(scene, whole, hooks);
    ReferenceRequest part = whole;
    part.path = folder / "part.exr";
    part.checkpoint_seconds = 0;
    for (const int at : {9, 4, 7}) {
        const pid_t child = ::fork();
        REQUIRE(child >= 0);
        if (child == 0) {
            World doomed;
            doomed.kill_at = at;
            doomed.sleep_per_sample = 0.002;
            try {
                make_reference(scene, part, fake_hooks(doomed));
            } catch (...) {}
            ::_exit(0);
        }
        int status = 0;
        REQUIRE(::waitpid(child, &status, 0) == child);
        REQUIRE(WIFSIGNALED(status));
        CHECK(fs::exists(part.path + ".sums"));
    }
    const auto continued = make_reference(scene, part, hooks);
    CHECK(continued.continued_from >= 4);
    CHECK(continued.continued_from < 64);
    CHECK(bool(continued.reference.mean.rgb == complete.reference.mean.rgb));
    CHECK(bool(continued.reference.standard_error.rgb == complete.reference.standard_error.rgb));
    CHECK_FALSE(fs::exists(part.path + ".sums"));
}
