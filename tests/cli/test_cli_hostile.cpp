// libs: ambilux_film
// timeout: 300
// The built program with outputs that must not be lost, signals at any time, full disks and files from strangers.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/file_lock.h"
#include "film/exr_io.h"
#include "tests/support/program.h"

using namespace ambilux;
using namespace ambilux::test;
namespace fs = std::filesystem;

namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Waits until `is` becomes true; false after half a minute.
bool wait_for(const std::function<bool()>& is) {
    for (const auto start = Clock::now(); since(start) < 30;) {
        if (is()) return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

/// The process is the program, no longer a copy of this test, and catches the signal (proc(5), SigCgt).
bool catches(pid_t process, int signal) {
    const std::string proc = "/proc/" + std::to_string(process);
    std::error_code not_yet;
    if (!fs::equivalent(proc + "/exe", AMBILUX_PROGRAM, not_yet)) return false;
    std::ifstream status(proc + "/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind("SigCgt:", 0) == 0) return std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1;
    return false;
}

bool has_temporary_files(const TempFolder& folder) {
    for (const auto& entry : fs::directory_iterator(folder.path))
        if (contains(entry.path().filename().string(), ".tmp-")) return true;
    return false;
}

std::vector<std::string> reference(const TempFolder& folder, const std::string& spp,
                                   std::vector<std::string> more = {}) {
    std::vector<std::string> all = {"reference", kCornell, "--size", "24x16", "--spp", spp, "-o", folder / "r.exr"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
}

}  // namespace

TEST_CASE("outputs are checked before work begins, and inputs are not written over") {
    const TempFolder folder;
    const std::string scene = folder.write("scene.xml", read_file(kCornell)), a = folder / "a.exr";
    const std::string locked = folder.write("locked.exr", "old");
    fs::permissions(locked, fs::perms(0444));
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const std::string with_mesh =
        folder.write("mesh.xml",
                     "<scene version='3.0.0'><sensor type='perspective'/><shape type='obj'><string "
                     "name='filename' value='m.obj'/></shape></scene>");
    struct Case {
        std::vector<std::string> arguments;
        int code;
        std::string message;
    };
    const std::vector<Case> cases = {
        {{"render", scene, "-o", ""}, 2, "-o: the image needs a name"},
        {{"render", scene, "-o", scene}, 2, "would replace a file that is read"},
        {{"render", with_mesh, "-o", folder / "m.obj"}, 2, "would replace a file that is read"},
        {{"info", scene, "--json", scene}, 2, "would replace a file that is read"},
        {{"render", scene, "-o", a, "--json", a}, 2, "-o and --json name the same file"},
        {{"render", scene, "-o", folder / "a", "--png", folder / "./a"}, 2, "-o and --png name the same file"},
        {{"render", scene, "-o", locked}, 4, "it is write-protected"},
        {{"render", scene, "-o", a, "--exposure", "nan", "--png", folder / "a.png"}, 2, "--exposure"},
        {{"render", scene, "-o", a, "--seed", "-1"}, 2, "--seed"},
        {{"render", scene, "-o", a, "--spp", "-1"}, 2, "--spp"},
        {{"render", scene, "-o", a, "--time", "inf"}, 2, "--time"},
        {{"render", scene, "-o", a, "--limits", "bites=3"}, 2, "known are pixels="},
        {{"render", scene, "-o", a, "--limits", "shapes=1"}, 3, "--limits shapes=1"},
        {reference(folder, "4", {"--png", locked + "/r.png"}), 4, "cannot make the folder"},
        {reference(folder, "4", {"--json", folder / "r.exr"}), 2, "-o and --json name the same file"},
        {{"reference", scene, "--spp", "4", "-o", ""}, 2, "-o: the reference needs a name"},
        {{"compare", a, a, "--json", locked + "/c.json"}, 4, "cannot make the folder"},
    };
    for (const Case& c : cases) {
        const Outcome o = run(folder, c.arguments);
        std::string line;
        for (const std::string& argument : c.arguments) line += argument + " ";
        CAPTURE(line, o.err);
        CHECK(o.code == c.code);
        CHECK(contains(o.out + o.err, c.message));
        CHECK_FALSE(fs::exists(a));
        CHECK_FALSE(fs::exists(folder.path / "r.exr"));
    }
    CHECK(read_file(scene) == read_file(kCornell));
    CHECK(read_file(locked) == "old");

    fs::create_symlink("real.exr", folder / "link.exr");
    CHECK(run(folder, render(folder, {"--spp", "1"}, "link.exr")).code == 0);
    CHECK(fs::is_symlink(folder / "link.exr"));
    CHECK(read_exr(folder / "real.exr").width == 24);
    CHECK(run(folder, {"render", kCornell, "--size", "8x8", "--spp", "1", "-o", "/dev/null"}).code == 0);
    CHECK(fs::is_character_file("/dev/null"));
}

TEST_CASE("what cannot be printed is an error") {
    const TempFolder folder;
    REQUIRE(run(folder, render(folder, {"--spp", "2"})).code == 0);
    const std::vector<std::vector<std::string>> commands = {
        {"info", kCornell},
        {"info", kCornell, "--json", "-"},
        {"compare", folder / "a.exr", folder / "a.exr"},
        {"render", "--help"},
        {"help", "settings"},
        {"--version"},
    };
    for (const auto& command : commands) {
        CAPTURE(command[0]);
        if (fs::exists("/dev/full")) {
            const Outcome full = finish(folder, start(folder, command, "/dev/full"));
            CHECK(full.code == 4);
            CHECK(contains(full.err, "cannot write to standard output"));
        }
        // A pipe whose reader is gone.
        const Outcome closed = finish(folder, start(folder, command, "", [] {
                                          int ends[2];
                                          if (::pipe(ends) != 0 || ::dup2(ends[1], STDOUT_FILENO) < 0) ::_exit(97);
                                          ::close(ends[0]);
                                      }));
        CHECK(closed.code == 4);
        CHECK(contains(closed.err, "cannot write to standard output"));
    }
}

TEST_CASE("inputs that need not end are refused, and messages show no raw bytes") {
    const TempFolder folder;
    const std::string pipe = folder / "pipe";
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    for (const std::string& path : {pipe, std::string("/dev/zero")}) {
        const Outcome o = run(folder, {"info", path});
        CHECK(o.code == 3);
        CHECK(contains(o.err, "no regular file"));
    }
    folder.write("m.ply", "ply\nformat ascii 1.0\nelement \x1b[2J\xff 1\nproperty half x\n");
    const std::string scene =
        folder.write("s.xml",
                     "<scene version='3.0.0'><sensor type='perspective'/><shape type='ply'><string "
                     "name='filename' value='m.ply'/></shape></scene>");
    folder.write("m.ply", "ply\nformat \x1b[2J\xff 1.0\n");
    const Outcome o = run(folder, {"info", scene});
    CHECK(o.code == 3);
    CHECK(contains(o.err, "unknown format '\\x1b[2J\\xff'"));
    CHECK_FALSE(contains(o.err, "\x1b"));
}

TEST_CASE("signals end loading at once, and without a trace") {
    const TempFolder folder;
    std::string text = "<scene version='3.0.0'><sensor type='perspective'/>";
    for (int i = 0; i < 300000; ++i) text += "<shape type='cube'/>\n";
    const std::string scene = folder.write("s.xml", text + "</scene>");
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        const pid_t child = start(folder, {"render", scene, "--spp", "1", "-o", folder / "a.exr"});
        REQUIRE(wait_for([&] { return catches(child, signal); }));
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        ::kill(child, signal);
        const auto sent = Clock::now();
        const Outcome o = finish(folder, child);
        CAPTURE(signal, o.err);
        CHECK(o.code == 5);
        CHECK(since(sent) < 1);
        CHECK(contains(o.err, "interrupted before there was anything to save"));
        CHECK_FALSE(fs::exists(folder / "a.exr"));
        CHECK_FALSE(has_temporary_files(folder));
    }
}

TEST_CASE("SIGHUP saves what a render has, unless nohup ignores it") {
    const TempFolder folder;
    const auto is_rendering = [&] {
        return fs::exists(folder / ".err") && contains(read_file(folder / ".err"), "spp");
    };
    pid_t child = start(folder, render(folder, {"--spp", "100000000"}));
    REQUIRE(wait_for(is_rendering));
    ::kill(child, SIGHUP);
    Outcome o = finish(folder, child);
    CHECK(o.code == 5);
    Attributes a;
    read_exr(folder / "a.exr", &a);
    CHECK(a["spp"].get<int>() >= 1);

    fs::remove(folder / ".err");
    child = start(folder, render(folder, {"--time", "4"}), "", [] { ::signal(SIGHUP, SIG_IGN); });
    REQUIRE(wait_for(is_rendering));
    ::kill(child, SIGHUP);
    CHECK(finish(folder, child).code == 0);
}

TEST_CASE("a file that may not grow as large is an error that leaves nothing behind") {
    const TempFolder folder;
    const Outcome o = finish(
        folder, start(folder, {"render", kCornell, "--size", "256x256", "--spp", "1", "-o", folder / "a.exr"}, "", [] {
            const rlimit limit = {20000, 20000};
            ::setrlimit(RLIMIT_FSIZE, &limit);
        }));
    CHECK(o.code == 4);
    CHECK(contains(o.err, "File too large"));
    CHECK_FALSE(fs::exists(folder / "a.exr"));
    CHECK_FALSE(has_temporary_files(folder));
}

TEST_CASE("two processes make one reference one after the other, and one that waits can be ended") {
    const TempFolder folder, other;
    const pid_t many = start(folder, reference(folder, "300"));
    std::vector<std::string> same = reference(folder, "100");
    const pid_t few = start(other, same);
    CHECK(finish(folder, many).code == 0);
    CHECK(finish(other, few).code == 0);
    CHECK(read_reference_exr(folder / "r.exr").samples == 300);
    CHECK_FALSE(fs::exists(folder / ".r.exr.lock"));

    FileLock lock(folder / ".r.exr.lock");
    REQUIRE(lock.try_lock());
    fs::remove(other / ".err");
    const pid_t waiting = start(other, reference(folder, "400"));
    REQUIRE(
        wait_for([&] { return fs::exists(other / ".err") && contains(read_file(other / ".err"), "waiting for it"); }));
    const auto sent = Clock::now();
    ::kill(waiting, SIGTERM);
    CHECK(finish(other, waiting).code == 5);
    CHECK(since(sent) < 1);
    CHECK(read_reference_exr(folder / "r.exr").samples == 300);
}

TEST_CASE("a reference with a changed bit, or by other roulette, is not continued") {
    const TempFolder folder;
    REQUIRE(run(folder, reference(folder, "4")).code == 0);
    Outcome o = run(folder, reference(folder, "8", {"--set", "rr_depth=2"}));
    CHECK(o.code == 3);
    CHECK(contains(o.err, "its rr_depth is "));
    std::string bytes = read_file(folder / "r.exr");
    bytes[bytes.size() / 2] = char(bytes[bytes.size() / 2] ^ 4);
    write_file_atomic(folder / "r.exr", bytes);
    o = run(folder, reference(folder, "8"));
    CHECK(o.code == 3);
    CHECK(contains(o.err, "r.exr: is damaged"));
}
