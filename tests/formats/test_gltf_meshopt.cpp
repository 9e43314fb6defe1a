// libs: ambilux_formats
// timeout: 60
// EXT_meshopt_compression. The packed bytes are those of meshoptimizer for the values beside them.
#include "tests/support/gltf_text.h"
#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using namespace ambilux::test::gltf;
using test::check_rgb;
using test::contains;

namespace {

// (-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)
const std::vector<int> kPositions = {160, 0, 0, 0, 1, 51, 0, 0, 0,   255, 255, 0, 0,   0,   1, 12, 0, 0, 0,
                                     255, 0, 0, 0, 0, 0,  0, 0, 0,   0,   0,   0, 0,   0,   0, 0,  0, 0, 0,
                                     0,   0, 0, 0, 0, 0,  0, 0, 128, 191, 0,   0, 128, 191, 0, 0,  0, 0};
// (i / 2, i % 2, 0) for i below 40
const std::vector<int> kStrip = {
    160, 0,   0,   21,  12,  204, 204, 204, 255, 255, 128, 128, 64,  64,  64,  204, 204, 204, 204, 64,  32,  32,
    32,  32,  32,  32,  32,  204, 204, 0,   0,   32,  16,  16,  16,  5,   12,  128, 0,   0,   126, 128, 0,   0,
    0,   0,   0,   31,  0,   255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255,
    255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 0,   0,   255, 255, 255, 255,
    255, 255, 255, 255, 31,  0,   126, 125, 126, 125, 126, 125, 126, 125, 126, 125, 126, 125, 126, 125, 126, 125,
    126, 125, 126, 125, 126, 125, 126, 125, 126, 125, 126, 125, 126, 125, 126, 255, 255, 0,   0,   125, 126, 125,
    126, 125, 126, 125, 126, 0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,
    0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0,   0};
// triangles of the strip
const std::vector<int> kTriangles = {
    225, 240, 16, 0, 16, 0, 16, 0, 16, 0, 16, 0, 16,  0,   16, 0,   16,  0,   16,  0,   16,  0,   16,  0, 16,  0, 16, 0,
    16,  0,   16, 0, 16, 0, 16, 0, 16, 0, 16, 0, 118, 135, 86, 103, 120, 169, 134, 101, 137, 104, 152, 1, 105, 0, 0};
// 0 5 10, 39 20 1, 7 27 12, 0 1 2, 30 31 3
const std::vector<int> kLoose = {225, 254, 254, 255, 254, 254, 255, 10,  10, 255, 58,  37,
                                 255, 25,  40,  29,  150, 255, 36,  2,   0,  118, 135, 86,
                                 103, 120, 169, 134, 101, 137, 104, 152, 1,  105, 0,   0};
// 0 1 2, 2 1 3 as a sequence
const std::vector<int> kSequence = {209, 0, 4, 4, 0, 2, 8, 0, 0, 0, 0};
// on an octahedron: (0, 0), (1, 0), (64, -63) / 127, (-100, -100) / 127
const std::vector<int> kNormals = {160, 1, 63, 0,  0, 0, 254, 125, 184, 1, 15, 0, 0, 0, 125, 73, 0,   1, 15,
                                   0,   0, 0,  10, 9, 0, 0,   0,   0,   0, 0,  0, 0, 0, 0,   0,  0,   0, 0,
                                   0,   0, 0,  0,  0, 0, 0,   0,   0,   0, 0,  0, 0, 0, 0,   0,  127, 0};
// three numbers of a quaternion, scaled by the square root of 2, and 1 with the place of the fourth in its last bits:
// (0, 0, 0), 16 bits, 3; (300, -200, 100), 10 bits, 0; (-20000, 12345, 11000), 16 bits, 1; (3, -4, 2), 4 bits, 2
const std::vector<int> kRotations = {160, 1,   63,  0,   0, 0,  88, 151, 70, 1,  47, 0, 0,  0,  159, 158, 1,   59,  0,
                                     0,   0,   112, 121, 1, 31, 0,  0,   0,  98, 97, 1, 63, 0,  0,   0,   200, 215, 20,
                                     1,   15,  0,   0,   0, 84, 83, 1,   59, 0,  0,  0, 5,  18, 1,   63,  0,   0,   0,
                                     251, 252, 253, 0,   0, 0,  0,  0,   0,  0,  0,  0, 0,  0,  0,   0,   0,   0,   0,
                                     0,   0,   0,   0,   0, 0,  0,  0,   0,  0,  0,  0, 0,  0,  255, 127};
// on an octahedron, 16 bits: (0, 0) and (-300, 411) of 511, (16000, -20000) and (-32767, 0) of 32767
const std::vector<int> kFineNormals = {
    160, 1, 63,  0,   0, 0, 87, 167, 253, 1, 63,  0, 0,  0, 3, 128, 132, 1,  63, 0, 0,  0, 201, 138, 64,  1, 47, 0,
    0,   0, 159, 158, 0, 1, 12, 0,   0,   0, 252, 1, 63, 0, 0, 0,   29,  34, 17, 1, 24, 0, 0,   0,   0,   0, 0,  0,
    0,   0, 0,   0,   0, 0, 0,  0,   0,   0, 0,   0, 0,  0, 0, 0,   0,   0,  0,  0, 0,  0, 0,   0,   255, 1, 7,  0};
// mantissas and exponents: (5, -2), (-7, 0), (100, 3); (123456, -20), (-1, 1), (0, 0); (-8, -3), (1, 20), (8388607,
// -22); (1, -1), (-1, -1), (-8388608, 4)
const std::vector<int> kExponents = {
    160, 1, 63, 0,  0,   0, 118, 143, 18, 1, 62, 0,  0, 0, 59, 58,  1, 46, 0, 0,   0,   3,   1,   63, 0,   0,  0,  35,
    34,  4, 1,  63, 0,   0, 0,   12,  4,  3, 1,  9,  0, 0, 0,  1,   9, 0,  0, 0,   1,   47,  0,   0,  0,   38, 41, 1,
    54,  0, 0,  0,  199, 1, 6,   0,   0,  0, 1,  14, 0, 0, 0,  254, 1, 63, 0, 0,   0,   5,   43,  52, 0,   0,  0,  0,
    0,   0, 0,  0,  0,   0, 0,   0,   0,  0, 0,  0,  0, 0, 0,  0,   5, 0,  0, 254, 249, 255, 255, 0,  100, 0,  0,  3};

/// A view of packed bytes, whose unpacked ones would lie in a buffer that the file does not have.
int add_view(Json& j, const std::vector<int>& bytes, int stride, int count, const char* mode,
             const char* filter = "NONE") {
    j["extensionsUsed"] = j["extensionsRequired"] = {"EXT_meshopt_compression", "KHR_mesh_quantization"};
    const std::string packed(bytes.begin(), bytes.end());
    j["buffers"].push_back({{"byteLength", packed.size()}, {"uri", data_uri("application/octet-stream", packed)}});
    j["buffers"].push_back(
        {{"byteLength", stride * count}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
    const size_t n = j["buffers"].size();
    j["bufferViews"].push_back({{"buffer", n - 1},
                                {"byteLength", stride * count},
                                {"extensions",
                                 {{"EXT_meshopt_compression",
                                   {{"buffer", n - 2},
                                    {"byteLength", packed.size()},
                                    {"byteStride", stride},
                                    {"count", count},
                                    {"mode", mode},
                                    {"filter", filter}}}}}});
    return int(j["bufferViews"].size()) - 1;
}

void use_view(Json& j, int accessor, int view, int count) {
    j["accessors"][size_t(accessor)]["bufferView"] = view;
    j["accessors"][size_t(accessor)]["count"] = count;
}

/// The strip's vertices without normals and coordinates.
Json strip() {
    Json j = quad_scene();
    j["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", 0}};
    use_view(j, 0, add_view(j, kStrip, 12, 40, "ATTRIBUTES"), 40);
    return j;
}

/// Vertices of a triangle from the smallest one on.
std::array<uint32_t, 3> corners(const Triangle& t) {
    std::array<uint32_t, 3> out{t.v0, t.v1, t.v2};
    std::rotate(out.begin(), std::min_element(out.begin(), out.end()), out.end());
    return out;
}

}  // namespace

TEST_CASE("packed vertices, triangles and sequences are unpacked") {
    Json j = quad_scene();
    use_view(j, 0, add_view(j, kPositions, 12, 4, "ATTRIBUTES"), 4);
    const Scene quad = load(j);
    check_rgb(quad.vertices[0].p, {-1, -1, 0});
    check_rgb(quad.vertices[2].p, {1, 1, 0});

    Json row = strip();
    use_view(row, 3, add_view(row, kTriangles, 2, 114, "TRIANGLES"), 114);
    const Scene s = load(row);
    REQUIRE(s.triangles.size() == 38);
    check_rgb(s.vertices[39].p, {19, 1, 0});
    for (uint32_t i = 0; i < 38; ++i) {
        CHECK(s.vertices[i].p.x == float(i / 2));
        const std::array<uint32_t, 3> even{i, i + 1, i + 2}, odd{i, i + 2, i + 1};
        CHECK(corners(s.triangles[i]) == (i % 2 ? odd : even));
    }

    Json loose = strip();
    use_view(loose, 3, add_view(loose, kLoose, 2, 15, "TRIANGLES"), 15);
    const Scene l = load(loose);
    const std::array<uint32_t, 3> expected[] = {{0, 5, 10}, {1, 39, 20}, {7, 27, 12}, {0, 1, 2}, {3, 30, 31}};
    REQUIRE(l.triangles.size() == 5);
    for (size_t i = 0; i < 5; ++i) CHECK(corners(l.triangles[i]) == expected[i]);

    Json sequence = strip();
    use_view(sequence, 3, add_view(sequence, kSequence, 4, 6, "INDICES"), 6);
    sequence["accessors"][3]["componentType"] = 5125;
    const Scene q = load(sequence);
    REQUIRE(q.triangles.size() == 2);
    CHECK(corners(q.triangles[1]) == std::array<uint32_t, 3>{1, 3, 2});
}

TEST_CASE("normals on an octahedron are unfolded") {
    Json j = quad_scene();
    use_view(j, 1, add_view(j, kNormals, 4, 4, "ATTRIBUTES", "OCTAHEDRAL"), 4);
    j["bufferViews"].back()["byteStride"] = 4;
    j["accessors"][1]["componentType"] = 5120;
    j["accessors"][1]["normalized"] = true;
    const Scene s = load(j);
    check_rgb(s.vertices[0].n, {0, 0, 1}, 0.01);
    check_rgb(s.vertices[1].n, {1, 0, 0}, 0.01);
    check_rgb(s.vertices[2].n, {0.713f, -0.702f, 0}, 0.01);
    check_rgb(s.vertices[3].n, {-0.329f, -0.329f, -0.885f}, 0.02);
}

// What is expected was worked out apart, in double precision, by the formulas of appendix B of the extension.
TEST_CASE("quaternions get their largest number back, in the place that it had") {
    const int expected[4][4] = {
        {0, 0, 0, 32767}, {28033, 13603, -9068, 4534}, {7778, 27147, -14142, 8729}, {-13240, 6620, 27495, 9930}};
    // Read as positions, which have three numbers: the first ones, and from the second one on.
    for (size_t from = 0; from < 2; ++from) {
        Json j = quad_scene();
        j["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", 0}};
        use_view(j, 0, add_view(j, kRotations, 8, 4, "ATTRIBUTES", "QUATERNION"), 4);
        j["bufferViews"].back()["byteStride"] = 8;
        j["accessors"][0].update({{"componentType", 5122}, {"normalized", true}, {"byteOffset", 2 * from}});
        const Scene s = load(j);
        REQUIRE(s.vertices.size() == 4);
        for (size_t i = 0; i < 4; ++i)
            for (size_t k = 0; k < 3; ++k)
                CHECK(std::lround((&s.vertices[i].p.x)[k] * 32767.0) == expected[i][from + k]);
    }
}

TEST_CASE("normals of 16 bits and numbers with exponents are unfolded") {
    Json j = quad_scene();
    use_view(j, 0, add_view(j, kExponents, 12, 4, "ATTRIBUTES", "EXPONENTIAL"), 4);
    use_view(j, 1, add_view(j, kFineNormals, 8, 4, "ATTRIBUTES", "OCTAHEDRAL"), 4);
    j["bufferViews"].back()["byteStride"] = 8;
    j["accessors"][1].update({{"componentType", 5122}, {"normalized", true}});
    const Scene s = load(j);
    REQUIRE(s.vertices.size() == 4);
    const float positions[4][3] = {
        {1.25f, -7, 800}, {123456 * 0x1p-20f, -2, 0}, {-1, 0x1p20f, 8388607 * 0x1p-22f}, {0.5f, -0.5f, -0x1p27f}};
    const int normals[4][3] = {{0, 0, 32767}, {-10658, 22488, -21316}, {19621, -25768, -4969}, {-32767, 0, 0}};
    for (size_t i = 0; i < 4; ++i)
        for (size_t k = 0; k < 3; ++k) {
            CHECK((&s.vertices[i].p.x)[k] == positions[i][k]);
            CHECK((&s.vertices[i].n.x)[k] == Approx(normals[i][k] / 32767.0).margin(5e-5));
        }
}

TEST_CASE("packed bytes that are broken are refused") {
    const auto with = [](std::vector<int> bytes, int count, const char* mode) {
        Json j = strip();
        use_view(j, 3, add_view(j, bytes, 2, count, mode), count);
        return error_of(j);
    };
    std::vector<int> cut = kTriangles;
    cut.pop_back();
    CHECK(contains(with(cut, 114, "TRIANGLES"), "its packed bytes are broken"));
    CHECK(contains(with(kTriangles, 111, "TRIANGLES"), "its packed bytes are broken"));
    CHECK(contains(with(kTriangles, 114, "INDICES"), "its packed bytes are broken"));
    CHECK(contains(with(kTriangles, 3000000, "TRIANGLES"), "its packed bytes are too few"));
}

TEST_CASE("modes, filters and sizes that the extension does not have are refused by name") {
    const auto with = [](int stride, int count, const char* mode, const char* filter) {
        Json j = strip();
        use_view(j, 3, add_view(j, kTriangles, stride, count, mode, filter), count);
        return error_of(j);
    };
    const std::string error = with(2, 114, "LINES", "NONE");
    CHECK(contains(error, "scene.gltf"));
    CHECK(contains(error, "buffer view 5: mode 'LINES' with filter 'NONE' cannot hold 114 elements of 2 bytes"));
    const struct {
        int stride, count;
        const char *mode, *filter;
    } wrong[] = {
        {2, 113, "TRIANGLES", "NONE"},       {3, 114, "TRIANGLES", "NONE"},      {8, 114, "INDICES", "NONE"},
        {0, 114, "INDICES", "NONE"},         {2, 114, "TRIANGLES", "NORMAL"},    {4, 114, "INDICES", "OCTAHEDRAL"},
        {0, 114, "ATTRIBUTES", "NONE"},      {6, 114, "ATTRIBUTES", "NONE"},     {260, 1, "ATTRIBUTES", "NONE"},
        {12, 9, "ATTRIBUTES", "OCTAHEDRAL"}, {4, 9, "ATTRIBUTES", "QUATERNION"}, {4, 9, "ATTRIBUTES", "OCT"}};
    for (const auto& w : wrong) {
        INFO(w.mode << ' ' << w.filter << ' ' << w.stride << ' ' << w.count);
        CHECK(contains(with(w.stride, w.count, w.mode, w.filter), "cannot hold"));
    }
}
