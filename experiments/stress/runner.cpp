#include "experiments/stress/runner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/atomic_file.h"
#include "core/log.h"
#include "core/progress.h"
#include "experiments/experiment_folder.h"
#include "experiments/results.h"
#include "experiments/stress/families.h"
#include "experiments/stress/methods.h"
#include "experiments/work_estimate.h"
#include "film/exr_io.h"
#include "integrators/reachability.h"

namespace ambilux::stress {
namespace {

namespace fs = std::filesystem;

/// A cell with the methods that it is rendered with.
struct Planned {
    const Family* family;
    const Cell* cell;
    std::vector<const Method*> methods;
};

Effort effort_of(const Request& request, const Cell& cell) {
    Effort effort;
    effort.relative_error = request.quick ? 0.003 : 0.001;
    effort.paths = (request.quick ? 1.4e5 : 4e6) * cell.effort;
    effort.seconds = (request.quick ? 1.0 : 20.0) * std::max(1.0, cell.effort);
    return effort;
}

class Sweep {
public:
    Sweep(const Request& request, const Hooks& hooks)
        : request_(request), hooks_(hooks), csv_(request.output + "/stress.csv"),
          backend_(request.backend == "auto" ? (cuda_available() ? "cuda" : "cpu") : request.backend) {}

    Summary run() {
        check_families();
        make_folders(request_.output + "/scenes");
        const FolderLock lock(request_.output);
        open();
        plan();
        Progress progress("stress");
        progress_ = &progress;
        for (const Planned& p : planned_)
            if (!run_cell(p)) break;
        progress.finish();
        Summary summary{{}, rows_planned_, interrupted_};
        for (const Row& row : rows_)
            if (row.backend == backend_) summary.rows.push_back(row);
        return summary;
    }

private:
    void check_families() const {
        for (const std::string& name : request_.families) {
            const auto same = [&](const Family& f) { return f.name == name; };
            if (std::any_of(families().begin(), families().end(), same)) continue;
            std::string known;
            for (const Family& f : families()) known += (known.empty() ? "" : ", ") + f.name;
            throw Error(ExitCode::usage, fmt::format("--family {}: known are {}", name, known));
        }
    }

    bool is_chosen(const Family& family) const {
        return request_.families.empty() ||
               std::find(request_.families.begin(), request_.families.end(), family.name) != request_.families.end();
    }

    /// The folder holds rows of one mode and seed; families and backends may be added.
    void open() {
        const std::string path = request_.output + "/sweep.txt",
                          now = fmt::format("quick={} seed={}\n", int(request_.quick), request_.seed);
        if (fs::exists(csv_) && !request_.resume)
            throw Error(ExitCode::usage, request_.output +
                                             " holds a sweep already: continue it with --resume or choose another "
                                             "folder");
        if (fs::exists(path) && read_file(path) != now)
            throw input_error(path, 1,
                              "the sweep in this folder is another one: " + read_file(path) + "Choose another folder");
        write_file_atomic(path, now);
        std::string text = std::string(kRowHeader) + "\n";
        for (const std::string& line : read_rows(csv_, kRowHeader))
            if (std::optional<Row> row = parse_row(line)) {
                rows_.push_back(std::move(*row));
                text += line + "\n";
            }
        write_file_atomic(csv_, text);
    }

    std::string scene_path(const Cell& cell) const {
        return fmt::format("{}/scenes/{}.xml", request_.output, cell.name());
    }

    void write_scene(const Cell& cell) const {
        const SceneFiles files = cell.scene();
        for (const Asset& asset : files.assets) {
            const std::string path = request_.output + "/scenes/" + asset.name;
            if (asset.image.rgb.empty())
                write_file_atomic(path, asset.text);
            else
                write_exr(path, asset.image);
        }
        write_file_atomic(scene_path(cell), files.xml);
    }

    /// Writes all scenes and finds out who can render them; what a loader refuses is found again, and noted, later.
    void plan() {
        std::string expected = std::string(kExpectedHeader) + "\n";
        for (const Family& family : families())
            for (const Cell& cell : family.cells) {
                if (!is_chosen(family) || (request_.quick && !cell.quick)) continue;
                if (is_set_interrupt()) return;
                write_scene(cell);
                Planned p{&family, &cell, methods_of(cell)};
                std::vector<std::string> names;
                for (const Method* m : p.methods) names.push_back(m->name);
                expected += expected_line(family, cell, names) + "\n";
                rows_planned_ += double(names.size());
                for (const Method* m : p.methods)
                    if (!find_row(cell, *m)) work_.plan(m->name, 1, {1, 0});
                planned_.push_back(std::move(p));
            }
        write_file_atomic(request_.output + "/expected.csv", expected);
    }

    std::vector<const Method*> methods_of(const Cell& cell) const {
        std::vector<const Method*> found;
        std::optional<Scene> scene;
        try {
            scene = hooks_.load_scene(scene_path(cell), {});
        } catch (const Error&) {}
        for (const Method& m : methods()) {
            if (request_.quick && !m.quick) continue;
            if (scene && !missing_light(scene->features, settings_of(m, *scene, backend_, request_.seed)).empty())
                continue;
            found.push_back(&m);
        }
        return found;
    }

    const Row* find_row(const Cell& cell, const Method& method) const {
        for (const Row& row : rows_)
            if (row.cell == cell.name() && row.method == method.name && row.backend == backend_) return &row;
        return nullptr;
    }

    const Row* benign_row(const Family& family, const Method& method) const {
        for (const Cell& cell : family.cells)
            if (cell.benign) return find_row(cell, method);
        return nullptr;
    }

    bool is_set_interrupt() { return interrupted_ = interrupted_ || (request_.interrupt && *request_.interrupt); }

    /// False if interrupted.
    bool run_cell(const Planned& p) {
        std::optional<Scene> scene;
        std::string refusal;
        for (const Method* method : p.methods) {
            if (is_set_interrupt()) return false;
            if (find_row(*p.cell, *method)) continue;
            if (!scene && refusal.empty()) try {
                    scene = hooks_.load_scene(scene_path(*p.cell), {});
                } catch (const Error& e) {
                    refusal = e.what();
                }
            work_.begin(method->name, {1, 0});
            progress_->update(work_.fraction(), p.cell->name() + " " + method->name, work_.seconds_left());
            std::optional<Row> row = run_method(p, *method, scene ? &*scene : nullptr, refusal);
            if (!row) return false;
            work_.progress(method->name, 1, row->seconds);
            work_.end(method->name);
            append_file(csv_, row_line(*row) + "\n");
            rows_.push_back(std::move(*row));
        }
        return true;
    }

    /// Nothing if interrupted.
    std::optional<Row> run_method(const Planned& p, const Method& method, const Scene* scene,
                                  const std::string& refusal) {
        const Cell& cell = *p.cell;
        Row row;
        row.cell = cell.name();
        row.family = p.family->name;
        row.value = cell.value;
        row.method = method.name;
        row.backend = backend_;
        row.limit = cell.limit;
        const Row* const benign = cell.benign ? nullptr : benign_row(*p.family, method);
        row.answer = answer_of(cell, benign);
        Measurement m;
        try {
            if (!scene) throw Error(ExitCode::bad_input, refusal);
            m = measure(*scene, settings_of(method, *scene, backend_, request_.seed), effort_of(request_, cell),
                        request_.interrupt);
        } catch (const Error& e) {
            row.note = e.what();
            row.verdict = cell.limit.empty() ? Verdict::refused : Verdict::limit;
            return row;
        }
        if (m.interrupted) {
            interrupted_ = true;
            return std::nullopt;
        }
        fill(row, cell, m);
        if (benign && benign->variance > 0) row.variance_ratio = row.variance / benign->variance;
        return row;
    }

    /// The benign cell of an invariance is its own answer: it is the others that are judged.
    static Mean answer_of(const Cell& cell, const Row* benign) {
        if (cell.answer.kind == AnswerKind::closed_form) return {cell.answer.value, 0, 0};
        return benign ? benign->mean : Mean{};
    }

    void fill(Row& row, const Cell& cell, const Measurement& m) const {
        row.mean = mean_of(m.batches);
        row.paths = m.paths;
        row.seconds = m.seconds;
        row.invalid = m.invalid;
        row.lost = m.lost;
        row.variance = relative_variance(row.mean, m.paths);
        if (cell.answer.kind == AnswerKind::invariance && cell.benign) row.answer = row.mean;
        row.comparison = compare(m.batches, row.answer, cell.answer.uniform);
        row.verdict = judge({row.comparison, row.mean.value, has_prefix_of(cell.rare, row.method), !cell.limit.empty(),
                             row.invalid + row.lost},
                            rows_planned_);
    }

    const Request& request_;
    const Hooks& hooks_;
    const std::string csv_, backend_;
    std::vector<Row> rows_;
    std::vector<Planned> planned_;
    double rows_planned_ = 0;
    WorkEstimate work_;
    Progress* progress_ = nullptr;
    bool interrupted_ = false;
};

}  // namespace

size_t Summary::count(Verdict verdict) const {
    return size_t(std::count_if(rows.begin(), rows.end(), [&](const Row& r) { return r.verdict == verdict; }));
}

Summary run(const Request& request, const Hooks& hooks) { return Sweep(request, hooks).run(); }

std::string report(const Summary& summary) {
    std::vector<const Row*> shown;
    for (const Row& row : summary.rows)
        if (row.verdict != Verdict::ok && row.verdict != Verdict::undecided) shown.push_back(&row);
    std::stable_sort(shown.begin(), shown.end(), [](const Row* a, const Row* b) { return a->verdict < b->verdict; });
    std::string text;
    if (!shown.empty())
        text += fmt::format("{:<34} {:<16} {:>9} {:>12} {:>12} {:>9} {:>8} {:>8}  {}\n", "cell", "method", "verdict",
                            "mean", "expected", "bias", "z", "box z", "invalid, lost, note");
    for (const Row* r : shown)
        text += fmt::format(
            "{:<34} {:<16} {:>9} {:>12.6g} {:>12.6g} {:>8.2f}% {:>8.1f} {:>8.1f}  {}\n", r->cell, r->method,
            verdict_name(r->verdict), r->mean.value, r->answer.value,
            r->answer.value != 0 ? 100 * (r->mean.value / r->answer.value - 1) : 0.0, r->comparison.z,
            r->comparison.box_z,
            r->note.empty() ? (r->invalid + r->lost ? fmt::format("{} {}", r->invalid, r->lost) : "") : r->note);
    for (const Verdict v :
         {Verdict::ok, Verdict::undecided, Verdict::limit, Verdict::failed, Verdict::invalid, Verdict::refused})
        text += fmt::format("{}{} {}", v == Verdict::ok ? "" : ", ", summary.count(v), verdict_name(v));
    return text + fmt::format(" of {:.0f} rows\n", summary.planned);
}

}  // namespace ambilux::stress
