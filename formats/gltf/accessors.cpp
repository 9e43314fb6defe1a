#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/file_budget.h"
#include "formats/gltf/model.h"

namespace ambilux::gltf {

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

namespace {

/// Elements as they lie in the bytes of a view, checked against them.
struct Elements {
    const unsigned char* first = nullptr;
    uint64_t stride = 0;
    int size = 0;  ///< bytes of a component
};

/// `count` elements of `components` at an offset of a view; `stride` 0: one after the other.
Elements elements(const Context& context, int view, uint64_t offset, uint64_t count, int component_type, int components,
                  const std::string& what) {
    const auto [bytes, length] = view_bytes(context, view, what);
    const int size = tinygltf::GetComponentSizeInBytes(uint32_t(component_type));
    if (size <= 0 || component_type == TINYGLTF_COMPONENT_TYPE_DOUBLE)
        context.fail(what + ": its accessor has the wrong type");
    const uint64_t element = uint64_t(size) * uint64_t(components),
                   given = context.model.bufferViews[size_t(view)].byteStride, stride = given ? given : element;
    if (stride < element || stride > 4096 || count > length || offset > length ||
        (count > 0 && (count - 1) * stride + element > length - offset))
        context.fail(what + ": its accessor reaches beyond its buffer");
    return {bytes + offset, stride, size};
}

double component(const unsigned char* p, int type, bool normalized) {
    const auto as = [p]<class T>(T v) { return memcpy(&v, p, sizeof v), v; };
    switch (type) {
        case TINYGLTF_COMPONENT_TYPE_FLOAT: return as(0.0f);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return *p / (normalized ? 255.0 : 1);
        case TINYGLTF_COMPONENT_TYPE_BYTE: return normalized ? std::max(as(int8_t{}) / 127.0, -1.0) : as(int8_t{});
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return as(uint16_t{}) / (normalized ? 65535.0 : 1);
        case TINYGLTF_COMPONENT_TYPE_SHORT: return normalized ? std::max(as(int16_t{}) / 32767.0, -1.0) : as(int16_t{});
        default: return as(uint32_t{});
    }
}

}  // namespace

std::vector<double> accessor_values(const Context& context, int index, int components, const std::string& what) {
    const tinygltf::Model& model = context.model;
    const auto fail = [&](const std::string& problem) { context.fail(what + ": " + problem); };
    if (index < 0 || size_t(index) >= model.accessors.size()) fail("there is no accessor " + std::to_string(index));
    const tinygltf::Accessor& a = model.accessors[size_t(index)];
    const int count = tinygltf::GetNumComponentsInType(uint32_t(a.type));
    if (count < components) fail("its accessor has the wrong type");
    FileBudget budget(context.where.file, context.document.limits);
    const auto copy = [&](const Elements& from, uint64_t i, double* to) {
        const unsigned char* p = from.first + i * from.stride;
        for (int c = 0; c < components; ++c) to[c] = component(p + c * from.size, a.componentType, a.normalized);
    };
    std::vector<double> out;
    const bool filled = a.bufferView >= 0;  // else zeros
    Elements dense;
    if (filled) dense = elements(context, a.bufferView, a.byteOffset, a.count, a.componentType, count, what);
    budget.bytes(uint64_t(a.count) * uint64_t(components), sizeof(double));
    out.resize(a.count * size_t(components));
    for (size_t i = 0; filled && i < a.count; ++i) copy(dense, i, &out[i * size_t(components)]);
    if (!a.sparse.isSparse) return out;
    const auto& s = a.sparse;
    if (s.count < 0 || size_t(s.count) > a.count) fail("it has more sparse values than elements");
    const Elements at = elements(context, s.indices.bufferView, uint64_t(s.indices.byteOffset), uint64_t(s.count),
                                 s.indices.componentType, 1, what + ", sparse indices"),
                   values = elements(context, s.values.bufferView, uint64_t(s.values.byteOffset), uint64_t(s.count),
                                     a.componentType, count, what + ", sparse values");
    for (uint64_t i = 0; i < uint64_t(s.count); ++i) {
        const double to = component(at.first + i * at.stride, s.indices.componentType, false);
        if (!(to >= 0 && to < double(a.count))) fail("a sparse value has no place");
        copy(values, i, &out[size_t(to) * size_t(components)]);
    }
    return out;
}

std::vector<uint32_t> accessor_indices(const Context& context, int index, int components, size_t limit,
                                       const std::string& what) {
    const std::vector<double> values = accessor_values(context, index, components, what);
    std::vector<uint32_t> out;
    out.reserve(values.size());
    for (const double v : values) {
        if (!(v >= 0 && v < double(limit) && v == std::floor(v)))
            context.fail(fmt::format("{}: index {:g} of {}", what, v, limit));
        out.push_back(uint32_t(v));
    }
    return out;
}

}  // namespace ambilux::gltf
