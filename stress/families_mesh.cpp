#include <algorithm>
#include <cmath>

#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

struct Mesh {
    std::vector<Point> vertices;
    std::vector<unsigned> faces;
};

/// A square of half side `half` at height z as a fan of n triangles around one corner; `down`: faces -z.
Mesh fan(double half, double z, unsigned n, bool down) {
    Mesh mesh;
    mesh.vertices.push_back({-half, -half, z});
    for (unsigned i = 0; i <= n; ++i) {
        // Along the right side, then along the upper one.
        const double t = 2.0 * i / n;
        mesh.vertices.push_back({t < 1 ? half : half * (1 - 2 * (t - 1)), t < 1 ? half * (2 * t - 1) : half, z});
    }
    for (unsigned i = 2; i < n + 2; ++i)
        for (const unsigned v : {1u, down ? i + 1 : i, down ? i : i + 1}) mesh.faces.push_back(v);
    return mesh;
}

/// Rows of quads between the lines x = xs[i], from y0 to y1 in `rows` equal parts, z = 0, facing +z.
void add_strips(Mesh& mesh, const std::vector<double>& xs, double y0, double y1, unsigned rows) {
    const unsigned first = unsigned(mesh.vertices.size()) + 1;
    for (const double x : xs)
        for (unsigned j = 0; j <= rows; ++j) mesh.vertices.push_back({x, y0 + (y1 - y0) * j / rows, 0});
    for (unsigned i = 0; i + 1 < xs.size(); ++i)
        for (unsigned j = 0; j < rows; ++j) {
            const unsigned a = first + i * (rows + 1) + j, b = a + rows + 1;
            for (const unsigned v : {a, b, b + 1, a, b + 1, a + 1}) mesh.faces.push_back(v);
        }
}

std::vector<double> equal_parts(double from, double to, unsigned n) {
    std::vector<double> xs;
    for (unsigned i = 0; i <= n; ++i) xs.push_back(from + (to - from) * i / n);
    return xs;
}

Asset asset(const std::string& name, const Mesh& mesh) { return {name, obj_text(mesh.vertices, mesh.faces)}; }

/// The plate with a floor of triangles.
SceneFiles meshed_plate(const Plate& plate, const std::string& file, const Mesh& floor) {
    return {plate_scene(plate, obj_shape(plate.frame, file, "", diffuse(plate.reflectance))), {asset(file, floor)}};
}

Family needles() {
    Family family{"needles", "triangles in a fan; about half of it their aspect", {}};
    for (const unsigned n : {2u, 20u, 200u, 2000u, 20000u, 200000u}) {
        Plate plate;
        // A ray meets the boxes of thousands.
        if (n > 2000) plate.film = {8, 8};
        Cell cell{family.name, decade(n), double(n), plate_answer(plate), [plate, n] {
                      const std::string floor = "needles_floor_" + decade(n) + ".obj",
                                        lamp = "needles_lamp_" + decade(n) + ".obj";
                      return SceneFiles{
                          plate_scene(plate, obj_shape({}, floor, "", diffuse(plate.reflectance)),
                                      obj_shape({}, lamp, "", diffuse(0) + area_emitter(plate.radiance))),
                          {asset(floor, fan(2, 0, n, false)), asset(lamp, fan(plate.lamp_half, 1, n, true))}};
                  }};
        cell.benign = n == 2;
        cell.quick = n == 2 || n == 2000;
        cell.effort = std::min(1.0, 2000.0 / n);
        family.cells.push_back(cell);
    }
    return family;
}

Family slivers() {
    Family family{"slivers", "width of every second strip of a floor of half side 2", {}};
    for (const int k : {-1, -2, -3, -4, -5, -6, -7, -8, -9}) {
        const double width = std::pow(10.0, k);
        const Plate plate;
        Cell cell{family.name, decade(width), width, plate_answer(plate), [plate, width] {
                      std::vector<double> xs;
                      for (int i = -8; i < 8; ++i) {
                          xs.push_back(0.25 * i);
                          xs.push_back(0.25 * i + width);
                      }
                      xs.push_back(2);
                      Mesh mesh;
                      add_strips(mesh, xs, -2, 2, 1);
                      return meshed_plate(plate, "slivers_" + decade(width) + ".obj", mesh);
                  }};
        cell.benign = k == -1;
        cell.quick = k == -1 || k == -7;
        family.cells.push_back(cell);
    }
    return family;
}

Family tessellation() {
    Family family{"tessellation", "triangles that a floor is split into", {}};
    for (const unsigned n : {1u, 8u, 64u, 512u}) {
        const Plate plate;
        Cell cell{family.name, decade(2.0 * n * n), 2.0 * n * n, plate_answer(plate), [plate, n] {
                      Mesh mesh;
                      add_strips(mesh, equal_parts(-2, 2, n), -2, 2, n);
                      return meshed_plate(plate, "tessellation_" + decade(2.0 * n * n) + ".obj", mesh);
                  }};
        cell.benign = n == 1;
        cell.quick = n == 1 || n == 64;
        family.cells.push_back(cell);
    }
    return family;
}

Family overlap() {
    Family family{"coplanar-overlap", "floors that lie in each other", {}};
    for (const int n : {1, 2, 3, 16}) {
        Plate plate;
        plate.frame.rigid = rotate(1, 2, 3, 37);
        Cell cell{family.name, decade(n), double(n), plate_answer(plate), [plate, n] {
                      std::string floors;
                      for (int i = 0; i < n; ++i) floors += plate_floor(plate);
                      return SceneFiles{plate_scene(plate, floors)};
                  }};
        cell.benign = n == 1;
        cell.quick = n == 1 || n == 3;
        family.cells.push_back(cell);
    }
    return family;
}

/// Light from below comes through wherever two triangles do not meet.
Family t_junctions() {
    Family family{"t-junctions", "edges that end at the middle line of a floor over a lamp 1e4 times brighter", {}};
    for (const unsigned n : {1u, 7u, 63u, 501u}) {
        Plate plate;
        plate.frame.rigid = rotate(1, 2, 3, 37) + translate(0.3, -7, 11);
        Cell cell{family.name, decade(2 * n + 1), 2.0 * n + 1, plate_answer(plate), [plate, n] {
                      Mesh mesh;
                      add_strips(mesh, {-2, 0}, -2, 2, n);
                      add_strips(mesh, {0, 2}, -2, 2, n + 1);
                      const std::string file = "t-junctions_" + decade(2 * n + 1) + ".obj";
                      return SceneFiles{
                          plate_scene(
                              plate, obj_shape(plate.frame, file, "", diffuse(plate.reflectance)) +
                                         rectangle(plate.frame, 1.5, 1.5, -0.1, false, diffuse(0) + area_emitter(1e4))),
                          {asset(file, mesh)}};
                  }};
        cell.benign = n == 1;
        cell.quick = n == 1 || n == 63;
        // Nearly all samples of emitters go to the lamp below.
        cell.rare = "path-nee path-ris light";
        family.cells.push_back(cell);
    }
    return family;
}

Family mirrors() {
    Family family{"mirrored", "number of a transform that maps the scene onto itself", {}};
    const std::string transforms[] = {"", scale_xyz(-1, 1, 1), scale_xyz(1, -1, 1), scale_xyz(-1, -1, 1),
                                      scale_xyz(-1, -1, -1) + rotate(1, 0, 0, 180)};
    for (int i = 0; i < 5; ++i) {
        Plate plate;
        plate.frame.mirror = transforms[i];
        Cell cell{family.name, decade(i), double(i), plate_answer(plate), [plate] {
                      const std::vector<Point> up(4, Point{0, 0, 1});
                      const std::string floor =
                          obj_text({{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}}, {1, 2, 3, 1, 3, 4}, up);
                      // The floor's normals come from its file, the lamp's from the shape.
                      Frame about = plate.frame;
                      return SceneFiles{
                          plate_scene(plate, obj_shape(about, "mirrored_floor.obj", "", diffuse(plate.reflectance)),
                                      rectangle(plate.frame, plate.lamp_half, plate.lamp_half, 1, true,
                                                diffuse(0) + area_emitter(1))),
                          {{"mirrored_floor.obj", floor}}};
                  }};
        // The last one turns the height of the lamp over twice.
        cell.benign = i == 0;
        cell.quick = i == 0 || i == 1 || i == 4;
        family.cells.push_back(cell);
    }
    return family;
}

/// Light below the plane of the floor, which its normals look at, is behind a black plate.
Family shading_normals() {
    Family family{"shading-normals", "degrees between shading and geometric normals", {}};
    for (const int degrees : {0, 30, 60, 80, 85, 89}) {
        const double a = degrees * M_PI / 180, reflectance = 0.5;
        const Answer answer{AnswerKind::closed_form, reflectance * (1 + std::cos(a)) / 2, true,
                            "rho (1 + cos a)/2: the part of the projected disk above the plane"};
        Cell cell{
            family.name, decade(degrees), double(degrees), answer, [degrees, a, reflectance] {
                const std::vector<Point> tilted(4, Point{std::sin(a), 0, std::cos(a)});
                const std::string file = "shading-normals_" + decade(degrees) + ".obj";
                const std::string camera = orthographic({}, {0, 0, 0.5}, {0, 0, 0}, {0, 1, 0}, 0.5, 1e-3);
                return SceneFiles{
                    scene_xml(2, camera + obj_shape({}, file, "", diffuse(reflectance)) +
                                     rectangle({}, 50, 50, -0.01, false, diffuse(0)) +
                                     "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1\"/></emitter>"),
                    {{file, obj_text({{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}}, {1, 2, 3, 1, 3, 4}, tilted)}}};
            }};
        cell.benign = degrees == 0;
        cell.quick = degrees == 0 || degrees == 60 || degrees == 89;
        // Of parallel rays over the black plate one in 600 meets what the camera sees.
        cell.rare = "light";
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> mesh_families() {
    return {needles(), slivers(), tessellation(), overlap(), t_junctions(), mirrors(), shading_normals()};
}

}  // namespace ambilux::stress
