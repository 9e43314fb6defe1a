#include "cli/interrupt.h"

#include <unistd.h>
#include <csignal>
#include <ctime>

#include "core/atomic_file.h"
#include "core/flag.h"

namespace ambilux {
namespace {

volatile bool interrupted = false, saves = false;

/// A second signal so soon is the first: `timeout` and others send it to a process and then to its group.
constexpr double kSameInterrupt = 0.5;

timespec first;

template <size_t N>
[[noreturn]] void end(const char (&text)[N]) {
    remove_unfinished_files();
    [[maybe_unused]] const auto written = ::write(STDERR_FILENO, text, N - 1);
    ::_exit(5);
}

extern "C" void on_signal(int) {
    if (!is_set(&saves)) end("\ninterrupted before there was anything to save\n");
    timespec now;
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    if (is_set(&interrupted)) {
        if (double(now.tv_sec - first.tv_sec) + 1e-9 * double(now.tv_nsec - first.tv_nsec) < kSameInterrupt) return;
        end("\ninterrupted twice: nothing more is saved\n");
    }
    first = now;
    set_flag(&interrupted);
}

}  // namespace

void install_interrupt_handler() {
    struct sigaction action = {};
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    struct sigaction hangup;
    if (::sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler != SIG_IGN)
        ::sigaction(SIGHUP, &action, nullptr);
    action.sa_handler = SIG_IGN;
    ::sigaction(SIGPIPE, &action, nullptr);
    ::sigaction(SIGXFSZ, &action, nullptr);
}

const volatile bool* save_when_interrupted() {
    set_flag(&saves);
    return &interrupted;
}

}  // namespace ambilux
