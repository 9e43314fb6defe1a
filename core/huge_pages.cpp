#include "core/huge_pages.h"

#include <cstdint>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace ambilux {

void use_huge_pages(const void* begin, size_t bytes) {
#if defined(__linux__)
    constexpr uintptr_t kPage = uintptr_t(1) << 21;
    const uintptr_t first = (reinterpret_cast<uintptr_t>(begin) + kPage - 1) / kPage * kPage;
    const uintptr_t end = (reinterpret_cast<uintptr_t>(begin) + bytes) / kPage * kPage;
    if (first >= end) return;
    void* const p = reinterpret_cast<void*>(first);  // NOLINT(performance-no-int-to-ptr): rounded up
    constexpr int kCollapse = 25;  // MADV_COLLAPSE, since Linux 6.1: at once, for pages that are in use
    madvise(p, end - first, MADV_HUGEPAGE);
    madvise(p, end - first, kCollapse);
#else
    (void)begin, (void)bytes;
#endif
}

}  // namespace ambilux
