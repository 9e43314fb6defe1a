// libs: ambilux_film
// timeout: 300
// The built program, as a person or a script meets it: wrong use, bad input, and scenes that are looked at and
// converted.
#include <filesystem>
#include <fstream>

#include "tests/support/program.h"

using namespace ambilux;
using namespace ambilux::test;
namespace fs = std::filesystem;
using nlohmann::json;

TEST_CASE("wrong use ends with code 2 and says what is right") {
    const test::TempFolder folder;
    struct Case {
        std::vector<std::string> arguments;
        std::string message;
    };
    const std::vector<Case> cases = {
        {{"frobnicate"}, "unknown command 'frobnicate': render, info"},
        {{"stress"}, "a sweep needs -o FOLDER"},
        {{"stress", "--backend", "abacus", "-o", folder / "s"}, "abacus"},
        {{"stress", "--time", "-1", "-o", folder / "s"}, "more than zero seconds"},
        {{"stress", "--family", "dragons", "-o", folder / "s"}, "--family dragons: known are emission-scale"},
        {{"convert", kCornell, folder / "x.pbrt"}, "names end in .xml"},
        {{"convert", kCornell}, "OUT is required"},
        {{"render", kCornell}, "--output is required"},
        {{"render", "-o", "x.exr"}, "SCENE is required"},
        {render(folder, {"--frob"}), "--frob"},
        {render(folder, {"--spp", "many"}), "error: --spp: 'many' is no integer of this option"},
        {render(folder, {"--seed", "18446744073709551616"}), "--seed: '18446744073709551616' is no integer"},
        {{"stress", "--seed", "-1", "-o", folder / "s"}, "--seed: it must not be negative"},
        {{"render", kCornell, "-o", "-"}, "-o -: give a name"},
        {render(folder, {"--png", folder / "a.jpg"}), "no .jpg; name it .png"},
        {render(folder, {}, "a.png"), "name it .exr, and ask for a PNG with --png"},
        {render(folder, {"--range-size", "0"}), "at least one sample"},
        {render(folder, {"--spp", "0"}), "at least one sample"},
        {render(folder, {"--spp", "1", "--time", "1"}), "exclude each other"},
        {render(folder, {"--time", "-1"}), "more than zero seconds"},
        {render(folder, {"--exposure", "1"}), "--png"},
        {{"render", kCornell, "-o", folder / "a.exr", "--size", "12"}, "WIDTHxHEIGHT"},
        {{"render", kCornell, "-o", folder / "a.exr", "--size", "12x"}, "WIDTHxHEIGHT"},
        {{"render", kCornell, "-o", folder / "a.exr", "--size", "0x5"}, "WIDTHxHEIGHT"},
        {{"render", kCornell, "-o", folder / "a.exr", "--size", "5x5x5"}, "WIDTHxHEIGHT"},
        {render(folder, {"-D", "novalue"}), "-D NAME=VALUE"},
        {render(folder, {"--set", "rr_depth"}), "--set NAME=VALUE"},
        {render(folder, {"--set", "no_such_key=1"}), "no_such_key"},
        {render(folder, {"--set", "estimator=best"}), "best"},
        {render(folder, {"-i", "magic"}), "magic"},
        {render(folder, {"--backend", "abacus"}), "abacus"},
        {render(folder, {"--light-picking", "random"}), "power, uniform and tree"},
        {{"reference", kCornell, "-o", folder / "r.exr", "--spp", "1"}, "at least 2 samples"},
        {{"reference", kCornell, "-o", folder / "r.exr", "--spp", "4", "--set", "estimator=nee"}, "estimator mis"},
        {{"reference", kCornell, "-o", folder / "r.exr", "--spp", "4", "-i", "path"}, "-i"},
        {{"bench", "rays", kCornell, "--repetitions", "0"}, "at least 1"},
        {{"bench", "queues", kCornell, "--repetitions", "0"}, "at least 1"},
        {{"bench", "frames", kCornell, "--frames", "0"}, "at least 1"},
        {{"bench", "frames", kCornell, "--memory", "4X"}, "512M or 4G"},
        {{"bench", "queues", kCornell, "--items", "many"}, "--items"},
        {{"bench", "queues", kCornell, "--items", "-1"}, "--items"},
        {{"bench", "queues", kCornell, "--items", "300000000"}, "at most"},
        {{"bench", "queues", kCornell, "--backend", "abacus"}, "auto, cpu, cuda"},
        {{"bench", "queues"}, "SCENE is required. See ambilux bench queues --help"},
        {{"bench", "cues", kCornell}, "one of these is needed: rays, queues, frames, stages"},
        {{"reference", kCornell, "-o", folder / "r.png", "--spp", "4"}, "name it .exr"},
        {{"trace", kCornell, "--pixel", "1,2"}, "--sample is required"},
        {{"trace", kCornell, "--sample", "0"}, "--pixel X,Y or --light-subpath N"},
        {{"trace", kCornell, "--sample", "0", "--light-subpath", "3", "--compare"}, "--compare: --pixel"},
        {{"trace", kCornell, "--sample", "0", "--pixel", "1"}, "write it as X,Y"},
        {{"trace", kCornell, "--sample", "0", "--pixel", "24,1", "--size", "24x16"}, "24x16 pixels"},
        {{"trace", kCornell, "--sample", "0", "--pixel", "1,2", "--strategy", "s1"}, "s1t3"},
        {{"trace", kCornell, "--sample", "0", "--light-subpath", "3"}, "has no light subpaths"},
        {{"trace", kCornell, "--sample", "0", "--light-subpath", "99999999", "-i", "light"}, "below 65536"},
        {{"trace", kCornell, "--sample", "0", "--pixel", "1,2", "-i", "toy"}, "there is no replay"},
        {render(folder, {"-i", "toy", "--outliers", "1"}), "there is no replay"},
        {render(folder, {"-i", "vcm", "--set", "merge_samples=2", "--spp", "2", "--outliers", "1"}), "merge_samples=1"},
        {{"trace", kCornell, "--sample", "0", "--pixel", "1,2", "-i", "bdpt", "--set", "bdpt.auto=true"}, "printed"},
    };
    for (const Case& c : cases) {
        const Outcome o = run(folder, c.arguments);
        std::string line;
        for (const std::string& a : c.arguments) line += a + " ";
        CAPTURE(line, o.err);
        CHECK(o.code == 2);
        CHECK(contains(o.out + o.err, c.message));
        CHECK_FALSE(fs::exists(folder.path / "a.exr"));
    }
    const Outcome help = run(folder, {});
    CHECK(help.code == 2);
    CHECK(contains(help.out, "experiment"));
    CHECK(run(folder, {"render", "--help"}).code == 0);
    CHECK(run(folder, {"help", "render"}).out == run(folder, {"render", "--help"}).out);
    CHECK(contains(run(folder, {"help"}).out, "stress"));
    CHECK(contains(run(folder, {"help", "rnder"}).err, "there is no command 'rnder'"));
    CHECK(run(folder, {"help", "bench", "rays"}).out == run(folder, {"bench", "rays", "--help"}).out);
    CHECK(contains(help.out, "Usage: ambilux [OPTIONS] SUBCOMMAND"));
    CHECK(contains(run(folder, {"--version"}).out, "ambilux "));
}

TEST_CASE("bad input ends with code 3, what cannot be written with code 4, before any work") {
    const test::TempFolder folder;
    Outcome o = run(folder, {"render", folder / "none.xml", "-o", folder / "a.exr"});
    CHECK(o.code == 3);
    CHECK(contains(o.err, "none.xml"));
    std::ofstream(folder / "bad.xml")
        << "<scene version=\"3.0.0\">\n  <sensor type=\"perspective\"/>\n  <shape type=\"teapot\"/>\n</scene>\n";
    o = run(folder, {"render", folder / "bad.xml", "-o", folder / "a.exr"});
    CHECK(o.code == 3);
    CHECK(contains(o.err, "bad.xml:3: "));
    CHECK(contains(o.err, "teapot"));
    o = run(folder, render(folder, {"-D", "nothing=1"}));
    CHECK(o.code == 3);
    CHECK(contains(o.err, "nothing"));
    std::ofstream(folder / "text.exr") << "text";
    o = run(folder, {"compare", folder / "text.exr", folder / "text.exr"});
    CHECK(o.code == 3);
    CHECK(contains(o.err, "text.exr"));

    for (const char* option : {"--png", "--json"}) {
        o = run(folder, render(folder, {option, folder / "text.exr/x"}));
        CHECK(o.code == 4);
        CHECK(contains(o.err, "cannot make the folder"));
        CHECK_FALSE(fs::exists(folder.path / "a.exr"));
    }
    CHECK(run(folder, render(folder, {}, "text.exr/a.exr")).code == 4);
    CHECK(run(folder, render(folder, {}, ".")).code == 4);
}

TEST_CASE("what an image says of its bias is told by render and by compare") {
    const test::TempFolder folder;
    for (const char* integrator : {"pm", "path"}) {
        INFO(integrator);
        const bool biased = std::string(integrator) == "pm";
        const std::string says = "biased by a radius of";
        Outcome o = run(folder, render(folder, {"-i", integrator}));
        REQUIRE(o.code == 0);
        CHECK(contains(o.err + o.out, says) == biased);
        o = run(folder, {"compare", folder / "a.exr", folder / "a.exr"});
        REQUIRE(o.code == 0);
        CHECK(contains(o.out, "the image says: " + says) == biased);
    }
}

TEST_CASE("scenes of all formats are converted, and the result renders") {
    const test::TempFolder folder;
    const std::string pbrt = folder.write(
        "a.pbrt",
        "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8 LookAt 0 0 -5 0 0 0 0 1 0 Camera "
        "\"perspective\" WorldBegin LightSource \"infinite\" Shape \"sphere\" Shape \"trianglemesh\" \"point3 P\" "
        "[0 0 3 1 0 3 0 1 3] \"integer indices\" [0 1 2]");
    for (const std::string& scene : {kCornell, pbrt}) {
        const std::string out = folder / "new/out.xml";
        const Outcome converted = run(folder, {"convert", scene, out});
        INFO(converted.err);
        REQUIRE(converted.code == 0);
        CHECK(run(folder, {"render", out, "-o", folder / "x.exr", "--size", "8x6", "--spp", "1", "--backend", "cpu"})
                  .code == 0);
        CHECK(run(folder, {"convert", out, out}).code == 2);
    }
    const Outcome broken = run(folder, {"info", folder.write("b.pbrt", "WorldBegin\nShape \"torus\"")});
    CHECK(broken.code == 3);
    CHECK(contains(broken.err, "b.pbrt:2: shape 'torus' is not supported"));
    CHECK(run(folder, {"info", folder.write("b.gltf", "{}")}).code == 3);
}

TEST_CASE("info tells what a scene has, and how long its parts took to load") {
    const test::TempFolder folder;
    const Outcome info = run(folder, {"info", kCornell, "--json", "-"});
    REQUIRE(info.code == 0);
    const json j = json::parse(info.out);
    CHECK(j["kernels"]["features"].is_array());
    CHECK(j["kernels"]["skipped"].is_array());
    // Loading by its parts, and the tree apart from them.
    const json seconds = j["seconds"];
    double parts = 0;
    for (const char* part : {"read", "place", "finish"}) {
        CHECK(seconds[part].get<double>() >= 0);
        parts += seconds[part].get<double>();
    }
    CHECK(parts > 0);
    CHECK(parts <= seconds["load"].get<double>());
    CHECK(seconds["build"].get<double>() > 0);
    CHECK(contains(run(folder, {"info", kCornell}).out, "kernels:"));
}

TEST_CASE("devices says which devices there are, or what is missing") {
    const test::TempFolder folder;
    const Outcome text = run(folder, {"devices"}), version = run(folder, {"--version"});
    CHECK(text.code == 0);
    CHECK(text.out.starts_with("CUDA"));
    CHECK(version.out.ends_with(text.out));
    const json j = json::parse(run(folder, {"devices", "--json", "-"}).out);
    for (const char* name : {"toolkit", "kernels", "driver", "driver_cuda", "graphs", "optix", "problem", "devices"})
        CHECK(j.contains(name));
    // Either a device, or a reason; of each device kernels, or a reason.
    CHECK(j["devices"].empty() == !j["problem"].get<std::string>().empty());
    for (const auto& d : j["devices"]) CHECK((d["kernels"] == "none") <= !d["problem"].get<std::string>().empty());
}
