// libs: ambilux_session ambilux_render ambilux_integrators ambilux_formats ambilux_film ambilux_core
// A setting is declared once: what follows from its declaration is complete and agrees.
#include "integrators/settings_help.h"

#include <algorithm>
#include <cmath>

#include "core/atomic_file.h"
#include "core/error.h"
#include "integrators/path/policy.h"
#include "integrators/registry.h"
#include "integrators/warnings.h"
#include "session/statistics.h"
#include "session/stats_sum.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

std::string refusal(const std::function<void()>& f) {
    try {
        f();
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::usage);
        return e.what();
    }
    FAIL("accepted");
    return "";
}

/// Another value than the default, as text.
std::string another(const Setting& s) {
    const std::string standard = s.default_text();
    for (const char* value :
         {"true",       "false", "light",     "lvc",        "cpu",    "nee",  "power",  "hits",   "coherent",
          "cwbvh",      "tree",  "sobol",     "good",       "moment", "none", "select", "double", "pinned",
          "consistent", "world", "densities", "efficiency", "2x1:12", "0.25", "2",      "1",      "16"}) {
        RenderSettings settings;
        try {
            s.what.set(settings, value);
            if (s.text(settings) != standard) return value;
        } catch (const Error&) {}
    }
    FAIL("no other value for " << s.what.key);
    return "";
}

const char* const kReference = AMBILUX_SOURCE_DIR "/docs/reference.md";

}  // namespace

TEST_CASE("docs/reference.md is what the declarations say") {
    INFO("make it anew: build/cli/ambilux help settings --markdown > docs/reference.md");
    CHECK(bool(read_file(kReference) == settings_reference()));
}

TEST_CASE("every setting is parsed, printed, explained and known to the message for a key that is nearly its own") {
    const std::string help = settings_help();
    for (const Setting& s : general_settings()) {
        INFO(s.what.key);
        const std::string value = another(s);
        RenderSettings settings;
        apply_setting(settings, s.what.key, value);
        CHECK(setting_text(settings, s.what.key) == value);
        CHECK_FALSE(s.is_default(settings));
        apply_setting(settings, s.what.key, s.default_text());
        CHECK(s.is_default(settings));
        const std::string nearly = refusal([&] { apply_setting(settings, s.what.key + "x", value); });
        CHECK(nearly.find("'" + s.what.key + "'") != std::string::npos);
        CHECK(help.find("\n" + s.what.key + "=" + s.default_text()) != std::string::npos);
        CHECK_FALSE(s.what.help.empty());
        const std::string message = refusal([&] { apply_setting(settings, s.what.key, "no such value"); });
        CHECK(message.find(s.what.key + "=no such value: ") == 0);
    }
}

TEST_CASE("help has a block for every setting, and a line for every variant") {
    const std::string help = settings_help();
    const auto has = [&](const Setting& s, const std::string& where) {
        INFO(s.what.key);
        CHECK(help.find("\n" + s.what.key + "=" + s.default_text() + "\n    " + s.what.help +
                        "\n    values: " + s.what.allowed + "\n    has an effect on: " + where) != std::string::npos);
    };
    for (const Setting& s : general_settings())
        has(s, s.applies ? applies_text(s.applies) : s.limits.empty() ? "everywhere\n\n" : "everywhere; ");
    std::string last = "Integrators and their variants:\n\n";
    for (const Variant& v : variants()) {
        const std::string name = v.name();
        last += name + std::string(std::max<size_t>(name.size(), 18) - name.size(), ' ') + " " + v.help + "\n";
        for (const Setting& s : v.own) has(s, name + "\n\n");
    }
    CHECK(help.ends_with("\n\n" + last));
    CHECK(help.starts_with("Settings, as --set KEY=VALUE or in an experiment:\n\n"));
}

TEST_CASE("what a variant declares for itself is refused elsewhere by name") {
    for (const Variant& owner : variants())
        for (const Setting& own : owner.own) {
            RenderSettings s;
            s.integrator = owner.integrator;
            s.variant = owner.variant;
            apply_setting(s, own.what.key, another(own));
            CHECK_NOTHROW(check_settings(s, owner, false));
            for (const Variant& v : variants()) {
                if (v.find_own(own.what.key)) continue;
                const std::string message = refusal([&] { check_settings(s, v, false); });
                INFO(message);
                CHECK(message.find(own.what.key + "=" + another(own)) == 0);
                CHECK(message.find(v.integrator) != std::string::npos);
                CHECK(message.find(owner.name()) != std::string::npos);
            }
        }
}

namespace {

/// A variant.h that says as little as can be.
struct Bare {
    static constexpr const char* kHelp = "nothing";
    static constexpr VariantTraits kTraits = {};
};
struct BareStrategies {
    static constexpr const char* kHelp = "nothing";
    static constexpr VariantTraits kTraits = {.strategies = true};
};

}  // namespace

TEST_CASE("a variant that says nothing else has no replay, makes no reference, is not selected and stressed as it is") {
    const Variant bare = describe<Bare>("new", "wavefront");
    CHECK(bare.traits.replay == ReplayPairing::no_replay);
    CHECK(bare.traits.references == References::none);
    CHECK_FALSE(bare.strategies);
    CHECK_FALSE(bare.selection);
    REQUIRE(bare.stress.size() == 1);
    CHECK(bare.stress[0].name == "new");
    CHECK(bare.stress[0].settings.empty());
    CHECK(describe<Bare>("new", "other").stress[0].name == "new-other");
    RenderSettings settings;
    settings.strategies = kHitStrategies;
    CHECK(describe<BareStrategies>("new", "wavefront").strategies(settings) == kHitStrategies);
}

TEST_CASE("stress has the methods that variants name, each once") {
    std::vector<std::string> names;
    for (const Variant& v : variants())
        for (const Stressed& s : v.stress)
            if (!v.outside) names.push_back(s.name);
    CHECK(names == std::vector<std::string>{"path-naive",      "path-nee",    "path-mis",         "path-mis-power",
                                            "path-ris",        "path-guided", "path-optimal",     "light",
                                            "light-power",     "bdpt",        "bdpt-power",       "lvc",
                                            "lvc-power",       "aware",       "bdpt-guided",      "streaming",
                                            "streaming-power", "megakernel",  "megakernel-power", "vcm"});
}

TEST_CASE("learned draws are offered to the selection as four that are worth twelve, where they may be") {
    RenderSettings s;
    s.integrator = "bdpt";
    s.variant = "lvc";
    const VariantTraits any = {.draws = true, .selects_any = true};
    SelectionRequest asked = {s, any, false, false, 1.0f};
    const Variant* learned = find_variant("bdpt", "learned");
    REQUIRE(learned);
    const std::vector<SelectionOffer> offers = learned->selection(asked);
    REQUIRE(offers.size() == 1);
    CHECK(offers[0].settings == SettingTexts{{"strategies", "all"}, {"connections", "4"}});
    CHECK(offers[0].connect);
    CHECK(offers[0].draws == 4);
    CHECK(offers[0].worth == 12);
    asked.cuda = true;
    REQUIRE(learned->selection(asked).size() == 1);
    CHECK(learned->selection(asked)[0].worth == 16);
    CHECK(learned->selection({s, any, false, false, 0.0f}).empty());
}

TEST_CASE("single strategies switch on the groups that sample them, and are named as they were given") {
    const auto set = [](const std::string& value) {
        RenderSettings s;
        s.integrator = "bdpt";
        apply_setting(s, "strategies", value);
        CHECK(setting_text(s, "strategies") == value);
        return s;
    };
    for (const auto& [value, groups] :
         std::vector<std::pair<const char*, uint32_t>>{{"all", kAllStrategies},
                                                       {"hits", kHitStrategies},
                                                       {"next_event+light", kNextEventStrategies | kLightStrategies},
                                                       {"s0t2", kHitStrategies},
                                                       {"s0t5", kHitStrategies},
                                                       {"s1t1", kLightStrategies},
                                                       {"s4t1", kLightStrategies},
                                                       {"s1t2", kNextEventStrategies},
                                                       {"s1t4", kNextEventStrategies},
                                                       {"s2t2", kConnectionStrategies},
                                                       {"s0t2+s1t2+s2t2+s4t1", kAllStrategies}}) {
        CAPTURE(value);
        const RenderSettings s = set(value);
        CHECK(s.strategies == groups);
        CHECK(s.singles.on == (value[0] == 's'));
    }
    const RenderSettings s = set("s1t2+s4t1");
    for (uint32_t k = 0; k <= SingleStrategies::kMaxSegments; ++k)
        CHECK(s.singles.s[k] == (k == 2 ? 1 : k == 4 ? 4 : SingleStrategies::kNone));
    const auto refused = [](const std::string& value) {
        return refusal([&] {
            RenderSettings other;
            apply_setting(other, "strategies", value);
        });
    };
    CHECK(refused("s1t2+s2t1") ==
          "strategies=s1t2+s2t1: 's2t1' and 's1t2' sample the same paths; single strategies have weight 1, so only one "
          "for each s + t can be on");
    CHECK(refused("s1t2+hits") == "strategies=s1t2+hits: groups and single strategies cannot be mixed");
    const std::string last = std::to_string(SingleStrategies::kMaxSegments + 1);
    for (const std::string& name : {std::string("s2t0"), std::string("s0t1"), "s0t" + last + "0"})
        CHECK_THAT(refused(name), StartsWith("strategies=" + name + ": '" + name));
    CHECK(refused("s2t0") == "strategies=s2t0: 's2t0': t is at least 1, and s + t from 2 to " + last);
    CHECK(set("s0t" + last).singles.s[SingleStrategies::kMaxSegments] == 0);
    CHECK_THAT(refused("s1t" + last), ContainsSubstring("s + t from 2 to " + last));
    for (const std::string name : {"other", "x1t2", "s1x2", "s1", "s1t", "st2", "s1t2x", "s1t2 ", ""})
        CHECK(refused("hits+" + name) ==
              "strategies=hits+" + name + ": '" + name +
                  "' is none of hits, next_event, connections, light and no single strategy such as s2t3; join them "
                  "with '+', or write all");
}

TEST_CASE("numbers of light subpaths between those that tiles can have are refused with the next ones") {
    RenderSettings s;
    CHECK_THAT(refusal([&] { apply_setting(s, "light_paths", "0.26"); }),
               ContainsSubstring("the next are 0.25 and 0.265625"));
    CHECK_THAT(refusal([&] { apply_setting(s, "light_paths", "2.99"); }),
               ContainsSubstring("the next are 2.984375 and 3"));
}

TEST_CASE("roulette that lets variance double within the depth of paths is warned of") {
    const Scene scene = scene_from_text(
        "<scene version='3.0.0'><sensor type='perspective'/><emitter type='constant'/><shape type='sphere'>"
        "<bsdf type='diffuse'><rgb name='reflectance' value='0.9, 0.99, 0.5'/></bsdf></shape></scene>");
    RenderSettings s;
    s.rr_depth = 5;
    s.rr_cap = 0.95f;
    const double doubles_after = std::log(2.0) / std::log(double(0.99f) * 0.99f / 0.95f);  // 22.2 vertices
    for (const auto& [depth, warned] : {std::pair{-1, true},
                                        {5 + int(std::ceil(doubles_after)), true},
                                        {5 + int(std::floor(doubles_after)), false},
                                        {1, false}}) {
        s.max_depth = depth;
        const std::vector<std::string> warnings = render_warnings(scene, s);
        INFO(depth << " of " << doubles_after);
        CHECK(std::any_of(warnings.begin(), warnings.end(), [](const std::string& w) {
                  return w.starts_with(
                      "a surface reflects 0.99 of the light, and Russian roulette ends one path in 20");
              }) == warned);
    }
    const auto text = [&](const char* reflected, const char* paths, const char* cap) {
        return std::string("a surface reflects ") + reflected +
               " of the light, and Russian roulette ends one path in " + paths +
               " at least: where such surfaces see only each other, variance grows without bound and error bars are "
               "too small; --set rr_cap=" +
               cap + " avoids that";
    };
    using Texts = std::vector<std::string>;
    s.max_depth = -1;
    CHECK(render_warnings(scene, s) == Texts{text("0.99", "20", "0.99")});
    s.rr_depth = -1;
    CHECK(render_warnings(scene, s).empty());  // without roulette
    s.rr_depth = 5;
    s.rr_cap = 0.99f;
    CHECK(render_warnings(scene, s).empty());
    const Scene white = scene_from_text(
        "<scene version='3.0.0'><sensor type='perspective'/><emitter type='constant'/><shape type='sphere'>"
        "<bsdf type='roughdiffuse'><rgb name='reflectance' value='0.5, 0.5, 1'/></bsdf></shape></scene>");
    s.rr_cap = 0.75f;
    CHECK(render_warnings(white, s) == Texts{text("1", "4", "0.999")});
}

TEST_CASE("light whose products floats cannot hold is warned of, and so are images without a path") {
    Scene scene = project_scene("cornell", 8, 8);
    REQUIRE(scene.emitters.size() == 1);
    scene.emitters.push_back(scene.emitters[0]);
    RenderSettings s;
    using Texts = std::vector<std::string>;
    const auto warned = [&](Rgb radiance) {
        scene.emitters[1].radiance.value = radiance;
        return render_warnings(scene, s);
    };
    const auto text = [](const char* most) {
        return Texts{
            "emitter 1 has " + std::string(most) +
            ", outside of 1e-30 to 1e+30: products of floats lose digits there or leave their range; scale all "
            "emission by the same factor, and the image back"};
    };
    CHECK(warned({1, 2.345e30f, 0}) == text("2.34e+30"));
    CHECK(warned({0, 1e-31f, 5e-31f}) == text("5e-31"));
    for (const float most : {0.0f, 1e-30f, 1.0f, 1e30f}) CHECK(warned({most, 0, 0}).empty());
    s.max_depth = 0;
    CHECK(
        render_warnings(scene, s) ==
        Texts{"max_depth=0: the shortest path has one segment, so that the image is black; 1 is emission alone, -1 no "
              "limit"});
}

TEST_CASE("a path tracer says which of its stages a render does without, and why") {
    const auto skipped = [](const Scene& scene, Estimator estimator, int max_depth) {
        RenderSettings s;
        s.estimator = estimator;
        s.max_depth = max_depth;
        return skipped_path_parts(scene, plan_path(scene, s).rules);
    };
    const Scene scene = project_scene("cornell", 8, 8);
    Scene dark = scene;
    dark.emitters.clear();
    using Parts = std::vector<std::string>;
    CHECK(skipped(scene, Estimator::mis, 8).empty());
    CHECK(skipped(scene, Estimator::naive, 8) == Parts{"connect, occlude: estimator naive samples no emitters"});
    CHECK(skipped(scene, Estimator::mis, 1) == Parts{"connect, occlude: max_depth leaves no segment for them"});
    CHECK(skipped(dark, Estimator::mis, 8) ==
          Parts{"connect, occlude: no emitters", "mis_weight and accumulate of hits: no emitters"});
    const Scene point = scene_from_text(
        "<scene version='3.0.0'><sensor type='perspective'/><emitter type='point'/><shape type='sphere'/></scene>");
    Scene both = scene;
    both.emitters.push_back(point.emitters.at(0));
    const std::string unseen = "mis_weight and accumulate of hits: no ray can meet these emitters",
                      naive = "connect, occlude: estimator naive samples no emitters",
                      lost = "light of point, spot and directional emitters: estimator naive cannot find it";
    CHECK(skipped(point, Estimator::mis, 8) == Parts{unseen});
    CHECK(skipped(point, Estimator::naive, 8) == Parts{naive, unseen, lost});
    CHECK(skipped(both, Estimator::mis, 8).empty());
    CHECK(skipped(both, Estimator::naive, 8) == Parts{naive, lost});
    const Scene sky = scene_from_text(
        "<scene version='3.0.0'><sensor type='perspective'/><emitter type='constant'/><shape type='sphere'/></scene>");
    CHECK(plan_path(sky, RenderSettings{}).rules.count_environment);
    CHECK_FALSE(plan_path(both, RenderSettings{}).rules.count_environment);
}

TEST_CASE("a setting without an effect is refused with key, value, place and where it has one") {
    const auto refused = [](const char* integrator, const char* variant, const char* key, const char* value,
                            bool cuda) {
        RenderSettings s;
        apply_setting(s, key, value);
        return refusal([&] { check_settings(s, *find_variant(integrator, variant), cuda); });
    };
    CHECK(refused("bdpt", "megakernel", "compaction", "select", false) ==
          "compaction=select: there are no queues of one item per path; this is integrator bdpt, variant megakernel, "
          "backend cpu. It has an effect on " +
              applies_text([](const VariantTraits& v, bool) { return v.compacts; }));
    CHECK(refused("path", "wavefront", "strategies", "hits", false).find("bdpt") != std::string::npos);
    CHECK(refused("bdpt", "lvc", "deterministic", "true", true).find("deterministic=true") == 0);
    CHECK(refused("bdpt", "lvc", "accel", "bvh2", true).find("accel=bvh2") == 0);
    CHECK(refused("path", "wavefront", "accel", "embree", true).find("cwbvh") != std::string::npos);
    RenderSettings s;
    apply_setting(s, "deterministic", "true");
    CHECK_NOTHROW(check_settings(s, *find_variant("bdpt", "lvc"), false));
    apply_setting(s, "ordering", "none");
    CHECK_NOTHROW(check_settings(s, *find_variant("bdpt", "megakernel"), true));
    CHECK(refusal([] {
              RenderSettings wrong;
              wrong.variant = "lvc";
              variant_of(wrong);
          }).find("variant=lvc: integrator path has ") == 0);
}

TEST_CASE("statistics name every setting as used and as asked for, images those that apply") {
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings asked = cpu_settings(scene, Estimator::mis);
    asked.integrator = "bdpt";
    asked.automatic = true;
    const RenderResult r = render_scene(scene, asked, 4);
    REQUIRE_FALSE(r.stats.selection.name.empty());
    const nlohmann::json json = stats_json(scene, asked, r.stats, 0);
    for (const Setting& s : general_settings()) {
        INFO(s.what.key);
        CHECK(json.contains(s.what.key));
        CHECK(json["asked"].contains(s.what.key));
    }
    CHECK(json["asked"]["bdpt.auto"] == true);
    CHECK(json["bdpt.auto"] == false);
    CHECK(json["asked"]["ordering"] == "auto");
    CHECK(json["ordering"] == "none");
    for (const auto& [key, value] : r.stats.selection.settings) {
        const RenderSettings used = used_settings(asked, r.stats);
        CHECK(setting_text(used, key) == value);
    }
    const Attributes attributes = image_attributes(scene, asked, r.stats);
    CHECK(attributes.at("integrator") == json["integrator"]);
    CHECK(attributes.at("method") == json["method"]);
    CHECK(json["light_picking"] == "power");
    CHECK(attributes.at("light_picking") == "power");
    // Asked for as 0, which leaves it open.
    CHECK(json["asked"]["wave_size"] == 0);
    CHECK(json["wave_paths"] >= kTilePixels);
    CHECK(attributes.at("wave_paths") == json["wave_paths"]);
    CHECK(restore_stats(save_stats(r.stats)).wave_paths == r.stats.wave_paths);
    RenderSettings lvc;
    lvc.integrator = "bdpt";
    lvc.variant = "lvc";
    apply_setting(lvc, "connections", "16");
    apply_setting(lvc, "light_paths", "0.25");
    CHECK(method_text(lvc).starts_with("bdpt lvc "));
    CHECK(method_text(lvc).find(" connections=16") != std::string::npos);
    CHECK(method_text(lvc).find(" light_paths=0.25") != std::string::npos);
    RenderSettings plain;
    plain.integrator = "bdpt";
    plain.variant = "lvc";
    CHECK(method_text(plain) == "bdpt lvc connections=3");
    RenderSettings path;
    path.integrator = "path";
    path.variant = "wavefront";
    CHECK(method_text(path).find("estimator=mis") != std::string::npos);
    CHECK(method_text(path).find("seed") == std::string::npos);
    CHECK(attributes.contains("selection"));
    CHECK(attributes.contains("estimator") == (json["integrator"] == "path"));
}
