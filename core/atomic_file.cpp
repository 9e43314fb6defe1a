#include "core/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "core/error.h"

namespace ambilux {
namespace {

namespace fs = std::filesystem;

/// "cannot write PATH: the system's reason".
Error system_error(ExitCode code, const std::string& what, const std::string& path) {
    return {code, what + " " + path + ": " + std::strerror(errno)};
}

/// Closes when it goes, whatever happens.
struct File {
    int fd = -1;
    File(const std::string& path, int flags, mode_t mode = 0) : fd(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}
    ~File() {
        if (fd >= 0) ::close(fd);
    }
    File(const File&) = delete;
    /// False with errno on failure.
    bool close() { return ::close(std::exchange(fd, -1)) == 0; }
};

/// Names of temporary files that signal handlers may remove; a name beyond the slots stays if the program is ended.
std::array<std::atomic<const char*>, 16> unfinished;

/// A temporary file that vanishes unless it is kept.
struct Temporary {
    std::string name;
    std::atomic<const char*>* slot = nullptr;
    bool kept = false;

    /// Unique among processes (pid) and threads (counter).
    explicit Temporary(const std::string& path) {
        static std::atomic<unsigned> counter{0};
        name = path + ".tmp-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
        for (auto& candidate : unfinished)
            if (const char* free = nullptr; candidate.compare_exchange_strong(free, name.c_str())) {
                slot = &candidate;
                break;
            }
    }
    ~Temporary() {
        if (!kept) ::unlink(name.c_str());
        if (slot) slot->store(nullptr);
    }
    Temporary(const Temporary&) = delete;
};

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

/// Where writing to a path leads.
struct Target {
    std::string path;  ///< behind symbolic links
    bool exists = false;
    bool special = false;  ///< a device, a pipe, a socket: written to, not replaced
    mode_t mode = 0666;
};

/// Throws Error(device) for what may not be written.
Target find_target(const std::string& path) {
    if (path.empty()) throw Error(ExitCode::device, "cannot write a file without a name");
    Target target{path};
    struct stat info;
    // The system follows links that lead to no name, such as those of /proc.
    if (::stat(path.c_str(), &info) == 0) {
        target.exists = true;
        target.special = !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode);
        target.mode = info.st_mode & 07777;
        if (S_ISDIR(info.st_mode)) throw Error(ExitCode::device, "cannot write " + path + ": it is a folder");
        // Root may write it all the same, but whoever took the permission away meant it.
        if (S_ISREG(info.st_mode) && !(info.st_mode & 0222))
            throw Error(ExitCode::device, "cannot write " + path + ": it is write-protected");
    } else if (errno != ENOENT) {
        throw system_error(ExitCode::device, "cannot write", path);
    }
    if (target.special) return target;
    std::error_code ignored;
    for (int links = 0; fs::is_symlink(fs::symlink_status(target.path, ignored)); ++links) {
        const fs::path next = fs::read_symlink(target.path, ignored);
        if (ignored || links == 40) throw Error(ExitCode::device, "cannot write " + path + ": it is a link to nowhere");
        target.path = (fs::path(target.path).parent_path() / next).string();
    }
    return target;
}

void write_special(const std::string& path, std::string_view bytes) {
    File file(path, O_WRONLY);
    if (file.fd < 0 || !write_all(file.fd, bytes) || !file.close())
        throw system_error(ExitCode::device, "cannot write", path);
}

}  // namespace

void write_file_atomic(const std::string& path, std::string_view bytes) {
    const Target target = find_target(path);
    if (target.special) return write_special(path, bytes);
    if (target.exists && ::access(target.path.c_str(), W_OK) != 0)
        throw system_error(ExitCode::device, "cannot write", path);
    Temporary temporary(target.path);
    File file(temporary.name, O_WRONLY | O_CREAT | O_EXCL, target.exists ? target.mode & 0777 : 0666);
    if (file.fd < 0) {
        temporary.kept = errno == EEXIST;  // somebody else's
        throw system_error(ExitCode::device, "cannot write", path);
    }
    if (target.exists) ::fchmod(file.fd, target.mode & 0777);
    if (!write_all(file.fd, bytes) || ::fsync(file.fd) != 0 || !file.close() ||
        ::rename(temporary.name.c_str(), target.path.c_str()) != 0)
        throw system_error(ExitCode::device, "cannot write", path);
    temporary.kept = true;
}

void append_file(const std::string& path, std::string_view text) {
    File file(path, O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (file.fd < 0 || !write_all(file.fd, text) || ::fsync(file.fd) != 0)
        throw system_error(ExitCode::device, "cannot append to", path);
}

std::string read_file(const std::string& path, uint64_t most) {
    // Opening a pipe would wait for its writer.
    const File file(path, O_RDONLY | O_NONBLOCK);
    struct stat info;
    const auto fail = [&](const std::string& why) { throw input_error(path, 0, why); };
    if (file.fd < 0 || ::fstat(file.fd, &info) != 0) fail(std::strerror(errno));
    if (!S_ISREG(info.st_mode))
        fail(S_ISDIR(info.st_mode) ? "it is a folder" : "it is no regular file, but a pipe or a device");
    if (uint64_t(info.st_size) > most)
        fail("it has " + std::to_string(info.st_size) + " bytes, and " + std::to_string(most) + " are allowed");
    std::string content(size_t(info.st_size), '\0');
    size_t got = 0;
    while (got < content.size()) {
        const ssize_t n = ::read(file.fd, content.data() + got, content.size() - got);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail(std::strerror(errno));
        if (n == 0) break;  // it became shorter meanwhile
        got += size_t(n);
    }
    content.resize(got);
    return content;
}

void make_folders(const std::string& path) {
    std::error_code reason;
    fs::create_directories(path, reason);
    if (reason) throw Error(ExitCode::device, "cannot make the folder " + path + ": " + reason.message());
}

void check_writable(const std::string& path) {
    const Target target = find_target(path);
    if (target.exists && ::access(target.path.c_str(), W_OK) != 0)
        throw system_error(ExitCode::device, "cannot write", path);
    if (target.special) return;
    const std::string folder = fs::path(target.path).parent_path().string();
    if (::access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) != 0)
        throw system_error(ExitCode::device, "cannot write", path);
}

void remove_unfinished_files() {
    for (const auto& slot : unfinished)
        if (const char* name = slot.load()) ::unlink(name);
}

}  // namespace ambilux
