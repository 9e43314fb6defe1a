#include "cli/interrupt.h"

#include <unistd.h>
#include <csignal>
#include <ctime>

#include "core/flag.h"

namespace ambilux {
namespace {

volatile bool interrupted = false;

/// A second signal so soon is the first: `timeout` and others send it to a process and then to its group.
constexpr double kSameInterrupt = 0.5;

timespec first;

extern "C" void on_signal(int) {
    timespec now;
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    if (is_set(&interrupted)) {
        if (double(now.tv_sec - first.tv_sec) + 1e-9 * double(now.tv_nsec - first.tv_nsec) < kSameInterrupt) return;
        constexpr char text[] = "\ninterrupted twice: nothing more is saved\n";
        [[maybe_unused]] const auto written = ::write(STDERR_FILENO, text, sizeof text - 1);
        ::_exit(5);
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
}

const volatile bool* interrupt_flag() { return &interrupted; }

}  // namespace ambilux
