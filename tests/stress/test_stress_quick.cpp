// libs: ambilux_core
// timeout: 900
// labels: stress
// seconds: 75
// `ambilux stress --quick`, as CI runs it: no cell is wrong, but where docs/numerics.md says so.
#include <cstdlib>

#include "core/atomic_file.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;

TEST_CASE("no cell of the quick stress sweep is wrong") {
    const test::TempFolder folder;
    const std::string out = folder / "report.txt";
    const int status = std::system(
        (std::string(AMBILUX_PROGRAM) + " stress --quick --backend cpu -o " + (folder / "sweep") + " >" + out).c_str());
    INFO(read_file(out));
    CHECK(status == 0);
}
