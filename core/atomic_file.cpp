#include "core/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/error.h"

namespace ambilux {
namespace {

Error system_error(ExitCode code, const std::string& what, const std::string& path) {
    return {code, what + " " + path + ": " + std::strerror(errno)};
}

/// Unique among processes (pid) and threads (counter).
std::string temporary_name(const std::string& path) {
    static std::atomic<unsigned> counter{0};
    return path + ".tmp-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
}

/// Writes everything; false with errno on failure.
bool write_all(int fd, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n < 0) {
            if (errno == EINTR) continue;
            return false;
        }
        bytes.remove_prefix(size_t(n));
    }
    return true;
}

}  // namespace

void write_file_atomic(const std::string& path, std::string_view bytes) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        throw Error(ExitCode::device, "cannot write " + path + ": it is a folder");
    const std::string temporary = temporary_name(path);
    const int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0) throw system_error(ExitCode::device, "cannot write", path);
    bool ok = write_all(fd, bytes) && ::fsync(fd) == 0;
    int reason = errno;
    if (::close(fd) != 0 && ok) {
        ok = false;
        reason = errno;
    }
    if (ok && ::rename(temporary.c_str(), path.c_str()) != 0) {
        ok = false;
        reason = errno;
    }
    if (!ok) {
        ::unlink(temporary.c_str());
        errno = reason;
        throw system_error(ExitCode::device, "cannot write", path);
    }
}

void append_file(const std::string& path, std::string_view text) {
    const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (fd < 0) throw system_error(ExitCode::device, "cannot append to", path);
    const bool ok = write_all(fd, text) && ::fsync(fd) == 0;
    const int reason = errno;
    ::close(fd);
    if (!ok) {
        errno = reason;
        throw system_error(ExitCode::device, "cannot append to", path);
    }
}

std::string read_file(const std::string& path) {
    const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (fd < 0) throw system_error(ExitCode::bad_input, "cannot read", path);
    std::string content;
    char buffer[1 << 16];
    for (;;) {
        const ssize_t n = ::read(fd, buffer, sizeof buffer);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            const int reason = errno;
            ::close(fd);
            errno = reason;
            throw system_error(ExitCode::bad_input, "cannot read", path);
        }
        if (n == 0) break;
        content.append(buffer, size_t(n));
    }
    ::close(fd);
    return content;
}

void make_folders(const std::string& path) {
    std::error_code reason;
    std::filesystem::create_directories(path, reason);
    if (reason) throw Error(ExitCode::device, "cannot make the folder " + path + ": " + reason.message());
}

void check_writable(const std::string& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        throw Error(ExitCode::device, "cannot write " + path + ": it is a folder");
    const std::string temporary = temporary_name(path);
    const int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0) throw system_error(ExitCode::device, "cannot write", path);
    ::close(fd);
    ::unlink(temporary.c_str());
}

}  // namespace ambilux
