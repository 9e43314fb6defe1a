// Triangles of a primitive as they stand: morphed, and on the joints of a skin.
#include <algorithm>

#include "formats/gltf/model.h"

namespace ambilux::gltf {

namespace {

int attribute(const std::map<std::string, int>& all, const std::string& name) {
    const auto it = all.find(name);
    return it == all.end() ? -1 : it->second;
}

std::vector<Vec3f> triples_of(const Context& context, int accessor, const std::string& what) {
    std::vector<Vec3f> out;
    if (accessor < 0) return out;
    const std::vector<double> v = accessor_values(context, accessor, 3, what);
    for (size_t i = 0; i + 2 < v.size(); i += 3) out.push_back({float(v[i]), float(v[i + 1]), float(v[i + 2])});
    return out;
}

void add_morphs(Context& context, Mesh& mesh, const tinygltf::Primitive& primitive, const std::vector<double>& weights,
                int tex_coord, const std::string& what) {
    for (size_t i = 0; i < std::min(weights.size(), primitive.targets.size()); ++i) {
        if (weights[i] == 0) continue;
        const auto add = [&](std::vector<Vec3f>& to, const char* name) {
            const std::string target = what + ", morph target " + std::to_string(i) + ", " + name;
            const std::vector<Vec3f> by = triples_of(context, attribute(primitive.targets[i], name), target);
            if (by.empty() || to.empty()) return;
            if (by.size() != to.size()) context.fail(target + ": its size is not that of the primitive");
            for (size_t k = 0; k < to.size(); ++k) to[k] += by[k] * float(weights[i]);
        };
        add(mesh.positions, "POSITION");
        add(mesh.normals, "NORMAL");
        if (attribute(primitive.targets[i], "COLOR_0") >= 0) context.note("morph targets of colours are left out");
        const int moved = attribute(primitive.targets[i], "TEXCOORD_" + std::to_string(tex_coord));
        if (moved < 0) continue;
        const std::vector<double> by = accessor_values(context, moved, 2, what + ", texture coordinates of a target");
        for (size_t k = 0; k < std::min(mesh.uvs.size(), by.size() / 2); ++k)
            mesh.uvs[k] = mesh.uvs[k] + Vec2f{float(by[2 * k]), float(by[2 * k + 1])} * float(weights[i]);
    }
}

/// Every vertex to where the weighted mean of its joints takes it. True if they mirror the mesh.
bool put_on_skin(Context& context, Mesh& mesh, const tinygltf::Primitive& primitive, const std::vector<Matrix>& joints,
                 const std::string& what) {
    const size_t n = mesh.positions.size();
    std::vector<Matrix> sums(n);
    for (Matrix& m : sums)
        for (auto& row : m.m) std::fill(row, row + 4, 0.0);
    std::vector<double> total(n);
    std::vector<size_t> first(n);  // joint
    for (int set = 0;; ++set) {
        const std::string tail = "_" + std::to_string(set);
        const int of_joints = attribute(primitive.attributes, "JOINTS" + tail),
                  of_weights = attribute(primitive.attributes, "WEIGHTS" + tail);
        if (of_joints < 0 || of_weights < 0) break;
        const std::vector<uint32_t> joint =
            accessor_indices(context, of_joints, 4, joints.size(), what + ", JOINTS" + tail);
        const std::vector<double> weight = accessor_values(context, of_weights, 4, what + ", WEIGHTS" + tail);
        if (joint.size() != 4 * n || weight.size() != 4 * n)
            context.fail(what + ": joints and weights are not given for every vertex");
        for (size_t i = 0; i < 4 * n; ++i) {
            if (set == 0 && i % 4 == 0) first[i / 4] = joint[i];
            const Matrix& m = joints[joint[i]];
            for (int r = 0; r < 3; ++r)
                for (int c = 0; c < 4; ++c) sums[i / 4].m[r][c] += weight[i] * m.m[r][c];
            total[i / 4] += weight[i];
        }
    }
    bool mirrored = false;
    for (size_t i = 0; i < n; ++i) {
        Matrix m = sums[i];
        if (!(total[i] > 0)) {
            context.note("vertices without weights follow their first joint");
            m = joints[first[i]];
            total[i] = 1;
        }
        for (int r = 0; r < 3; ++r)
            for (double& v : m.m[r]) v /= total[i];
        for (int c = 0; c < 4; ++c) m.m[3][c] = c == 3;
        const float side = document::determinant(m) < 0 ? -1.0f : 1.0f;
        if (i == 0) mirrored = side < 0;
        mesh.positions[i] = document::to_affine(m).point(mesh.positions[i]);
        if (mesh.normals.empty()) continue;
        // By the cofactors, so that it stays perpendicular to the surface, and on its side.
        const Vec3d x = document::column(m, 0), y = document::column(m, 1), z = document::column(m, 2);
        const Vec3f v = mesh.normals[i] * side;
        mesh.normals[i] = rounded(cross(y, z) * v.x + cross(z, x) * v.y + cross(x, y) * v.z);
    }
    return mirrored;
}

}  // namespace

VertexColors vertex_colors(Context& context, const tinygltf::Primitive& primitive, const std::string& what) {
    VertexColors out;
    const int index = attribute(primitive.attributes, "COLOR_0");
    if (index < 0) return out;
    const std::vector<double> v = accessor_values(context, index, 3, what + ", COLOR_0");
    for (size_t i = 0; i + 2 < v.size(); i += 3) out.values.push_back({float(v[i]), float(v[i + 1]), float(v[i + 2])});
    if (context.model.accessors[size_t(index)].type == TINYGLTF_TYPE_VEC4) {
        const std::vector<double> all = accessor_values(context, index, 4, what + ", COLOR_0");
        for (size_t i = 3; i < all.size(); i += 4) out.alphas.push_back(splat(float(all[i])));
    }
    float largest = 0;
    for (std::vector<Rgb>* list : {&out.values, &out.alphas})
        for (Rgb& c : *list) {
            if (!is_finite(c) || min_component(c) < 0) context.fail(what + ": a colour is negative or not finite");
            largest = std::max(largest, max_component(c));
            c = min(c, splat(1));
        }
    context.at_most_1(largest, what + ": the largest colour of its vertices");
    const auto merge_equal = [](const std::vector<Rgb>& all, Rgb& one, bool& varies) {
        if (all.empty()) return;
        one = all[0];
        varies = std::any_of(all.begin(), all.end(), [&](Rgb c) { return !(c == all[0]); });
    };
    Rgb alpha = splat(1);
    merge_equal(out.values, out.color, out.varies);
    merge_equal(out.alphas, alpha, out.alpha_varies);
    out.alpha = alpha.x;
    return out;
}

Mesh primitive_mesh(Context& context, const tinygltf::Primitive& primitive, int tex_coord, const Pose& pose,
                    const VertexColors& colors, const std::string& what) {
    Mesh mesh;
    const auto find = [&](const std::string& name) { return attribute(primitive.attributes, name); };
    const auto triples = [&](const std::string& name) { return triples_of(context, find(name), what + ", " + name); };
    mesh.positions = triples("POSITION");
    if (mesh.positions.empty()) context.fail(what + " has no positions");
    mesh.normals = triples("NORMAL");
    const std::string uv = "TEXCOORD_" + std::to_string(tex_coord);
    if (find(uv) >= 0) {
        const std::vector<double> v = accessor_values(context, find(uv), 2, what + ", " + uv);
        for (size_t i = 0; i + 1 < v.size(); i += 2) mesh.uvs.push_back({float(v[i]), float(v[i + 1])});
    }
    add_morphs(context, mesh, primitive, pose.weights, tex_coord, what);
    const bool turn = !pose.joints.empty() && put_on_skin(context, mesh, primitive, pose.joints, what);
    if (colors.varies) mesh.attributes.push_back({"vertex_color", false, 3, colors.values});
    if (colors.alpha_varies) mesh.attributes.push_back({"vertex_alpha", false, 1, colors.alphas});
    std::vector<uint32_t> indices;
    if (primitive.indices >= 0) {
        indices = accessor_indices(context, primitive.indices, 1, mesh.positions.size(), what + ", indices");
    } else {
        for (uint32_t i = 0; i < mesh.positions.size(); ++i) indices.push_back(i);
    }
    if (primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP || primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN) {
        for (size_t i = 2; i < indices.size(); ++i)
            if (primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN)
                mesh.faces.push_back({indices[0], indices[i - 1], indices[i]});
            else
                mesh.faces.push_back({indices[i - 2 + i % 2], indices[i - 1 - i % 2], indices[i]});
    } else {
        for (size_t i = 0; i + 2 < indices.size(); i += 3)
            mesh.faces.push_back({indices[i], indices[i + 1], indices[i + 2]});
    }
    if (turn)
        for (auto& face : mesh.faces) std::swap(face[1], face[2]);
    check_mesh(context.where.file + ": " + what, mesh);
    for (const std::string& note : mesh.notes) context.note(note);
    return mesh;
}

}  // namespace ambilux::gltf
