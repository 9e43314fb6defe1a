#include "core/version.h"

#include "core/version_generated.h"

namespace ambilux {

const char* version() { return AMBILUX_VERSION_STRING; }
const char* git_revision() { return AMBILUX_GIT_REVISION; }

const char* compiler() {
#if defined(__clang__)
    return "clang " __clang_version__;
#else
    return "g++ " __VERSION__;
#endif
}

}  // namespace ambilux
