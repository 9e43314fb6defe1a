#include "stress/runner.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include "backends/cuda_device.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/progress.h"
#include "integrators/reachability.h"
#include "stress/deadline.h"
#include "stress/folder.h"

namespace ambilux::stress {
namespace {

using CellList = std::vector<std::pair<const Family*, const Cell*>>;

/// Entries of `all` with one of `names`, or all of them. Throws Error(usage) for a name that none has.
template <class T>
std::vector<const T*> named(const std::vector<T>& all, const std::vector<std::string>& names, const char* option) {
    std::vector<const T*> chosen;
    for (const std::string& name : names)
        if (std::none_of(all.begin(), all.end(), [&](const T& x) { return x.name == name; })) {
            std::string known;
            for (const T& x : all) known += (known.empty() ? "" : ", ") + x.name;
            throw Error(ExitCode::usage, fmt::format("{} {}: known are {}", option, name, known));
        }
    for (const T& x : all)
        if (names.empty() || std::find(names.begin(), names.end(), x.name) != names.end()) chosen.push_back(&x);
    return chosen;
}

std::vector<const Method*> chosen_methods(const std::vector<std::string>& names, bool quick) {
    std::vector<const Method*> chosen = named(methods(), names, "--method");
    std::erase_if(chosen, [&](const Method* m) { return quick && !m->quick; });
    return chosen;
}

/// "cpu" or "cuda". Throws Error(usage) for another name, Error(device) without a device.
std::string backend_of(const std::string& name) {
    const Choice<Backend> backend(name);
    if (backend == Backend::automatic) return cuda_available() ? "cuda" : "cpu";
    if (backend == Backend::cuda && !cuda_available()) throw Error(ExitCode::device, "stress: " + why_no_cuda_device());
    return name;
}

/// Rows that are rendered at the same time. Most films are so small that one thread renders them: of two cores one
/// would be idle.
unsigned rows_at_once(const Request& request, const std::string& backend, size_t rows) {
    if (request.rows_at_once > 0) return request.rows_at_once;
    if (backend != "cpu") return 1;
    return unsigned(std::clamp<size_t>(std::thread::hardware_concurrency(), 1, std::max<size_t>(rows, 1)));
}

class Sweep {
public:
    Sweep(const Request& request, const std::vector<Family>& all, const Hooks& hooks)
        : request_(request), hooks_(hooks), backend_(backend_of(request.backend)),
          cells_(chosen_cells(all, request.families, request.quick)),
          methods_(chosen_methods(request.methods, request.quick)),
          rows_in_all_(double(chosen_cells(all, {}, request.quick).size() * chosen_methods({}, request.quick).size())),
          folder_(request.output, fmt::format("quick={} seed={}", int(request.quick), request.seed), request.resume) {
        for (const auto& [family, cell] : cells_)
            for (const Method* method : methods_) rows_left_ += find(*cell, *method) == nullptr;
        rows_to_do_ = rows_left_;
        workers_ = rows_at_once(request, backend_, methods_.size());
    }

    Summary run() {
        // The threads of all rows together are as many as cores.
        const tbb::global_control threads(
            tbb::global_control::max_allowed_parallelism,
            std::max(1u, std::max(std::thread::hardware_concurrency(), workers_) - workers_ + 1));
        for (const auto& [family, cell] : cells_) {
            run_cell(*family, *cell);
            if (interrupted_) break;
        }
        progress_.finish();
        Summary summary{{}, cells_.size() * methods_.size(), interrupted_};
        for (const auto& [family, cell] : cells_)
            for (const Method* method : methods_)
                if (const Row* row = find(*cell, *method)) summary.rows.push_back(*row);
        return summary;
    }

private:
    /// Rows stay where they are while others are added.
    const Row* find(const Cell& cell, const Method& method) const {
        const std::lock_guard lock(mutex_);
        return folder_.find(cell.name(), method.name, backend_);
    }

    void run_cell(const Family& family, const Cell& cell) {
        std::vector<const Method*> left;
        for (const Method* method : methods_)
            if (!find(cell, *method)) left.push_back(method);
        if (left.empty() || out_of_time()) return;
        std::optional<Scene> scene;
        std::string refusal;
        try {
            scene = load(cell);
        } catch (const Error& e) {
            refusal = e.what();
        }
        std::atomic<size_t> next = 0;
        std::exception_ptr failure;
        const auto work = [&] {
            try {
                for (size_t i = next++; i < left.size() && !out_of_time(); i = next++)
                    add_row(family, cell, *left[i], scene ? &*scene : nullptr, refusal);
            } catch (...) {
                const std::lock_guard lock(mutex_);
                failure = std::current_exception();
                interrupted_ = true;
            }
        };
        {
            std::vector<std::jthread> others;
            for (unsigned i = 1; i < std::min<size_t>(workers_, left.size()); ++i) others.emplace_back(work);
            work();
        }
        if (failure) std::rethrow_exception(failure);
    }

    bool out_of_time() {
        if (is_set(deadline_.flag())) interrupted_ = true;
        return interrupted_;
    }

    void add_row(const Family& family, const Cell& cell, const Method& method, const Scene* scene,
                 const std::string& refusal) {
        {
            const std::lock_guard lock(mutex_);
            progress_.update(
                1 - double(rows_left_) / double(rows_to_do_),
                fmt::format("{} of {} rows, {} {}", rows_to_do_ - rows_left_, rows_to_do_, cell.name(), method.name));
        }
        const std::optional<Row> row = run_method(family, cell, method, scene, refusal);
        if (!row) return;
        const std::lock_guard lock(mutex_);
        folder_.add(*row);
        --rows_left_;
    }

    Scene load(const Cell& cell) {
        const std::string path = write_scene(folder_.scenes(), cell);
        Scene scene = hooks_.load_scene(path, {});
        folder_.clear_scenes();
        return scene;
    }

    Effort effort_of(const Cell& cell) const {
        // Of the quick sweep all samples are the same on any machine; the other one goes by the clock.
        // Its first round is as small as a film allows: most rows need no more.
        Effort effort = request_.quick ? Effort{0.004, 1.3e5 * cell.effort, 60, 8e3} : Effort{5e-5, 8e6, 0.4};
        effort.first_paths *= cell.effort;
        effort.samples = cell.samples;
        if (cell.samples) effort.seconds = 15;
        if (request_.seconds > 0) {
            // What is left, in equal parts; a cell whose samples are given may take a few parts more.
            const double left = std::max(0.0, request_.seconds - elapsed()),
                         part = std::min(left, left * workers_ / double(rows_left()));
            effort.seconds = std::min(effort.seconds, cell.samples ? std::min(left, 20 * part) : part);
            if (!request_.quick) effort.paths = 4e7;
        }
        return effort;
    }

    size_t rows_left() const {
        const std::lock_guard lock(mutex_);
        return rows_left_;
    }

    /// Nothing if it was interrupted.
    std::optional<Row> run_method(const Family& family, const Cell& cell, const Method& method, const Scene* scene,
                                  const std::string& refusal) {
        const Row* benign = cell.benign ? nullptr : find(family.cells.front(), method);
        if (benign && benign->samples == 0) benign = nullptr;
        Row row = blank_row(cell, method.name, backend_, benign);
        try {
            if (!scene) throw Error(ExitCode::bad_input, refusal);
            if (!cell.only.empty() && !has_prefix_of(cell.only, method.name)) {
                leave_out(row, "for " + cell.only + " alone");
                return row;
            }
            const RenderSettings settings = settings_of(hooks_, method, cell, *scene, backend_, request_.seed);
            if (const std::string why = reason_to_leave_out(cell, *scene, settings); !why.empty()) {
                leave_out(row, why);
                return row;
            }
            const Measurement m = measure(hooks_, *scene, settings, effort_of(cell), deadline_.flag());
            if (m.interrupted) return {};
            fill_row(row, cell, m, benign, rows_in_all_, method.bias);
        } catch (const Error& e) {
            refuse_row(row, cell, e.what());
        }
        return row;
    }

    std::string reason_to_leave_out(const Cell& cell, const Scene& scene, const RenderSettings& settings) const {
        if (cell.device_only && backend_ == "cpu") return "for devices: it takes a host minutes";
        return missing_light(scene.features, settings);
    }

    double elapsed() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

    const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    const Request& request_;
    const Hooks& hooks_;
    const std::string backend_;
    const CellList cells_;
    const std::vector<const Method*> methods_;
    const double rows_in_all_;  ///< of all families and methods: the correction is the same whatever is chosen
    unsigned workers_ = 1;
    mutable std::mutex mutex_;  ///< of what follows
    SweepFolder folder_;
    size_t rows_left_ = 0, rows_to_do_ = 0;
    Progress progress_{"stress"};
    std::atomic<bool> interrupted_ = false;
    Deadline deadline_{request_.interrupt, request_.seconds};  ///< the last: it begins when all else is there
};

}  // namespace

CellList chosen_cells(const std::vector<Family>& all, const std::vector<std::string>& names, bool quick) {
    CellList cells;
    for (const Family* family : named(all, names, "--family"))
        for (const Cell& cell : family->cells)
            if (!quick || cell.quick) cells.emplace_back(family, &cell);
    return cells;
}

Summary run(const Request& request, const std::vector<Family>& all, const Hooks& hooks) {
    return Sweep(request, all, hooks).run();
}

}  // namespace ambilux::stress
