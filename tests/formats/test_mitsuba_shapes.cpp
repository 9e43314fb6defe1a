// libs: ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 120
// Shapes that become triangles: distances and heights on a grid, and curves.
#include <cmath>
#include <cstring>

#include "formats/meshes/curves.h"
#include "formats/meshes/height_field.h"
#include "formats/meshes/sdf_grid.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// A ball of radius 0.3 about the middle, as a .vol file.
std::string ball(uint32_t n) {
    std::string bytes = "VOL\3";
    const auto add = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
    for (int32_t i : {1, int32_t(n), int32_t(n), int32_t(n), 1}) add(i);
    for (float f : {0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f}) add(f);
    for (uint32_t i = 0; i < n * n * n; ++i) {
        const auto at = [&](uint32_t k) { return double(k) / (n - 1) - 0.5; };
        const double x = at(i % n), y = at(i / n % n), z = at(i / n / n);
        add(float(std::sqrt(x * x + y * y + z * z) - 0.3));
    }
    return bytes;
}

double area(const Mesh& mesh) {
    double sum = 0;
    for (const auto& f : mesh.faces)
        sum += 0.5 *
               length(cross(mesh.positions[f[1]] - mesh.positions[f[0]], mesh.positions[f[2]] - mesh.positions[f[0]]));
    return sum;
}

}  // namespace

TEST_CASE("sdfgrid: a ball has its radius, normals and area, and is closed") {
    for (GridNormals normals : {GridNormals::smooth, GridNormals::analytic}) {
        const Mesh mesh = mesh_of_grid("ball", read_distance_grid("ball", ball(25)), normals);
        for (size_t i = 0; i < mesh.positions.size(); ++i) {
            const Vec3f r = mesh.positions[i] - splat(0.5f);
            // The interpolant cuts the curve by h²/8R at most along each axis.
            REQUIRE(std::fabs(length(r) - 0.3) < 3.0 / (24 * 24) / (8 * 0.3));
            REQUIRE(dot(normalize(r), normalize(mesh.normals[i])) > (normals == GridNormals::smooth ? 0.999f : 0.99f));
        }
        CHECK(area(mesh) == Approx(4 * M_PI * 0.09).epsilon(8e-3));  // twice that of the radius
        if (normals == GridNormals::smooth) CHECK(mesh.faces.size() == 2 * mesh.positions.size() - 4);  // Euler
    }
}

TEST_CASE("heightfield: heights of an image over a square, with the patches' own normals") {
    const TempFolder folder;
    // A slope of 1 along x and a bump: 3 columns, 2 rows, the first of them along y = -1.
    write_float_image(folder / "h.exr", 3, 2, {0, 0, 0, 1, 1, 1, 2, 2, 2, 0, 0, 0, 1, 1, 1, 4, 4, 4});
    const std::string shape =
        "<shape type='heightfield'><string name='filename' value='h.exr'/><float name='scale' value='0.5'/>";
    const Scene s = load(shape + "</shape>", {}, "0.6.0", &folder);
    CHECK(has_note(s, "shapes of type 'heightfield' are triangles: 8 of them"));
    REQUIRE(s.vertices.size() == 8);
    const float heights[6] = {0, 0.5f, 1, 0, 0.5f, 2};
    for (uint32_t i = 0; i < 6; ++i) {
        check_rgb(s.vertices[i].p, {float(i % 3) - 1, i < 3 ? -1.0f : 1.0f, heights[i]});
        CHECK(s.vertices[i].u == float(i % 3) / 2);
        CHECK(s.vertices[i].v == (i < 3 ? 0.0f : 1.0f));
    }
    // Middles lie on the bilinear patches.
    check_rgb(s.vertices[6].p, {-0.5f, 0, 0.25f});
    check_rgb(s.vertices[7].p, {0.5f, 0, 1});
    // The first column knows the slope alone: half a unit of height a cell, and cells are one unit wide.
    check_rgb(s.vertices[0].n, normalize(Vec3f{-0.5f, 0, 1}));
    // The corner of the bump: 1.5 along x, and 1 along y in one cell, which is two units.
    check_rgb(s.vertices[5].n, normalize(Vec3f{-1.5f, -0.5f, 1}));
    const Scene flat = load(shape + "<boolean name='shadingNormals' value='false'/></shape>", {}, "0.6.0", &folder);
    CHECK((flat.shapes[0].flags & kShapeHasNormals) == 0);
    CHECK(flat.shapes[0].area == Approx(s.shapes[0].area));
    write_float_image(folder / "thin.exr", 3, 1, std::vector<float>(9, 1.0f));
    CHECK(contains(
        error_of("<shape type='heightfield'><string name='filename' value='thin.exr'/></shape>", {}, "0.6.0", &folder),
        "two rows and columns"));
    // Many cells are two triangles each.
    const Mesh many = mesh_of_heights("many", 800, 700, std::vector<float>(560000, 0.0f), true);
    CHECK(many.positions.size() == 560000);
    CHECK(many.faces.size() == 2u * 799 * 699);
}

TEST_CASE("sdfgrid: files that are no grid of distances are refused") {
    const auto error = [](std::string bytes) {
        try {
            mesh_of_grid("g.vol", read_distance_grid("g.vol", bytes), GridNormals::smooth);
        } catch (const Error& e) {
            return std::string(e.what());
        }
        return std::string("no error");
    };
    const std::string good = ball(4);
    CHECK(error(good) == "no error");
    CHECK(contains(error("VOX" + good.substr(3)), "no VOL"));
    CHECK(contains(error(good.substr(0, 40)), "no VOL"));
    CHECK(contains(error(good.substr(0, good.size() - 1)), "ends before"));
    std::string other = good;
    other[3] = 2;
    CHECK(contains(error(other), "version 2"));
    other = good;
    other[20] = 3;
    CHECK(contains(error(other), "3 channels"));
    other = good;
    const int32_t huge = 60000;
    for (int k = 0; k < 3; ++k) memcpy(other.data() + 8 + 4 * k, &huge, 4);
    CHECK(contains(error(other), "bytes"));
    other = good;
    for (size_t i = 48; i + 3 < other.size(); i += 4) memcpy(other.data() + i, "\0\0\x80\x3f", 4);
    CHECK(contains(error(other), "no surface"));
}

TEST_CASE("curves: areas of tubes and spheres; radii do not follow the transform") {
    const double r = 0.1;
    const std::vector<Curve> line = {{{{0, 0, 0}, r}, {{0, 0, 1}, r}}};
    CHECK(area(mesh_of_linear_curves(line)) == Approx(2 * M_PI * r + 8 * M_PI * r * r).epsilon(0.02));
    // A straight B-spline of four points reaches from the second to the third.
    const std::vector<Curve> straight = {{{{0, 0, 0}, r}, {{0, 0, 1}, r}, {{0, 0, 2}, r}, {{0, 0, 3}, r}}};
    CHECK(area(mesh_of_bspline_curves("c", straight)) == Approx(2 * M_PI * r).epsilon(0.01));
    const TempFolder folder;
    folder.write("c.txt", "0 0 0 0.1\n0 0 1 0.1\n\n1 0 0 0.1\n1 0 1 0.2\n1 1 1 0.1\n");
    const auto shape = [&](const std::string& to_world) {
        return load_quietly("<shape type='linearcurve'><string name='filename' value='c.txt'/>" + to_world + "</shape>",
                            "3.0.0", &folder);
    };
    const Scene plain = shape(""), large = shape("<transform name='to_world'><scale value='10'/></transform>");
    CHECK(has_note(plain, "are triangles"));
    float most[2] = {0, 0};
    for (const MeshVertex& v : plain.vertices) most[0] = max(most[0], v.p.z);
    for (const MeshVertex& v : large.vertices) most[1] = max(most[1], v.p.z);
    CHECK(most[0] == Approx(1.2).epsilon(3e-3));
    CHECK(most[1] == Approx(10.2).epsilon(1e-3));
}

TEST_CASE("curves: bad lines are refused with their number") {
    const TempFolder folder;
    const auto error = [&](const std::string& text, const std::string& type = "linearcurve") {
        folder.write("c.txt", text);
        return error_of("<shape type='" + type + "'><string name='filename' value='c.txt'/></shape>", {}, "3.0.0",
                        &folder);
    };
    CHECK(contains(error("0 0 0 1\n0 0 x 1\n"), "c.txt:2"));
    CHECK(contains(error("0 0 0 1\n0 0 1 -1\n"), "radius"));
    CHECK(contains(error("0 0 0 1\n"), "two points"));
    CHECK(contains(error("\n\n"), "no curves"));
    CHECK(contains(error("0 0 0 1\n0 0 1 1\n0 0 2 1\n", "bsplinecurve"), "four points"));
}
