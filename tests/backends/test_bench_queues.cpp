// libs: ambilux_backends ambilux_formats ambilux_accel ambilux_core
// What `bench queues` pushes, how it finds out whether that came back, and what it reports on the CPU.
#include <cmath>
#include <functional>
#include <set>
#include <type_traits>
#include <utility>

#include "backends/bench_queue_stages.h"
#include "backends/bench_queues.h"
#include "backends/cuda_device.h"
#include "formats/load.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

Scene cornell() { return load_mitsuba(std::string(AMBILUX_SOURCE_DIR) + "/scenes/cornell.xml"); }

bool throws(ExitCode code, const std::string& text, const std::function<void()>& f) {
    try {
        f();
    } catch (const Error& error) {
        return error.code == code && std::string(error.what()).find(text) != std::string::npos;
    }
    return false;
}

}  // namespace

TEST_CASE("items that are pushed know their paths, and sums tell them from each other and from what is not whole") {
    for_pushed_items([]<class Item>(const char* name, std::type_identity<Item>) {
        INFO(name);
        constexpr uint32_t n = 10000;
        std::set<uint32_t> sums;
        uint32_t wrong = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const Item item = made_item<Item>(i);
            wrong += path_of(item) != i;
            sums.insert(item_sum(item));
            uint32_t words[sizeof(Item) / 4];
            memcpy(words, &item, sizeof(Item));
            std::swap(words[i % 4], words[(i + 1) % 4]);
            Item swapped;
            memcpy(&swapped, words, sizeof(Item));
            wrong += item_sum(swapped) == item_sum(item);
        }
        CHECK(wrong == 0);
        CHECK(sums.size() > n - 5);  // of 2^32 that there can be
    });
}

TEST_CASE("the share of threads that push is what it is said to be, and differs from warp to warp") {
    constexpr uint32_t n = 1u << 18;
    for (const uint32_t one_in : kPushShares) {
        INFO("1 of " << one_in);
        uint32_t count = 0;
        std::set<uint32_t> warps;
        for (uint32_t first = 0; first < n; first += 32) {
            uint32_t mask = 0;
            for (uint32_t lane = 0; lane < 32; ++lane) mask |= uint32_t(pushes(first + lane, one_in)) << lane;
            count += uint32_t(__builtin_popcount(mask));
            warps.insert(mask);
        }
        const double p = 1.0 / one_in;
        CHECK(std::fabs(count - n * p) <= 5 * std::sqrt(n * p * (1 - p)));
        if (one_in == 1)
            CHECK(warps.size() == 1);
        else
            CHECK(warps.size() > n / 32 / 4);
        CHECK(pushed_contents<PairItem>(n, one_in).items == count);
    }
}

TEST_CASE("what does not come back is an error") {
    check_contents("PairItem", {3, 7}, {3, 7});
    CHECK(throws(ExitCode::device, "of PairItem 3 items were pushed and 2 came back",
                 [] { check_contents("PairItem", {2, 7}, {3, 7}); }));
    CHECK(
        throws(ExitCode::device, "3 came back, but not the same", [] { check_contents("PairItem", {3, 8}, {3, 7}); }));
}

TEST_CASE("bench queues reports complete rows on the CPU") {
    const nlohmann::json json = bench_queues(cornell(), "cpu", 5000, 2);
    CHECK(json.at("backend") == "cpu");
    CHECK_FALSE(json.at("device").get<std::string>().empty());
    CHECK(json.at("items") == 5120);  // ten queues
    CHECK(json.at("repetitions") == 2);
    const nlohmann::json& rows = json.at("rows");
    // Four items with three compactions and one with one, pushed and drained for four shares; hits and rays in two
    // orders.
    REQUIRE(rows.size() == (4 * 3 + 1) * 4 * 2 + 4);
    for (size_t i = 0; i < rows.size(); ++i) {
        const nlohmann::json& row = rows[i];
        INFO(row.dump());
        CHECK(row.size() == 11);
        const std::string operation = row.at("operation"), compaction = row.at("compaction");
        const uint64_t items = row.at("items"), looked = row.at("looked"), bytes = row.at("bytes");
        const double ns = double(row.at("ns_per_item")) * double(items);
        CHECK(ns > 0);
        CHECK(double(row.at("ns_per_look")) * double(looked) == Approx(ns));
        CHECK(double(row.at("gb_per_s")) == Approx(double(bytes * items) / ns));
        if (i + 4 < rows.size()) {
            CHECK(operation == (i % 2 == 0 ? "push" : "drain"));
            CHECK(row.at("order") == "none");
            CHECK(items ==
                  10 * pushed_contents<PairItem>(512, uint32_t(std::lround(1 / double(row.at("share"))))).items);
            CHECK(looked == (operation == "push" || compaction != "atomic" ? 5120 : items));
        } else {
            CHECK(operation == "drain");
            CHECK(row.at("item") == (i + 2 < rows.size() ? "PathHit" : "PathRay"));
            CHECK(row.at("order") == (i % 2 == 0 ? "none" : i + 2 < rows.size() ? "material" : "morton"));
            CHECK(items <= 5120);
            CHECK(items > 4000);  // of a closed box, as the camera sees it
        }
    }
}

TEST_CASE("bench queues of a scene without surfaces has hits of nothing and no rays") {
    const nlohmann::json rows = bench_queues(Scene{}, "cpu", 1, 1).at("rows");
    REQUIRE(rows.size() > 4);
    CHECK(rows[rows.size() - 4].at("items") == 512);
    CHECK(rows[rows.size() - 1].at("items") == 0);
    CHECK(rows[rows.size() - 1].at("ns_per_item") == 0.0);
}

TEST_CASE("bench queues refuses what it does not know") {
    const Scene scene;
    CHECK(throws(ExitCode::usage, "'vulkan' is not one of auto, cpu, cuda",
                 [&] { bench_queues(scene, "vulkan", 0, 1); }));
    CHECK(throws(ExitCode::usage, "at least 1 repetition", [&] { bench_queues(scene, "cpu", 0, 0); }));
    CHECK(throws(ExitCode::usage, "at most 268435456 items", [&] { bench_queues(scene, "cpu", (1u << 28) + 1, 1); }));
    if (!cuda_device_present())
        CHECK(throws(ExitCode::device, "--backend cuda: " + why_no_cuda_device(),
                     [&] { bench_queues(scene, "cuda", 0, 1); }));
}
