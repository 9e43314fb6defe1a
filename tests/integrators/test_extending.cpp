// libs: ambilux_core
// docs/extending.md quotes files that are compiled and tested: what it shows is what they say.
#include <fmt/format.h>

#include <filesystem>
#include <sstream>

#include "core/atomic_file.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("code in docs/extending.md is that of the files that it names") {
    std::istringstream page(read_file(AMBILUX_SOURCE_DIR "/docs/extending.md"));
    const std::string head = "From `";
    std::string file, line;
    uint32_t quotes = 0;
    while (std::getline(page, line)) {
        if (line.starts_with(head)) file = line.substr(head.size(), line.find('`', head.size()) - head.size());
        if (line != "```cpp" && line != "```list") continue;
        std::string code;
        while (std::getline(page, line) && line != "```") code += line + "\n";
        INFO(file << " no longer has\n" << code);
        REQUIRE_FALSE(file.empty());
        CHECK(bool(read_file(AMBILUX_SOURCE_DIR "/" + file).find(code) != std::string::npos));
        file.clear();
        ++quotes;
    }
    CHECK(quotes >= 8);
}

TEST_CASE("files that docs/extending.md names are there") {
    const std::string page = read_file(AMBILUX_SOURCE_DIR "/docs/extending.md");
    for (const char* folder : {"integrators/", "transport/", "stages/", "queues/", "models/", "formats/", "film/",
                               "tests/", "backends/", "scene/", "cmake/", "render/"})
        for (size_t at = page.find(fmt::format("`{}", folder)); at != std::string::npos;
             at = page.find(fmt::format("`{}", folder), at + 1)) {
            const std::string name = page.substr(at + 1, page.find('`', at + 1) - at - 1);
            if (name.find("NAME") != std::string::npos || name.find(' ') != std::string::npos) continue;
            INFO(name);
            CHECK(std::filesystem::exists(AMBILUX_SOURCE_DIR "/" + name));
        }
}
