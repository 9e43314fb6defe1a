// Materials that shapes name before the file defines them: pbrt looks them up at its end.
#include <set>

#include "formats/pbrt/names.h"
#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

namespace {

/// The material, and all that it mixes. A mix of itself is known: what makes it says what is wrong.
bool is_known(const SceneMaker& scene, const Shared& material) {
    std::set<Shared> seen;
    std::vector<Shared> open = {material};
    while (!open.empty()) {
        const Shared next = std::move(open.back());
        open.pop_back();
        if (!next || !seen.insert(next).second) continue;
        if (next->in.directive == kNamedMaterial) return false;
        const Parameter* parts = next->in.type == "mix" ? next->in.find("materials") : nullptr;
        for (const std::string& name : parts ? parts->strings : std::vector<std::string>{}) {
            const auto known = scene.named_materials.find(name);
            if (known == scene.named_materials.end()) return false;
            open.push_back(known->second);
        }
    }
    return true;
}

}  // namespace

Shared named_material(const SceneMaker& scene, const std::string& name, const Where& where) {
    const auto known = scene.named_materials.find(name);
    if (known != scene.named_materials.end()) return known->second;
    return std::make_shared<const Described>(Described{{kNamedMaterial, name, where, {}}});
}

void add_shape_when_known(SceneMaker& scene, Parameters in) {
    // The name may be defined by now.
    if (scene.state.material && scene.state.material->in.directive == kNamedMaterial)
        scene.state.material = named_material(scene, scene.state.material->in.type, scene.state.material->in.where);
    if (is_known(scene, scene.state.material)) return add_shape(scene, in);
    document::check_shapes(scene.document.limits, scene.late_shapes.size() + 1, in.where);
    scene.late_shapes.push_back({std::move(in), scene.state, scene.open_object});
}

void finish_shapes(SceneMaker& scene) {
    for (LateShape& late : scene.late_shapes) {
        scene.state = std::move(late.state);
        scene.open_object = late.open_object;
        const Shared& material = scene.state.material;
        if (material->in.directive == kNamedMaterial)
            scene.state.material = known_as(scene.named_materials, material->in.type, material->in.where, "material");
        add_shape(scene, late.in);
    }
    scene.late_shapes.clear();
}

}  // namespace ambilux::pbrt
