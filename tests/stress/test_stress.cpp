// libs: ambilux_stress
// timeout: 120
// The stress sweep: its answers, its judge, its rows, and that it goes on where it was stopped.
#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <set>
#include <thread>

#include "stress/answers.h"
#include "stress/elsewhere.h"
#include "stress/families.h"
#include "stress/folder.h"
#include "stress/runner.h"
#include "tests/support/experiment_fakes.h"

using namespace ambilux;
using namespace ambilux::stress;
using namespace ambilux::test;

namespace {

/// Batches of one box whose values are `mean` times (1 + spread·normal).
Batches batches(double mean, double spread, uint64_t seed = 1, uint32_t side = 1) {
    Batches b;
    b.boxes_x = b.boxes_y = side;
    for (uint32_t i = 0; i < 32 * side * side; ++i) {
        const Vec4f u = random_floats({seed, i, 0, Stream::eye}, 0);
        const double normal = std::sqrt(-2 * std::log(1 - double(u.x))) * std::cos(2 * M_PI * double(u.y));
        b.boxes.push_back(mean * (1 + spread * normal));
    }
    return b;
}

Verdict verdict(const Batches& b, const Answer& answer, double rows = 1000, RowState state = {}) {
    state.comparison = compare(b, {answer.value, 0, 0}, answer.uniform, answer.rounding);
    state.mean = stress::mean_of(b).value;
    return judge(state, rows);
}

/// A family of which the fake renderer knows the mean, 2, whatever the scene.
Family fake_family(const std::string& name, double answer) {
    Family family{name, "number", {}};
    for (const double v : {0.0, 1.0, 2.0}) {
        Cell cell{name, fmt::format("{:g}", v), v, {AnswerKind::closed_form, answer, true, "known"}, [] {
                      return SceneFiles{"<scene a>", {{"part.txt", "text"}}};
                  }};
        cell.benign = v == 0;
        cell.quick = v != 1;
        family.cells.push_back(cell);
    }
    return family;
}

Hooks stress_hooks(World& world) {
    return {fake_scene,
            [&world](const Scene& scene, const RenderSettings& settings) -> std::unique_ptr<Renderer> {
                if (settings.integrator == "light") throw Error(ExitCode::usage, "light: not here, and not there");
                return std::make_unique<FakeRenderer>(scene, settings, world);
            },
            apply_setting};
}

Request stress_request(const TempFolder& folder, const std::string& output, bool resume = false) {
    Request r;
    r.output = folder / output;
    r.backend = "cpu";
    r.quick = true;
    r.resume = resume;
    r.rows_at_once = 1;  // the fakes count in plain numbers
    return r;
}

/// Lines of stress.csv without the seconds.
std::vector<std::string> lines_of(const std::string& folder) {
    std::vector<std::string> lines;
    for (const std::string& line : read_results(folder + "/stress.csv", row_header().c_str())) {
        Row row = *parse_row(line);
        row.seconds = 0;
        lines.push_back(row_line(row));
    }
    return lines;
}

}  // namespace

TEST_CASE("closed forms of the stress scenes") {
    CHECK(geometric_sum(0.5, 4) == Approx(1.875));
    CHECK(integral([](double x) { return std::sin(x); }, 0, M_PI, 3) == Approx(2).epsilon(1e-12));
    // Two unit squares that face each other at distance 1 (Howell C-11).
    CHECK(4 * 0.25 * mean_rectangle_form_factor(0.5, 0.5, 0.5, 1) == Approx(0.199825).epsilon(1e-5));
    // A large lamp close by is all that the floor sees, and the sphere of directions has six equal faces.
    CHECK(rectangle_form_factor(0.1, 0.2, 1e4, 1e4, 1) == Approx(1).epsilon(1e-6));
    CHECK(square_solid_angle(1, 1) == Approx(4 * M_PI / 6).epsilon(1e-12));
    // A lamp as large as the sphere leaves the wall its own first reflection; without a limit of depth all comes back.
    CHECK(integrating_sphere(0.5, 1, 10) == Approx(0.5));
    CHECK(integrating_sphere(1, 0.1, 100000) == Approx(1).epsilon(1e-12));
    CHECK(furnace(0.5, 60) == Approx(2));
}

TEST_CASE("the judge finds a bias of a few errors of the corrected level, and no smaller one") {
    const Answer answer{AnswerKind::closed_form, 3, false, ""};
    // 32 batches of 1 %: an error of 0.18 %; of t with 31 degrees of freedom the corrected level is 9, and the skewness
    // that 32 batches happen to have may cost a factor of 4.
    for (uint64_t seed = 1; seed <= 200; ++seed) {
        CHECK(verdict(batches(3, 0.01, seed), answer) == Verdict::ok);
        CHECK(verdict(batches(3 * 1.1, 0.01, seed), answer) == Verdict::failed);
        CHECK(verdict(batches(3 * 0.9, 0.01, seed), answer) == Verdict::failed);
        CHECK(verdict(batches(3 * 1.007, 0.01, seed), answer) == Verdict::ok);
    }
}

TEST_CASE("the judge's level is that of the whole sweep") {
    // Of one test of level 0.1 in ten fails; corrected for as many, nearly none.
    int alone = 0;
    for (uint64_t seed = 1; seed <= 2000; ++seed) {
        const Comparison c = compare(batches(1, 0.01, seed), {1, 0, 0}, false, 0);
        alone += c.p < 0.1;
    }
    CHECK(std::abs(alone - 200) < 5 * std::sqrt(180.0));
    RowState edge;
    edge.mean = edge.comparison.events = 1e9;
    edge.comparison.z = 5;
    edge.comparison.p = 0.5 * kSignificance;
    CHECK(judge(edge, 1) == Verdict::failed);
    CHECK(judge(edge, 1000) == Verdict::ok);
}

TEST_CASE("one box that is off fails where all pixels have the same answer") {
    Batches b = batches(3, 0.001, 7, 4);
    for (size_t i = 5; i < b.boxes.size(); i += 16) b.boxes[i] *= 1.03;
    for (size_t i = 6; i < b.boxes.size(); i += 16) b.boxes[i] *= 0.97;
    CHECK(verdict(b, {AnswerKind::closed_form, 3, true, ""}) == Verdict::failed);
    CHECK(verdict(b, {AnswerKind::closed_form, 3, false, ""}) == Verdict::ok);
}

TEST_CASE("a box that has met none of the rare samples of the others is not judged") {
    const Answer answer{AnswerKind::closed_form, 3, true, ""};
    // All boxes have 2.997 for sure, and 0.003 by rare hits; one has met none.
    Batches b = batches(2.997, 0, 1, 4);
    for (uint32_t i = 0; i < b.boxes.size(); ++i)
        if (i % 16 != 9 && random_floats({3, i, 0, Stream::eye}, 0).x < 0.25f) b.boxes[i] += 0.003 * 4;
    CHECK(verdict(b, answer) == Verdict::ok);
    // Without chance anywhere there is nothing to wait for.
    CHECK(verdict(batches(2.99, 0, 1, 4), answer) == Verdict::failed);
}

TEST_CASE("black, rare, limited and invalid") {
    const Answer answer{AnswerKind::closed_form, 3, false, ""};
    RowState rare, limited, dropped;
    rare.rare = true;
    limited.has_limit = true;
    dropped.dropped = 1;
    const Batches black = batches(0, 0), wrong = batches(2, 0.01), right = batches(3, 0.01);
    CHECK(verdict(black, answer) == Verdict::failed);
    CHECK(verdict(black, answer, 1000, rare) == Verdict::noisy);
    CHECK(verdict(black, answer, 1000, limited) == Verdict::limit);
    CHECK(verdict(wrong, answer, 1000, rare) == Verdict::failed);
    CHECK(verdict(wrong, answer, 1000, limited) == Verdict::limit);
    CHECK(verdict(right, answer, 1000, dropped) == Verdict::invalid);
    CHECK(verdict(right, answer, 1000, limited) == Verdict::ok);
    // One bright batch: its size says as little as that there was one.
    Batches rich = batches(0, 0);
    rich.boxes[3] = 500;
    CHECK(verdict(rich, answer) == Verdict::noisy);
    // A little noise of few events, near the answer and significantly off it.
    Batches few = batches(3, 0);
    few.boxes[3] *= 1.1;
    CHECK(verdict(few, answer) == Verdict::ok);
    for (double& v : few.boxes) v *= 0.95;
    CHECK(verdict(few, answer) == Verdict::noisy);
    Batches no_number = right;
    no_number.boxes[3] = NAN;
    CHECK(verdict(no_number, answer) == Verdict::failed);
}

TEST_CASE("differences up to the stated rounding are none") {
    Answer answer{AnswerKind::closed_form, 3, true, ""};
    CHECK(verdict(batches(3 * (1 + 1e-5), 0), answer) == Verdict::ok);
    CHECK(verdict(batches(3 * (1 + 1e-3), 0), answer) == Verdict::failed);
    answer.rounding = 1e-2;
    CHECK(verdict(batches(3 * (1 + 1e-3), 0), answer) == Verdict::ok);
}

TEST_CASE("a row survives being written and read") {
    Row row;
    row.cell = "family_1e-06";
    row.family = "family";
    row.value = 1e-6;
    row.method = "bdpt";
    row.backend = "cpu";
    row.verdict = Verdict::left_out;
    row.mean = {1.5, 0.25, 31};
    row.answer = {1.75, 0, 0};
    row.comparison = {-INFINITY, 4.5, 1e-9, 300, -0.125};
    row.invalid = 7;
    row.lost = 8;
    row.underflow = 9;
    row.samples = 4294967296.0;
    row.note = "one, \"two\"\nthree";
    const std::string line = row_line(row);
    const std::optional<Row> read = parse_row(line);
    REQUIRE(read);
    CHECK(row_line(*read) == line);
    CHECK(read->verdict == Verdict::left_out);
    CHECK(read->comparison.z == -INFINITY);
    CHECK(read->underflow == 9);
    CHECK(read->note == "one; 'two' three");
    CHECK_FALSE(parse_row(line + ",more"));
    CHECK_FALSE(parse_row(line.substr(0, line.rfind(','))));
}

TEST_CASE("a sweep finds the method that is biased and notes the one that refuses") {
    TempFolder folder;
    World world;
    const std::vector<Family> families = {fake_family("good", 2)};
    const Summary summary = stress::run(stress_request(folder, "out"), families, stress_hooks(world));
    CHECK(summary.rows.size() == summary.planned);
    size_t refused = 0;
    for (const Row& row : summary.rows) {
        CAPTURE(row.cell, row.method, row.note);
        if (row.method == "light") {
            CHECK(row.verdict == Verdict::refused);
            CHECK(row.note == "light: not here, and not there");
            ++refused;
        } else {
            CHECK(row.verdict == (row.method == "path-naive" ? Verdict::failed : Verdict::ok));
            CHECK(row.samples > 0);
            CHECK(row.variance_ratio == (row.value == 0 ? Approx(0) : Approx(1).epsilon(1.0)));
        }
    }
    CHECK(refused == 2);
    CHECK(summary.bad() == 4);
    CHECK(contains(report(summary), "2 failed, 0 invalid, 2 refused"));
    CHECK(contains(report(summary), fmt::format(", {} ok,", summary.rows.size() - 4)));
    // Nothing of the scenes is left behind.
    CHECK_FALSE(fs::exists(folder / "out/scene-in-work"));
}

TEST_CASE("an invariance is judged by the benign cell") {
    TempFolder folder;
    World world;
    Family family = fake_family("scaled", 1);
    for (Cell& cell : family.cells) cell.answer.kind = AnswerKind::invariance;
    family.cells[2].answer.value = 3;  // the fake does not scale
    Request request = stress_request(folder, "out");
    request.methods = {"path-mis"};
    request.quick = false;
    const Summary summary = stress::run(request, {family}, stress_hooks(world));
    REQUIRE(summary.rows.size() == 3);
    CHECK(summary.rows[0].verdict == Verdict::ok);
    CHECK(summary.rows[1].verdict == Verdict::ok);
    CHECK(summary.rows[2].verdict == Verdict::failed);
    CHECK(summary.rows[1].answer.error > 0);
    // Without the benign cell's mean there is nothing to compare with.
    Row alone = blank_row(family.cells[1], "bdpt", "cpu", nullptr);
    Measurement m;
    m.batches = batches(1, 0.01);
    fill_row(alone, family.cells[1], m, nullptr, 1);
    CHECK(alone.verdict == Verdict::left_out);
    // A method that is not unbiased may be off by as much as it says, and no more.
    m.batches = batches(1, 0.0005);
    Cell cell = family.cells[0];
    cell.answer = {AnswerKind::closed_form, mean_of(m.batches).value / 1.009};
    for (const auto& [bias, verdict] :
         {std::pair(0.0, Verdict::failed), {0.01, Verdict::ok}, {0.007, Verdict::failed}}) {
        INFO(bias);
        Row row = blank_row(cell, "vcm", "cpu", nullptr);
        fill_row(row, cell, m, nullptr, 1, bias);
        CHECK(row.verdict == verdict);
    }
    CHECK(summary.rows[2].answer.value == Approx(6).epsilon(0.05));
}

TEST_CASE("a sweep that was stopped goes on to the rows of one that was not") {
    TempFolder folder;
    const std::vector<Family> families = {fake_family("a", 2), fake_family("b", 2)};
    World whole;
    stress::run(stress_request(folder, "whole"), families, stress_hooks(whole));
    World stopped;
    stopped.stop_at = whole.calls / 2;
    Request request = stress_request(folder, "parts");
    request.interrupt = &stopped.flag;
    const Summary half = stress::run(request, families, stress_hooks(stopped));
    CHECK(half.interrupted);
    CHECK(half.rows.size() > 0);
    CHECK(half.rows.size() < half.planned);
    error_of([&] { stress::run(request, families, stress_hooks(stopped)); }, ExitCode::usage);
    // A process that was killed while it wrote leaves a part of a line.
    append_file(folder / "parts/stress.csv", "b_2,b,2,bdpt,cp");
    World rest;
    const Summary all = stress::run(stress_request(folder, "parts", true), families, stress_hooks(rest));
    CHECK(all.rows.size() == all.planned);
    CHECK(lines_of(folder / "parts") == lines_of(folder / "whole"));
    CHECK(rest.calls < whole.calls);
    Request other = stress_request(folder, "parts", true);
    other.seed = 2;
    CHECK(contains(error_of([&] { stress::run(other, families, stress_hooks(rest)); }), "sweep.txt:1"));
}

TEST_CASE("rows that are rendered at the same time are those that are rendered one by one") {
    TempFolder folder;
    World world;
    std::mutex mutex;
    std::atomic<int> now = 0, most = 0;
    /// One call at a time, each long enough that the other thread is there.
    struct Locked : Renderer {
        std::unique_ptr<Renderer> inner;
        std::mutex& mutex;
        std::atomic<int>&now, &most;
        Locked(std::unique_ptr<Renderer> r, std::mutex& m, std::atomic<int>& n, std::atomic<int>& max)
            : inner(std::move(r)), mutex(m), now(n), most(max) {}
        uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
            most = std::max<int>(most, ++now);
            std::this_thread::sleep_for(std::chrono::microseconds(200));
            const std::lock_guard lock(mutex);
            --now;
            return inner->render(first, count, interrupt);
        }
        FilmMoments film() override { return inner->film(); }
        void clear_film() override { inner->clear_film(); }
        RenderStats stats() override { return inner->stats(); }
        uint32_t preferred_batch() const override { return inner->preferred_batch(); }
    };
    Hooks hooks = stress_hooks(world);
    hooks.make_renderer = [&, make = hooks.make_renderer](const Scene& scene, const RenderSettings& settings) {
        const std::lock_guard lock(mutex);
        return std::make_unique<Locked>(make(scene, settings), mutex, now, most);
    };
    const std::vector<Family> families = {fake_family("a", 2), fake_family("b", 2)};
    Request one = stress_request(folder, "one"), three = stress_request(folder, "three");
    three.rows_at_once = 3;
    const Summary expected = stress::run(one, families, hooks);
    CHECK(most == 1);
    const Summary found = stress::run(three, families, hooks);
    CHECK(most > 1);
    CHECK(found.rows.size() == expected.rows.size());
    std::vector<std::string> a = lines_of(folder / "one"), b = lines_of(folder / "three");
    std::sort(a.begin(), a.end()), std::sort(b.begin(), b.end());
    CHECK(a == b);
}

TEST_CASE("a row that outlasts the time of a sweep ends with it") {
    TempFolder folder;
    World world;
    world.sleep_per_sample = 0.05;  // 8 batches, which a row has at least, take 2 s and more
    Request request = stress_request(folder, "out");
    request.seconds = 0.3;
    const auto start = std::chrono::steady_clock::now();
    CHECK(stress::run(request, {fake_family("a", 2)}, stress_hooks(world)).interrupted);
    CHECK(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < 1.5);
}

TEST_CASE("a sweep ends in the time that it is given and says so") {
    TempFolder folder;
    World world;
    world.sleep_per_sample = 0.01;
    Request request = stress_request(folder, "out");
    request.seconds = 1;
    const auto start = std::chrono::steady_clock::now();
    const Summary summary = stress::run(request, {fake_family("a", 2), fake_family("b", 2)}, stress_hooks(world));
    // One more first round at most.
    CHECK(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < 5);
    CHECK(summary.interrupted);
    CHECK(summary.rows.size() < summary.planned);
}

TEST_CASE("a measurement whose time is over ends with the batches that it has") {
    World world;
    world.sleep_per_sample = 0.01;
    Scene scene;
    scene.sensor.crop_width = scene.sensor.crop_height = 8;
    Effort effort;
    effort.first_paths = 32 * 64;
    effort.seconds = 0.1;
    const Measurement m = measure(stress_hooks(world), scene, {}, effort, nullptr);
    const size_t done = m.batches.boxes.size() / m.batches.box_count();
    CHECK(done >= kLeastBatches);
    CHECK(done < 32);
    CHECK(m.samples == done);
    CHECK(m.first == 0);
    CHECK(stress::mean_of(m.batches).dof == double(done - 1));
}

TEST_CASE("unknown families and methods are named") {
    TempFolder folder;
    World world;
    Request request = stress_request(folder, "out");
    request.families = {"c"};
    const auto run_it = [&] { stress::run(request, {fake_family("a", 2)}, stress_hooks(world)); };
    CHECK(contains(error_of(run_it, ExitCode::usage), "--family c: known are a"));
    request.families = {};
    request.methods = {"photon"};
    CHECK(contains(error_of(run_it, ExitCode::usage), "--method photon: known are path-naive, path-nee"));
}

TEST_CASE("more samples than a renderer counts are refused") {
    World world;
    Scene scene;
    scene.sensor.crop_width = scene.sensor.crop_height = 1;
    Effort effort;
    effort.samples = uint64_t(1) << 33;
    CHECK(contains(error_of([&] { measure(stress_hooks(world), scene, {}, effort, nullptr); }, ExitCode::usage),
                   "4294967295"));
    effort.samples = 100000;
    effort.paths = 10;
    effort.seconds = 1e9;
    CHECK(measure(stress_hooks(world), scene, {}, effort, nullptr).samples >= 100000);
}

TEST_CASE("what other renderers measured is judged alike") {
    TempFolder folder;
    const std::string header = "cell,method,backend,boxes_x,boxes_y,samples,pixels,seconds,invalid,state,note,boxes\n";
    std::string good, bad;
    for (const double v : batches(2, 0.01).boxes) {
        good += fmt::format("{} ", v);
        bad += fmt::format("{} ", v * 1.1);
    }
    const std::vector<Family> families = {fake_family("a", 2)};
    // The benign cell stands behind what is compared with it.
    const std::string path = folder.write("m.csv", header + "a_1,path,other,1,1,320,16,0.5,0,,," + bad +
                                                       "\na_0,path,other,1,1,320,16,0.5,0,,," + good +
                                                       "\na_2,path,other,1,1,0,1,0,0,refused,unknown plugin,\n");
    const std::vector<Row> rows = judge_elsewhere(path, families);
    REQUIRE(rows.size() == 3);
    CHECK(rows[0].verdict == Verdict::failed);
    CHECK(rows[0].variance_ratio == Approx(1));
    CHECK(rows[1].verdict == Verdict::ok);
    CHECK(rows[1].paths == 320 * 16);
    CHECK(rows[2].verdict == Verdict::refused);
    CHECK(rows[2].note == "unknown plugin");
    for (const auto& [line, what] : std::vector<std::pair<std::string, std::string>>{
             {"b_0,path,other,1,1,320,16,0.5,0,,,1 2", "there is no cell 'b_0'"},
             {"a_0,path,other,1,1,320,16,0.5,0,,,1 two", "'two' is no number"},
             {"a_0,path,other,2,2,320,16,0.5,0,,,1 2 3", "3 means are no two batches of 4 boxes"},
             {"a_0,path,other,1,1,320,16,0.5,0,black,,", "no means, and the state 'black'"},
             {"a_0,path,other,1,1,320", "6 columns"}}) {
        folder.write("m.csv", header + line + "\n");
        const std::string message = error_of([&] { judge_elsewhere(path, families); });
        CAPTURE(message);
        CHECK(contains(message, "m.csv:2: " + what));
    }
}

TEST_CASE("families are well formed") {
    std::string headings;
    std::istringstream numerics(read_file(std::string(AMBILUX_SOURCE_DIR) + "/docs/numerics.md"));
    for (std::string line; std::getline(numerics, line);)
        if (line.starts_with("## ")) headings += line.substr(3) + "\n";
    std::set<std::string> names, families_seen;
    size_t quick = 0;
    for (const Family& family : families()) {
        CAPTURE(family.name);
        CHECK(families_seen.insert(family.name).second);
        REQUIRE_FALSE(family.cells.empty());
        CHECK(family.cells.front().benign);
        for (const Cell& cell : family.cells) {
            CAPTURE(cell.label);
            CHECK(names.insert(cell.name()).second);
            CHECK(cell.family == family.name);
            CHECK(cell.benign == (&cell == &family.cells.front()));
            CHECK(std::isfinite(cell.answer.value));
            CHECK(cell.answer.value > 0);
            CHECK((cell.limit.empty() || contains(headings, cell.limit + "\n")));
            quick += cell.quick;
        }
        // The benign cell is what others are compared with.
        const bool any = std::any_of(family.cells.begin(), family.cells.end(), [](const Cell& c) { return c.quick; });
        CHECK((!any || family.cells.front().quick));
    }
    CHECK(names.size() * methods().size() >= 500);
    CHECK(quick >= 90);
}
