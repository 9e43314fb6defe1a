#include <algorithm>

#include "formats/document/shape_jobs.h"

namespace ambilux::document {

void read_obj_parts(Builder& builder, Reader& in, MeshSource& source) {
    in.ignore({"collapse"});  // one shape per group or for all looks the same
    const bool load = in.boolean("load_materials", true);
    if (in.object().version >= 2) return;
    if (in.integer("shape_index", -1) >= 0)
        builder.refuse(in.where("shape_index"), "a single part of an obj file is not supported", "all are shown");
    const auto& children = in.object().children;
    source.lacks_materials =
        load && std::none_of(children.begin(), children.end(), [](const Child& c) { return c.object->tag == "bsdf"; });
}

}  // namespace ambilux::document
