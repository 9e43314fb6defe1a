// Large arrays on large pages: random access to more memory than the address translation cache covers is otherwise
// bound by page walks.
#pragma once

#include <cstddef>

namespace ambilux {

/// Asks the system to put memory that is in use on huge pages, where whole ones fit. A hint: nothing happens where that
/// is not possible.
void use_huge_pages(const void* begin, size_t bytes);

}  // namespace ambilux
