#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/scoped_seconds.h"
#include "core/srgb.h"
#include "formats/document/shape_jobs.h"
#include "formats/file_budget.h"
#include "formats/gzip.h"

namespace ambilux::document {

bool is_attribute(const Object& texture) { return texture.type == "mesh_attribute" || texture.type == "vertexcolors"; }

namespace {

/// The attribute that such a texture shows.
std::string attribute_of(const Object& texture) {
    const Value* name = texture.type == "vertexcolors" ? nullptr : texture.find("name");
    return texture.type == "vertexcolors" ? "vertex_color" : name ? name->text : "";
}

/// Textures of a BSDF: those that take values from the mesh, and are there some that depend on coordinates?
struct AttributeUse {
    std::set<std::string> attributes = {};
    bool others = false;
    std::set<const Object*> seen = {};  ///< objects are shared: what is twice in each of n levels is there 2^n times

    void look_into(const Object& object) {
        if (!seen.insert(&object).second) return;
        for (const Child& child : object.children) {
            const Object& inner = *child.object;
            if (inner.tag == "texture" && is_attribute(inner))
                attributes.insert(attribute_of(inner));
            else if (inner.tag == "texture" && inner.type != "scale" && inner.type != "rawconstant")
                others = true;
            look_into(inner);
        }
    }
};

struct Atlas {
    uint32_t columns, width, height;

    explicit Atlas(size_t triangles) {
        columns = uint32_t(std::ceil(std::sqrt(double(std::max<size_t>(triangles, 1)))));
        width = 2 * columns;
        height = 2 * uint32_t((triangles + columns - 1) / columns);
    }
    uint32_t x(size_t triangle) const { return 2 * uint32_t(triangle % columns); }
    uint32_t y(size_t triangle) const { return 2 * uint32_t(triangle / columns); }
};

/// Texels (0,0), (1,0), (0,1) and (1,1) that are linear between the values of three corners. Coordinates are off by
/// width·2^-23 texels, so that values stay by so much of the largest above 0.
std::array<Rgb, 4> linear_block(std::array<Rgb, 3> v, uint32_t width) {
    const float margin = float(width) * 0x1p-22f;
    for (int c = 0; c < 3; ++c) {
        const float most = std::max({v[0][c], v[1][c], v[2][c]});
        for (Rgb& value : v) value[c] = std::max(value[c], margin * most);
    }
    return {v[0], v[1], v[2], v[1] + v[2] - v[0]};
}

std::vector<float> texels_of(const Atlas& atlas, const Mesh& mesh, const MeshAttribute& a, TextureFacts& facts) {
    std::vector<float> texels(size_t(atlas.width) * atlas.height * 4, 0.0f);
    for (size_t t = 0; t < mesh.faces.size(); ++t) {
        std::array<Rgb, 3> v;
        for (size_t k = 0; k < 3; ++k) v[k] = a.values[a.per_face ? t : mesh.faces[t][k]];
        const std::array<Rgb, 4> block = linear_block(v, atlas.width);
        for (uint32_t k = 0; k < 4; ++k) {
            float* texel = &texels[4 * (size_t(atlas.y(t) + k / 2) * atlas.width + atlas.x(t) + k % 2)];
            for (int c = 0; c < 3; ++c) texel[c] = block[k][c];
            texel[3] = 1;
        }
        facts.mean += (v[0] + v[1] + v[2]) * (1.0f / (3 * float(mesh.faces.size())));
    }
    return texels;
}

}  // namespace

std::set<std::string> mesh_attributes_of(const Object& bsdf) {
    AttributeUse use;
    use.look_into(bsdf);
    if (!use.attributes.empty() && use.others)
        fail(bsdf.where, "mesh attributes together with other textures in one BSDF are not supported");
    return use.attributes;
}

Mesh read_with_attributes(Builder& builder, Reader& in, const MeshSource& source, const std::set<std::string>& names) {
    const ScopedSeconds clock(&builder.options.times->read);
    const Limits& limits = builder.options.limits;
    const std::string bytes = gunzip_if_packed(source.path, read_input(source.path, limits), limits);
    builder.file_digests.push_back({source.path, sha256(bytes)});
    const bool is_ply = source.type == "ply";
    Mesh mesh = is_ply ? read_ply(source.path, bytes, source.flip_v, limits, names)
                       : read_obj(source.path, bytes, source.flip_v, limits, names);
    for (const std::string& note : mesh.notes) builder.note({source.path, 0}, note);
    const bool older = in.object().version < 2, srgb = older && is_ply && in.boolean("srgb", true);
    for (MeshAttribute& a : mesh.attributes) {
        if (a.most > 1 && (!older || a.property == "r"))
            builder.note({source.path, 0}, "integer colours are divided by " + std::to_string(int(a.most)) +
                                               (srgb ? " and read as sRGB" : " and read as linear") +
                                               "; Mitsuba reads them undivided");
        if (srgb && a.name == "vertex_color")
            for (Rgb& value : a.values)
                for (int c = 0; c < 3; ++c) value[c] = float(srgb_to_linear(value[c]));
    }
    return mesh;
}

Mesh with_attribute_atlas(Builder& builder, const std::string& path, const Mesh& mesh,
                          std::map<std::string, int32_t>& textures) {
    const Atlas atlas(mesh.faces.size());
    for (const MeshAttribute& a : mesh.attributes) {
        if (a.values.size() != (a.per_face ? mesh.faces.size() : mesh.positions.size()))
            throw input_error(path, 0, "attribute '" + a.name + "' is not given everywhere");
        for (const Rgb& value : a.values)
            if (min_component(value) < 0) throw input_error(path, 0, "attribute '" + a.name + "' is negative");
        builder.take_memory(uint64_t(atlas.width) * atlas.height * 16, path);
        TextureFacts facts{{}, {}, path};
        for (const Rgb& value : a.values) facts.largest = max(facts.largest, value);
        const std::vector<float> texels = texels_of(atlas, mesh, a, facts);
        textures[a.name] = add_atlas(builder, atlas.width, atlas.height, texels, facts);
    }
    builder.take_memory(mesh_bytes(3 * mesh.faces.size(), mesh.faces.size()), path);
    Mesh out = with_own_corners(mesh);
    // Vertices that were shared keep the normal that they would have got.
    if (mesh.normals.empty() && builder.document.smooth_normals) {
        const std::vector<Vec3f> normals = smooth_normals(mesh);
        for (const auto& face : mesh.faces)
            for (const uint32_t v : face) out.normals.push_back(normals[v]);
    }
    for (size_t t = 0; t < mesh.faces.size(); ++t)
        for (uint32_t k = 0; k < 3; ++k) {
            const double x = atlas.x(t) + (k == 1 ? 1.5 : 0.5), y = atlas.y(t) + (k == 2 ? 1.5 : 0.5);
            out.uvs.push_back({float(x / atlas.width), float(y / atlas.height)});
        }
    return out;
}

int32_t attribute_texture(const Builder& builder, Reader& in) {
    const std::string name = attribute_of(in.object());
    in.ignore({"name", "scale"});  // load_scaled_texture() takes the scale
    in.finish();
    if (builder.validate_only) return 0;
    const auto* known = builder.attribute_textures;
    if (!known || !known->count(name)) in.fail("the shape has no attribute '" + name + "'");
    return known->at(name);
}

}  // namespace ambilux::document
