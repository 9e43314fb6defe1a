#include "backends/fast_build.h"

namespace ambilux {
namespace {

/// Bytes of the largest of several uses of one place, and the place.
class Shared {
public:
    /// `place`: takes a layout.
    template <class Place>
    Shared& use(Place&& place) {
        Layout dry;
        place(dry);
        bytes_ = std::max(bytes_, dry.bytes());
        return *this;
    }
    uint64_t bytes() const { return bytes_; }

private:
    uint64_t bytes_ = 0;
};

}  // namespace

FastBuildMemory FastBuildMemory::lay_out(Layout& layout, uint32_t primitives, uint32_t references,
                                         const PrimitiveBytes& bytes) {
    FastBuildMemory m{};
    const uint32_t n = references, sums = std::max(primitives, n) + 1;
    m.nodes = layout.allocate<fast::Node>(2 * uint64_t(n));
    for (int i = 0; i < 3; ++i) m.boxes[i] = layout.allocate<Bounds3f>(kBoxes[i]);
    m.room = n;
    m.scan = ScanMemory::lay_out(layout, sums, bytes);
    const auto plans = [&](Layout& l) { m.plans = l.allocate<collapse::Plan>(n); };
    const auto parts = [&](Layout& l) { m.references = l.allocate<fast::Reference>(n); };
    const auto count = [&](Layout& l) {
        m.counts = l.allocate<uint32_t>(sums);
        m.worth = l.allocate<float>(sums);
    };
    const auto sort = [&](Layout& l) { m.sort = SortMemory<uint64_t>::lay_out(l, n, bytes); };
    const auto join = [&](Layout& l) {
        for (uint32_t** list : {&m.clusters[0], &m.clusters[1], &m.partner, &m.stays})
            *list = l.allocate<uint32_t>(uint64_t(n) + 1);
    };
    const auto widen = [&](Layout& l) {
        for (uint32_t** list : {&m.wide.binary, &m.wide.first_child, &m.wide.first_primitive, &m.inner, &m.primitives})
            *list = l.allocate<uint32_t>(uint64_t(n) + 1);
    };
    const auto share = [&](auto&... uses) {
        Shared shared;
        (shared.use(uses), ...);
        std::byte* const place = layout.allocate<std::byte>(shared.bytes());
        const auto put = [&](auto& use) {
            Layout l = place ? Layout(Layout(), place) : Layout();
            use(l);
        };
        (put(uses), ...);
    };
    share(plans, parts);
    share(count, sort, join, widen);
    return m;
}

uint64_t fast_build_bytes(uint32_t primitives, const PrimitiveBytes& bytes) {
    Layout dry;
    FastBuildMemory::lay_out(dry, primitives, fast_references(primitives), bytes);
    return dry.bytes();
}

}  // namespace ambilux
