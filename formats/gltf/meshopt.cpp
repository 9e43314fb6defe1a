#include "formats/gltf/meshopt.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "formats/file_budget.h"

namespace ambilux::gltf {

namespace {

constexpr const char* kName = "EXT_meshopt_compression";

std::string text_of(const tinygltf::Value& of, const char* name, const char* fallback) {
    return of.Has(name) && of.Get(name).IsString() ? of.Get(name).Get<std::string>() : fallback;
}

struct Packing {
    size_t count, stride;  ///< of what is packed
    std::string mode, filter;
};

/// The extension's rules. meshoptimizer asserts them, also in the distribution's builds.
bool is_valid(const Packing& p) {
    const bool short_or_int = p.stride == 2 || p.stride == 4;
    if (p.mode == "TRIANGLES") return short_or_int && p.count % 3 == 0 && p.filter == "NONE";
    if (p.mode == "INDICES") return short_or_int && p.filter == "NONE";
    if (p.mode != "ATTRIBUTES" || p.stride == 0 || p.stride > 256 || p.stride % 4 != 0) return false;
    if (p.filter == "OCTAHEDRAL") return p.stride == 4 || p.stride == 8;
    if (p.filter == "QUATERNION") return p.stride == 8;
    return p.filter == "EXPONENTIAL" || p.filter == "NONE";
}

/// False for broken bytes.
bool unpack(const Packing& p, const unsigned char* from, size_t length, unsigned char* to) {
    if (p.mode == "TRIANGLES") return meshopt_decodeIndexBuffer(to, p.count, p.stride, from, length) == 0;
    if (p.mode == "INDICES") return meshopt_decodeIndexSequence(to, p.count, p.stride, from, length) == 0;
    if (meshopt_decodeVertexBuffer(to, p.count, p.stride, from, length) != 0) return false;
    if (p.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(to, p.count, p.stride);
    if (p.filter == "QUATERNION") meshopt_decodeFilterQuat(to, p.count, p.stride);
    if (p.filter == "EXPONENTIAL") meshopt_decodeFilterExp(to, p.count, p.stride);
    return true;
}

void unpack_view(Context& context, size_t index, const tinygltf::Value& given) {
    const std::string what = "buffer view " + std::to_string(index);
    const auto size = [&](const char* name, double fallback) {
        const double v = number(&given, name, fallback);
        if (!(v >= 0 && v < 0x1p32 && v == std::floor(v))) context.fail(what + ": '" + name + "' is no size");
        return size_t(v);
    };
    const size_t buffer = size("buffer", -1), offset = size("byteOffset", 0), length = size("byteLength", -1);
    const Packing packing{size("count", -1), size("byteStride", -1), text_of(given, "mode", ""),
                          text_of(given, "filter", "NONE")};
    if (buffer >= context.model.buffers.size()) context.fail(what + ": its buffer does not exist");
    const std::vector<unsigned char>& from = context.model.buffers[buffer].data;
    if (offset > from.size() || length > from.size() - offset) context.fail(what + " reaches beyond its buffer");
    if (!is_valid(packing))
        context.fail(fmt::format("{}: mode '{}' with filter '{}' cannot hold {} elements of {} bytes", what,
                                 packing.mode, packing.filter, packing.count, packing.stride));
    const uint64_t bytes = uint64_t(packing.count) * packing.stride;
    if (bytes > 64 * uint64_t(length)) context.fail(what + ": its packed bytes are too few");
    FileBudget(context.where.file, context.document.limits).bytes(bytes);
    std::vector<unsigned char> out(bytes);
    if (!unpack(packing, from.data() + offset, length, out.data()))
        context.fail(what + ": its packed bytes are broken");
    tinygltf::BufferView& view = context.model.bufferViews[index];
    view.buffer = int(context.model.buffers.size());
    view.byteOffset = 0;
    view.byteLength = out.size();
    context.model.buffers.emplace_back().data = std::move(out);
}

}  // namespace

std::string_view json_part(std::string_view bytes) {
    if (!bytes.starts_with("glTF")) return bytes;
    uint32_t length = 0;
    if (bytes.size() < 20) return {};
    memcpy(&length, bytes.data() + 12, 4);
    return length > bytes.size() - 20 ? std::string_view{} : bytes.substr(20, length);
}

std::string with_fallback_buffers(const std::string& bytes) {
    if (bytes.find(kName) == std::string::npos) return bytes;
    const bool binary = bytes.starts_with("glTF");
    const std::string_view part = json_part(bytes);
    auto json = nlohmann::json::parse(part.begin(), part.end(), nullptr, false);
    if (!json.is_object() || !json.contains("buffers") || !json["buffers"].is_array()) return bytes;
    for (auto& buffer : json["buffers"])
        if (buffer.is_object() && !buffer.contains("uri") && buffer.contains("extensions") &&
            buffer["extensions"].is_object() && buffer["extensions"].contains(kName))
            buffer["uri"] = "data:application/octet-stream;base64,AA==", buffer["byteLength"] = 1;
    std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    if (!binary) return text;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string out = bytes.substr(0, 12);
    const auto put = [&out](size_t v) {
        const uint32_t w = uint32_t(v);
        out.append(reinterpret_cast<const char*>(&w), 4);
    };
    put(text.size());
    out += bytes.substr(16, 4) + text + bytes.substr(20 + part.size());
    const uint32_t total = uint32_t(out.size());
    memcpy(out.data() + 8, &total, 4);
    return out;
}

void unpack_views(Context& context) {
    for (size_t i = 0; i < context.model.bufferViews.size(); ++i) {
        const auto it = context.model.bufferViews[i].extensions.find(kName);
        if (it == context.model.bufferViews[i].extensions.end() || !it->second.IsObject()) continue;
        const tinygltf::Value given = it->second;
        unpack_view(context, i, given);
    }
}

}  // namespace ambilux::gltf
