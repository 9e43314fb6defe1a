#include "cli/interrupt.h"

#include <csignal>
#include <unistd.h>

#include "core/flag.h"

namespace ambilux {
namespace {

volatile bool interrupted = false;

extern "C" void on_signal(int) {
    if (is_set(&interrupted)) {
        constexpr char text[] = "\ninterrupted twice: nothing more is saved\n";
        [[maybe_unused]] const auto written = ::write(STDERR_FILENO, text, sizeof text - 1);
        ::_exit(5);
    }
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
