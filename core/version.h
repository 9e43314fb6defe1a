// Which build this is; goes into every file the program writes.
#pragma once

namespace ambilux {

/// Version of the project, "MAJOR.MINOR.PATCH".
const char* version();
/// Abbreviated git revision of the sources at build time, with "-dirty" when files differed from it; "unknown" outside
/// a git checkout.
const char* git_revision();
/// Compiler and its version, for manifests.
const char* compiler();

}  // namespace ambilux
