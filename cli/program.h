// The program: reads the command line, runs one command, turns errors into messages and exit codes (docs/program.md).
#pragma once

namespace ambilux {

/// Returns the exit code. Changes what signals do (cli/interrupt.h).
int run_program(int argc, const char* const* argv);

}  // namespace ambilux
