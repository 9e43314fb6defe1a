// libs: ambilux_core
// timeout: 900
// labels: stress
// seconds: 40
// `ambilux stress --quick`, by methods that differ most (with AMBILUX_LONG=1 by all): no cell is wrong, but where
// docs/numerics.md says so.
#include <cstdlib>

#include "core/atomic_file.h"
#include "tests/support/catch.h"
#include "tests/support/long_run.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;

TEST_CASE("no cell of the quick stress sweep is wrong") {
    const test::TempFolder folder;
    const std::string out = folder / "report.txt";
    std::string command = AMBILUX_PROGRAM " stress --quick --backend cpu";
    if (!is_long_run())
        for (const char* method : {"path-mis", "light", "bdpt-power", "lvc"})
            command += std::string(" --method ") + method;
    command += " -o " + (folder / "sweep") + " >" + out;
    const int status = std::system(command.c_str());
    INFO(read_file(out));
    CHECK(status == 0);
}
