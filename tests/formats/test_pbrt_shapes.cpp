// libs: ambilux_formats
// timeout: 60
// Transforms and shapes of pbrt scenes.
#include <cmath>

#include "formats/meshes/loop_subdivision.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("transforms apply from the last to the first, and attributes come back") {
    const Scene s = load_pbrt_world("Translate 1 2 3 Scale 2 2 2 AttributeBegin Rotate 90 0 0 1 Translate 1 0 0\n" +
                                    kUnitTriangle + "CoordinateSystem \"there\" AttributeEnd\n" + kUnitTriangle +
                                    "Identity ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]\n" + kUnitTriangle +
                                    "CoordSysTransform \"there\"\n" + kUnitTriangle);
    REQUIRE(s.shapes.size() == 4);
    const Vec3f expected[4] = {{1, 4, 3}, {1, 2, 3}, {5, 6, 7}, {1, 4, 3}};
    for (size_t i = 0; i < 4; ++i) check_rgb(s.vertices[3 * i].p, expected[i]);
}

TEST_CASE("ReverseOrientation and mirrors leave normals as pbrt has them") {
    const auto normal = [](const std::string& before) {
        const Scene s = load_pbrt_world(before + kUnitTriangle);
        const Triangle& t = s.triangles[0];
        return normalize(cross(s.vertices[t.v1].p - s.vertices[t.v0].p, s.vertices[t.v2].p - s.vertices[t.v0].p));
    };
    check_rgb(normal(""), {0, 0, 1});
    check_rgb(normal("ReverseOrientation "), {0, 0, -1});
    check_rgb(normal("Scale -1 1 1 "), {0, 0, 1});
    check_rgb(normal("Scale 1 1 -1 "), {0, 0, -1});
}

TEST_CASE("mirrored files of meshes and quadrics keep their outside, as in pbrt") {
    const TempFolder folder;
    folder.write("t.ply",
                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                 "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    const auto z = [&](const std::string& before) {
        const Scene s = load_pbrt_world(before + "Shape \"plymesh\" \"string filename\" \"t.ply\"", {}, &folder);
        const Triangle& t = s.triangles[0];
        return normalize(cross(s.vertices[t.v1].p - s.vertices[t.v0].p, s.vertices[t.v2].p - s.vertices[t.v0].p)).z;
    };
    CHECK(z("") == 1);
    CHECK(z("Scale -1 1 1 ") == 1);
    CHECK(z("Scale 1 1 -1 ") == -1);
    CHECK(z("ReverseOrientation Scale -1 1 1 ") == -1);
    for (const std::string type : {"sphere", "disk", "cylinder"}) {
        INFO(type);
        const auto flip = [&](const std::string& before) {
            return load_pbrt_world(before + "Shape \"" + type + "\"").quadrics[0].flip;
        };
        CHECK(flip("") == 0);
        CHECK(flip("Scale -1 1 1 ") == 0);
        CHECK(flip("ReverseOrientation Scale -1 1 1 ") == 1);
    }
}

TEST_CASE("meshes without normals are flat") {
    const Scene s = load_pbrt_world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  0 0 1] \"integer indices\" [0 1 2 0 1 3]");
    CHECK(!(s.shapes[0].flags & kShapeHasNormals));
}

TEST_CASE("objects are flattened with both transforms") {
    const Scene s = load_pbrt_world("ObjectBegin \"o\" Translate 1 0 0\n" + kUnitTriangle +
                                    "ObjectEnd Scale 2 2 2 ObjectInstance \"o\" Translate 0 5 0 ObjectInstance \"o\"");
    REQUIRE(s.shapes.size() == 2);
    check_rgb(s.vertices[0].p, {2, 0, 0});
    check_rgb(s.vertices[3].p, {2, 10, 0});
}

TEST_CASE("patches and subdivision surfaces are tessellated") {
    const Scene flat = load_pbrt_world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]");
    CHECK(flat.triangles.size() == 2);
    const Scene bent = load_pbrt_world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]");
    CHECK(bent.triangles.size() == 128);
    CHECK(has_note(bent, "bilinear patches"));
    // The limit of an octahedron is round, to what Loop's surface is.
    const Scene round = load_pbrt_world(
        "Shape \"loopsubdiv\" \"integer levels\" 4 \"point3 P\" [1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1] \"integer "
        "indices\" "
        "[0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5]");
    CHECK(round.triangles.size() == 8 * 256);
    float least = 10, most = 0;
    for (const MeshVertex& v : round.vertices) least = std::min(least, length(v.p)), most = std::max(most, length(v.p));
    CHECK(most / least < 1.25f);
    // Refinement leaves a vertex on the limit surface: half of itself and an eighth of each of its four neighbours.
    check_rgb(round.vertices[0].p, {0.5f, 0, 0});
    // Loop's surface of a regular plane mesh is the plane mesh: its boundary and the inner vertices stay in it.
    Mesh plane;
    for (int i = 0; i < 9; ++i) plane.positions.push_back({float(i % 3), float(i / 3), 2});
    for (uint32_t i : {0u, 1u, 3u, 4u}) plane.faces.insert(plane.faces.end(), {{i, i + 1, i + 4}, {i, i + 4, i + 3}});
    for (Vec3f p : subdivide_loop("plane", plane, 2, {}).positions) CHECK(p.z == Approx(2));
}

TEST_CASE("parts of spheres, disks and cylinders are meshes") {
    const auto check = [](const std::string& shape, double area, auto lies_on_it) {
        INFO(shape);
        const Scene s = load_pbrt_world(shape);
        REQUIRE(s.shapes.size() == 1);
        CHECK(s.quadrics.empty());
        CHECK(s.shapes[0].area == Approx(area).epsilon(2e-4));
        for (const MeshVertex& v : s.vertices) {
            CHECK(lies_on_it(v));
            CHECK(length(v.n) == Approx(1));
        }
        CHECK(has_note(s, "are triangles"));
    };
    check("Shape \"sphere\" \"float radius\" 2 \"float zmin\" -1 \"float zmax\" 1.5 \"float phimax\" 270",
          1.5 * M_PI * 2 * 2.5, [](const MeshVertex& v) {
              const float phi = std::atan2(v.p.y, v.p.x);
              return std::fabs(length(v.p) - 2) < 1e-5f && v.p.z > -1.0001f && v.p.z < 1.5001f &&
                     dot(v.p, v.n) > 1.999f && !(phi > -0.999f * float(M_PI / 2) && phi < -0.001f);
          });
    check("Shape \"disk\" \"float innerradius\" 0.5 \"float height\" 3", M_PI * 0.75, [](const MeshVertex& v) {
        const float r = std::hypot(v.p.x, v.p.y);
        return v.p.z == 3 && r > 0.499f && r < 1.001f && v.n.z == 1;
    });
    check("Shape \"cylinder\" \"float zmin\" 1 \"float zmax\" 2 \"float phimax\" 90", M_PI / 2,
          [](const MeshVertex& v) {
              return v.p.x > -1e-6f && v.p.y > -1e-6f && v.p.z >= 1 && v.p.z <= 2 &&
                     v.n.x * v.p.x + v.n.y * v.p.y > 0.999f;
          });
    // Outside of the file's orientation.
    const Scene turned = load_pbrt_world("ReverseOrientation Shape \"sphere\" \"float zmin\" 0");
    CHECK(dot(turned.vertices[0].p, turned.vertices[0].n) < -0.99f);
    CHECK(load_pbrt_world("Shape \"sphere\" \"float zmin\" -1 \"float zmax\" 1 \"float phimax\" 360").quadrics.size() ==
          1);
    CHECK(contains(world_error("Shape \"disk\" \"float innerradius\" 1"), "innerradius must be less than radius"));
}

TEST_CASE("stretched spheres and cylinders are meshes, with their normals") {
    const auto load_stretched = [](const std::string& world) {
        const Scene s = load_pbrt_world(world);
        CHECK(s.quadrics.empty());
        CHECK(has_note(s, "stretched spheres and cylinders are triangles"));
        return s;
    };
    const Scene egg = load_stretched("Scale 3 0.5 1 Shape \"sphere\" \"float radius\" 2");
    for (const MeshVertex& v : egg.vertices) {
        const Vec3f unit = {v.p.x / 6, v.p.y / 1, v.p.z / 2}, n = normalize({v.p.x / 36, v.p.y, v.p.z / 4});
        CHECK(length(unit) == Approx(1).epsilon(1e-5));
        CHECK(dot(n, v.n) > 0.9999f);
    }
    load_stretched("Scale 1 2 1 Shape \"cylinder\"");
    load_stretched("ConcatTransform [1 0 0 0  0.5 1 0 0  0 0 1 0  0 0 0 1] Shape \"sphere\"");
    for (const char* world : {"Scale 2 2 5 Shape \"cylinder\"", "Scale -2 2 2 Rotate 40 1 2 3 Shape \"sphere\"",
                              "Scale 1 2 1 Shape \"disk\""})
        CHECK(load_pbrt_world(world).quadrics.size() == 1);
}

TEST_CASE("an instance that stretches a sphere has a mesh in its place, others keep it") {
    const Scene both = load_pbrt_world(
        "ObjectBegin \"o\" Translate 1 0 0 Shape \"sphere\" Shape \"disk\"\nObjectEnd\n"
        "ObjectInstance \"o\" Scale 1 2 1 ObjectInstance \"o\" ObjectInstance \"o\"");
    CHECK(has_note(both, "stretched spheres and cylinders are triangles"));
    CHECK(both.shapes.size() == 6);
    CHECK(both.quadrics.size() == 4);  // a sphere and three disks
    for (const MeshVertex& v : both.vertices)
        CHECK(length(Vec3f{v.p.x - 1, v.p.y / 2, v.p.z}) == Approx(1).epsilon(1e-5));
    // What the object stretches, an instance may make round again, but it is a mesh by then; a cylinder may be longer.
    const auto quadrics_in = [](const std::string& shape, const std::string& transform) {
        return load_pbrt_world("ObjectBegin \"o\" " + shape + " ObjectEnd " + transform + " ObjectInstance \"o\"")
            .quadrics.size();
    };
    CHECK(quadrics_in("Shape \"cylinder\"", "Scale 1 1 3") == 1);
    CHECK(quadrics_in("Shape \"cylinder\"", "Scale 1 2 1") == 0);
    CHECK(quadrics_in("Shape \"sphere\"", "Scale -2 2 2 Rotate 40 1 2 3") == 1);
    CHECK(quadrics_in("Shape \"disk\"", "Scale 1 2 3") == 1);
}

TEST_CASE("a sphere of an object on a material that comes later is stretched by instances too") {
    const Scene s = load_pbrt_world(
        "ObjectBegin \"o\" NamedMaterial \"late\" Shape \"sphere\" ObjectEnd\n"
        "Scale 1 1 4 ObjectInstance \"o\"\n"
        "MakeNamedMaterial \"late\" \"string type\" \"conductor\"");
    CHECK(s.quadrics.empty());
    REQUIRE(s.shapes.size() == 1);
    CHECK(s.bsdfs[s.shapes[0].material].type == BsdfType::conductor);
}

TEST_CASE("curves are tubes, those of one material in one mesh") {
    const std::string curve = "Shape \"curve\" \"string type\" \"cylinder\" \"float width\" 0.2 ";
    const Scene s = test::load_pbrt_world(
        curve + "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]\n" + curve +
        "\"point3 P\" [0 1 0 1 1 0 2 1 0] \"integer degree\" 2\n" + curve +
        "\"string basis\" \"bspline\" \"point3 P\" [-1 2 0 0 2 0 1 2 0 2 2 0] \"float width1\" 0.4\n"
        "Material \"conductor\"\n" +
        curve + "\"point3 P\" [0 3 0 1 3 0 2 3 0 3 3 0]\n");
    REQUIRE(s.shapes.size() == 2);
    // Areas of open tubes: circumference times length; the last of the first mesh is a cone.
    const double slant = std::sqrt(1 + 0.1 * 0.1);
    CHECK(s.shapes[0].area == Approx(2 * M_PI * (0.1 * 3 + 0.1 * 2 + 0.15 * slant)).epsilon(0.005));
    CHECK(s.shapes[1].area == Approx(2 * M_PI * 0.1 * 3).epsilon(0.005));
    float most = 0;
    for (uint32_t i = 0; i < s.shapes[0].primitive_count; ++i) most = std::max(most, s.vertices[s.triangles[i].v2].p.x);
    CHECK(most == Approx(3).margin(1e-5));
    CHECK(test::contains(test::pbrt_error("WorldBegin\n" + curve + "\"point3 P\" [0 0 0 1 0 0 2 0 0]\n"),
                         "3 control points do not make a curve of degree 3"));
}

TEST_CASE("faces of ptex and tangents of meshes are left out") {
    const Scene s = load_pbrt_world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] \"integer faceIndices\" "
        "[0] "
        "\"vector3 S\" [1 0 0 1 0 0 1 0 0]");
    CHECK(s.triangles.size() == 1);
}
