// Instances of objects. Where one stretches what is a sphere or cylinder in the object, it is of a copy of the object
// in which that is a mesh.
#include <algorithm>
#include <set>

#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

namespace {

struct Copies {
    SceneMaker& scene;
    std::map<const Object*, std::vector<const RoundShape*>> round;  ///< of each object
    std::map<const Object*, const Object*> made;

    bool stretches(const Instance& instance) const {
        const auto known = round.find(instance.group);
        if (known == round.end() || !is_stretched(Surface::sphere, instance.ctm)) return false;
        return std::any_of(known->second.begin(), known->second.end(), [&](const RoundShape* r) {
            return is_stretched(r->surface, instance.ctm * r->shape.state.ctm);
        });
    }
    const Object& copy_of(const Object& group) {
        const Object*& copy = made[&group];
        if (copy) return *copy;
        Object& with_meshes = add_object(scene.document, "shape", "shapegroup", group.where);
        std::set<const Object*> left_out;
        for (const RoundShape* r : round[&group]) left_out.insert(r->object);
        for (const document::Child& child : group.children)
            if (!left_out.contains(child.object)) with_meshes.children.push_back(child);
        for (const RoundShape* r : round[&group]) {
            scene.state = r->shape.state;
            scene.open_object = &with_meshes;
            add_shape(scene, r->shape.in, true);
        }
        return *(copy = &with_meshes);
    }
};

}  // namespace

void add_instance(SceneMaker& scene, Object& group, const Where& where) {
    check_shapes(scene.document.limits, ++scene.shape_count, where);
    Object& object = add_to_scene(scene.document, "shape", "instance", where);
    set_transform(object, "to_world", scene.state.ctm);
    scene.instances.push_back({&object, &group, scene.state.ctm});
}

void finish_instances(SceneMaker& scene) {
    Copies copies{scene, {}, {}};
    for (const RoundShape& r : scene.round_shapes) copies.round[r.shape.open_object].push_back(&r);
    for (const Instance& instance : scene.instances) {
        const bool stretches = copies.stretches(instance);
        if (stretches) note_stretched(scene, instance.object->where);
        add_child(*instance.object, stretches ? copies.copy_of(*instance.group) : *instance.group);
    }
}

}  // namespace ambilux::pbrt
