// Layout (Mitsuba 0.6 documentation, section 8.2.10): u16 0x041C, u16 version, then one deflated stream per mesh: u32
// flags, (v4) zero-terminated name, u64 vertices, u64 triangles, positions, normals, texture coordinates, colours,
// indices. At the end of the file the offset of each mesh (u64 in version 4, u32 in version 3) and their number (u32).
// Little endian.
#include <zlib.h>

#include <bit>
#include <cstring>

#include "formats/file_budget.h"
#include "formats/meshes/mesh.h"

namespace ambilux {

static_assert(std::endian::native == std::endian::little, "the reader copies little-endian values as they are");

namespace {

enum Flags : uint32_t { kNormals = 0x0001, kTexcoords = 0x0002, kColors = 0x0008, kDoublePrecision = 0x2000 };

constexpr int kLongestName = 1 << 16;

/// Inflates a stream piece by piece.
struct Inflater {
    FileBudget& budget;
    std::string_view rest;  ///< what zlib, which counts in 32 bits, has not got yet
    z_stream stream{};

    Inflater(std::string_view bytes, FileBudget& b) : budget(b), rest(bytes) {
        if (inflateInit(&stream) != Z_OK) budget.fail("cannot start zlib");
    }
    ~Inflater() { inflateEnd(&stream); }
    Inflater(const Inflater&) = delete;

    void read(void* data, size_t size) {
        auto* out = static_cast<Bytef*>(data);
        while (size > 0) {
            const uInt chunk = uInt(std::min<size_t>(size, kPiece));
            if (stream.avail_in == 0 && !rest.empty()) {
                stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(rest.data()));
                stream.avail_in = uInt(std::min<size_t>(rest.size(), 1u << 30));
                rest.remove_prefix(stream.avail_in);
            }
            stream.next_out = out;
            stream.avail_out = chunk;
            const int status = inflate(&stream, Z_SYNC_FLUSH);
            const size_t got = chunk - stream.avail_out;
            out += got;
            size -= got;
            if (status != Z_OK && status != Z_STREAM_END)
                budget.fail(std::string("mesh data is damaged (zlib: ") + (stream.msg ? stream.msg : "no progress") +
                            ")");
            if (size > 0 && (status == Z_STREAM_END || (got == 0 && rest.empty())))
                budget.fail("mesh data ends too early");
            budget.check_time();
        }
    }
    template <class T>
    T value() {
        T v{};
        read(&v, sizeof v);
        return v;
    }
    /// `count` values, which grow as the data comes: a count that lies allocates little.
    template <class T>
    std::vector<T> values(uint64_t count) {
        std::vector<T> all;
        while (all.size() < count) {
            const size_t begin = all.size(), piece = size_t(std::min<uint64_t>(count - begin, kPiece / sizeof(T)));
            if (begin + piece > all.capacity()) all.reserve(std::min<uint64_t>(count, 2 * (begin + piece)));
            all.resize(begin + piece);
            read(all.data() + begin, piece * sizeof(T));
        }
        return all;
    }
    /// `count` floats, which the file may store as doubles.
    std::vector<float> floats(uint64_t count, bool doubles) {
        if (!doubles) return values<float>(count);
        const std::vector<double> wide = values<double>(count);
        return {wide.begin(), wide.end()};
    }

    static constexpr size_t kPiece = 16 << 20;
};

template <class T>
T load(const FileBudget& budget, std::string_view bytes, size_t offset) {
    if (offset + sizeof(T) > bytes.size()) budget.fail("file ends too early");
    T value{};
    memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
}

}  // namespace

Mesh read_serialized(const std::string& path, std::string_view bytes, int shape_index, bool flip_v,
                     const Limits& limits) {
    FileBudget budget(path, limits);
    if (load<uint16_t>(budget, bytes, 0) != 0x041C) budget.fail("not a Mitsuba serialized mesh");
    const uint16_t version = load<uint16_t>(budget, bytes, 2);
    if (version != 3 && version != 4)
        budget.fail("unknown version " + std::to_string(version) + " of the serialized format");
    if (bytes.size() < 8) budget.fail("file ends too early");

    const uint32_t count = load<uint32_t>(budget, bytes, bytes.size() - 4);
    if (shape_index < 0 || uint32_t(shape_index) >= count)
        budget.fail("shape_index " + std::to_string(shape_index) + " is out of range (the file has " +
                    std::to_string(count) + " meshes)");
    size_t offset = 0;
    if (shape_index > 0) {
        const size_t entry = version == 4 ? 8 : 4, back = entry * (count - uint32_t(shape_index)) + 4;
        if (back > bytes.size()) budget.fail("the table of meshes is damaged");
        offset = version == 4 ? load<uint64_t>(budget, bytes, bytes.size() - back)
                              : load<uint32_t>(budget, bytes, bytes.size() - back);
    }
    if (offset + 4 >= bytes.size() || offset + 4 < offset) budget.fail("the table of meshes is damaged");

    Inflater in(bytes.substr(offset + 4), budget);
    const uint32_t flags = in.value<uint32_t>();
    if (version == 4)
        for (int length = 0; in.value<char>() != 0; ++length)
            if (length == kLongestName) budget.fail("the name of the mesh does not end");
    const uint64_t vertices = in.value<uint64_t>(), triangles = in.value<uint64_t>();
    // Deflate packs at most 1032:1, so larger claims are wrong and must not be allocated.
    if (vertices > bytes.size() * 1032 / 12 || triangles > bytes.size() * 1032 / 12)
        budget.fail("mesh claims more data than the file holds");
    budget.bytes(mesh_bytes(vertices, triangles));

    const bool doubles = flags & kDoublePrecision;
    const auto vectors = [&] {
        const std::vector<float> values = in.floats(vertices * 3, doubles);
        std::vector<Vec3f> result(vertices);
        for (size_t i = 0; i < vertices; ++i) result[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
        return result;
    };
    Mesh mesh;
    if (doubles)
        set_positions(mesh, in.values<std::array<double, 3>>(vertices));
    else
        mesh.positions = vectors();
    if (flags & kNormals) mesh.normals = vectors();
    if (flags & kTexcoords) {
        const std::vector<float> values = in.floats(vertices * 2, doubles);
        mesh.uvs.resize(vertices);
        for (size_t i = 0; i < vertices; ++i)
            mesh.uvs[i] = {values[2 * i], flip_v ? 1 - values[2 * i + 1] : values[2 * i + 1]};
    }
    if (flags & kColors) vectors(), mesh.notes.push_back("the serialized file has unused data: colours of vertices");
    mesh.faces = in.values<std::array<uint32_t, 3>>(triangles);
    check_mesh(path, mesh);
    return mesh;
}

}  // namespace ambilux
