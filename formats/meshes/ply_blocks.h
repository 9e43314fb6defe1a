// Binary PLY a column or a block at a time, where entries have a fixed size: ten times as fast as value by value.
#pragma once

#include <bit>
#include <cstring>

#include "formats/meshes/ply_format.h"

namespace ambilux::ply {

/// Entries of a block, between two looks at the clock; their bytes stay in the cache from column to column.
constexpr uint64_t kBlock = 1024;

inline bool is_swapped(Encoding encoding) {
    return (encoding == Encoding::big_endian) == (std::endian::native == std::endian::little);
}

/// The value of type T at any address.
template <class T>
T load(const char* at, bool swap) {
    char bytes[sizeof(T)];
    memcpy(bytes, at, sizeof(T));
    if (swap)
        for (size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
    T value;
    memcpy(&value, bytes, sizeof(T));
    return value;
}

/// Calls f with a value of the type.
template <class Function>
auto with_type(Scalar type, Function&& f) {
    switch (type) {
        case Scalar::int8: return f(int8_t());
        case Scalar::uint8: return f(uint8_t());
        case Scalar::int16: return f(int16_t());
        case Scalar::uint16: return f(uint16_t());
        case Scalar::int32: return f(int32_t());
        case Scalar::uint32: return f(uint32_t());
        case Scalar::float32: return f(float());
        default: return f(double());
    }
}

/// A property of `count` entries, `stride` bytes apart, into numbers `step` of them apart.
template <class Number>
void copy_column(Scalar type, bool swap, const char* from, size_t stride, uint64_t count, Number* to, size_t step) {
    with_type(type, [&](auto tag) {
        using T = decltype(tag);
        if (swap)
            for (uint64_t i = 0; i < count; ++i) to[i * step] = Number(load<T>(from + i * stride, true));
        else
            for (uint64_t i = 0; i < count; ++i) to[i * step] = Number(load<T>(from + i * stride, false));
    });
}

/// Bytes of an entry without lists.
inline size_t fixed_size(const Element& element) {
    size_t size = 0;
    for (const Property& p : element.properties) size += size_of(p.type);
    return size;
}

inline bool has_lists(const Element& element) {
    for (const Property& p : element.properties)
        if (p.list) return true;
    return false;
}

/// Where the corners of a face lie in its entry.
struct FaceLayout {
    bool valid = false;  ///< one list, of vertices, by whole numbers; nothing else is kept
    size_t before = 0, after = 0;
    Scalar count_type = Scalar::uint8, index_type = Scalar::int32;
};

inline FaceLayout face_layout(const Element& element) {
    FaceLayout layout;
    int lists = 0;
    for (const Property& p : element.properties) {
        if (p.attribute >= 0 || (p.list && p.role != Role::corners)) return {};
        if (p.list)
            layout.count_type = p.count_type, layout.index_type = p.type, ++lists;
        else
            (lists ? layout.after : layout.before) += size_of(p.type);
    }
    const auto whole = [](Scalar type) { return type != Scalar::float32 && type != Scalar::float64; };
    layout.valid = lists == 1 && whole(layout.count_type) && whole(layout.index_type);
    return layout;
}

/// Appends fans of up to `count` faces, and moves `at` behind them; `cut` gets the first triangle of a fan of several
/// when it is the last of `triangles`. Stops before a face that is cut off, has other than
/// 3 to 16 corners, or has a number that is no index: the caller reads or refuses it. Returns how many were read.
template <class Triangles, class Cut>
uint64_t read_small_faces(const FaceLayout& layout, bool swap, const char*& at, const char* end, uint64_t count,
                          Triangles& triangles, Cut&& cut) {
    const auto read = [&](auto count_tag, auto index_tag) {
        using Count = decltype(count_tag);
        using Index = decltype(index_tag);
        const auto index = [&](const char* from, bool& valid) {
            const Index value = load<Index>(from, swap);
            valid &= !(value < Index(0)) && uint32_t(value) != UINT32_MAX;
            return uint32_t(value);
        };
        uint64_t done = 0;
        for (; done < count; ++done) {
            const size_t left = size_t(end - at), head = layout.before + sizeof(Count);
            if (left < head) break;
            const Count corners = load<Count>(at + layout.before, swap);
            if (corners < 3 || corners > 16) break;
            const size_t size = head + size_t(corners) * sizeof(Index) + layout.after;
            if (left < size) break;
            bool valid = true;
            const char* from = at + head;
            const uint32_t first = index(from, valid);
            uint32_t last = index(from += sizeof(Index), valid);
            for (int k = 2; k < int(corners); ++k) {
                const uint32_t next = index(from += sizeof(Index), valid);
                triangles.push_back({first, last, next});
                last = next;
            }
            if (!valid) {
                triangles.resize(triangles.size() - (size_t(corners) - 2));
                break;
            }
            if (corners > 3) cut(triangles.size() - (size_t(corners) - 2));
            at += size;
        }
        return done;
    };
    return with_type(layout.count_type, [&](auto count_tag) {
        return with_type(layout.index_type, [&](auto index_tag) { return read(count_tag, index_tag); });
    });
}

}  // namespace ambilux::ply
