#include "cli/program.h"

// What throws before the first `try` of the program is a mistake of ours.
// NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) { return ambilux::run_program(argc, argv); }
