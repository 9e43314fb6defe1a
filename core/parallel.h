// Loops whose iterations run on all threads.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cstddef>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace ambilux {
namespace detail {

/// What happened before `happened(a)` happened before what follows a later `happens_after(a)`. TBB guarantees it where
/// these are called, but the thread sanitizer does not see that, for the distribution's library is not built with it.
/// Nothing without the sanitizer.
inline void happened([[maybe_unused]] void* address) {
#if defined(__SANITIZE_THREAD__)
    __tsan_release(address);
#endif
}
inline void happens_after([[maybe_unused]] void* address) {
#if defined(__SANITIZE_THREAD__)
    __tsan_acquire(address);
#endif
}

/// Number that tasks which run at the same time in one arena do not share; beyond the table some do, which can only
/// hide races.
inline std::array<char, 256> task_slots;

/// One task of a loop, from its construction to its end by return or exception.
struct TaskScope {
    char& loop_end;
    char& slot = task_slots[size_t(std::max(tbb::this_task_arena::current_thread_index(), 0)) % task_slots.size()];

    TaskScope(char& loop_begin, char& end) : loop_end(end) {
        happens_after(&loop_begin);
        happens_after(&slot);
    }
    ~TaskScope() {
        happened(&slot);
        happened(&loop_end);
    }
};

}  // namespace detail

/// Calls f(i) for 0 <= i < count on all threads of the current arena and returns when all calls have ended. `grain`:
/// the least number of iterations that are worth a task of their own. An exception from f ends the loop early and is
/// thrown on.
template <class Index, class Function>
void parallel_for(Index count, Function&& f, Index grain = 1) {
    char begin = 0, end = 0;
    detail::happened(&begin);
    try {
        tbb::parallel_for(tbb::blocked_range<Index>(0, count, grain), [&](const tbb::blocked_range<Index>& range) {
            const detail::TaskScope scope(begin, end);
            for (Index i = range.begin(); i != range.end(); ++i) f(i);
        });
    } catch (...) {
        detail::happens_after(&end);
        throw;
    }
    detail::happens_after(&end);
}

}  // namespace ambilux
