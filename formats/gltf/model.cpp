#include "formats/gltf/model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "formats/file_budget.h"

namespace ambilux::gltf {

void Context::fail(const std::string& message) const { throw input_error(where.file, where.line, message); }

namespace {

struct Files {
    Context& context;
    std::string problem;
};

bool file_exists(const std::string& path, void*) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path, ignored);
}

std::string same_path(const std::string& path, void*) { return path; }

/// Within the limits; what is wrong is kept, since no exception may pass the library.
bool read_whole_file(std::vector<unsigned char>* out, std::string* error, const std::string& path, void* user) {
    Files& files = *static_cast<Files*>(user);
    try {
        const std::string bytes = read_input(path, files.context.document.limits);
        files.context.document.file_digests.push_back({path, sha256(bytes)});
        out->assign(bytes.begin(), bytes.end());
        return true;
    } catch (const std::exception& e) {
        files.problem = *error = e.what();
        return false;
    }
}

bool write_nothing(std::string*, const std::string&, const std::vector<unsigned char>&, void*) { return false; }

/// Keeps the bytes of a file or a data URI: our readers decode them when they are needed. Those of a buffer come
/// unchecked: image_views() takes them.
bool keep_image(tinygltf::Image* image, const int index, std::string*, std::string*, int, int,
                const unsigned char* bytes, int size, void* user) {
    auto& all = static_cast<Files*>(user)->context.image_bytes;
    if (image->bufferView >= 0) return true;
    if (index < 0 || size < 0) return false;
    if (all.size() <= size_t(index)) all.resize(size_t(index) + 1);
    all[size_t(index)].assign(reinterpret_cast<const char*>(bytes), size_t(size));
    return true;
}

/// The bytes of a view, which lie inside of its buffer. Throws Error(bad_input).
std::pair<const unsigned char*, uint64_t> view_bytes(const Context& context, int index, const std::string& what) {
    const tinygltf::Model& model = context.model;
    if (index < 0 || size_t(index) >= model.bufferViews.size()) context.fail(what + ": its buffer view does not exist");
    const tinygltf::BufferView& view = model.bufferViews[size_t(index)];
    if (view.buffer < 0 || size_t(view.buffer) >= model.buffers.size())
        context.fail(what + ": its buffer does not exist");
    const std::vector<unsigned char>& data = model.buffers[size_t(view.buffer)].data;
    if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset)
        context.fail(what + ": its buffer view reaches beyond the buffer");
    return {data.data() + view.byteOffset, view.byteLength};
}

void image_views(Context& context) {
    for (size_t i = 0; i < context.model.images.size(); ++i) {
        const int view = context.model.images[i].bufferView;
        if (view < 0) continue;
        const auto [bytes, size] = view_bytes(context, view, "image " + std::to_string(i));
        context.image_bytes[i].assign(bytes, bytes + size);
    }
}

/// Since version 2.9 tinygltf asks for sizes too.
template <class Callbacks>
Callbacks callbacks(Files& files) {
    Callbacks c;
    c.FileExists = file_exists;
    c.ExpandFilePath = same_path;
    c.ReadWholeFile = read_whole_file;
    c.WriteWholeFile = write_nothing;
    c.user_data = &files;
    if constexpr (requires { c.GetFileSizeInBytes; })
        c.GetFileSizeInBytes = [](size_t* size, std::string*, const std::string& name, void*) {
            std::error_code error;
            *size = std::filesystem::file_size(name, error);
            return !error;
        };
    return c;
}

}  // namespace

void read_model(Context& context, const std::string& path) {
    const std::string bytes = read_input(path, context.document.limits);
    context.document.file_digests.push_back({path, sha256(bytes)});
    if (bytes.size() > size_t(INT32_MAX)) context.fail("a glTF file may have 2 GiB at most");
    Files files{context, ""};
    tinygltf::TinyGLTF reader;
    reader.SetFsCallbacks(callbacks<tinygltf::FsCallbacks>(files));
    reader.SetImageLoader(keep_image, &files);
    const std::string folder = std::filesystem::path(path).parent_path().string();
    std::string error, warning;
    bool read = false;
    try {
        read = bytes.starts_with("glTF")
                   ? reader.LoadBinaryFromMemory(&context.model, &error, &warning,
                                                 reinterpret_cast<const unsigned char*>(bytes.data()),
                                                 unsigned(bytes.size()), folder)
                   : reader.LoadASCIIFromString(&context.model, &error, &warning, bytes.data(), unsigned(bytes.size()),
                                                folder);
    } catch (const std::exception& e) {
        error = e.what();
    }
    if (!files.problem.empty()) context.fail(files.problem);
    std::replace(error.begin(), error.end(), '\n', ' ');
    if (!read) context.fail("it is no sound glTF 2.0: " + (error.empty() ? "unknown reason" : error));
    context.image_bytes.resize(context.model.images.size());
    image_views(context);
    static const std::set<std::string> known = {"KHR_lights_punctual",        "KHR_materials_emissive_strength",
                                                "KHR_materials_transmission", "KHR_materials_volume",
                                                "KHR_materials_ior",          "KHR_materials_clearcoat",
                                                "KHR_texture_transform",      "KHR_mesh_quantization"};
    for (const std::string& name : context.model.extensionsRequired)
        if (!known.contains(name)) context.refuse("extension '" + name + "' is not supported", "it is left out");
    if (!context.model.animations.empty()) context.note("animations are left out: nodes stand as they do without them");
}

std::vector<double> accessor_values(const Context& context, int index, int components, const std::string& what) {
    const tinygltf::Model& model = context.model;
    const auto fail = [&](const std::string& problem) { context.fail(what + ": " + problem); };
    if (index < 0 || size_t(index) >= model.accessors.size()) fail("there is no accessor " + std::to_string(index));
    const tinygltf::Accessor& a = model.accessors[size_t(index)];
    if (a.sparse.isSparse) fail("sparse accessors are not supported");
    const auto [bytes, length] = view_bytes(context, a.bufferView, what);
    const int size = tinygltf::GetComponentSizeInBytes(uint32_t(a.componentType)),
              count = tinygltf::GetNumComponentsInType(uint32_t(a.type));
    if (size <= 0 || count < components || a.componentType == TINYGLTF_COMPONENT_TYPE_DOUBLE)
        fail("its accessor has the wrong type");
    const uint64_t element = uint64_t(size) * uint64_t(count),
                   given = model.bufferViews[size_t(a.bufferView)].byteStride, stride = given ? given : element;
    if (stride < element || stride > 4096 || a.count > length || a.byteOffset > length ||
        (a.count > 0 && (a.count - 1) * stride + element > length - a.byteOffset))
        fail("its accessor reaches beyond its buffer");
    FileBudget(context.where.file, context.document.limits)
        .bytes(uint64_t(a.count) * uint64_t(components), sizeof(double));
    std::vector<double> out;
    out.reserve(a.count * size_t(components));
    const auto value = [&](const unsigned char* p) -> double {
        const auto as = [p]<class T>(T v) { return memcpy(&v, p, sizeof v), v; };
        const double scale = a.normalized ? 1 : 0;
        switch (a.componentType) {
            case TINYGLTF_COMPONENT_TYPE_FLOAT: return as(0.0f);
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return *p / (scale ? 255.0 : 1);
            case TINYGLTF_COMPONENT_TYPE_BYTE: return scale ? std::max(as(int8_t{}) / 127.0, -1.0) : as(int8_t{});
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return as(uint16_t{}) / (scale ? 65535.0 : 1);
            case TINYGLTF_COMPONENT_TYPE_SHORT: return scale ? std::max(as(int16_t{}) / 32767.0, -1.0) : as(int16_t{});
            default: return as(uint32_t{});
        }
    };
    const unsigned char* begin = bytes + a.byteOffset;
    for (size_t i = 0; i < a.count; ++i)
        for (int c = 0; c < components; ++c) out.push_back(value(begin + i * stride + size_t(c) * size_t(size)));
    return out;
}

Mesh primitive_mesh(Context& context, const tinygltf::Primitive& primitive, int tex_coord, const std::string& what) {
    Mesh mesh;
    const auto find = [&](const std::string& name) {
        const auto it = primitive.attributes.find(name);
        return it == primitive.attributes.end() ? -1 : it->second;
    };
    const auto triples = [&](const std::string& name) {
        std::vector<Vec3f> out;
        if (find(name) < 0) return out;
        const std::vector<double> v = accessor_values(context, find(name), 3, what + ", " + name);
        for (size_t i = 0; i + 2 < v.size(); i += 3) out.push_back({float(v[i]), float(v[i + 1]), float(v[i + 2])});
        return out;
    };
    mesh.positions = triples("POSITION");
    if (mesh.positions.empty()) context.fail(what + " has no positions");
    mesh.normals = triples("NORMAL");
    const std::string uv = "TEXCOORD_" + std::to_string(tex_coord);
    if (find(uv) >= 0) {
        const std::vector<double> v = accessor_values(context, find(uv), 2, what + ", " + uv);
        for (size_t i = 0; i + 1 < v.size(); i += 2) mesh.uvs.push_back({float(v[i]), float(v[i + 1])});
    }
    if (find("COLOR_0") >= 0)
        context.refuse(what + " has colours of vertices, which are not supported", "they are left out");
    if (find("JOINTS_0") >= 0)
        context.refuse(what + " is skinned, which is not supported", "it stands in its rest pose");
    if (!primitive.targets.empty())
        context.refuse(what + " has morph targets, which are not supported", "they are left out");
    std::vector<uint32_t> indices;
    if (primitive.indices >= 0) {
        for (double i : accessor_values(context, primitive.indices, 1, what + ", indices")) {
            if (!(i >= 0 && i < double(mesh.positions.size())))
                context.fail(what + ": index " + std::to_string(int64_t(i)) + " of " +
                             std::to_string(mesh.positions.size()) + " vertices");
            indices.push_back(uint32_t(i));
        }
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
    check_mesh(context.where.file + ": " + what, mesh);
    return mesh;
}

const tinygltf::Value* extension(const tinygltf::ExtensionMap& extensions, const char* name) {
    const auto it = extensions.find(name);
    return it == extensions.end() || !it->second.IsObject() ? nullptr : &it->second;
}

double number(const tinygltf::Value* object, const char* name, double fallback) {
    if (!object || !object->Has(name) || !object->Get(name).IsNumber()) return fallback;
    return object->Get(name).GetNumberAsDouble();
}

}  // namespace ambilux::gltf
