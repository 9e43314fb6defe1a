// libs: ambilux_film
// timeout: 120
// What a render says of single samples, and the command trace, which replays them.
#include <cstdlib>
#include <sstream>

#include "core/atomic_file.h"
#include "tests/support/program.h"

using namespace ambilux;
using namespace ambilux::test;
using nlohmann::json;

TEST_CASE("Outliers come with a command that replays them") {
    const test::TempFolder folder;
    for (const std::vector<std::string>& method :
         {std::vector<std::string>{}, {"-i", "bdpt"}, {"-i", "bdpt", "--variant", "lvc"}, {"-i", "vcm"}}) {
        std::vector<std::string> more = {"--spp", "4",          "--backend", "cpu",   "--seed",
                                         "3",     "--outliers", "2",         "--set", "specialise=false"};
        more.insert(more.end(), method.begin(), method.end());
        const json stats = statistics(folder, more);
        REQUIRE(stats["outliers"].size() == 2);
        CHECK(stats["invalid_values"].empty());
        for (const json& o : stats["outliers"]) {
            std::istringstream words(o["command"].get<std::string>());
            std::vector<std::string> arguments;
            for (std::string word; words >> word;) arguments.push_back(word);
            CAPTURE(o["command"]);
            REQUIRE(arguments.at(0) == "ambilux");
            arguments.erase(arguments.begin());
            const Outcome text = run(folder, arguments);
            CHECK(text.code == 0);
            CHECK(contains(text.out, "found by the eye subpath"));
            arguments.insert(arguments.end(), {"--json", "-"});
            const Outcome replay = run(folder, arguments);
            REQUIRE(replay.code == 0);
            CHECK(json::parse(replay.out)["total"] == o["value"]);
        }
    }
    const Outcome light = run(folder, {"trace", kCornell, "--size", "24x16", "-i", "light", "--light-subpath", "7",
                                       "--sample", "1", "--strategy", "s2t1", "--json", "-"});
    REQUIRE(light.code == 0);
    const json replay = json::parse(light.out);
    for (const json& splat : replay["splats"]) CHECK(splat["s"] == 2);
}

TEST_CASE("A render that drops invalid values names the command that replays the first of each stage") {
    const test::TempFolder folder;
    // A name that a shell would take apart.
    const std::string scene = folder / "a lamp's.xml";
    write_file_atomic(scene,
                      "<scene version='3.0.0'><sensor type='perspective'><film type='hdrfilm'>"
                      "<integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>"
                      "<emitter type='point'><point name='position' x='0' y='0' z='1'/>"
                      "<rgb name='intensity' value='3e38'/></emitter><shape type='rectangle'>"
                      "<transform name='to_world'><scale value='9'/><rotate y='1' angle='180'/>"
                      "<translate z='1.1'/></transform></shape></scene>");
    const Outcome o = run(
        folder, {"render", scene, "--spp", "3", "--seed", "5", "-o", folder / "a.exr", "--json", folder / "a.json"});
    REQUIRE(o.code == 0);
    CHECK(contains(o.err, "stage connect dropped"));
    const json values = json::parse(read_file(folder / "a.json"))["invalid_values"];
    REQUIRE(values.size() == 1);
    CHECK(values[0]["stage"] == "connect");
    CHECK(values[0]["what"] == "Inf");
    CHECK(values[0]["found"]["strategy"] == "s1t2");
    const std::string command = values[0]["command"];
    CHECK(contains(o.err, command));
    CHECK(contains(command, "--seed 5"));
    // As a shell reads it.
    const std::string out = folder / "out.txt";
    const std::string line = std::string(AMBILUX_PROGRAM) + command.substr(std::string("ambilux").size());
    REQUIRE(std::system((line + " > '" + out + "'").c_str()) == 0);
    CHECK(contains(read_file(out), "invalid (Inf): dropped by stage connect"));

    const Outcome strict = run(folder, {"render", scene, "--spp", "1", "--strict", "-o", folder / "a.exr"});
    CHECK(strict.code == 4);
    CHECK(contains(strict.err, "ambilux trace"));
}
