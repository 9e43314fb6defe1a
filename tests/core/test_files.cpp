// libs: ambilux_core
// timeout: 60
// Files that are read, written, locked, and named in messages.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <thread>
#include <vector>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/file_lock.h"
#include "core/memory_reserve.h"
#include "core/outputs.h"
#include "core/printable.h"
#include "tests/support/skip.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;
namespace fs = std::filesystem;

namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
constexpr bool kSanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
constexpr bool kSanitized = false;
#endif

template <class F>
std::string error_of(ExitCode code, const F& f) {
    try {
        f();
    } catch (const Error& e) {
        CHECK(int(e.code) == int(code));
        return e.what();
    }
    return "no error";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Exit status of `f` in a process of its own, which may set limits.
template <class F>
int in_child(const F& f) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(f());
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace

TEST_CASE("links are followed, and what they lead to is replaced") {
    const test::TempFolder folder;
    const std::string real = folder.write("deep/real.txt", "old");
    fs::create_symlink("deep/real.txt", folder / "one");
    fs::create_symlink(folder / "one", folder / "two");
    write_file_atomic(folder / "two", "new");
    CHECK(read_file(real) == "new");
    CHECK(fs::is_symlink(folder / "one"));
    CHECK(fs::is_symlink(folder / "two"));
    // One to a file that is not there yet, and one to itself.
    fs::create_symlink("deep/fresh.txt", folder / "three");
    write_file_atomic(folder / "three", "fresh");
    CHECK(read_file(folder / "deep/fresh.txt") == "fresh");
    fs::create_symlink("loop", folder / "loop");
    CHECK(contains(error_of(ExitCode::device, [&] { write_file_atomic(folder / "loop", "x"); }), "cannot write"));
    CHECK(contains(error_of(ExitCode::device, [&] { check_writable(folder / "loop"); }), "cannot write"));
    CHECK(fs::is_symlink(folder / "loop"));
}

TEST_CASE("devices and pipes are written to, not replaced") {
    const test::TempFolder folder;
    write_file_atomic("/dev/null", "nothing");
    CHECK(fs::is_character_file("/dev/null"));
    const std::string pipe = folder / "pipe";
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    check_writable(pipe);  // does not wait for a reader
    std::string got;
    std::thread reader([&] {
        const int fd = ::open(pipe.c_str(), O_RDONLY);
        char buffer[16];
        for (ssize_t n; (n = ::read(fd, buffer, sizeof buffer)) > 0;) got.append(buffer, size_t(n));
        ::close(fd);
    });
    write_file_atomic(pipe, "through the pipe");
    reader.join();
    CHECK(got == "through the pipe");
    CHECK(fs::is_fifo(pipe));
    if (fs::exists("/dev/full"))
        CHECK(contains(error_of(ExitCode::device, [] { write_file_atomic("/dev/full", "x"); }), "No space left"));
}

TEST_CASE("a file without permission to write is refused, even to root, and keeps its content; modes are kept") {
    const test::TempFolder folder;
    const std::string path = folder.write("a.txt", "old");
    fs::permissions(path, fs::perms(0444));
    CHECK(contains(error_of(ExitCode::device, [&] { write_file_atomic(path, "new"); }), "it is write-protected"));
    CHECK(contains(error_of(ExitCode::device, [&] { check_writable(path); }), "it is write-protected"));
    CHECK(read_file(path) == "old");
    fs::permissions(path, fs::perms(0640));
    write_file_atomic(path, "new");
    CHECK(fs::status(path).permissions() == fs::perms(0640));
    CHECK(folder.files() == 1);
}

TEST_CASE("a write that fails leaves no temporary file: the size of files is limited") {
    const test::TempFolder folder;
    const std::string path = folder.write("a.txt", "old");
    CHECK(in_child([&] {
              ::signal(SIGXFSZ, SIG_IGN);
              const rlimit limit = {1 << 16, 1 << 16};
              ::setrlimit(RLIMIT_FSIZE, &limit);
              try {
                  write_file_atomic(path, std::string(1 << 20, 'x'));
              } catch (const Error& e) {
                  return contains(e.what(), "File too large") ? 0 : 2;
              }
              return 1;
          }) == 0);
    CHECK(read_file(path) == "old");
    CHECK(folder.files() == 1);
}

TEST_CASE("what need not end is not read") {
    const test::TempFolder folder;
    const std::string pipe = folder / "pipe";
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    for (const std::string& path : {pipe, std::string("/dev/zero"), folder.path.string()})
        CHECK(contains(error_of(ExitCode::bad_input, [&] { read_file(path); }), path + ": it is "));
    const std::string path = folder.write("a.txt", "12345");
    CHECK(read_file(path, 5) == "12345");
    CHECK(contains(error_of(ExitCode::bad_input, [&] { read_file(path, 4); }), "it has 5 bytes, and 4 are allowed"));
    CHECK(contains(error_of(ExitCode::bad_input, [&] { read_file(folder / "none"); }), "No such file or directory"));
}

TEST_CASE("outputs are distinct files that can be written, and no inputs") {
    const test::TempFolder folder;
    const std::string a = folder.write("a", "1"), b = folder / "b";
    fs::create_symlink(a, folder / "link");
    fs::create_hard_link(a, folder / "hard");
    check_outputs({{"-o", a}, {"--json", b}, {"--png", ""}, {"--x", "-"}, {"--y", "-"}});
    check_outputs({{"-o", "/dev/null"}, {"--json", "/dev/null"}});
    for (const std::string& other :
         {a, folder / "link", folder / "hard", folder / "./a", folder / "../" + folder.path.filename().string() + "/a"})
        CHECK(contains(error_of(ExitCode::usage, [&] { check_outputs({{"-o", a}, {"--json", other}}); }),
                       "-o and --json name the same file"));
    CHECK(contains(error_of(ExitCode::usage, [&] { check_outputs({{"-o", b}, {"--json", folder / "./b"}}); }),
                   "-o and --json name the same file"));
    check_outputs({{"-o", folder / "new/folder/a"}});
    CHECK(fs::is_directory(folder / "new/folder"));
    CHECK(!fs::exists(folder / "new/folder/a"));
    CHECK(contains(error_of(ExitCode::device, [&] { check_outputs({{"-o", a + "/b"}}); }), "cannot make the folder"));
    CHECK(contains(error_of(ExitCode::device, [&] { check_outputs({{"-o", folder.path.string()}}); }), "a folder"));
    check_not_inputs({{"-o", b}, {"--json", "-"}}, {a});
    CHECK(contains(error_of(ExitCode::usage, [&] { check_not_inputs({{"-o", folder / "link"}}, {a}); }),
                   "would replace a file that is read"));
}

TEST_CASE("a lock has one holder, passes on, and leaves no file") {
    const test::TempFolder folder;
    const std::string path = folder / ".lock";
    {
        FileLock first(path);
        REQUIRE(first.try_lock());
        FileLock second(path);
        CHECK_FALSE(second.try_lock());
        CHECK(in_child([&] { return FileLock(path).try_lock() ? 1 : 0; }) == 0);
    }
    CHECK_FALSE(fs::exists(path));
    auto first = std::make_unique<FileLock>(path);
    REQUIRE(first->try_lock());
    FileLock waiting(path), third(path);
    first.reset();
    // The file that it opened is gone: it must not hold a lock that nobody else sees.
    CHECK(waiting.try_lock());
    CHECK_FALSE(third.try_lock());
    CHECK_FALSE(FileLock(path).try_lock());
}

TEST_CASE("memory that is kept is there when all else is used up") {
    if (kSanitized) return skip("sanitizers need more addresses than the test allows");
    CHECK(in_child([] {
              constexpr size_t kKept = 64 << 20, kPiece = 1 << 20;
              MemoryReserve reserve(kKept);
              const rlimit limit = {1ull << 30, 1ull << 30};
              ::setrlimit(RLIMIT_AS, &limit);
              std::vector<void*> hog;
              hog.reserve(1 << 14);
              for (void* piece; (piece = ::malloc(kPiece));) hog.push_back(piece);
              if (hog.size() > 1 << 13) return 2;
              try {
                  std::vector<char> late(kKept - kPiece);
                  return 3;
              } catch (const std::bad_alloc&) {}
              reserve.release();
              try {
                  std::vector<char> late(kKept - kPiece);
              } catch (const std::bad_alloc&) {
                  return 1;
              }
              return 0;
          }) == 0);
}

TEST_CASE("messages show no raw bytes of files, and their text as it is") {
    CHECK(printable("Größe 5 µm: „ab“\tc\n") == "Größe 5 µm: „ab“\tc\n");
    CHECK(printable(std::string("a\x1b[2J\r\x00z\x7f", 9)) == "a\\x1b[2J\\x0d\\x00z\\x7f");
    CHECK(printable("\xff\xc3(\xed\xa0\x80\xc0\x80\xf4\x90\x80\x80\xc2\x85\xe2\x82") ==
          "\\xff\\xc3(\\xed\\xa0\\x80\\xc0\\x80\\xf4\\x90\\x80\\x80\\xc2\\x85\\xe2\\x82");
    CHECK(printable(std::string(100000, 'x')).size() < 5000);
    CHECK(contains(printable(std::string(100000, 'x')), "(100000 bytes)"));
}
