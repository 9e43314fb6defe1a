#include <algorithm>
#include <map>

#include "formats/document/document.h"

namespace ambilux::document {

namespace {

/// Objects that a shape may be made of, on average.
constexpr uint64_t kObjectsPerShape = 16;

/// Of an object with all that is in it, each counted as often as it is referred to.
struct Extent {
    uint64_t objects;  ///< 0 until it is known
    uint64_t height;   ///< objects in objects
};

struct Extents {
    const Limits& limits;
    std::map<const Object*, Extent> known = {};

    Extent measure(const Object& object, uint64_t depth) {
        const auto [entry, is_new] = known.try_emplace(&object, Extent{0, 0});
        if (!is_new) return entry->second;
        Extent sum = {1, 1};
        for (const Child& child : object.children) {
            const Where& at = child.where.file.empty() ? child.object->where : child.where;
            const Extent inner = depth < limits.nesting ? measure(*child.object, depth + 1) : Extent{1, 1};
            if (inner.objects == 0) fail(at, "circular reference to id '" + child.object->id + "'");
            // What instances make of a group is limited where it is copied (Limits::copies, shapes).
            const uint64_t objects =
                child.object->type == "shapegroup" && object.type == "instance" ? 1 : inner.objects;
            sum = {sum.objects + objects, std::max(sum.height, inner.height + 1)};
            check_nesting(limits, depth + inner.height, at, "references");
            if (sum.objects / kObjectsPerShape > limits.shapes)
                fail(at, "the references of the scene make more objects of it than --limits shapes=" +
                             std::to_string(limits.shapes) + " would need");
        }
        return known[&object] = sum;
    }
};

}  // namespace

void check_references(const Document& document) { Extents{document.limits}.measure(*document.scene, 1); }

}  // namespace ambilux::document
