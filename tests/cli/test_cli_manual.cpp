// libs: ambilux_film
// timeout: 60
// The manual page and the completion that the program prints, and folders of outputs.
#include <cstdlib>
#include <filesystem>

#include "core/atomic_file.h"
#include "tests/support/program.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// What bash offers for the last of `words`, by the script that the program prints.
std::string completed(const TempFolder& folder, const std::string& words, int last) {
    const std::string script = folder.write("completion", run(folder, {"help", "completion"}).out);
    const std::string command = "bash -c 'set -eu; source " + script + "; COMP_WORDS=(" + words +
                                "); COMP_CWORD=" + std::to_string(last) + "; _ambilux; echo \"${COMPREPLY[*]-}\"' >" +
                                (folder / "offered");
    REQUIRE(std::system(command.c_str()) == 0);
    std::string offered = read_file(folder / "offered");
    offered.pop_back();
    return offered;
}

}  // namespace

TEST_CASE("the manual page names every command and its options") {
    const TempFolder folder;
    const Outcome o = run(folder, {"help", "man"});
    REQUIRE(o.code == 0);
    for (const char* text :
         {".TH AMBILUX 1", "ambilux render SCENE", "ambilux bench rays SCENE", "ambilux help completion",
          "\\fB\\-o, \\-\\-output\\fR", "\\-\\-technique\\-images", "interrupted; what was finished is saved"})
        CHECK(contains(o.out, text));
    for (size_t i = 0, end; i < o.out.size(); i = end + 1) {
        end = o.out.find('\n', i);
        const std::string line = o.out.substr(i, end - i);
        INFO(line);
        // A line that begins with a dot or an apostrophe is a macro: only ours may.
        const bool text = !line.starts_with('.') && !line.starts_with('\'');
        CHECK((text || line.starts_with(".TH ") || line.starts_with(".S") || line == ".TP" || line == ".B ambilux"));
    }
}

TEST_CASE("the completion offers commands, options and, for all else, files") {
    const TempFolder folder;
    CHECK(completed(folder, "ambilux re", 1) == "render reference");
    CHECK(completed(folder, "ambilux bench r", 2) == "rays");
    CHECK(completed(folder, "ambilux bench rays --opa", 3) == "--opaque");
    CHECK(completed(folder, "ambilux render scene.xml --techn", 3) == "--technique-images");
    CHECK(completed(folder, "ambilux render sce", 2).empty());
}

TEST_CASE("folders of outputs are made") {
    const TempFolder folder;
    const Outcome o =
        run(folder, {"render", kCornell, "-o", folder / "new/out/x.exr", "--json", folder / "new/json/x.json", "--png",
                     folder / "new/png/x.png", "--size", "8x6", "--spp", "1", "--backend", "cpu"});
    INFO(o.err);
    CHECK(o.code == 0);
    for (const char* file : {"new/out/x.exr", "new/json/x.json", "new/png/x.png"})
        CHECK(std::filesystem::exists(folder / file));
}
