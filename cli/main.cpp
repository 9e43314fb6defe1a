#include "cli/program.h"
#include "core/ranks.h"
#if defined(AMBILUX_HAS_MPI)
#include "backends/mpi/mpi_ranks.h"
#endif

// What throws before the first `try` of the program is a mistake of ours.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
#if defined(AMBILUX_HAS_MPI)
    ambilux::join_mpi();
#endif
    const int code = ambilux::run_program(argc, argv);
    // The others wait for messages that do not come any more.
    if (code != 0 && ambilux::ranks().size() > 1) ambilux::ranks().abort(code);
#if defined(AMBILUX_HAS_MPI)
    ambilux::leave_mpi();
#endif
    return code;
}
