// A flag that a signal handler or another thread sets.
#pragma once

namespace ambilux {

/// False without a flag.
inline bool is_set(const volatile bool* flag) { return flag && __atomic_load_n(flag, __ATOMIC_RELAXED); }
inline void set_flag(volatile bool* flag) { __atomic_store_n(flag, true, __ATOMIC_RELAXED); }

}  // namespace ambilux
