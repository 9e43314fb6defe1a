#include "formats/document/names.h"

#include <set>

namespace ambilux::document {

namespace {

struct Namer {
    std::vector<NamedObject> all;
    std::set<const Object*> seen;
    std::set<std::string> taken;

    std::string free_name(const std::string& wanted) {
        std::string name = wanted;
        for (int i = 2; !taken.insert(name).second; ++i) name = wanted + "_" + std::to_string(i);
        return name;
    }

    void visit(const Object& parent, const std::string& prefix) {
        for (size_t i = 0; i < parent.children.size(); ++i) {
            const Child& child = parent.children[i];
            const Object& object = *child.object;
            if (!seen.insert(&object).second) continue;
            const std::string part = child.name.empty() ? object.tag : child.name;
            const std::string name = object.id.empty() ? free_name(prefix + part) : object.id;
            all.push_back({name, &object, &parent, i});
            visit(object, name + ".");
        }
    }
};

}  // namespace

std::vector<NamedObject> named_objects(const Document& document) {
    Namer namer;
    for (const auto& object : document.storage)
        if (!object->id.empty()) namer.taken.insert(object->id);
    namer.visit(*document.scene, "");
    return std::move(namer.all);
}

}  // namespace ambilux::document
