// Messages for the person at the terminal, on standard error. Results go to files or standard output, never through
// here.
#pragma once

#include <string>

namespace ambilux {

/// Only errors are shown from now on.
void set_quiet(bool quiet);
bool is_quiet();

/// One line of information; nothing when quiet.
void log_info(const std::string& message);
/// One line, marked "warning: "; nothing when quiet.
void log_warning(const std::string& message);
/// One line, marked "error: "; always shown.
void log_error(const std::string& message);

/// Shows `line` in place of the previous status line; "" removes it. Only for terminals; messages move it out of their
/// way.
void set_status_line(const std::string& line);

}  // namespace ambilux
