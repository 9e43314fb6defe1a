// ambilux._core: what the Python of the package ambilux stands on. Structured values cross as JSON.
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "cli/program.h"
#include "core/error.h"
#include "core/flag.h"
#include "core/nearest.h"
#include "core/version.h"
#include "formats/document/plugins.h"
#include "integrators/settings_help.h"
#include "python/src/bindings.h"
#include "render/renderer.h"

namespace nb = nanobind;

namespace ambilux {
namespace {

/// How often a thread that waits looks at signals.
constexpr std::chrono::milliseconds kSignalPeriod(50);

void translate(const std::exception_ptr& thrown, void*) {
    try {
        std::rethrow_exception(thrown);
    } catch (const Error& e) {
        const char* name = e.code == ExitCode::usage       ? "UsageError"
                           : e.code == ExitCode::bad_input ? "SceneError"
                                                           : "DeviceError";
        const nb::object type = nb::module_::import_("ambilux.errors").attr(name);
        PyErr_SetObject(type.ptr(), nb::str(e.what()).ptr());
    }
}

int main_with(const std::vector<std::string>& arguments) {
    std::vector<const char*> argv;
    for (const std::string& a : arguments) argv.push_back(a.c_str());
    const nb::gil_scoped_release unlocked;
    return run_program(int(argv.size()), argv.data());
}

}  // namespace

void run_unlocked(const std::function<void(const volatile bool* interrupt)>& work,
                  const std::function<void()>& meanwhile) {
    volatile bool interrupt = false;
    std::optional<nb::python_error> raised;
    const auto look = [&](bool ended) {
        if (raised) return;
        try {
            if (!ended && PyErr_CheckSignals() != 0) throw nb::python_error();
            if (meanwhile) meanwhile();
        } catch (nb::python_error& e) {
            raised.emplace(std::move(e));
            set_flag(&interrupt);
        }
    };
    std::exception_ptr failure;
    {
        const nb::gil_scoped_release unlocked;
        std::mutex mutex;
        std::condition_variable changed;
        bool done = false;
        std::thread worker([&] {
            try {
                work(&interrupt);
            } catch (...) {
                failure = std::current_exception();
            }
            const std::lock_guard lock(mutex);
            done = true;
            changed.notify_one();
        });
        std::unique_lock lock(mutex);
        while (!changed.wait_for(lock, kSignalPeriod, [&] { return done; })) {
            lock.unlock();
            {
                const nb::gil_scoped_acquire locked;
                look(false);
            }
            lock.lock();
        }
        lock.unlock();
        worker.join();
    }
    if (!failure) look(true);
    if (raised) throw nb::python_error(std::move(*raised));
    if (failure) std::rethrow_exception(failure);
}

}  // namespace ambilux

NB_MODULE(_core, m) {
    using namespace ambilux;
    nb::register_exception_translator(translate);
    m.attr("version") = version();
    m.attr("git_revision") = git_revision();
    m.def("cuda_available", &cuda_available, "True if this build has the CUDA backend and a device answers.");
    m.def("settings_help", &settings_help, "All settings and variants, as `ambilux help settings`.");
    m.def("plugins", &document::plugins, "Tags of the objects that scene files can have, by their types.");
    m.def("nearest_name", &nearest_name, nb::arg("known"), nb::arg("name"),
          "The one of these that may be meant; empty if none.");
    m.def("main", &main_with, nb::arg("arguments"), "Runs the program; returns its exit code.");
    bind_images(m);
    bind_scenes(m);
    bind_renders(m);
    bind_replays(m);
    bind_commands(m);
}
