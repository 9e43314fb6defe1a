#include <fmt/format.h>

#include <algorithm>

#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

/// A room of diffuse, rough, glossy and smooth surfaces, without a closed form: what must not change it is the answer.
struct Room {
    double radiance = 1;
    Frame frame = {};
    bool reversed = false;    ///< the order of shapes
    unsigned wall_parts = 1;  ///< along each side of the wall
};

std::string wall_mesh(unsigned parts) {
    std::vector<Point> vertices;
    std::vector<unsigned> faces;
    for (unsigned i = 0; i <= parts; ++i)
        for (unsigned j = 0; j <= parts; ++j) vertices.push_back({2.0 * i / parts - 1, -1, 2.0 * j / parts - 1});
    for (unsigned i = 0; i < parts; ++i)
        for (unsigned j = 0; j < parts; ++j) {
            const unsigned a = i * (parts + 1) + j + 1, b = a + parts + 1;
            for (const unsigned v : {a, a + 1, b, b, a + 1, b + 1}) faces.push_back(v);
        }
    return obj_text(vertices, faces);
}

SceneFiles room_files(const Room& room) {
    const Frame& f = room.frame;
    const std::string bronze =
        "<bsdf type=\"roughconductor\"><string name=\"material\" value=\"none\"/><rgb "
        "name=\"specular_reflectance\" value=\"0.8\"/><string name=\"distribution\" value=\"ggx\"/><float "
        "name=\"alpha\" value=\"0.2\"/></bsdf>";
    const std::string glass =
        "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>";
    const std::string lacquer =
        "<bsdf type=\"roughplastic\"><string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" "
        "value=\"0.15\"/><rgb name=\"diffuse_reflectance\" value=\"0.4\"/></bsdf>";
    const std::string inward = "<boolean name=\"flip_normals\" value=\"true\"/>",
                      file = fmt::format("room_wall_{}.obj", room.wall_parts);
    std::vector<std::string> shapes = {
        // The wall at y = -1 lies before that of the cube.
        shape("cube", f, scale_xyz(1, 1.125, 1), inward + diffuse(0.6)),
        obj_shape(f, file, "", "<bsdf type=\"twosided\">" + diffuse(0.3) + "</bsdf>"),
        rectangle(f, 0.4, 0.4, 0.9375, true, diffuse(0) + area_emitter(room.radiance)),
        shape("sphere", f, "", center({-0.4, -0.3, -0.65}) + radius(0.35) + glass),
        shape("sphere", f, "", center({0.45, 0.2, -0.7}) + radius(0.3) + bronze),
        shape("cube", f, scale_xyz(0.3, 0.2, 0.4) + rotate(0, 0, 1, 30) + translate(-0.5, 0.5, -0.6), lacquer)};
    if (room.reversed) std::reverse(shapes.begin(), shapes.end());
    std::string text = perspective(f, {0.8, -0.8, 0.1}, {-0.3, 0.3, -0.4}, {0, 0, 1}, 70, 1e-2);
    for (const std::string& s : shapes) text += s;
    return {scene_xml(8, text), {{file, wall_mesh(room.wall_parts)}}};
}

/// `factor`: of the image over that of the benign room.
Cell room_cell(const std::string& family, double value, double factor, const Room& room) {
    return {family,
            family == "room-far" ? whole(value) : decade(value),
            value,
            {AnswerKind::invariance, factor, false, "the benign room times the factor"},
            [room] { return room_files(room); }};
}

/// Rooms that `change` makes of each value; the first is benign.
template <class Change>
Family rooms(const std::string& name, const std::string& parameter, std::initializer_list<double> values,
             Change change) {
    Family family{name, parameter, {}};
    for (const double value : values) {
        Room room;
        const double factor = change(room, value);
        Cell cell = room_cell(name, value, factor, room);
        cell.benign = family.cells.empty();
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> room_families() {
    return {
        rooms("room-emission", "radiance of the lamp of a room of several materials",
              {1, 1e-15, 1e-10, 1e-5, 1e5, 1e10, 1e15}, [](Room& room, double v) { return room.radiance = v; }),
        rooms("room-scale", "half side of the same room", {1, 1e-10, 1e-6, 1e-3, 1e3, 1e6, 1e10},
              [](Room& room, double v) {
                  room.frame.scale = v;
                  return 1.0;
              }),
        rooms("room-far", "distance of the same room from the origin", {0, 1 << 6, 1 << 12, 1 << 18, 1 << 21},
              [](Room& room, double v) {
                  room.frame.rigid = translate(v, -v / 2, v / 4);
                  return 1.0;
              }),
        rooms("room-turned", "degrees that the same room is turned by", {0, 45, 90, 179.99},
              [](Room& room, double v) {
                  room.frame.rigid = rotate(1, 2, 3, v);
                  return 1.0;
              }),
        rooms("room-order", "whether the shapes of the same room stand in reverse", {0, 1},
              [](Room& room, double v) {
                  room.reversed = v != 0;
                  return 1.0;
              }),
        rooms("room-split", "parts of a side of a wall of the same room", {1, 8, 64, 512}, [](Room& room, double v) {
            room.wall_parts = unsigned(v);
            return 1.0;
        })};
}

}  // namespace ambilux::stress
