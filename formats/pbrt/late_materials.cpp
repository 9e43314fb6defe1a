// Materials that shapes name before the file defines them: pbrt looks them up at its end.
#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

namespace {

bool is_known(const SceneMaker& scene, const Shared& material, uint64_t depth) {
    if (!material) return true;
    const bool is_name = material->in.directive == kNamedMaterial;
    if (!is_name && material->in.type != "mix") return true;
    const Parameter* parts = is_name ? nullptr : material->in.find("materials");
    if (!is_name && !parts) return true;
    // A mix of itself is known: what makes it says what is wrong.
    if (depth > scene.named_materials.size()) return true;
    for (const std::string& name : is_name ? std::vector<std::string>{material->in.type} : parts->strings) {
        const auto known = scene.named_materials.find(name);
        if (known == scene.named_materials.end() || !is_known(scene, known->second, depth + 1)) return false;
    }
    return true;
}

}  // namespace

Shared named_material(const SceneMaker& scene, const std::string& name, const Where& where) {
    const auto known = scene.named_materials.find(name);
    if (known != scene.named_materials.end()) return known->second;
    Described later;
    later.in.directive = kNamedMaterial;
    later.in.type = name;
    later.in.where = where;
    return std::make_shared<const Described>(std::move(later));
}

void add_shape_when_known(SceneMaker& scene, Parameters in) {
    if (is_known(scene, scene.state.material, 0)) return add_shape(scene, in);
    if (scene.late_shapes.size() >= scene.document.limits.shapes)
        fail(in.where,
             "the scene has more shapes than --limits shapes=" + std::to_string(scene.document.limits.shapes));
    scene.late_shapes.push_back({std::move(in), scene.state, scene.open_object});
}

void finish_shapes(SceneMaker& scene) {
    for (LateShape& late : scene.late_shapes) {
        scene.state = std::move(late.state);
        scene.open_object = late.open_object;
        const Shared& material = scene.state.material;
        if (material->in.directive == kNamedMaterial) {
            const auto known = scene.named_materials.find(material->in.type);
            if (known == scene.named_materials.end())
                fail(material->in.where, "unknown material '" + material->in.type + "'");
            scene.state.material = known->second;
        }
        add_shape(scene, late.in);
    }
    scene.late_shapes.clear();
}

}  // namespace ambilux::pbrt
