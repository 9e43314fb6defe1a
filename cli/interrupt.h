// What signals do. As long as nothing is to be saved they end the program; later they set a flag that work looks at.
#pragma once

namespace ambilux {

/// From now on SIGINT, SIGTERM and, unless it is ignored, SIGHUP end the program with code 5. A write to a closed pipe
/// or beyond the allowed size of a file fails instead of ending the program.
void install_interrupt_handler();

/// From now on there is something to save: a first signal only sets the flag that is returned, a second one ends the
/// program at once.
const volatile bool* save_when_interrupted();

}  // namespace ambilux
