// libs: ambilux_session
// timeout: 60
// Several ranks render one image: its bits do not depend on who adds which films up.
#include "core/error.h"
#include "core/flag.h"
#include "session/parallel/collector.h"
#include "session/parallel/parallel_render.h"
#include "session/parallel/wire.h"
#include "tests/support/render_scene.h"
#include "tests/support/thread_ranks.h"

using namespace ambilux;

namespace {

bool same(const FilmMoments& a, const FilmMoments& b) {
    return a.width == b.width && a.height == b.height && a.samples == b.samples && a.sum == b.sum &&
           a.sum_squares == b.sum_squares;
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
    size_t reused_by_first = 0, reused_by_others = 0;
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
            CHECK((result.stats.device.find(host_name() + ": ") != std::string::npos) == (ranks > 1));
            uint64_t samples = 0, parts = 0;
            for (size_t i = 0; i < result.workers.size(); ++i) {
                const WorkerShare& w = result.workers[i];
                CHECK(w.rank == int(i));
                CHECK(w.host == host_name());
                CHECK(w.device.starts_with("CPU, "));
                CHECK((w.seconds > 0) == (w.ranges > 0));
                CHECK(w.samples <= 3 * w.ranges);
                samples += w.samples;
                parts += w.ranges;
            }
            CHECK(samples == 200);
            CHECK(parts == 67);
            CHECK(result.ranges.size == 3);
            CHECK(result.ranges.samples == 200);
            CHECK(result.position.samples == 200);
            CHECK_FALSE(result.position.interrupted);
            CHECK(result.stats.render_seconds >= result.position.seconds);
            CHECK(result.merge_seconds > 0);
            CHECK((result.receive_seconds > 0) == (ranks > 1));
            CHECK(result.merge_seconds + result.receive_seconds <= result.position.seconds);
            size_t others = 0;
            for (int rank = 1; rank < ranks; ++rank) others += all.films(rank);
            if (block_nodes == 1) CHECK(others == 0);
            if (block_nodes > 1 && ranks > 1) CHECK(others > 0);
            for (int rank = 0; rank < ranks; ++rank)
                (rank == 0 ? reused_by_first : reused_by_others) += all.reused(rank);
        }
    }
    // Once a film has been added to another one, the next one comes into its memory.
    CHECK(reused_by_first > 0);
    CHECK(reused_by_others > 0);
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
    CHECK(collector_of({2, 5}, {1, 10}, 2) == 1);
    CHECK(collector_of({2, 0}, {1, 1}, 7) == 1);
    CHECK(collector_of({2, 5}, {1, 11}, 7) == 6);
    CHECK(collector_of({2, 6}, {1, 12}, 7) == 1);
}

namespace {

/// What one rank tells itself.
Told told_back(const std::function<void(Ranks&)>& say) {
    test::ThreadRanks one(1);
    std::optional<Told> told;
    one.run([&](Ranks& ranks) {
        say(ranks);
        told = hear(ranks);
        CHECK_FALSE(hear(ranks).has_value());
    });
    REQUIRE(told.has_value());
    return std::move(*told);
}

std::string refusal_of(const RankMessage& message) {
    test::ThreadRanks one(1);
    std::string refusal = "none";
    one.run([&](Ranks& ranks) {
        std::vector<std::span<const double>> arrays(message.arrays.begin(), message.arrays.end());
        ranks.send(0, message.kind, message.bytes, arrays);
        try {
            hear(ranks);
        } catch (const Error& error) {
            CHECK(error.code == ExitCode::device);
            refusal = error.what();
        }
    });
    return refusal;
}

constexpr const char* kCutOff = "a message of another rank is cut off";

}  // namespace

TEST_CASE("what a rank tells is heard whole: text, film and states, or any of them alone") {
    const FilmMoments film = {2, 1, 5, {1, 2, 3, 4, 5, 6}, {7, 8, 9, 10, 11, 12}};
    const std::vector<RangeState> states = {{1, 7, {std::byte(1), std::byte(2), std::byte(3)}}, {0, 9, {}}};
    const auto check_states = [&](const std::vector<RangeState>& heard) {
        REQUIRE(heard.size() == 2);
        for (size_t i = 0; i < 2; ++i) {
            CHECK(heard[i].device == states[i].device);
            CHECK(heard[i].range == states[i].range);
            CHECK(heard[i].state == states[i].state);
        }
    };
    Told told = told_back([&](Ranks& r) { tell(r, 0, Say::finished, {{"a", 1}}, &film, states); });
    CHECK(told.from == 0);
    CHECK(told.kind == Say::finished);
    CHECK(told.text == nlohmann::json({{"a", 1}}));
    CHECK(told.film.width == 2);
    CHECK(told.film.height == 1);
    CHECK(same(told.film, film));
    check_states(told.states);
    told = told_back([&](Ranks& r) { tell(r, 0, Say::states, {}, nullptr, states); });
    CHECK(told.text.is_null());
    CHECK(told.film.width == 0);
    CHECK(told.film.height == 0);
    CHECK(told.film.samples == 0);
    CHECK(told.film.sum.empty());
    check_states(told.states);
    told = told_back([](Ranks& r) { tell(r, 0, Say::wanted, {{"ranges", 3}}); });
    CHECK(told.kind == Say::wanted);
    CHECK(told.states.empty());

    Finished finished;
    finished.order.node = {1, 6};
    finished.order.block = {3, 1};
    finished.film = film;
    told = told_back([&](Ranks& r) { tell_part(r, finished); });
    CHECK(told.kind == Say::part);
    CHECK(read_node(told.text.at("node")) == RangeNode{1, 6});
    CHECK(read_node(told.text.at("block")) == RangeNode{3, 1});
    CHECK(same(told.film, film));
}

TEST_CASE("a message that is cut off anywhere is refused, and so is a film of another size") {
    const FilmMoments film = {2, 1, 5, {1, 2, 3, 4, 5, 6}, {7, 8, 9, 10, 11, 12}};
    const std::vector<RangeState> states = {{1, 7, {std::byte(1), std::byte(2), std::byte(3)}}, {0, 9, {}}};
    test::ThreadRanks one(1);
    RankMessage whole, with_film;
    one.run([&](Ranks& r) {
        tell(r, 0, Say::states, {{"a", 1}}, nullptr, states);
        tell(r, 0, Say::finished, {}, &film);
        whole = r.poll().value();
        with_film = r.poll().value();
    });
    CHECK(refusal_of(whole) == "none");
    const size_t head = 32 + nlohmann::json({{"a", 1}}).dump().size(), first = head + 24 + 3;
    REQUIRE(whole.bytes.size() == first + 24);
    for (size_t length = 0; length < whole.bytes.size(); ++length) {
        CAPTURE(length);
        RankMessage part = whole;
        part.bytes.resize(length);
        CHECK(refusal_of(part) == (length == head || length == first ? "none" : kCutOff));  // fewer states
    }
    CHECK(refusal_of(with_film) == "none");
    for (const int change : {0, 1, 2, 3}) {
        CAPTURE(change);
        RankMessage other = with_film;
        if (change == 0) other.arrays[0].pop_back();
        if (change == 1) other.arrays[1].pop_back();
        if (change == 2) other.arrays.pop_back();
        if (change == 3) other.arrays.push_back(other.arrays[0]);
        CHECK(refusal_of(other) == kCutOff);
    }
}

TEST_CASE("orders and work come back with every field") {
    const Order order = {{3, 200}, {2, 5}, 1.25, 0, {4, 1}, 6};
    for (const bool last : {false, true}) {
        const nlohmann::json text = nlohmann::json::parse(order_text(order, last).dump());
        CHECK(text.at("last") == last);
        const Order back = read_order(text);
        CHECK(back.ranges.size == 3);
        CHECK(back.ranges.samples == 200);
        CHECK(back.node == RangeNode{2, 5});
        CHECK(back.seconds_left == 1.25);
        CHECK(back.trial_seconds == 0);
        CHECK(back.block == RangeNode{4, 1});
        CHECK(back.collector == 6);
    }
    std::vector<DeviceWork> work(2);
    work[0] = {30, 4, 0.5, {}};
    work[1] = {60, 7, 0.75, {}};
    work[1].stats.device = "H100";
    work[1].stats.rays_extend = 9;
    const std::vector<DeviceWork> back = restore_work(nlohmann::json::parse(work_text(work).dump()));
    REQUIRE(back.size() == 2);
    for (size_t i = 0; i < 2; ++i) {
        CHECK(back[i].samples == work[i].samples);
        CHECK(back[i].ranges == work[i].ranges);
        CHECK(back[i].seconds == work[i].seconds);
        CHECK(back[i].stats.device == work[i].stats.device);
        CHECK(back[i].stats.rays_extend == work[i].stats.rays_extend);
    }
}

TEST_CASE("memory of a film is its arrays, the one of the next film, and none of one that is empty") {
    const Arrays memory = memory_of({1, 1, 1, {1, 2, 3}, {4, 5, 6}});
    REQUIRE(memory.size() == 2);
    CHECK(memory[0] == std::vector<double>{1, 2, 3});
    CHECK(memory[1] == std::vector<double>{4, 5, 6});
    CHECK(memory_of({}).empty());
    Collector collector;
    CHECK(collector.add({1, 0}, {0, 0}, filled(1)).empty());
    CHECK(collector.take_spare().sum.empty());
    CHECK(collector.add({1, 0}, {0, 1}, filled(2)).size() == 1);
    CHECK(collector.take_spare().sum.size() == 3);
    CHECK(collector.take_spare().sum.empty());
}
