// The main program of every test: Catch's, whose exit status tells skipped tests from passed ones.
#define CATCH_CONFIG_RUNNER
#include "tests/support/skip.h"

namespace {

#if __has_include(<catch2/catch_all.hpp>)
using Listener = Catch::EventListenerBase;
#else
using Listener = Catch::TestEventListenerBase;
#endif

struct CountSkipped : Listener {
    using Listener::Listener;
    void testCaseStarting(const Catch::TestCaseInfo&) override { ambilux::the_skipped_cases.asked = false; }
    void testCaseEnded(const Catch::TestCaseStats& stats) override {
        ambilux::SkippedCases& cases = ambilux::the_skipped_cases;
        ++(cases.asked && stats.totals.assertions.total() == 0 ? cases.skipped : cases.ran);
    }
};

}  // namespace

CATCH_REGISTER_LISTENER(CountSkipped)

int main(int argc, char** argv) {
    const int failed = Catch::Session().run(argc, argv);
    const ambilux::SkippedCases& cases = ambilux::the_skipped_cases;
    return failed == 0 && cases.skipped > 0 && cases.ran == 0 ? ambilux::kSkippedExit : failed;
}
