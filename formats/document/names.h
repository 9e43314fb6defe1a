// Names by which the parts of a scene are changed.
#pragma once

#include "formats/document/document.h"

namespace ambilux::document {

/// An object and where it hangs.
struct NamedObject {
    std::string name;
    const Object* object = nullptr;
    const Object* parent = nullptr;
    size_t child = 0;  ///< index in the parent's children
};

/// The objects of the scene in the order of the file, each once. One with an id is called by it. Others are called by
/// their parents and, behind a dot, by what they are there: the parameter that they give, or their tag, numbered from
/// the second of a tag on (floor.bsdf.reflectance, shape_2.emitter).
std::vector<NamedObject> named_objects(const Document& document);

}  // namespace ambilux::document
