#include "formats/mitsuba/origin.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ambilux::mitsuba {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
/// Half diagonals of a scene that its centre may be away from the origin: four bits.
constexpr double kFar = 16;

struct Box {
    Vec3d lo = {kInf, kInf, kInf}, hi = {-kInf, -kInf, -kInf};

    void add(Vec3d p, double reach) {
        lo = {std::min(lo.x, p.x - reach), std::min(lo.y, p.y - reach), std::min(lo.z, p.z - reach)};
        hi = {std::max(hi.x, p.x + reach), std::max(hi.y, p.y + reach), std::max(hi.z, p.z + reach)};
    }
    Vec3d center() const { return {(lo.x + hi.x) / 2, (lo.y + hi.y) / 2, (lo.z + hi.z) / 2}; }
    double radius() const { return length({(hi.x - lo.x) / 2, (hi.y - lo.y) / 2, (hi.z - lo.z) / 2}); }
};

Matrix transform_of(const Object& object) {
    const Value* v = object.find("to_world");
    return v && v->kind == ValueKind::transform ? v->transform : Matrix{};
}

/// The shape's own form: about a point, of size 1 unless it has a radius.
void add_shape(const Object& shape, const Matrix& outer, Box& box) {
    const Matrix to_world = outer * transform_of(shape);
    if (shape.type == "shapegroup") return;  // shown by its instances
    for (const Child& child : shape.children)
        if (shape.type == "instance" && child.object && child.object->type == "shapegroup")
            for (const Child& inner : child.object->children)
                if (inner.object && inner.object->tag == "shape") add_shape(*inner.object, to_world, box);
    if (shape.type == "instance") return;
    double radius = 1;
    if (const Value* v = shape.find("radius")) radius = std::fabs(v->number);
    double reach = 0;
    for (int k = 0; k < 3; ++k) reach += length(column(to_world, k)) * radius;
    bool placed = false;
    for (const char* name : {"center", "p0", "p1"})
        if (const Value* v = shape.find(name); v && v->kind == ValueKind::vector) {
            box.add(column(to_world * translation(v->vector.x, v->vector.y, v->vector.z), 3), reach);
            placed = true;
        }
    if (!placed) box.add(column(to_world, 3), reach);
}

}  // namespace

Vec3d scene_origin(const Document& document) {
    Box box;
    for (const Child& child : document.scene->children) {
        if (!child.object) continue;
        if (child.object->tag == "sensor") box.add(column(transform_of(*child.object), 3), 0);
        if (child.object->tag == "shape") add_shape(*child.object, {}, box);
    }
    const Vec3d c = box.center();
    const double radius = box.radius(), away = std::max({std::fabs(c.x), std::fabs(c.y), std::fabs(c.z)});
    // Written so that what is not finite stays where it is, to be refused by name.
    return radius > 0 && std::isfinite(away + radius) && away > kFar * radius ? c : Vec3d{};
}

}  // namespace ambilux::mitsuba
