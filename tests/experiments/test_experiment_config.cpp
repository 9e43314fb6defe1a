// libs: ambilux_experiments
// timeout: 60
// Configurations: sweeps, ablations, refusals with their lines, reduced sizes, and the plan of a dry run.
#include <cstdlib>

#include "core/log.h"
#include "experiments/config.h"
#include "experiments/dry_run.h"
#include "tests/support/experiment_fakes.h"
#include "tests/support/skip.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// kConfig with `from` replaced.
std::string changed(const std::string& from, const std::string& to) {
    std::string config = kConfig;
    const size_t at = config.find(from);
    REQUIRE(at != std::string::npos);
    return config.replace(at, from.size(), to);
}

ExperimentConfig read(const TempFolder& folder, const std::string& config, bool reduced = false) {
    write_inputs(folder, config);
    return read_experiment(folder / "e.toml", reduced);
}

std::vector<std::string> names(const std::vector<RunEntry>& runs) {
    std::vector<std::string> all;
    for (const RunEntry& run : runs) all.push_back(run.name);
    return all;
}

using Names = std::vector<std::string>;

}  // namespace

TEST_CASE("a sweep is one line and gives the product of its values, in the order in which they are written") {
    const TempFolder folder;
    const ExperimentConfig config =
        read(folder, changed("estimator = \"naive\"",
                             "set = { estimator = \"mis\" }\nsweep = { rr_depth = [2, -1], connections = [1, 4] }"));
    CHECK(names(config.runs) == Names{"good", "biased[rr_depth=2,connections=1]", "biased[rr_depth=2,connections=4]",
                                      "biased[rr_depth=-1,connections=1]", "biased[rr_depth=-1,connections=4]"});
    const RunEntry& run = config.runs[2];
    CHECK(run.base == "biased");
    CHECK(run.swept == Settings{{"rr_depth", "2"}, {"connections", "4"}});
    CHECK(run.settings ==
          Settings{{"integrator", "path"}, {"estimator", "mis"}, {"rr_depth", "2"}, {"connections", "4"}});
    CHECK(run.lines.back() == 22);

    SECTION("what is written to the results is a configuration that gives the same") {
        const std::string resolved = resolved_toml(config);
        folder.write("resolved.toml", resolved);
        const ExperimentConfig again = read_experiment(folder / "resolved.toml");
        CHECK(resolved_toml(again) == resolved);
        CHECK(names(again.runs) == names(config.runs));
    }
    SECTION("it may choose the integrator or the variant") {
        CHECK(names(read(folder, changed("integrator = \"path\"\nestimator = \"naive\"",
                                         "sweep = { integrator = [\"path\", \"bdpt\"] }"))
                        .runs) == Names{"good", "biased[integrator=path]", "biased[integrator=bdpt]"});
    }
    SECTION("of scenes it gives sizes and depths") {
        const ExperimentConfig c =
            read(folder, changed("size = [9, 5]", "sweep = { size = [[9, 5], [18, 10]], max_depth = [2, -1] }"));
        REQUIRE(c.scenes.size() == 5);
        CHECK(c.scenes[2].name == "b[size=9x5,max_depth=-1]");
        CHECK(c.scenes[3].width == 18);
        CHECK(c.scenes[4].max_depth == -1);
        CHECK(c.scenes[4].base == "b");
    }
    SECTION("of scenes it gives values of their parameters, by name and as $parameters") {
        const ExperimentConfig c =
            read(folder, changed("size = [9, 5]",
                                 "size = [9, 5]\nparams = { \"red.reflectance\" = 0.5 }\nsweep = { "
                                 "\"params.red.reflectance\" = [0.1, [0.1, 0.2, 0.3]], "
                                 "\"parameters.res\" = [8, 16] }"));
        REQUIRE(c.scenes.size() == 5);
        CHECK(c.scenes[1].name == "b[params.red.reflectance=0.1,parameters.res=8]");
        CHECK(c.scenes[3].name == "b[params.red.reflectance=0.1_0.2_0.3,parameters.res=8]");
        CHECK(c.scenes[3].params == Settings{{"red.reflectance", "0.1 0.2 0.3"}});
        CHECK(c.scenes[4].parameters == Settings{{"res", "16"}});
    }
}

TEST_CASE("an ablation changes one switch of its default at a time") {
    const TempFolder folder;
    const std::string ablation =
        "[ablation]\ndefault = \"biased\"\n[ablation.switches]\nestimator = [\"mis\"]\nconnections = [1, 8]\n";
    const ExperimentConfig config = read(folder, kConfig + ablation);
    CHECK(config.ablation_default == "biased");
    CHECK(names(config.runs) ==
          Names{"good", "biased", "biased[estimator=mis]", "biased[connections=1]", "biased[connections=8]"});
    CHECK(config.runs[2].settings == Settings{{"integrator", "path"}, {"estimator", "mis"}});
    CHECK(config.runs[4].settings == Settings{{"integrator", "path"}, {"estimator", "naive"}, {"connections", "8"}});
    CHECK(contains(resolved_toml(config), "[ablation]\ndefault = 'biased'"));
    const auto message = [&](const std::string& text) { return error_of([&] { read(folder, kConfig + text); }); };
    CHECK(contains(message("[ablation]\ndefault = \"best\"\n"),
                   "e.toml:23: [ablation] default 'best' is no run; runs are: good, biased"));
    CHECK(contains(message("[ablation]\nswitches = { rr_depth = [1] }\n"),
                   "e.toml:22: [ablation] lacks the key 'default'"));
    CHECK(contains(message("[ablation]\ndefault = \"biased\"\nswitches = { estimator = [\"naive\"] }\n"),
                   "e.toml:24: estimator=naive is what the default run has"));
}

TEST_CASE("keys of many dots are refused; strings and numbers may have as many as they like") {
    const TempFolder folder;
    std::string dots, quoted;
    for (int i = 0; i < 100000; ++i) dots += "a.", quoted += "\"b\" . ";
    for (const std::string& text : {dots + "a = 1\n", "[" + dots + "a]\n", "x = { " + dots + "a = 1 }\n",
                                    quoted + "a = 1\n", "s = \"\"\"\n'\n\"\"\" # '\n" + dots + "a = 1\n"})
        CHECK(contains(error_of([&] { read(folder, kConfig + text); }), "a key has more than 32 dots"));
    const std::string harmless =
        "reference_spp = 64\n# " + dots + "\n[scene.parameters]\np = \"" + dots + "\"\nq = '" + dots + "'\n";
    CHECK(read(folder, changed("size = [9, 5]\n", "size = [9, 5]\n" + harmless)).scenes.size() == 2);
}

TEST_CASE("a scene whose name no file can have is not there") {
    const TempFolder folder;
    const std::string name(5000, 'x');
    CHECK(contains(error_of([&] { read(folder, changed("path = \"b.xml\"", "path = \"" + name + "\"")); }),
                   "e.toml:13: scene 'b': there is no file"));
}

TEST_CASE("budgets of samples and of seconds stand side by side; --reduced replaces what its section says") {
    const TempFolder folder;
    const std::string text = changed("spp = [1, 2, 8, 32]", "spp = [1, 2]\nseconds = [0.5, 1]") +
                             "[reduced]\nscale = 0.5\nseeds = [5]\nreference_spp = 10\nseconds = [0.25]\n";
    std::string sized = text;
    sized.replace(sized.find("path = \"a.xml\""), 14, "path = \"a.xml\"\nsize = [16, 12]");
    const ExperimentConfig config = read(folder, sized);
    REQUIRE(config.checkpoints().size() == 4);
    CHECK(config.checkpoints()[1].samples == 2);
    CHECK(config.checkpoints()[2].seconds == 0.5);
    CHECK(config.scenes[1].width == 9);
    const ExperimentConfig small = read(folder, sized, true);
    CHECK(small.name == "fake-reduced");
    CHECK(small.seeds == std::vector<uint64_t>{5});
    CHECK(small.spp.empty());
    CHECK(small.seconds == std::vector<double>{0.25});
    CHECK(small.scenes[1].width == 5);
    CHECK(small.scenes[1].height == 3);
    CHECK(small.scenes[1].reference.spp == 10);
    CHECK(contains(error_of([&] { read(folder, text, true); }),
                   "e.toml:9: scene 'a': 'scale' of [reduced] needs a 'size' here"));
    CHECK(config.metric == "relmse");
    CHECK(read(folder, "metric = \"mse\"\n" + text).metric == "mse");
    CHECK(contains(resolved_toml(read(folder, "metric = \"mse\"\n" + text)), "metric = 'mse'"));
    CHECK(config.random_order == false);
    CHECK(contains(error_of([&] { read(folder, "seeds = [1]\n[reference]\nspp = 8\n[budget]\nspp = [1]\n[scene]\n"); }),
                   "e.toml:6: one of several: write [[scene]]"));
    CHECK(contains(error_of([&] { read(folder, changed("\"listed\"", "\"sorted\"")); }),
                   "e.toml:3: order 'sorted': must be random or listed"));
    CHECK(contains(error_of([&] { read(folder, "metric = \"ssim\"\n" + text); }),
                   "e.toml:1: metric 'ssim': must be relmse or mse"));
    CHECK(contains(error_of([&] { read(folder, kConfig, true); }), "e.toml: --reduced: it has no section [reduced]"));
}

TEST_CASE("the project's configurations are right, also reduced") {
    for (const auto& file : fs::directory_iterator(std::string(AMBILUX_SOURCE_DIR) + "/experiments"))
        if (file.path().extension() == ".toml") {
            CAPTURE(file.path().string());
            const std::string text = read_file(file.path().string());
            // Scenes may be left out, but not all of them.
            const bool has_own = contains(text, "path = \"../scenes/");
            if (contains(text, "$AMBILUX_DATA") && !(has_own && contains(text, "optional = true"))) {
                const char* data = std::getenv("AMBILUX_DATA");
                const auto there = [&](const char* scene) {
                    return data && fs::exists(std::string(data) + "/scenes/" + scene + "/scene.xml");
                };
                if (!there("veach-bidir") || !there("water-caustic") || !there("veach-ajar") || !there("living-room") ||
                    !there("cornell-box")) {
                    skip("skipped: the published scenes are not in AMBILUX_DATA");
                    continue;
                }
            }
            const Hooks hooks = default_hooks();
            const ExperimentConfig config = read_experiment(file.path().string());
            for (const RunEntry& run : config.runs) {
                if (!run.renderer.empty()) continue;
                RenderSettings settings;
                for (const auto& [key, value] : run.settings) CHECK_NOTHROW(hooks.apply_setting(settings, key, value));
            }
            if (contains(text, "\n[reduced]")) CHECK_NOTHROW(read_experiment(file.path().string(), true));
        }
}

TEST_CASE("a dry run tells the plan and writes nothing") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    world.batch = 100;
    world.sleep_per_sample = 0.001;
    auto r = request(folder, "out");
    const std::string plan = describe_plan(r, fake_hooks(world));
    INFO(plan);
    CHECK_FALSE(fs::exists(folder.path / "out"));
    CHECK(contains(plan, "2 scenes x 2 runs x 2 seeds = 8 renders; 4 checkpoints each, 32 rows\n"));
    CHECK(contains(plan, "4 at 1, 2, 8, 32 spp"));
    CHECK(contains(plan, "400 spp by path: to make, about "));
    CHECK(contains(plan, "biased: integrator=path estimator=naive"));
    CHECK(contains(plan, "These are estimates."));
    CHECK(contains(plan, "fake device"));
    const auto seconds_after = [&](const std::string& word) {
        const size_t at = plan.find(word);
        return at == std::string::npos ? -1.0 : std::stod(plan.substr(at + word.size()));
    };
    // A sample sleeps 1 ms and a bit: 2 references of 400 and 8 renders of 32 take 1.06 s.
    CHECK(seconds_after("time    about ") > 1.0);
    CHECK(seconds_after("time    about ") < 30.0);  // sleeps are longer on a loaded machine

    SECTION("it knows what is there already") {
        world.sleep_per_sample = 0;
        run_experiment(r, fake_hooks(world));
        const std::string after = describe_plan(r, fake_hooks(world));
        CHECK(contains(after, "32 rows, 32 of them made already"));
        CHECK(contains(after, "400 spp by path: cached with 400 spp"));
        folder.write("e.toml", changed("spp = 400", "spp = 600"));
        r.output = "";
        r.references = folder / "out/references";
        CHECK(contains(describe_plan(r, fake_hooks(world)), "600 spp by path: to extend from 400 spp, "));
        r.output = folder / "out";
        CHECK(contains(error_of([&] { describe_plan(r, fake_hooks(world)); }), "a different configuration"));
    }
    SECTION("times in seconds need no pilot") {
        folder.write("e.toml", changed("spp = [1, 2, 8, 32]", "seconds = [1, 3]"));
        r.references = folder / "refs";
        world.sleep_per_sample = 0;
        const std::string timed = describe_plan(r, fake_hooks(world));
        CHECK(contains(timed, "2 at 1, 3 s"));
        CHECK(contains(timed, "renders 24 s"));
        CHECK(contains(timed, "about 3.0 s per seed"));
    }
    SECTION("it refuses what a run would refuse") {
        folder.write("e.toml", changed("estimator = \"naive\"", "set = { connections = 99 }"));
        CHECK(contains(error_of([&] { describe_plan(r, fake_hooks(world)); }),
                       "e.toml:21: run 'biased' on scene 'a': connections=99: too many"));
    }
}

TEST_CASE("configurations are refused with file, line and the offending name, before anything is rendered") {
    const TempFolder folder;
    const auto refused = [&](const std::string& from, const std::string& to) {
        std::string config = kConfig;
        const size_t at = config.find(from);
        REQUIRE(at != std::string::npos);
        write_inputs(folder, config.replace(at, from.size(), to));
        folder.write("broken.xml", "broken");
        World world;
        const std::string message = error_of([&] { run_experiment(request(folder, "out"), fake_hooks(world)); });
        CHECK(world.calls == 0);
        CHECK_FALSE(fs::exists(folder.path / "out"));
        return message;
    };
    CHECK(contains(refused("seeds = [1, 2]", "seed = [1, 2]"),
                   "e.toml:2: unknown key 'seed' in the configuration: is 'seeds' meant?"));
    CHECK(contains(refused("seeds = [1, 2]", "seeds = [1, 1]"), "e.toml:2: seed 1 is listed twice"));
    CHECK(contains(refused("seeds = [1, 2]", "seeds = 1"), "e.toml:2: 'seeds' must be a list"));
    CHECK(contains(refused("seeds = [1, 2]", "seeds = [1, 2"), "e.toml:3: "));
    CHECK(contains(refused("seeds = [1, 2]\n", ""), "e.toml: lacks the key 'seeds'"));
    CHECK(contains(refused("spp = 400", "spp = 1"), "e.toml:5: 'spp' must be an integer from 2"));
    CHECK(contains(refused("spp = [1, 2, 8, 32]", "spp = [1, 2, 2]"), "e.toml:7: 'spp' must rise; 2 does not"));
    CHECK(contains(refused("spp = [1, 2, 8, 32]", "seconds = [-1.0]"), "e.toml:7: 'seconds' must be positive"));
    CHECK(contains(refused("spp = [1, 2, 8, 32]", ""), "e.toml:6: [budget] needs 'spp', 'seconds' or both"));
    CHECK(contains(refused("path = \"b.xml\"", "path = \"c.xml\""), "e.toml:13: scene 'b': there is no file "));
    {
        const char* set = std::getenv("AMBILUX_DATA");
        const std::string before = set ? set : "";
        unsetenv("AMBILUX_DATA");
        CHECK(contains(refused("path = \"b.xml\"", "path = \"$AMBILUX_DATA/b.xml\""),
                       "e.toml:13: scene 'b': the environment variable AMBILUX_DATA is not set"));
        setenv("AMBILUX_DATA", "/nowhere", 1);
        CHECK(contains(refused("path = \"b.xml\"", "path = \"$AMBILUX_DATA/b.xml\""),
                       "e.toml:13: scene 'b': there is no file /nowhere/b.xml"));
        if (set)
            setenv("AMBILUX_DATA", before.c_str(), 1);
        else
            unsetenv("AMBILUX_DATA");
    }
    CHECK(contains(refused("path = \"b.xml\"", "path = \"broken.xml\""), "broken.xml:7: unknown bsdf 'broken'"));
    CHECK(contains(refused("size = [9, 5]", "size = [9]"), "e.toml:14: 'size' must be [width, height]"));
    CHECK(contains(refused("size = [9, 5]", "sise = [9, 5]"), "e.toml:14: unknown key 'sise' in [[scene]]"));
    CHECK(contains(refused("name = \"biased\"", "name = \"good\""), "e.toml:19: name 'good' of [[run]] is used twice"));
    CHECK(contains(refused("name = \"biased\"", "name = \"a/b\""), "e.toml:19: name 'a/b'"));
    CHECK(contains(refused("estimator = \"naive\"", "estimator = \"best\""),
                   "e.toml:21: run 'biased': estimator=best is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "set = { rr_dept = 3 }"),
                   "e.toml:21: run 'biased': rr_dept=3 is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "set = { seed = 3 }"),
                   "e.toml:21: 'seed' belongs to the experiment"));
    CHECK(contains(refused("estimator = \"naive\"", "integrator2 = 1"),
                   "e.toml:21: unknown key 'integrator2' in [[run]]"));
    CHECK(contains(refused("name = \"biased\"\nintegrator = \"path\"", "name = \"biased\"\nintegrator = \"magic\""),
                   "e.toml:18: run 'biased' on scene 'a': integrator 'magic' is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { rr_depth = 3 }"),
                   "e.toml:21: 'sweep': 'rr_depth' must be a list"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { rr_depth = [] }"),
                   "e.toml:21: 'sweep': 'rr_depth' must be a list"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = {}"), "e.toml:21: 'sweep' is empty"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { rr_depth = [3, 3] }"),
                   "e.toml:21: 'sweep': value 3 of 'rr_depth' is listed twice"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { rr_dept = [3] }"),
                   "e.toml:21: run 'biased[rr_dept=3]': rr_dept=3 is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { estimator = [\n\"mis\",\n\"best\"] }"),
                   "e.toml:23: run 'biased[estimator=best]': estimator=best is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { estimator = [\"../x\"] }"),
                   "e.toml:21: 'sweep': value '../x' of 'estimator' cannot be part of a name"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { max_depth = [3] }"),
                   "e.toml:21: 'max_depth' belongs to the experiment"));
    CHECK(contains(refused("estimator = \"naive\"", "set = { rr_depth = 1 }\nsweep = { rr_depth = [3] }"),
                   "e.toml:22: 'rr_depth' of run 'biased' is set and in 'sweep'"));
    CHECK(contains(refused("estimator = \"naive\"", "sweep = { connections = [1, 99] }"),
                   "e.toml:21: run 'biased[connections=99]' on scene 'a': connections=99: too many"));
    CHECK(contains(refused("estimator = \"naive\"", "estimator = \"naive\"\ntechniques = 0"),
                   "e.toml:22: 'techniques' must be an integer from 1"));
    CHECK(contains(refused("size = [9, 5]", "sweep = { parameters = [1] }"),
                   "e.toml:14: unknown key 'parameters' in 'sweep' of [[scene]]"));
    CHECK(contains(refused("size = [9, 5]", "size = [9, 5]\nsweep = { size = [[1, 1]] }"),
                   "e.toml:15: 'size' is set and in 'sweep'"));
    CHECK(contains(refused("spp = 400", "spp = 400\nintegrator = \"light\""),
                   "e.toml:6: integrator 'light': a reference is made by path or bdpt"));
    CHECK(contains(refused("spp = 400", "spp = 400\nset = { rr_depth = 3 }"),
                   "e.toml:4: [reference] lacks the key 'integrator'"));
    CHECK(contains(refused("spp = 400", "spp = 400\nintegrator = \"bdpt\"\nset = { strategies = \"hits\" }"),
                   "e.toml:7: 'strategies' in [reference]"));
    CHECK(contains(refused("spp = 400", "spp = 400\nintegrator = \"bdpt\"\nset = { connections = 99 }"),
                   "e.toml:7: reference of 'a': connections=99: too many"));
    CHECK(contains(refused("size = [9, 5]", "reference_spp = 9\nreference = { spp = 8 }"),
                   "e.toml:14: 'reference_spp' and 'reference.spp' say the same"));
    CHECK(contains(refused("spp = 400", "spp = 400\n[reduced]\nscale = 2"),
                   "e.toml:7: 'scale' must be a number above 0"));
    World world;
    ExperimentRequest missing{folder / "none.toml", folder / "out", "", false, nullptr};
    CHECK(contains(error_of([&] { run_experiment(missing, fake_hooks(world)); }), "none.toml: No such file"));
}
