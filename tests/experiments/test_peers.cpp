// libs: ambilux_experiments
// timeout: 120
// Other renderers as runs of an experiment. The built program itself stands for one: it must agree with itself.
#include <csignal>
#include <cstdlib>
#include <thread>

#include "core/flag.h"
#include "experiments/peers/agreement.h"
#include "experiments/peers/child_process.h"
#include "experiments/peers/command_peer.h"
#include "experiments/peers/image_peer.h"
#include "experiments/peers/pass_film.h"
#include "film/exr_io.h"
#include "session/drive.h"
#include "session/load.h"
#include "tests/support/experiment_fakes.h"
#include "tests/support/render_scene.h"
#include "tests/support/skip.h"

using namespace ambilux;
using namespace ambilux::test;
using nlohmann::json;

namespace {

/// A peer that is this program.
std::string own_run(const std::string& name, const std::string& depth = "{depth}") {
    return "[[run]]\nname = \"" + name + "\"\nrenderer = \"command\"\ncommand = \"" + AMBILUX_PROGRAM +
           " render {scene} -o {output} --spp {spp} --seed {seed} --size {width}x{height} --backend cpu "
           "--max-depth " +
           depth + "\"\n";
}

std::string config_of(const std::string& runs, const std::string& budget = "spp = [16, 48]") {
    return "repeats = 0\nseeds = [1]\nbackend = \"cpu\"\nfilter = \"box\"\nagreement_spp = 256\n[reference]\nspp = "
           "512\n[budget]\n" +
           budget + "\n[[scene]]\nname = \"box\"\npath = \"" + AMBILUX_SOURCE_DIR +
           "/scenes/cornell.xml\"\nsize = [16, 16]\nmax_depth = 3\n[[run]]\nname = \"path\"\nintegrator = \"path\"\n" +
           runs;
}

std::string run(const TempFolder& folder, const std::string& config, bool resume = false) {
    folder.write("e.toml", config);
    REQUIRE(run_experiment(request(folder, "out", resume), default_hooks()) == ExitCode::done);
    return folder / "out";
}

json read_json(const std::string& path) { return json::parse(read_file(path)); }

json entry_of(const std::string& output, const std::string& run) {
    for (const json& entry : read_json(output + "/peers.json"))
        if (entry["run"] == run) return entry;
    FAIL("no entry of " << run);
    return {};
}

size_t rows_of(const std::string& output, const std::string& run) {
    size_t count = 0;
    for (const auto& row : table(output + "/runs.csv")) count += row[1] == run;
    return count;
}

std::string refusal(const TempFolder& folder, const std::string& runs) {
    folder.write("e.toml", config_of(runs));
    return error_of([&] { read_experiment(folder / "e.toml"); });
}

}  // namespace

TEST_CASE("a peer that agrees is timed, one that does not is reported and not timed") {
    const TempFolder folder;
    const std::string output =
        run(folder, config_of(own_run("same") + own_run("shallow", "2") +
                              "[[run]]\nname = \"none\"\nrenderer = \"command\"\ncommand = \"no-such-program {output} "
                              "{spp} {seed}\"\n"));
    CHECK(rows_of(output, "path") == 2);
    CHECK(rows_of(output, "same") == 2);
    CHECK(rows_of(output, "shallow") == 0);
    CHECK(rows_of(output, "none") == 0);
    const json same = entry_of(output, "same"), shallow = entry_of(output, "shallow"), none = entry_of(output, "none");
    CHECK(same["state"] == "agrees");
    CHECK(same["agreement"]["samples"] == 256);
    CHECK(same["agreement"]["equivalent"] == false);  // so few samples find no difference, and show nothing
    CHECK(same["agreement"]["mean_bound"].get<double>() > 1e-3);
    CHECK(std::abs(same["agreement"]["relative_difference"].get<double>()) < 0.1);
    CHECK(shallow["state"] == "differs");
    CHECK(shallow["agreement"]["samples"] == 1024);  // four times as many decide
    CHECK(shallow["agreement"]["relative_difference"].get<double>() < -0.05);
    CHECK(none["state"] == "missing");
    CHECK(contains(none["reason"], "no-such-program"));
    const Image image = read_exr(output + "/images/box/same_1.exr");
    CHECK(image.width == 16);
    const json stats = read_json(output + "/stats/box/same_1.json");
    CHECK(stats["spp"] == 48);
    CHECK(stats["peer"]["state"] == "agrees");
    CHECK(stats["seconds"]["render"].get<double>() > 0);

    SECTION("a complete experiment keeps what it found, and looks again for what was not there") {
        const std::string before = read_file(output + "/runs.csv");
        fs::remove_all(output + "/peers");
        run(folder, read_file(folder / "e.toml"), true);
        CHECK(read_file(output + "/runs.csv") == before);
        CHECK(fs::exists(output + "/peers/box/none"));
        CHECK_FALSE(fs::exists(output + "/peers/box/same"));
    }
}

TEST_CASE("a path tracer that the reference fails may agree with as many samples of ours, and with nobody else's") {
    const auto scene_of = [](const char* reflectance) {
        return scene_from_text(std::string(R"(<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">
            <integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/></film></sensor>
            <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate z="4"/></transform>
            <bsdf type="diffuse"><rgb name="reflectance" value=")") +
                               reflectance + R"("/></bsdf></shape>
            <emitter type="constant"/></scene>)");
    };
    const Scene scene = scene_of("0.5"), darker = scene_of("0.4");
    const auto renderer_of = [](const Scene& s, uint64_t seed) {
        RenderSettings settings = cpu_settings(s, Estimator::mis, seed);
        return make_renderer(s, settings);
    };
    Agreement a;
    a.samples = 256;
    const std::unique_ptr<Renderer> peer = renderer_of(scene, 1);
    for (uint32_t i = 0; i < kAgreementParts; ++i) {
        peer->render(i * 16, 16);
        FilmMoments part = peer->film();
        peer->clear_film();
        for (size_t k = 0; k < part.sum.size(); ++k)
            part.sum[k] = part.mean(k), part.sum_squares[k] = part.sum[k] * part.sum[k];
        part.samples = 1;
        if (i == 0)
            a.parts = part;
        else
            a.parts.add(part);
    }
    compare_with_own(a, *renderer_of(darker, 2), nullptr);
    CHECK_FALSE(a.test.pass);
    CHECK_FALSE(a.with_own_path);
    compare_with_own(a, *renderer_of(scene, 2), nullptr);
    CHECK(a.test.pass);
    CHECK(a.with_own_path);
}

TEST_CASE("a Python peer that is not installed is skipped by name, and one that breaks its promises is refused") {
    const TempFolder folder;
    const char* const set = std::getenv("AMBILUX_PEERS_PYTHON");
    const std::string given = set ? set : "";
    ::setenv("AMBILUX_PEERS_PYTHON", (folder / "python").c_str(), 1);
    const auto answer = [&](const std::string& text) {
        folder.write("python", "#!/bin/sh\n" + text + "\n");
        fs::permissions(folder / "python", fs::perms::owner_all);
        fs::remove_all(folder / "out");
        return entry_of(run(folder, config_of("[[run]]\nname = \"m\"\nrenderer = \"mitsuba\"\n")), "m");
    };
    json entry =
        answer("echo '{\"progress\": \"kernels, 10 s\"}'; echo '{\"missing\": \"mitsuba cannot be imported\"}'");
    CHECK(entry["state"] == "missing");
    CHECK(entry["reason"] == "mitsuba cannot be imported");
    entry = answer("echo 'it fell over' >&2");
    CHECK(entry["state"] == "refused");
    CHECK(contains(entry["reason"], "it fell over"));
    const std::string ready =
        R"(echo '{"ready": {"version": "m 1", "device": "d", "backend": "cpu", )"
        R"("load_seconds": 0, "compile_seconds": 0, "changes": ["a"], "differences": []}}'; read a;)";
    entry = answer(ready + R"( printf 1234 > "$(dirname "$2")/pass.f32"; echo '{"seconds": 1}')"
                           "; read a");
    CHECK(entry["state"] == "refused");
    entry = answer("echo hello");
    CHECK(contains(entry["reason"], "not JSON: hello"));
    CHECK(fs::exists(folder / "out/peers/box/m/peer_mitsuba.py"));
    const json job = read_json(folder / "out/peers/box/m/job.json");
    CHECK(job["crop"] == json({0, 0, 16, 16}));
    CHECK(job["max_depth"] == 3);
    CHECK(job["variant"] == "scalar_rgb");
    given.empty() ? ::unsetenv("AMBILUX_PEERS_PYTHON") : ::setenv("AMBILUX_PEERS_PYTHON", given.c_str(), 1);
}

TEST_CASE("Mitsuba agrees on the Cornell box, and its passes reach the checkpoints") {
    const char* python = std::getenv("AMBILUX_PEERS_PYTHON");
    if (!python) return skip("AMBILUX_PEERS_PYTHON names no Python with Mitsuba");
    const TempFolder folder;
    const std::string output = run(folder, config_of("[[run]]\nname = \"m\"\nrenderer = \"mitsuba\"\n"));
    const json entry = entry_of(output, "m");
    if (entry["state"] == "missing") return skip(entry["reason"]);
    CHECK(entry["state"] == "agrees");
    CHECK(rows_of(output, "m") == 2);
    CHECK(read_json(output + "/stats/box/m_1.json")["spp"] == 48);
}

TEST_CASE("wrong runs of peers are refused with their line") {
    const TempFolder folder;
    const std::string head = "[[run]]\nname = \"m\"\n";
    CHECK(contains(refusal(folder, head + "renderer = \"arnold\"\n"), "renderer 'arnold' is not known; known are: "));
    CHECK(contains(refusal(folder, head + "renderer = \"mitsuba\"\nintegrator = \"bdpt\"\n"), "'bdpt' of mitsuba"));
    CHECK(contains(refusal(folder, head + "renderer = \"mitsuba\"\nset = { connections = 3 }\n"), "connections"));
    CHECK(contains(refusal(folder, head + "renderer = \"mitsuba\"\ncommand = \"x\"\n"), "unknown key 'command'"));
    CHECK(contains(refusal(folder, head + "renderer = \"command\"\n"), "lacks the key 'command'"));
    CHECK(contains(refusal(folder, head + "renderer = \"command\"\ncommand = \"x {output} {spp}\"\n"), "{seed}"));
    const std::string wrong = refusal(folder, head + "renderer = \"mitsuba\"\nvariant = \"gpu\"\n");
    INFO(wrong);
    CHECK(contains(wrong, "e.toml:21: variant 'gpu' of mitsuba: must be one of scalar_rgb"));
    folder.write("e.toml", config_of(head + "renderer = \"mitsuba\"\n"));
    const std::string resolved = resolved_toml(read_experiment(folder / "e.toml"));
    folder.write("r.toml", resolved);
    CHECK(resolved_toml(read_experiment(folder / "r.toml")) == resolved);
    CHECK(contains(resolved, "renderer = 'mitsuba'"));
}

TEST_CASE("a scene that is optional and not there is left out, and one of them must be there") {
    const TempFolder folder;
    const std::string extra = "[[scene]]\nname = \"far\"\npath = \"none.xml\"\noptional = true\n";
    folder.write("e.toml", config_of(extra));
    CHECK(read_experiment(folder / "e.toml").scenes.size() == 1);
    folder.write("e.toml", config_of("[[scene]]\nname = \"far\"\npath = \"none.xml\"\n"));
    CHECK(contains(error_of([&] { read_experiment(folder / "e.toml"); }), "there is no file"));
    std::string text = config_of("");
    text.replace(text.find("cornell.xml"), 7, "nowhere");
    text.insert(text.find("size = "), "optional = true\n");
    folder.write("e.toml", text);
    CHECK(contains(error_of([&] { read_experiment(folder / "e.toml"); }), "none of its scenes is there"));
}

TEST_CASE("an interrupt that is known only once all is prepared ends a peer at work") {
    const TempFolder folder;
    folder.write("e.toml", config_of("[[run]]\nname = \"slow\"\nrenderer = \"command\"\n"
                                     "command = \"sleep 5; true {output} {spp} {seed}\"\n"));
    volatile bool stop = false;
    ExperimentRequest asked = request(folder, "out");
    asked.on_prepared = [&] { asked.interrupt = &stop; };
    std::thread user([&] {
        while (!fs::exists(folder / "out/peers/box/slow/log.txt"))
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        set_flag(&stop);
    });
    const ExitCode code = run_experiment(asked, default_hooks());
    user.join();
    CHECK(code == ExitCode::interrupted);
    // It did not come to a result.
    CHECK_FALSE(fs::exists(folder / "out/peers.json"));
}

TEST_CASE("placeholders are filled in once and quoted for the shell") {
    CHECK(fill_command("a {x} {y} {z}", {{"x", "it's {y}"}, {"y", "2"}}) == "a 'it'\\''s {y}' '2' {z}");
    CHECK(check_command({{"command", "{output}{spp}{seed}"}}).empty());
}

TEST_CASE("images made elsewhere take part at their times") {
    const TempFolder folder;
    const auto image = [&](int number, float value) {
        write_exr(folder / ("i_1_" + std::to_string(number) + ".exr"), {16, 16, std::vector<float>(768, value)});
    };
    image(1, 4);
    image(2, 2);
    const std::string theirs =
        "[[run]]\nname = \"theirs\"\nrenderer = \"images\"\nfiles = \"i_{seed}_{number}.exr\"\n"
        "samples = [10, 40]\nseconds = [0.25, 0.5]\n";
    const std::string output = run(folder, config_of(theirs, "seconds = [0.25, 0.5]"));
    CHECK(entry_of(output, "theirs")["state"] == "untested");
    std::vector<std::pair<std::string, double>> found;
    for (const auto& row : table(output + "/runs.csv"))
        if (row[1] == "theirs") found.emplace_back(row[column("spp")], std::stod(row[column("time")]));
    REQUIRE(found.size() == 2);
    CHECK(found[0] == std::pair<std::string, double>{"10", 0.25});
    CHECK(found[1] == std::pair<std::string, double>{"40", 0.5});
    for (const float v : read_exr(output + "/images/box/theirs_1.exr").rgb) REQUIRE(v == Approx(2));

    folder.write("r.toml", resolved_toml(read_experiment(folder / "e.toml")));
    CHECK(resolved_toml(read_experiment(folder / "r.toml")) == read_file(folder / "r.toml"));
    const auto wrong = [&](const std::string& from, const std::string& to) {
        std::string text = theirs;
        return refusal(folder, text.replace(text.find(from), from.size(), to));
    };
    CHECK(contains(wrong("{number}", "x"), "lacks the placeholder {number}"));
    CHECK(contains(wrong("[10, 40]", "[10]"), "lists of equal length"));
    CHECK(contains(wrong("[10, 40]", "[10, 5]"), "must rise"));
    CHECK(contains(wrong("[10, 40]", "[1.5, 5]"), "integers"));
}

TEST_CASE("a run whose image is missing is left out with the reason, and is there once the image is") {
    const TempFolder folder;
    const std::string images =
        "[[run]]\nname = \"theirs\"\nrenderer = \"images\"\nfiles = "
        "\"theirs_{seed}_{number}.exr\"\nsamples = [16, 48]\nseconds = [0.1, 0.2]\n";
    const Image grey{16, 16, std::vector<float>(16 * 16 * 3, 0.5f)};
    write_exr(folder / "theirs_1_1.exr", grey, {});
    const std::string output = run(folder, config_of(images));
    CHECK(rows_of(output, "path") == 2);
    CHECK(rows_of(output, "theirs") == 0);  // not half of a render
    json entry = entry_of(output, "theirs");
    REQUIRE(entry["lost"].size() == 1);
    CHECK(entry["lost"][0]["seed"] == 1);
    CHECK(contains(entry["lost"][0]["reason"], "theirs_1_2.exr"));
    write_exr(folder / "theirs_1_2.exr", grey, {});
    run(folder, read_file(folder / "e.toml"), true);
    CHECK(rows_of(output, "theirs") == 2);
    CHECK(entry_of(output, "theirs")["lost"].empty());
}

TEST_CASE("another build of this program takes any setting, and its module is looked for beside the configuration") {
    const TempFolder folder;
    folder.write("e.toml",
                 config_of("[[run]]\nname = \"before\"\nrenderer = \"build\"\nmodule = \"old/python\"\nintegrator "
                           "= \"bdpt\"\nvariant = \"lvc\"\nset = { connections = 2, gone = true }\n"));
    const std::string text = read_file(folder / "e.toml");
    const ExperimentConfig config = read_experiment(folder / "e.toml");
    const RunEntry& before = config.runs[1];
    CHECK(before.settings == Settings{{"integrator", "bdpt"},
                                      {"variant", "lvc"},
                                      {"module", folder / "old/python"},
                                      {"connections", "2"},
                                      {"gone", "true"}});
    folder.write("r.toml", resolved_toml(config));
    CHECK(resolved_toml(read_experiment(folder / "r.toml")) == read_file(folder / "r.toml"));
    CHECK(contains(refusal(folder, "[[run]]\nname = \"b\"\nrenderer = \"build\"\n"), "module"));
    const json entry = entry_of(run(folder, text), "before");
    CHECK(entry["state"] == "missing");
    CHECK(contains(entry["reason"], "old/python"));
}

TEST_CASE("passes are averaged by their samples, and what is no radiance is dropped and counted") {
    PassFilm film(1, 1);
    CHECK(film.preferred_batch() == 1);
    film.add({1, 1, {1, 2, -1}}, 2, 0.5);
    film.add({1, 1, {4, std::nanf(""), 3}}, 1, 0.01);
    CHECK(film.moments().samples == 3);
    CHECK(film.moments().mean(0) == Approx(2));
    CHECK(film.moments().mean(1) == Approx(4.0 / 3));
    CHECK(film.moments().mean(2) == Approx(1));
    CHECK(film.last_seconds() == 0.01);
    CHECK(film.preferred_batch() == 16);  // 20 fit; powers of two
    RenderStats stats;
    film.state(stats);
    CHECK(stats.invalid.nan == 1);
    CHECK(stats.invalid.negative == 1);
    CHECK(stats.render_seconds == Approx(0.51));
    CHECK(pass_seed(1, 0) != pass_seed(1, 1));
    CHECK(pass_seed(1, 5) != pass_seed(2, 5));
}

TEST_CASE("a process is talked to in lines, its time is ours, and it ends with its object") {
    const TempFolder folder;
    const LoadReading before = read_load();
    pid_t pid = 0;
    {
        ChildProcess child({"/bin/sh", "-c",
                            "read a; echo got $a; echo $$; echo words >&2; i=0; "
                            "while [ $i -lt 200000 ]; do i=$((i+1)); done; echo done; sleep 60"},
                           folder / "log");
        child.send("it");
        CHECK(child.read_line(nullptr) == "got it");
        pid = std::stoi(child.read_line(nullptr).value_or("0"));
        CHECK(child.read_line(nullptr) == "done");
        CHECK(child.last_words() == "words");
        CHECK(read_load().own > before.own);
        volatile bool stop = true;
        CHECK_FALSE(child.read_line(&stop));
    }
    {
        // What this program ignores, programs that it starts do not.
        const auto before_it = ::signal(SIGPIPE, SIG_IGN);
        ChildProcess writer({"/bin/sh", "-c", "(while :; do echo y; done; echo stuck) 2>&1 | head -n 1"},
                            folder / "log");
        CHECK(writer.read_line(nullptr) == "y");
        CHECK(writer.wait(nullptr) == 0);
        ::signal(SIGPIPE, before_it);
    }
    REQUIRE(pid > 0);
    CHECK(::kill(pid, 0) != 0);
    ChildProcess failing({"/no/such/program"}, folder / "log");
    CHECK(failing.wait(nullptr) == 127);
    CHECK(parse_stat_seconds("12 (a) b) S 1 1 1 0 -1 0 0 0 0 0 100 50 25 25 20 0", 100) == Approx(2));
}
