#include "formats/gltf/meshopt.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "formats/file_budget.h"

namespace ambilux::gltf {

namespace {

constexpr const char* kName = "EXT_meshopt_compression";

/// Bytes that are read one after the other; past the end they are zeros, and `good` is false.
struct Stream {
    const uint8_t *at, *end;
    bool good = true;

    uint8_t byte() {
        if (at < end) return *at++;
        good = false;
        return 0;
    }
    /// Seven bits a byte, the low ones first.
    uint32_t number() {
        uint32_t out = 0;
        for (int shift = 0; shift < 35; shift += 7) {
            const uint8_t b = byte();
            out |= uint32_t(b & 127) << shift;
            if (b < 128) break;
        }
        return out;
    }
    uint32_t after(uint32_t last) {
        const uint32_t v = number();
        return last + ((v >> 1) ^ (0u - (v & 1)));
    }
};

/// 16 bytes of a plane, in as many bits each as `mode` says.
void unpack_group(Stream& in, int mode, uint8_t* to) {
    if (mode == 0) return void(memset(to, 0, 16));
    if (mode == 3) {
        for (int i = 0; i < 16; ++i) to[i] = in.byte();
        return;
    }
    const int bits = 2 * mode, mask = (1 << bits) - 1;
    uint8_t packed[8];
    for (int i = 0; i < 2 * bits; ++i) packed[i] = in.byte();
    for (int i = 0; i < 16; ++i) {
        const int shift = 8 - bits - i * bits % 8, v = packed[i * bits / 8] >> shift & mask;
        to[i] = v == mask ? in.byte() : uint8_t(v);
    }
}

bool unpack_vertices(Stream in, size_t count, size_t stride, uint8_t* out) {
    if (in.byte() != 0xa0 || stride == 0 || stride > 256 || stride % 4 != 0) return false;
    const size_t tail = std::max<size_t>(stride, 32);
    if (size_t(in.end - in.at) < tail) return false;
    uint8_t last[256];
    memcpy(last, in.end - stride, stride);
    in.end -= tail;
    const size_t most = std::min<size_t>(8192 / stride & ~size_t(15), 256);
    for (size_t first = 0; first < count; first += most) {
        const size_t n = std::min(most, count - first), groups = (n + 15) / 16;
        for (size_t k = 0; k < stride; ++k) {
            uint8_t modes[4];
            for (size_t i = 0; i < (groups + 3) / 4; ++i) modes[i] = in.byte();
            for (size_t g = 0; g < groups; ++g) {
                uint8_t deltas[16];
                unpack_group(in, modes[g / 4] >> g % 4 * 2 & 3, deltas);
                for (size_t i = 16 * g; i < std::min(n, 16 * g + 16); ++i) {
                    const uint8_t d = deltas[i - 16 * g];
                    last[k] = uint8_t(last[k] + (d >> 1 ^ -(d & 1)));
                    out[(first + i) * stride + k] = last[k];
                }
            }
        }
    }
    return in.good && in.at == in.end;
}

void put_index(uint8_t*& out, size_t stride, uint32_t v) {
    if (stride == 4) {
        memcpy(out, &v, 4);
    } else {
        const uint16_t half = uint16_t(v);
        memcpy(out, &half, 2);
    }
    out += stride;
}

/// The last 16 edges and vertices, of which new triangles take theirs.
struct Fifos {
    uint32_t edges[16][2], vertices[16];
    uint32_t edge = 0, vertex = 0;

    void push(uint32_t v, bool is_new = true) {
        vertices[vertex] = v;
        vertex = (vertex + is_new) & 15;
    }
    void push_edge(uint32_t a, uint32_t b) {
        edges[edge][0] = a, edges[edge][1] = b;
        edge = (edge + 1) & 15;
    }
};

bool unpack_triangles(Stream in, size_t count, size_t stride, uint8_t* out) {
    if (in.byte() != 0xe1 || count % 3 != 0 || size_t(in.end - in.at) < count / 3 + 16) return false;
    Stream codes{in.at, in.at + count / 3};
    in.at = codes.end, in.end -= 16;
    const uint8_t* table = in.end;
    Fifos fifo;
    memset(fifo.edges, 255, sizeof fifo.edges), memset(fifo.vertices, 255, sizeof fifo.vertices);
    uint32_t next = 0, last = 0;
    for (size_t i = 0; i < count; i += 3) {
        const uint32_t code = codes.byte();
        const auto recent = [&](uint32_t k) { return k == 0 ? next++ : fifo.vertices[(fifo.vertex - k) & 15]; };
        uint32_t a, b, c;
        if (code < 0xf0) {
            const uint32_t* edge = fifo.edges[(fifo.edge - 1 - (code >> 4)) & 15];
            const uint32_t k = code & 15;
            a = edge[0], b = edge[1];
            if (k < 13) {
                c = k == 0 ? next++ : fifo.vertices[(fifo.vertex - 1 - k) & 15];
            } else {
                c = last = k == 15 ? in.after(last) : k == 13 ? last - 1 : last + 1;
            }
            fifo.push(c, k == 0 || k >= 13);
            fifo.push_edge(c, b), fifo.push_edge(a, c);
        } else {
            const bool of_table = code < 0xfe;
            const uint32_t both = of_table ? table[code & 15] : in.byte(), kb = both >> 4, kc = both & 15,
                           ka = of_table || code == 0xfe ? 0 : 15;
            if (!of_table && both == 0) next = 0;
            const auto vertex = [&](uint32_t k) { return !of_table && k == 15 ? 0 : recent(k); };
            a = vertex(ka), b = vertex(kb), c = vertex(kc);
            if (!of_table) {
                if (ka == 15) last = a = in.after(last);
                if (kb == 15) last = b = in.after(last);
                if (kc == 15) last = c = in.after(last);
            }
            fifo.push(a);
            fifo.push(b, kb == 0 || (!of_table && kb == 15));
            fifo.push(c, kc == 0 || (!of_table && kc == 15));
            fifo.push_edge(b, a), fifo.push_edge(c, b), fifo.push_edge(a, c);
        }
        for (const uint32_t v : {a, b, c}) put_index(out, stride, v);
    }
    return in.good && in.at == in.end;
}

bool unpack_indices(Stream in, size_t count, size_t stride, uint8_t* out) {
    if (in.byte() != 0xd1 || in.end - in.at < 4) return false;
    in.end -= 4;
    uint32_t last[2] = {0, 0};
    for (size_t i = 0; i < count; ++i) {
        const uint32_t v = in.number(), d = v >> 1;
        uint32_t& from = last[v & 1];
        from += (d >> 1) ^ (0u - (d & 1));
        put_index(out, stride, from);
    }
    return in.good && in.at == in.end;
}

int rounded(double v, double most) { return int(std::lround(std::clamp(v, -1.0, 1.0) * most)); }

/// Unit vectors on an octahedron, the third number what stands for 1.
template <class T>
void unfold_octahedron(uint8_t* data, size_t count) {
    const double most = double((1 << (8 * sizeof(T) - 1)) - 1);
    for (size_t i = 0; i < count; ++i, data += 4 * sizeof(T)) {
        T v[4];
        memcpy(v, data, sizeof v);
        const double one = v[2] == 0 ? 1 : double(v[2]);
        double x = v[0] / one, y = v[1] / one;
        const double z = 1 - std::fabs(x) - std::fabs(y), t = std::min(z, 0.0);
        x += x >= 0 ? t : -t, y += y >= 0 ? t : -t;
        const double l = std::sqrt(x * x + y * y + z * z);
        v[0] = T(rounded(x / l, most)), v[1] = T(rounded(y / l, most)), v[2] = T(rounded(z / l, most));
        memcpy(data, v, sizeof v);
    }
}

/// Quaternions without their largest number, which the last two bits name.
void unfold_quaternions(uint8_t* data, size_t count) {
    for (size_t i = 0; i < count; ++i, data += 8) {
        int16_t v[4];
        memcpy(v, data, sizeof v);
        const double scale = std::sqrt(0.5) / (v[3] | 3), x = v[0] * scale, y = v[1] * scale, z = v[2] * scale,
                     w = std::sqrt(std::max(0.0, 1 - x * x - y * y - z * z));
        const int largest = v[3] & 3;
        const double all[4] = {w, x, y, z};
        for (int k = 0; k < 4; ++k) v[(largest + k) & 3] = int16_t(rounded(all[k], 32767));
        memcpy(data, v, sizeof v);
    }
}

/// Mantissas of 24 bits behind exponents of 8.
void unfold_exponents(uint8_t* data, size_t count) {
    for (size_t i = 0; i < count; ++i, data += 4) {
        uint32_t bits;
        memcpy(&bits, data, 4);
        const float v = std::ldexp(float(int32_t(bits << 8) >> 8), int32_t(bits) >> 24);
        memcpy(data, &v, 4);
    }
}

std::string text_of(const tinygltf::Value& of, const char* name, const char* fallback) {
    return of.Has(name) && of.Get(name).IsString() ? of.Get(name).Get<std::string>() : fallback;
}

void unpack_view(Context& context, size_t index, const tinygltf::Value& given) {
    const std::string what = "buffer view " + std::to_string(index);
    const auto size = [&](const char* name, double fallback) {
        const double v = number(&given, name, fallback);
        if (!(v >= 0 && v < 0x1p32 && v == std::floor(v))) context.fail(what + ": '" + name + "' is no size");
        return size_t(v);
    };
    const size_t buffer = size("buffer", -1), offset = size("byteOffset", 0), length = size("byteLength", -1),
                 stride = size("byteStride", -1), count = size("count", -1);
    if (buffer >= context.model.buffers.size()) context.fail(what + ": its buffer does not exist");
    const std::vector<unsigned char>& from = context.model.buffers[buffer].data;
    if (offset > from.size() || length > from.size() - offset) context.fail(what + " reaches beyond its buffer");
    if (uint64_t(count) * stride > 64 * uint64_t(length)) context.fail(what + ": its packed bytes are too few");
    FileBudget(context.where.file, context.document.limits).bytes(uint64_t(count) * stride, 1);
    const Stream in{from.data() + offset, from.data() + offset + length};
    const std::string mode = text_of(given, "mode", ""), filter = text_of(given, "filter", "NONE");
    std::vector<unsigned char> out(count * stride);
    const bool indices = mode == "TRIANGLES" || mode == "INDICES";
    bool good = mode == "ATTRIBUTES" || (indices && (stride == 2 || stride == 4));
    if (good)
        good = mode == "ATTRIBUTES"  ? unpack_vertices(in, count, stride, out.data())
               : mode == "TRIANGLES" ? unpack_triangles(in, count, stride, out.data())
                                     : unpack_indices(in, count, stride, out.data());
    if (good && filter == "OCTAHEDRAL" && (stride == 4 || stride == 8))
        stride == 4 ? unfold_octahedron<int8_t>(out.data(), count) : unfold_octahedron<int16_t>(out.data(), count);
    else if (good && filter == "QUATERNION" && stride == 8)
        unfold_quaternions(out.data(), count);
    else if (good && filter == "EXPONENTIAL")
        unfold_exponents(out.data(), count * stride / 4);
    else
        good = good && filter == "NONE";
    if (!good) context.fail(what + ": its packed bytes are broken");
    tinygltf::BufferView& view = context.model.bufferViews[index];
    view.buffer = int(context.model.buffers.size());
    view.byteOffset = 0;
    view.byteLength = out.size();
    context.model.buffers.emplace_back().data = std::move(out);
}

}  // namespace

std::string with_fallback_buffers(const std::string& bytes) {
    if (bytes.find(kName) == std::string::npos) return bytes;
    const auto word = [&](size_t at) {
        uint32_t v = 0;
        if (at + 4 <= bytes.size()) memcpy(&v, bytes.data() + at, 4);
        return size_t(v);
    };
    const bool binary = bytes.starts_with("glTF");
    const size_t first = binary ? 20 : 0, length = binary ? word(12) : bytes.size();
    if (first > bytes.size() || length > bytes.size() - first) return bytes;
    auto json = nlohmann::json::parse(bytes.begin() + std::ptrdiff_t(first),
                                      bytes.begin() + std::ptrdiff_t(first + length), nullptr, false);
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
    out += bytes.substr(16, 4) + text + bytes.substr(first + length);
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
