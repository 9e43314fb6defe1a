// glTF files written as JSON in a test.
#pragma once

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "formats/load.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

namespace ambilux::test::gltf {

using Json = nlohmann::json;

inline std::string base64(const std::string& bytes) {
    const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t v = 0;
        const size_t n = std::min<size_t>(3, bytes.size() - i);
        for (size_t j = 0; j < 3; ++j) v = v << 8 | (j < n ? uint8_t(bytes[i + j]) : 0u);
        for (size_t j = 0; j < 4; ++j) out += j <= n ? digits[v >> (18 - 6 * j) & 63] : '=';
    }
    return out;
}

inline std::string data_uri(const std::string& type, const std::string& bytes) {
    return "data:" + type + ";base64," + base64(bytes);
}

/// Two triangles of [-1,1]² at z = 0, with normals and texture coordinates whose v runs downwards.
inline std::string quad_bytes() {
    const float values[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, 0, 0, 1, 0,
                            0,  1,  0, 0, 1,  0, 0, 1, 0, 1,  1, 1, 1, 0, 0, 0};
    const uint16_t indices[] = {0, 1, 2, 0, 2, 3};
    std::string bytes(reinterpret_cast<const char*>(values), sizeof values);
    return bytes.append(reinterpret_cast<const char*>(indices), sizeof indices);
}

/// A camera at z = 3 and the quad of material 0.
inline Json quad_scene() {
    Json j = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 3]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.9, "aspectRatio": 1.5, "znear": 0.01}}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.6, 0.7, 1], "metallicFactor": 0.25,
                                                "roughnessFactor": 0.5}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3,
                                    "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                       "min": [-1, -1, 0], "max": [1, 1, 0]},
                      {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
                      {"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 96, "byteLength": 32},
                        {"buffer": 0, "byteOffset": 128, "byteLength": 12}],
        "buffers": [{"byteLength": 140}]})");
    j["buffers"][0]["uri"] = data_uri("application/octet-stream", quad_bytes());
    return j;
}

/// componentType of accessors.
constexpr int kFloat = 5126, kByte = 5121, kShort = 5123;

/// An accessor to these values, in a buffer of its own.
template <class T>
int add_accessor(Json& j, const std::vector<T>& values, const char* type, int component, size_t count,
                 bool normalized = false) {
    const std::string bytes(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    const auto add = [&j](const char* list, Json what) {
        j[list].push_back(std::move(what));
        return j[list].size() - 1;
    };
    const size_t buffer =
        add("buffers", {{"byteLength", bytes.size()}, {"uri", data_uri("application/octet-stream", bytes)}});
    const size_t view = add("bufferViews", {{"buffer", buffer}, {"byteLength", bytes.size()}});
    return int(add("accessors", {{"bufferView", view},
                                 {"componentType", component},
                                 {"count", count},
                                 {"type", type},
                                 {"normalized", normalized}}));
}

inline Json& attributes(Json& j) { return j["meshes"][0]["primitives"][0]["attributes"]; }

inline Scene load(const Json& j, const LoadOptions& options = {}, const TempFolder* folder = nullptr) {
    const TempFolder own;
    return load_gltf((folder ? *folder : own).write("scene.gltf", j.dump()), options);
}

inline std::string error_of(const Json& j, const LoadOptions& options = {}) {
    try {
        load(j, options);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

}  // namespace ambilux::test::gltf
