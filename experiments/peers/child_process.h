// A program that runs beside this one and is talked to in lines.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace ambilux {

/// Its standard input and output are lines to and from this process; what it writes to standard error goes to a file.
/// It ends with this object, and with this process however that ends.
class ChildProcess {
public:
    /// Starts `command` (program and arguments). Throws Error(device).
    ChildProcess(const std::vector<std::string>& command, const std::string& log_path);
    ~ChildProcess();
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;

    /// Adds the end of the line. A process that has ended does not hear it.
    void send(const std::string& line);
    /// The next line without its end. Nothing once *interrupt is true, or when the process has closed its output.
    std::optional<std::string> read_line(const volatile bool* interrupt);
    /// Waits for the end; the exit status, 128 plus the signal that ended it, or -1 if interrupted.
    int wait(const volatile bool* interrupt);
    /// The end of what it wrote to standard error, in one line.
    std::string last_words() const;

private:
    std::string log_path_, buffer_;
    pid_t pid_ = -1;
    int socket_ = -1;
};

}  // namespace ambilux
