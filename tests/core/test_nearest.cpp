#include "core/nearest.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("what may be meant by a name is what the field calls so, or what it nearly is") {
    const Names known = {"reflectance", "alpha", "int_ior", "seeds"};
    CHECK(nearest_name(known, "albedo") == "reflectance");
    CHECK(nearest_name(known, "roughness") == "alpha");
    CHECK(nearest_name(known, "eta") == "int_ior");
    CHECK(nearest_name(known, "seed") == "seeds");
    CHECK(nearest_name(known, "reflectnace") == "reflectance");
    CHECK(nearest_name(known, "thickness").empty());
    CHECK(suggestion(known, "albedo") == ": 'reflectance' is known");
    CHECK(suggestion_or_all(known, "seed") == ": is 'seeds' meant?");
    CHECK(suggestion_or_all({"a", "bcd"}, "thickness") == "; known are: a, bcd");
}
