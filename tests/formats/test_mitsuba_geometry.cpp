// libs: ambilux_formats ambilux_accel
// timeout: 120
// Analytic shapes, instances and meshes of Mitsuba files: areas, sides, what has no area.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/math.h"
#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("analytic shapes and instances") {
    const Scene s = load(
        "<shape type='sphere'><point name='center' x='1' y='2' z='3'/><float name='radius' value='4'/><boolean "
        "name='flip_normals' value='true'/></shape>"
        "<shape type='cylinder'><point name='p0' value='0 0 1'/><point name='p1' value='0 0 5'/><float name='radius' "
        "value='0.5'/></shape>"
        "<shape type='disk'><transform name='to_world'><scale x='2' y='3'/></transform></shape><shape "
        "type='rectangle'/>");
    REQUIRE(s.quadrics.size() == 3);
    CHECK(s.shapes[0].first_primitive == 2);  // behind the two triangles
    CHECK(s.shapes[2].first_primitive == 4);
    CHECK(s.shapes[3].first_primitive == 0);
    CHECK(s.quadrics[0].radius == 4.0f);
    CHECK(s.quadrics[0].flip == 1);
    check_rgb(s.quadrics[0].to_world.point({0, 0, 1}), {1, 2, 7}, 1e-5);
    check_rgb(s.quadrics[0].to_local.point({5, 2, 3}), {1, 0, 0}, 1e-5);
    check_rgb(s.quadrics[1].to_world.point({1, 0, 1}), {0.5f, 0, 5}, 1e-5);
    CHECK(s.shapes[2].area == Approx(6 * M_PI));
    CHECK(contains(error_of("<shape type='sphere'><transform name='to_world'><scale x='2'/></transform></shape>"),
                   "sphere with shear or non-uniform scale"));

    const Scene instanced = load(
        "<shape type='shapegroup' id='g'><shape type='rectangle'/><shape type='sphere'><transform "
        "name='to_world'><translate x='1'/></transform></shape></shape>"
        "<shape type='instance'><ref id='g'/></shape>"
        "<shape type='instance'><ref id='g'/><transform name='to_world'><scale value='2'/><translate "
        "z='5'/></transform></shape>");
    CHECK(instanced.triangles.size() == 4);
    REQUIRE(instanced.quadrics.size() == 2);
    check_rgb(instanced.quadrics[1].to_world.point({0, 0, 0}), {2, 0, 5}, 1e-5);
    CHECK(instanced.quadrics[1].radius == Approx(2));
}

TEST_CASE("mirrored meshes keep their outside; in format 3 those without vertex normals turn it in (B12)") {
    const test::TempFolder folder;
    // A tetrahedron, outside by winding; with and without vertex normals, the normals once right and once against the
    // winding.
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    const std::string faces[4] = {"1 3 2", "1 2 4", "1 4 3", "2 3 4"};
    const Vec3f normals[4] = {{0, 0, -1}, {0, -1, 0}, {-1, 0, 0}, {0.57735f, 0.57735f, 0.57735f}};
    std::string plain = vertices, with = vertices;
    for (const std::string& f : faces) plain += "f " + f + "\n";
    for (const Vec3f& n : normals)
        with += "vn " + std::to_string(n.x) + " " + std::to_string(n.y) + " " + std::to_string(n.z) + "\n";
    std::string against = with;
    for (int i = 0; i < 4; ++i) {
        const std::string a(1, faces[i][0]), b(1, faces[i][2]), c(1, faces[i][4]), n = "//" + std::to_string(i + 1);
        with += "f " + a + n + " " + b + n + " " + c + n + "\n";
        against += "f " + a + n + " " + c + n + " " + b + n + "\n";
    }
    folder.write("plain.obj", plain);
    folder.write("with.obj", with);
    folder.write("against.obj", against);
    for (const auto& [file, version] : {std::pair<std::string, std::string>{"plain", "3.0.0"},
                                        {"plain", "0.6.0"},
                                        {"with", "3.0.0"},
                                        {"with", "0.6.0"},
                                        {"against", "3.0.0"}})
        for (const std::string scale : {"x='1'", "x='-1'", "x='-2' y='-3' z='-0.5'", "x='-2' y='-3' z='0.5'"})
            for (const bool flip : {false, true})
                for (const bool face_normals : {false, true}) {
                    if (file == "against" && face_normals) continue;  // then the winding alone counts
                    INFO(file << " " << version << " " << scale << " " << flip << " " << face_normals);
                    // One or three axes negative mirror; vertex normals that are used keep the outside.
                    const bool mirrors = scale == "x='-1'" || scale == "x='-2' y='-3' z='-0.5'",
                               turns = mirrors && version == "3.0.0" && (file == "plain" || face_normals);
                    const Scene s =
                        load("<shape type='obj'><string name='filename' value='" + file +
                                 ".obj'/><boolean name='flip_normals' value='" + (flip ? "true" : "false") +
                                 "'/><boolean name='face_normals' value='" + (face_normals ? "true" : "false") +
                                 "'/><transform name='to_world'><scale " + scale +
                                 "/><translate value='3 4 5'/></transform></shape>",
                             {}, version, &folder);
                    REQUIRE(s.triangles.size() == 4);
                    CHECK(bool(s.shapes[0].flags & kShapeHasNormals) == !face_normals);
                    Vec3f middle = {0, 0, 0};
                    for (const Triangle& t : s.triangles)
                        for (uint32_t v : {t.v0, t.v1, t.v2}) middle += s.vertices[v].p * (1.0f / 12);
                    for (const Triangle& t : s.triangles) {
                        const Vec3f a = s.vertices[t.v0].p, ng = cross(s.vertices[t.v1].p - a, s.vertices[t.v2].p - a);
                        CHECK((dot(ng, a - middle) > 0) == (flip == turns));
                        if (face_normals) continue;
                        const Vec3f sum = s.vertices[t.v0].n + s.vertices[t.v1].n + s.vertices[t.v2].n;
                        CHECK(dot(ng, sum) > 0);
                        if (file != "plain") CHECK(length(normalize(ng) - s.vertices[t.v0].n) < 1e-4f);
                    }
                }
}

TEST_CASE("triangles without area are left out and counted") {
    const test::TempFolder folder;
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n");
    const Scene s = load("<shape type='obj'><string name='filename' value='m.obj'/></shape>", {}, "3.0.0", &folder);
    CHECK(s.triangles.size() == 1);
    CHECK(s.degenerate_triangles == 2);
    CHECK(s.shapes[0].primitive_count == 1);
    for (const Triangle& t : s.triangles)
        for (uint32_t v : {t.v0, t.v1, t.v2}) CHECK(length(s.vertices[v].n) == Approx(1));
}
