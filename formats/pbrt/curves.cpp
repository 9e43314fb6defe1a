// Shape "curve": tubes of triangles, those that follow each other in one mesh.
#include <algorithm>

#include "formats/meshes/curves.h"
#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

/// Control points of a uniform B-spline that is one cubic Bezier segment.
std::array<Vec3d, 4> spline_of(const std::array<Vec3d, 4>& b) {
    return {b[0] * 6 - b[1] * 7 + b[2] * 2, b[1] * 2 - b[2], b[2] * 2 - b[1], b[1] * 2 - b[2] * 7 + b[3] * 6};
}

/// The curve of cubic B-splines of these points, whose radius goes from `first` to `last` along it. The radius at a
/// control point is that at its Greville abscissa, which makes it linear.
Curve curve_of(const Vec3d* points, size_t count, double first, double last) {
    Curve curve;
    for (size_t i = 0; i < count; ++i) {
        const double u = (double(i) - 1) / double(count - 3);
        curve.push_back({points[i], first + (last - first) * u});
    }
    return curve;
}

}  // namespace

std::vector<Curve> read_curve(SceneMaker& scene, const Parameters& in) {
    const std::string type = in.text("type", "flat"), basis = in.text("basis", "bezier");
    if (type != "flat" && type != "cylinder" && type != "ribbon")
        fail(in.where_of("type"), "curve type '" + type + "' is not known: flat, cylinder, ribbon");
    if (basis != "bezier" && basis != "bspline")
        fail(in.where_of("basis"), "basis '" + basis + "' is not known: bezier, bspline");
    if (type == "flat")
        scene.report.note(
            in.where, "flat curves, which face every ray, are tubes of the same visible width with normals all around");
    in.ignore({"N", "splitdepth"});  // N is for ribbons
    const int64_t degree = in.integer("degree", 3);
    if (degree != 2 && degree != 3) fail(in.where_of("degree"), "the degree of a curve is 2 or 3");
    if (degree == 2 && basis == "bspline") {
        scene.report.refuse(in.where_of("degree"), "B-splines of degree 2 are not supported", "the curve is left out");
        in.ignore({"P", "width", "width0", "width1"});
        return {};
    }
    const double width = in.number("width", 1), first = in.number("width0", width), last = in.number("width1", width);
    if (!(first >= 0 && last >= 0 && std::max(first, last) > 0))
        fail(in.where, "the width of a curve must be positive");
    const std::vector<double>& numbers = in.numbers("P", 3);
    std::vector<Vec3d> p;
    for (size_t i = 0; i < numbers.size(); i += 3) p.push_back({numbers[i], numbers[i + 1], numbers[i + 2]});
    const size_t step = size_t(degree);
    if (p.size() <= step || (basis == "bezier" && (p.size() - 1) % step != 0))
        fail(in.where_of("P"),
             std::to_string(p.size()) + " control points do not make a curve of degree " + std::to_string(degree));
    if (basis == "bspline") return {curve_of(p.data(), p.size(), first / 2, last / 2)};
    std::vector<Curve> curves;
    const size_t segments = (p.size() - 1) / step;
    for (size_t k = 0; k < segments; ++k) {
        const Vec3d* q = p.data() + k * step;
        std::array<Vec3d, 4> cubic = {q[0], q[1], q[2], q[step]};
        if (degree == 2) cubic[1] = (q[0] + q[1] * 2) * (1. / 3), cubic[2] = (q[1] * 2 + q[2]) * (1. / 3);
        const auto radius = [&](size_t j) { return (first + (last - first) * double(j) / double(segments)) / 2; };
        curves.push_back(curve_of(spline_of(cubic).data(), 4, radius(k), radius(k + 1)));
    }
    return curves;
}

Object* add_curves(SceneMaker& scene, const Parameters& in, const std::vector<Curve>& curves, const Object* bsdf,
                   bool alone) {
    if (!alone && !scene.curves.empty()) {
        CurveMesh& last = scene.curves.back();
        if (last.bsdf == bsdf && last.group == scene.open_object && last.reversed == scene.state.reverse_orientation &&
            last.to_world == scene.state.ctm) {
            last.curves.insert(last.curves.end(), curves.begin(), curves.end());
            return nullptr;
        }
    }
    const std::string name = in.where.text() + "#curves" + std::to_string(scene.curves.size());
    scene.curves.push_back({name, in.where, curves, alone ? nullptr : bsdf, scene.open_object,
                            scene.state.reverse_orientation, scene.state.ctm});
    Object& shape = add_object(scene.document, "shape", "mesh", in.where);
    set_text(shape, "name", name);
    return &shape;
}

void finish_curves(SceneMaker& scene) {
    for (CurveMesh& c : scene.curves) {
        Mesh mesh = mesh_of_bspline_curves(c.where.file, c.curves);
        for (Vec2f& uv : mesh.uvs) std::swap(uv.x, uv.y);  // pbrt's u goes along
        scene.report.note(c.where,
                          "curves are tubes of triangles: " + std::to_string(mesh.faces.size()) + " of them here");
        scene.document.meshes[c.name] = std::move(mesh);
        c.curves = {};
    }
}

}  // namespace ambilux::pbrt
