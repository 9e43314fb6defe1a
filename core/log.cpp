#include "core/log.h"

#include <cstdio>
#include <mutex>

#include "core/printable.h"

namespace ambilux {
namespace {

std::mutex mutex;
bool quiet_mode = false;
std::string status;

void print(const char* prefix, const std::string& message) {
    const std::lock_guard lock(mutex);
    const char* clear = status.empty() ? "" : "\r\033[K";
    std::fprintf(stderr, "%s%s%s\n%s", clear, prefix, printable(message).c_str(), status.c_str());
    std::fflush(stderr);
}

}  // namespace

void set_quiet(bool quiet) { quiet_mode = quiet; }
bool is_quiet() { return quiet_mode; }

void log_info(const std::string& message) {
    if (!quiet_mode) print("", message);
}
void log_warning(const std::string& message) {
    if (!quiet_mode) print("warning: ", message);
}
void log_error(const std::string& message) { print("error: ", message); }

void set_status_line(const std::string& line) {
    const std::lock_guard lock(mutex);
    if (line.empty() && status.empty()) return;
    status = line;
    std::fprintf(stderr, "\r\033[K%s", line.c_str());
    std::fflush(stderr);
}

}  // namespace ambilux
