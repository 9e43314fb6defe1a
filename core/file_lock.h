// A lock between processes; the system releases it when its holder ends, however it does.
#pragma once

#include <string>

namespace ambilux {

class FileLock {
public:
    /// Makes the file if it is not there. Throws Error(device).
    explicit FileLock(std::string path);
    /// Releases the lock and removes its file.
    ~FileLock();
    FileLock(const FileLock&) = delete;
    FileLock& operator=(const FileLock&) = delete;

    /// False while another process has it.
    bool try_lock();

private:
    void open();

    const std::string path_;
    int fd_ = -1;
    bool held_ = false;
};

}  // namespace ambilux
