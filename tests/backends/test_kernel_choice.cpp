// libs: ambilux_backends
#include "backends/kernel_choice.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("a list of architectures is read as CMake reads it") {
    const BuiltFor built = built_for("80-real,90-real,120-real,80-virtual");
    CHECK(built.machine_code == std::vector<int>{80, 90, 120});
    CHECK(built.ptx == std::vector<int>{80});
    CHECK(built_text(built) == "machine code of 8.0, 9.0, 12.0 and PTX of 8.0");
    CHECK(built_for("90").machine_code == std::vector<int>{90});
    CHECK(built_for("90").ptx == std::vector<int>{90});
    CHECK(built_for("90a-real").machine_code == std::vector<int>{90});
    CHECK(built_text(built_for("90-real")) == "machine code of 9.0 and PTX of none");
    CHECK(built_text(built_for("all-major,")) == "none");
}

TEST_CASE("a device gets the newest machine code of its major number, and PTX where there is none") {
    const BuiltFor built = built_for("80-real,86-real,90-real,120-real,80-virtual,90-virtual");
    struct Case {
        int capability;
        KernelChoice chosen;
    };
    for (const auto& [capability, chosen] : std::vector<Case>{{75, {}},
                                                              {80, {KernelKind::machine_code, 80}},
                                                              {86, {KernelKind::machine_code, 86}},
                                                              {89, {KernelKind::machine_code, 86}},
                                                              {90, {KernelKind::machine_code, 90}},
                                                              {100, {KernelKind::ptx, 90}},
                                                              {103, {KernelKind::ptx, 90}},
                                                              {120, {KernelKind::machine_code, 120}},
                                                              {121, {KernelKind::machine_code, 120}}}) {
        INFO(capability);
        CHECK(kernels_for(capability, built, false) == chosen);
    }
}

TEST_CASE("PTX is taken by force, and a build without it has none then") {
    CHECK(kernels_for(90, built_for("80-real,90-real,80-virtual"), true) == KernelChoice{KernelKind::ptx, 80});
    CHECK(kernels_for(90, built_for("90-real"), true) == KernelChoice{});
    CHECK(kernels_text(kernels_for(86, built_for("80-virtual"), false)) == "PTX of 8.0");
    CHECK(kernels_text({}) == "none");
    CHECK(capability_text(121) == "12.1");
}
