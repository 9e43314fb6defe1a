#include "core/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace ambilux {

FileLock::FileLock(std::string path) : path_(std::move(path)) { open(); }

void FileLock::open() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (fd_ < 0) throw Error(ExitCode::device, "cannot write " + path_ + ": " + std::strerror(errno));
}

bool FileLock::try_lock() {
    for (;;) {
        if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) return false;
        // The holder before may have removed the file that we opened: then a third one locks a new file of this name.
        struct stat ours, named;
        if (::fstat(fd_, &ours) == 0 && ::stat(path_.c_str(), &named) == 0 && ours.st_ino == named.st_ino &&
            ours.st_dev == named.st_dev)
            return held_ = true;
        open();
    }
}

FileLock::~FileLock() {
    if (held_) ::unlink(path_.c_str());
    if (fd_ >= 0) ::close(fd_);
}

}  // namespace ambilux
