// libs: ambilux_session
// timeout: 60
// Several ranks render one image: its bits do not depend on who adds which films up.
#include "core/flag.h"
#include "session/parallel/collector.h"
#include "session/parallel/parallel_render.h"
#include "tests/support/render_scene.h"
#include "tests/support/thread_ranks.h"

using namespace ambilux;

namespace {

bool same(const FilmMoments& a, const FilmMoments& b) {
    return a.samples == b.samples && a.sum == b.sum && a.sum_squares == b.sum_squares;
}

ParallelRequest request_for(const Scene& scene, const test::TempFolder& folder, unsigned block_nodes) {
    ParallelRequest request;
    request.settings = cpu_settings(scene, Estimator::mis);
    apply_setting(request.settings, "integrator", "bdpt");
    request.budget = {200, 0};
    request.range_size = 3;
    request.block_nodes = block_nodes;
    request.state_path = folder / "state";
    return request;
}

ParallelResult render(const Scene& scene, const ParallelRequest& request, test::ThreadRanks& all) {
    ParallelResult result;
    all.run([&](Ranks& ranks) {
        if (ranks.rank() == 0)
            result = render_parallel(scene, request, ranks);
        else
            serve_parallel(scene, request, ranks);
    });
    return result;
}

FilmMoments filled(double value) { return {1, 1, 1, {value, value, value}, {1, 1, 1}}; }

}  // namespace

TEST_CASE("1, 2, 4 and 7 ranks make the same bits, whether the first one adds up all films or others help") {
    const Scene scene = project_scene("cornell", 16, 12);
    const test::TempFolder folder;
    std::optional<FilmMoments> expected;
    for (const int ranks : {1, 2, 4, 7}) {
        std::vector<size_t> films;
        for (const unsigned block_nodes : {1, 2, 4}) {
            CAPTURE(ranks, block_nodes);
            test::ThreadRanks all(ranks);
            const ParallelResult result = render(scene, request_for(scene, folder, block_nodes), all);
            if (!expected) expected = result.film;
            CHECK(same(result.film, *expected));
            CHECK(result.stats.samples == 200);
            CHECK(result.workers.size() == size_t(ranks));
            uint64_t samples = 0;
            for (const WorkerShare& w : result.workers) samples += w.samples;
            CHECK(samples == 200);
            size_t others = 0;
            for (int rank = 1; rank < ranks; ++rank) others += all.films(rank);
            if (block_nodes == 1) CHECK(others == 0);
            if (block_nodes > 1 && ranks > 1) CHECK(others > 0);
        }
    }
}

TEST_CASE("with a budget in seconds blocks that are not whole are handed over at the end") {
    const Scene scene = project_scene("cornell", 16, 12);
    const test::TempFolder folder;
    ParallelRequest request = request_for(scene, folder, 4);
    request.budget = {0, 0.5};
    request.range_size = 0;
    test::ThreadRanks all(7);
    const ParallelResult result = render(scene, request, all);
    CHECK(result.film.samples > 7 * result.ranges.size);
    uint64_t samples = 0;
    for (const WorkerShare& w : result.workers) samples += w.samples;
    CHECK(samples == result.film.samples);  // none was lost on its way
}

TEST_CASE("7 ranks go on from a state of 4 that were interrupted, to the same bits") {
    const Scene scene = project_scene("cornell", 16, 12);
    const test::TempFolder folder;
    test::ThreadRanks one(1), four(4), seven(7);
    const FilmMoments expected = render(scene, request_for(scene, folder, 1), one).film;
    volatile bool interrupt = false;
    ParallelRequest request = request_for(scene, folder, 2);
    request.interrupt = &interrupt;
    request.checkpoint_seconds = 1e-3;  // collectors hand over at once what they have
    request.on_progress = [&](const RenderPosition& p, const RenderStats&) {
        if (p.samples > 40) set_flag(&interrupt);
    };
    const ParallelResult part = render(scene, request, four);
    REQUIRE(part.position.interrupted);
    REQUIRE(part.film.samples < 200);
    request = request_for(scene, folder, 2);
    request.resume = true;
    const ParallelResult whole = render(scene, request, seven);
    CHECK(same(whole.film, expected));
    CHECK(!std::filesystem::exists(folder / "state"));
}

TEST_CASE("a collector hands over whole blocks, what it has when asked, and at the end whatever comes") {
    Collector collector;
    const RangeNode block = {2, 3};  // ranges 12 to 15
    CHECK(collector.add(block, {0, 13}, filled(2)).empty());
    CHECK(collector.add(block, {1, 7}, filled(3)).empty());
    CHECK(collector.add({1, 9}, {0, 18}, filled(5)).empty());
    const auto whole = collector.add(block, {0, 12}, filled(1));
    REQUIRE(whole.size() == 1);
    CHECK(whole[0].node == block);
    CHECK(whole[0].film.samples == 3);
    CHECK(whole[0].film.sum[0] == 6);

    const auto early = collector.hand_over(false);
    REQUIRE(early.size() == 1);
    CHECK(early[0].node == RangeNode{0, 18});
    CHECK(collector.hand_over(false).empty());
    const auto rest = collector.add({1, 9}, {0, 19}, filled(7));
    REQUIRE(rest.size() == 1);
    CHECK(rest[0].node == RangeNode{0, 19});

    CHECK(collector.hand_over(true).empty());
    CHECK(collector.add({4, 2}, {1, 16}, filled(8)).size() == 1);
}

TEST_CASE("blocks go round the ranks but the first one; few ranks need none") {
    for (const int ranks : {1, 2, 8, 15}) CHECK(default_block_nodes(ranks) == 1);
    CHECK(default_block_nodes(16) == 4);
    CHECK(default_block_nodes(64) == 8);
    CHECK(default_block_nodes(512) == 16);
    CHECK(collector_of({2, 0}, {2, 0}, 7) == 0);
    CHECK(collector_of({2, 0}, {1, 0}, 1) == 0);
    CHECK(collector_of({2, 0}, {1, 1}, 7) == 1);
    CHECK(collector_of({2, 5}, {1, 11}, 7) == 6);
    CHECK(collector_of({2, 6}, {1, 12}, 7) == 1);
}
