// libs: ambilux_core
// What a person sees of long work: durations, counts, progress lines and messages.
#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

#include "core/log.h"
#include "core/progress.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// What `f` writes to standard error.
std::string captured(const std::function<void()>& f) {
    std::FILE* file = std::tmpfile();
    REQUIRE(file);
    std::fflush(stderr);
    const int saved = ::dup(STDERR_FILENO);
    ::dup2(::fileno(file), STDERR_FILENO);
    f();
    std::fflush(stderr);
    ::dup2(saved, STDERR_FILENO);
    ::close(saved);
    std::rewind(file);
    std::string text;
    for (int c; (c = std::fgetc(file)) != EOF;) text += char(c);
    std::fclose(file);
    return text;
}

}  // namespace

TEST_CASE("durations and counts are short") {
    CHECK(format_duration(0.04) == "0.0 s");
    CHECK(format_duration(3.42) == "3.4 s");
    CHECK(format_duration(59.4) == "59 s");
    CHECK(format_duration(59.6) == "1 min 00 s");
    CHECK(format_duration(125) == "2 min 05 s");
    CHECK(format_duration(3600 * 5 + 12 * 60) == "5 h 12 min");
    CHECK(format_duration(INFINITY) == "?");
    CHECK(format_duration(-1) == "?");
    CHECK(format_count(12) == "12 ");
    CHECK(format_count(1234) == "1.23 k");
    CHECK(format_count(12.5e6) == "12.50 M");
    CHECK(format_count(3e9) == "3.00 G");
}

TEST_CASE("on a terminal one line renews itself, and messages do not break it") {
    const std::string text = captured([] {
        Progress progress("render", true);
        progress.update(0.25, "16 spp", 30);
        log_warning("odd");
        progress.finish();
        log_info("done");
    });
    CHECK(text ==
          "\r\033[Krender  25 %  16 spp  30 s left"
          "\r\033[Kwarning: odd\nrender  25 %  16 spp  30 s left"
          "\r\033[Kdone\n");
}

TEST_CASE("elsewhere there are plain lines, not too many") {
    const std::string text = captured([] {
        Progress progress("render", false, 0.0);
        progress.update(0.5, "a", 1);
        Progress rare("rare", false, 10.0);
        for (int i = 0; i < 1000; ++i) rare.update(i / 1000.0, "b");
    });
    CHECK(text == "render  50 %  a  1.0 s left\n");
}

TEST_CASE("quiet shows errors only") {
    const std::string text = captured([] {
        set_quiet(true);
        Progress progress("render", true);
        progress.update(0.5, "a", 1);
        log_info("i");
        log_warning("w");
        log_error("e");
        set_quiet(false);
    });
    CHECK(text == "error: e\n");
}
