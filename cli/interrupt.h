// Ctrl-C as a flag that work looks at between batches.
#pragma once

namespace ambilux {

/// From now on SIGINT and SIGTERM set the flag instead of ending the program; a second one ends it at once.
void install_interrupt_handler();

/// True once a signal came.
const volatile bool* interrupt_flag();

}  // namespace ambilux
