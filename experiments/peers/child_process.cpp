#include "experiments/peers/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/flag.h"

namespace ambilux {
namespace {

constexpr int kLookMilliseconds = 20;

Error system_error(const std::string& what) { return {ExitCode::device, what + ": " + std::strerror(errno)}; }

/// What the new process does before it becomes the program; only calls that are safe behind a fork.
[[noreturn]] void become(char* const* argv, int socket, int log) {
    // Ignored signals stay ignored in a new program; this one ignores them.
    ::signal(SIGPIPE, SIG_DFL);
    ::signal(SIGXFSZ, SIG_DFL);
    ::setpgid(0, 0);  // Ctrl-C is for this program, which then ends the other
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::dup2(socket, STDIN_FILENO);
    ::dup2(socket, STDOUT_FILENO);
    ::dup2(log, STDERR_FILENO);
    ::execvp(argv[0], argv);
    ::_exit(127);
}

}  // namespace

ChildProcess::ChildProcess(const std::vector<std::string>& command, const std::string& log_path) : log_path_(log_path) {
    std::vector<char*> argv;
    for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    const int log = ::open(log_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (log < 0) throw system_error(log_path);
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
        ::close(log);
        throw system_error("socketpair");
    }
    pid_ = ::fork();
    if (pid_ == 0) become(argv.data(), ends[1], log);
    ::close(log);
    ::close(ends[1]);
    socket_ = ends[0];
    if (pid_ < 0) {
        ::close(socket_);
        throw system_error("cannot start " + command[0]);
    }
}

ChildProcess::~ChildProcess() {
    ::close(socket_);
    if (pid_ < 0) return;
    ::kill(-pid_, SIGKILL);
    ::kill(pid_, SIGKILL);  // before it has made its group
    ::waitpid(pid_, nullptr, 0);
}

void ChildProcess::send(const std::string& line) {
    const std::string text = line + "\n";
    for (size_t done = 0; done < text.size();) {
        const ssize_t n = ::send(socket_, text.data() + done, text.size() - done, MSG_NOSIGNAL);
        if (n < 0 && errno != EINTR) return;
        if (n > 0) done += size_t(n);
    }
}

std::optional<std::string> ChildProcess::read_line(const volatile bool* interrupt) {
    for (;;) {
        if (const size_t end = buffer_.find('\n'); end != std::string::npos) {
            std::string line = buffer_.substr(0, end);
            buffer_.erase(0, end + 1);
            return line;
        }
        if (is_set(interrupt)) return std::nullopt;
        pollfd look{socket_, POLLIN, 0};
        if (::poll(&look, 1, kLookMilliseconds) <= 0) continue;
        char bytes[4096];
        const ssize_t n = ::read(socket_, bytes, sizeof bytes);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return std::nullopt;
        buffer_.append(bytes, size_t(n));
    }
}

int ChildProcess::wait(const volatile bool* interrupt) {
    // The end of the output wakes this up at once; a process that closed its output early is looked at again.
    while (read_line(interrupt)) {}
    for (int status = 0;;) {
        const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
        if (ended == pid_) {
            pid_ = -1;
            return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
        }
        if (is_set(interrupt)) return -1;
        ::poll(nullptr, 0, 1);
    }
}

std::string ChildProcess::last_words() const {
    constexpr size_t kMost = 400;
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(log_path_, ignored)) return "";
    std::string text = read_file(log_path_);
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
    if (text.size() > kMost) text = "..." + text.substr(text.size() - kMost);
    for (char& c : text)
        if (c == '\n' || c == '\r' || c == '\t') c = ' ';
    return text;
}

}  // namespace ambilux
