#include <algorithm>
#include <map>

#include "core/math.h"
#include "formats/file_budget.h"
#include "formats/front_end.h"
#include "formats/gltf/model.h"

namespace ambilux {
namespace gltf {
namespace {

using namespace document;

/// What an instance takes until the scene is built, measured.
constexpr uint64_t kBytesOfInstance = 1600;

class SceneMaker {
public:
    explicit SceneMaker(Context& context)
        : c_(context), uses_(c_.model.meshes.size()), parents_(c_.model.nodes.size(), -1) {
        for (size_t i = 0; i < c_.model.nodes.size(); ++i) {
            const tinygltf::Node& node = c_.model.nodes[i];
            if (node.mesh >= 0 && size_t(node.mesh) < uses_.size())
                uses_[size_t(node.mesh)] += has_instances(node) ? 2 : 1;
            for (const int child : node.children)
                if (child >= 0 && size_t(child) < parents_.size()) parents_[size_t(child)] = int(i);
        }
    }

    void make() {
        for (const int node : roots()) visit(node, {}, 1, true);
        if (shown_ == 0) c_.fail("it shows no triangles");
        Object& sensor = sensor_ ? *sensor_ : add_default_camera(c_, lower_, upper_);
        add_child(*c_.document.scene, sensor);
        add_to_scene(c_.document, "integrator", "path", c_.where);
        if (c_.emits) return;
        c_.note("the file has no light: an environment of radiance 1 is used");
        set_rgb(add_to_scene(c_.document, "emitter", "constant", c_.where), "radiance", splat(1));
    }

private:
    std::vector<int> roots() {
        const tinygltf::Model& model = c_.model;
        if (!model.scenes.empty()) {
            const size_t index = model.defaultScene < 0 ? 0 : size_t(model.defaultScene);
            if (index >= model.scenes.size()) c_.fail("there is no scene " + std::to_string(index));
            if (model.scenes.size() > 1) c_.note("one of several scenes is used: the default one");
            return model.scenes[index].nodes;
        }
        c_.note("the file has no scene: all its nodes are used");
        std::vector<int> out;
        for (size_t i = 0; i < parents_.size(); ++i)
            if (parents_[i] < 0) out.push_back(int(i));
        return out;
    }

    static bool has_instances(const tinygltf::Node& node) {
        return node.extensions.contains("EXT_mesh_gpu_instancing");
    }

    /// From a node to the world.
    Matrix global(int node) const {
        Matrix m;
        for (size_t steps = 0; node >= 0; node = parents_[size_t(node)]) {
            if (size_t(node) >= parents_.size()) c_.fail("there is no node " + std::to_string(node));
            check_nesting(c_.document.limits, ++steps, c_.where, "nodes");
            m = local(c_.model.nodes[size_t(node)]) * m;
        }
        return m;
    }

    Pose pose_of(const tinygltf::Node& node) const {
        Pose pose;
        const tinygltf::Model& model = c_.model;
        const std::vector<double>& weights =
            node.weights.empty() ? model.meshes[size_t(node.mesh)].weights : node.weights;
        pose.weights = weights;
        if (node.skin < 0) return pose;
        const std::string what = "skin " + std::to_string(node.skin);
        if (size_t(node.skin) >= model.skins.size()) c_.fail("there is no " + what);
        const tinygltf::Skin& skin = model.skins[size_t(node.skin)];
        std::vector<double> inverse;
        if (skin.inverseBindMatrices >= 0)
            inverse = accessor_values(c_, skin.inverseBindMatrices, 16, what + ", inverseBindMatrices");
        if (!inverse.empty() && inverse.size() < 16 * skin.joints.size())
            c_.fail(what + " has fewer matrices than joints");
        for (size_t i = 0; i < skin.joints.size(); ++i) {
            Matrix bind;
            for (int k = 0; k < 16 && !inverse.empty(); ++k) bind.m[k % 4][k / 4] = inverse[16 * i + size_t(k)];
            if (skin.joints[i] < 0) c_.fail(what + " has a joint that is no node");
            pose.joints.push_back(global(skin.joints[i]) * bind);
        }
        if (pose.joints.empty()) c_.fail(what + " has no joints");
        return pose;
    }

    /// Transforms of EXT_mesh_gpu_instancing.
    std::vector<Matrix> instances_of(const tinygltf::Node& node) {
        const tinygltf::Value* given = extension(node.extensions, "EXT_mesh_gpu_instancing");
        if (!given || !given->Has("attributes")) return {Matrix{}};
        const tinygltf::Value& attributes = given->Get("attributes");
        const auto values = [&](const char* name, int n) {
            const int accessor = integer(&attributes, name, -1);
            return accessor < 0 ? std::vector<double>{}
                                : accessor_values(c_, accessor, n, "node '" + node.name + "', " + name);
        };
        const std::vector<double> t = values("TRANSLATION", 3), r = values("ROTATION", 4), s = values("SCALE", 3);
        const size_t count = std::max({t.size() / 3, r.size() / 4, s.size() / 3});
        for (const auto& [list, n] : {std::pair{&t, 3}, std::pair{&r, 4}, std::pair{&s, 3}})
            if (!list->empty() && list->size() != count * size_t(n))
                c_.fail("node '" + node.name + "' has instances of unequal attributes");
        // A few bytes may ask for millions: accessors without a buffer are zeros.
        instances_ += count;
        FileBudget(c_.where.file, c_.document.limits).bytes(instances_, kBytesOfInstance);
        std::vector<Matrix> out;
        for (size_t i = 0; i < count; ++i) {
            tinygltf::Node place;
            const auto part = [i](const std::vector<double>& from, std::vector<double>& to, int n) {
                if (!from.empty())
                    to.assign(from.begin() + std::ptrdiff_t(i) * n, from.begin() + std::ptrdiff_t(i + 1) * n);
            };
            part(t, place.translation, 3), part(r, place.rotation, 4), part(s, place.scale, 3);
            out.push_back(local(place));
        }
        return out;
    }

    Matrix local(const tinygltf::Node& node) const {
        Matrix m;
        if (node.matrix.size() == 16) {
            for (int i = 0; i < 16; ++i) m.m[i % 4][i / 4] = node.matrix[size_t(i)];
        } else {
            const auto value = [](const std::vector<double>& v, size_t i, double fallback) {
                return i < v.size() ? v[i] : fallback;
            };
            const auto &t = node.translation, &r = node.rotation, &s = node.scale;
            const double x = value(r, 0, 0), y = value(r, 1, 0), z = value(r, 2, 0), w = value(r, 3, 1);
            const double l2 = x * x + y * y + z * z + w * w, n = l2 > 0 ? 2 / l2 : 0;
            const Matrix q = from_columns({1 - n * (y * y + z * z), n * (x * y + z * w), n * (x * z - y * w)},
                                          {n * (x * y - z * w), 1 - n * (x * x + z * z), n * (y * z + x * w)},
                                          {n * (x * z + y * w), n * (y * z - x * w), 1 - n * (x * x + y * y)});
            m = translation(value(t, 0, 0), value(t, 1, 0), value(t, 2, 0)) * q *
                scaling(value(s, 0, 1), value(s, 1, 1), value(s, 2, 1));
        }
        if (!is_affine(m)) c_.fail("the transform of node '" + node.name + "' is not affine and finite");
        return m;
    }

    /// KHR_node_visibility; true without it.
    static bool is_visible(const tinygltf::Node& node) {
        const tinygltf::Value* given = extension(node.extensions, "KHR_node_visibility");
        return !given || !given->Has("visible") || !given->Get("visible").IsBool() || given->Get("visible").Get<bool>();
    }

    /// `visible`: all nodes above are. Cameras see all the same where they are not.
    void visit(int index, const Matrix& outer, uint64_t depth, bool visible) {
        const Limits& limits = c_.document.limits;
        if (index < 0 || size_t(index) >= c_.model.nodes.size()) c_.fail("there is no node " + std::to_string(index));
        check_nesting(limits, depth, c_.where, "nodes");
        if (++visited_ > limits.shapes)
            c_.fail("it has more nodes than --limits shapes=" + std::to_string(limits.shapes));
        const tinygltf::Node& node = c_.model.nodes[size_t(index)];
        const Matrix to_world = outer * local(node);
        visible = visible && is_visible(node);
        if (node.mesh >= 0 && visible) {
            if (size_t(node.mesh) >= c_.model.meshes.size()) c_.fail("there is no mesh " + std::to_string(node.mesh));
            for (const Matrix& place : instances_of(node)) {
                if (node.skin < 0 && determinant(to_world * place) == 0)
                    c_.note("meshes that are scaled to nothing are left out");
                else
                    add_mesh(index, to_world * place);
            }
        }
        if (node.camera >= 0 && sensor_) c_.note("the first of several cameras is used");
        if (node.camera >= 0 && !sensor_) {
            if (size_t(node.camera) >= c_.model.cameras.size())
                c_.fail("there is no camera " + std::to_string(node.camera));
            sensor_ = &add_camera(c_, c_.model.cameras[size_t(node.camera)], to_world);
        }
        if (const tinygltf::Value* light = extension(node.extensions, "KHR_lights_punctual"); light && visible) {
            const double i = number(light, "light", -1);
            if (!(i >= 0 && i < double(c_.model.lights.size())))
                c_.fail("node '" + node.name + "' names a light that is not there");
            add_light(c_, c_.model.lights[size_t(i)], to_world);
        }
        for (const int child : node.children) visit(child, to_world, depth + 1, visible);
    }

    void add_mesh(int at, Matrix to_world) {
        const tinygltf::Node& node = c_.model.nodes[size_t(at)];
        const int index = node.mesh;
        const tinygltf::Mesh& mesh = c_.model.meshes[size_t(index)];
        const Pose pose = pose_of(node);
        const bool posed = !pose.joints.empty() || !node.weights.empty();
        if (!pose.joints.empty()) to_world = {};  // joints place it
        const bool in_mirror = determinant(to_world) < 0 && has_normal_texture(mesh);
        // Meshes of several nodes become groups, but for what shines or has a pose of its own.
        const bool shared = uses_[size_t(index)] > 1 && !posed;
        const std::pair group{index, in_mirror};
        const bool first_use = shared && !groups_.contains(group);
        if (first_use) groups_[group] = &add_object(c_.document, "shape", "shapegroup", c_.where);
        bool any_shared = false;
        for (size_t i = 0; i < mesh.primitives.size(); ++i) {
            const tinygltf::Primitive& primitive = mesh.primitives[i];
            const std::string what = "mesh " + std::to_string(index) +
                                     (mesh.name.empty() ? "" : " '" + mesh.name + "'") + ", primitive " +
                                     std::to_string(i);
            if (primitive.mode >= 0 && primitive.mode < TINYGLTF_MODE_TRIANGLES) {
                c_.note("points and lines have no surface and are left out");
                continue;
            }
            if (!primitive.attributes.contains("POSITION")) {
                c_.note("primitives without positions are left out");
                continue;
            }
            ++shown_;
            const std::string name = c_.where.file + ", " + what +
                                     (posed ? ", node " + std::to_string(at) : std::string()) +
                                     (in_mirror ? ", in a mirror" : "");
            for (const Part& part : parts_of(primitive, name, what, pose, in_mirror)) {
                grow(c_.document.meshes.at(part.name), to_world);
                const Context::Surface& s = part.surface;
                any_shared |= shared && !s.emitter;
                if (shared && !s.emitter && !first_use) continue;
                Object& shape = add_object(c_.document, "shape", "mesh", c_.where);
                set_text(shape, "name", part.name);
                add_child(shape, *s.bsdf);
                if (s.emitter) add_child(shape, *s.emitter);
                if (shared && !s.emitter) {
                    add_child(*groups_[group], shape);
                } else {
                    set_transform(shape, "to_world", to_world);
                    add_child(*c_.document.scene, shape);
                    if (s.emitter && s.double_sided) add_child(*c_.document.scene, add_light_back(c_.document, shape));
                }
            }
        }
        if (!any_shared) return;
        Object& instance = add_to_scene(c_.document, "shape", "instance", c_.where);
        set_transform(instance, "to_world", to_world);
        add_child(instance, *groups_[group]);
    }

    /// A mesh in the document.
    struct Part {
        std::string name;
        Context::Surface surface;
    };

    /// What a primitive is made into: one mesh for each of its materials.
    const std::vector<Part>& parts_of(const tinygltf::Primitive& primitive, const std::string& name,
                                      const std::string& what, const Pose& pose, bool in_mirror) {
        const auto [place, is_new] = parts_.try_emplace(name);
        std::vector<Part>& parts = place->second;
        if (!is_new) return parts;
        const VertexColors colors = vertex_colors(c_, primitive, what);
        const Use use{colors, false, primitive.attributes.contains("TANGENT")};
        if (!has_colored_textures(c_, primitive.material, colors)) {
            add_part(parts, name, primitive, use, in_mirror,
                     [&](int tex_coord) { return primitive_mesh(c_, primitive, tex_coord, pose, colors, what); });
            return parts;
        }
        const Mesh whole = primitive_mesh(
            c_, primitive, surface(c_, primitive.material, {{}, false, use.tangents}).tex_coord, pose, {}, what);
        if (colors.values.size() != whole.positions.size())
            c_.fail(what + ", COLOR_0: its size is not that of the primitive");
        c_.note("colours of vertices beside textures are averaged over each triangle, in steps");
        for (ColoredPart& part : parts_by_color(whole, colors))
            add_part(parts, name + ", colour " + std::to_string(parts.size()), primitive,
                     {part.colors, false, use.tangents}, in_mirror, [&](int) { return std::move(part.mesh); });
        return parts;
    }

    template <class Make>
    void add_part(std::vector<Part>& parts, const std::string& name, const tinygltf::Primitive& primitive, Use use,
                  bool in_mirror, Make make) {
        const Context::Surface front = surface(c_, primitive.material, use);
        Mesh mesh = make(front.tex_coord), mirrored;
        if (front.has_textures && mesh.uvs.empty()) {
            c_.note("textures have one colour on a mesh without texture coordinates");
            mesh.uvs.assign(mesh.positions.size(), Vec2f{0, 0});
        }
        if (front.has_normals) mirrored = take_mirrored(mesh, in_mirror);
        const auto add = [&](Mesh& given, const std::string& as, const Context::Surface& with) {
            if (given.faces.empty()) return;
            c_.document.meshes[as] = std::move(given);
            parts.push_back({as, with});
        };
        add(mesh, name, front);
        use.mirrored = true;
        if (!mirrored.faces.empty()) add(mirrored, name + ", mirrored", surface(c_, primitive.material, use));
    }

    bool has_normal_texture(const tinygltf::Mesh& mesh) const {
        return std::any_of(mesh.primitives.begin(), mesh.primitives.end(), [&](const tinygltf::Primitive& p) {
            return p.material >= 0 && size_t(p.material) < c_.model.materials.size() &&
                   c_.model.materials[size_t(p.material)].normalTexture.index >= 0;
        });
    }

    void grow(const Mesh& mesh, const Matrix& m) {
        const Affine a = to_affine(m);
        for (const Vec3f& p : mesh.positions) {
            const Vec3f q = a.point(p);
            lower_ = min(lower_, q), upper_ = max(upper_, q);
        }
    }

    Context& c_;
    std::vector<uint32_t> uses_;                      ///< of meshes by nodes
    std::vector<int> parents_;                        ///< of nodes; -1: none
    std::map<std::pair<int, bool>, Object*> groups_;  ///< by mesh, and whether it is mirrored
    std::map<std::string, std::vector<Part>> parts_;  ///< by primitive
    Object* sensor_ = nullptr;
    uint64_t visited_ = 0, shown_ = 0, instances_ = 0;
    Vec3f lower_ = splat(kInfinity), upper_ = splat(-kInfinity);
};

}  // namespace
}  // namespace gltf

Scene load_gltf(const std::string& path, const LoadOptions& options) {
    return load_by(path, options, [&](document::Document& document, Report& report) {
        const document::Where where{path, 0};
        gltf::Context context{document, report, where, {}, {}, {}, {}, false};
        gltf::read_model(context, path);
        gltf::SceneMaker(context).make();
    });
}

}  // namespace ambilux
