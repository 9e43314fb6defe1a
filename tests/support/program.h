// The built program in a process of its own. AMBILUX_PROGRAM is its path (tests/CMakeLists.txt).
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

namespace ambilux::test {

const std::string kScenes = std::string(AMBILUX_SOURCE_DIR) + "/scenes/";
const std::string kCornell = kScenes + "cornell.xml";

struct Outcome {
    int code = -1;
    std::string out, err;
};

/// Starts a program with output and messages in files of `folder`, or with output elsewhere; `before` runs in the new
/// process first.
inline pid_t start_program(const TempFolder& folder, const std::string& program,
                           const std::vector<std::string>& arguments, const std::string& output = "",
                           const std::function<void()>& before = {}) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
        std::vector<char*> argv = {const_cast<char*>(program.c_str())};
        for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
        argv.push_back(nullptr);
        const std::string out = output.empty() ? folder / ".out" : output;
        if (!std::freopen(out.c_str(), "w", stdout) || !std::freopen((folder / ".err").c_str(), "w", stderr))
            ::_exit(99);
        for (const int number : {SIGHUP, SIGINT, SIGTERM}) ::signal(number, SIG_DFL);  // nohup and shells ignore some
        if (before) before();
        ::execvp(program.c_str(), argv.data());
        ::_exit(98);
    }
    return child;
}

inline pid_t start(const TempFolder& folder, const std::vector<std::string>& arguments, const std::string& output = "",
                   const std::function<void()>& before = {}) {
    return start_program(folder, AMBILUX_PROGRAM, arguments, output, before);
}

inline Outcome finish(const TempFolder& folder, pid_t child) {
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    const std::string out = folder / ".out";
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status),
            std::filesystem::exists(out) ? read_file(out) : "", read_file(folder / ".err")};
}

inline Outcome run(const TempFolder& folder, const std::vector<std::string>& arguments) {
    return finish(folder, start(folder, arguments));
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Arguments of a small render of the Cornell box to a.exr, and further ones.
inline std::vector<std::string> render(const TempFolder& folder, std::vector<std::string> more,
                                       const std::string& output = "a.exr") {
    std::vector<std::string> all = {"render", kCornell, "--size", "24x16", "-o", folder / output};
    all.insert(all.end(), more.begin(), more.end());
    return all;
}

/// Statistics of such a render.
inline nlohmann::json statistics(const TempFolder& folder, std::vector<std::string> more,
                                 const std::string& output = "a.exr") {
    more.insert(more.end(), {"--json", "-"});
    const Outcome o = run(folder, render(folder, more, output));
    INFO(o.err);
    REQUIRE(o.code == 0);
    return nlohmann::json::parse(o.out);
}

}  // namespace ambilux::test
