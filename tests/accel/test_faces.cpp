// libs: ambilux_formats ambilux_accel
// labels: accel
// What a host keeps of triangles changes no bit of what shading sees.
#include <cstring>

#include "accel/faces.h"
#include "scene/surface.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"
#include "transport/scattering.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

constexpr Features kTextured = {bit(BsdfType::diffuse), 0, bit(PrimitiveType::triangle), true, false, false};

template <class T>
bool equal(const T& a, const T& b) {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
}

/// Meshes with and without vertex normals and texture coordinates, some of them degenerate.
Scene meshes() {
    Random random(5);
    Scene scene;
    for (uint32_t i = 0; i < 200; ++i) {
        const Vec3f c = random.in_box(1.0f);
        const Vec3f far = c + random.in_box(i % 7 ? 1.0f : 1e-20f);
        add_mesh(scene, {c, c + random.in_box(1.0f), i % 11 ? far : c}, {0, 1, 2});
        scene.shapes.back().flags = i % 4;
        for (uint32_t k = 0; k < 3; ++k) {
            MeshVertex& v = scene.vertices.edit()[scene.vertices.size() - 1 - k];
            v.n = i % 13 ? random.direction() : Vec3f{0, 0, 0};
            v.u = i % 5 ? random.uniform() : 0.0f;
            v.v = random.uniform();
        }
    }
    return scene;
}

}  // namespace

TEST_CASE("Points and frames of triangles by their faces are those by their vertices, to the bit") {
    const Scene scene = meshes();
    const Faces faces(scene);
    REQUIRE(faces.memory_bytes() == 64 * scene.triangles.size());
    const SceneView without = scene.view();
    SceneView with = without;
    with.faces = faces.data();
    Random random(6);
    uint32_t framed = 0, different = 0;
    for (uint32_t i = 0; i < 20000; ++i) {
        const uint32_t prim = random.index(uint32_t(scene.triangles.size()));
        const float b1 = random.uniform(), b2 = random.uniform() * (1.0f - b1);
        const SurfacePoint a = surface_at<kTextured>(without, prim, b1, b2),
                           b = surface_at<kTextured>(with, prim, b1, b2);
        const Vec3f wi = random.direction();
        const Scattering s = make_scattering<kTextured>(without, a, wi), t = make_scattering<kTextured>(with, b, wi);
        framed += b.framed;
        different += !(equal(a.p, b.p) && equal(a.p_error, b.p_error) && equal(a.ng, b.ng) && equal(a.ns, b.ns) &&
                       equal(a.uv, b.uv) && a.prim == b.prim && a.shape == b.shape && equal(s.frame, t.frame) &&
                       equal(s.ng, t.ng) && equal(s.wi, t.wi));
    }
    CHECK(different == 0);
    CHECK((framed > 5000 && framed < 15000));
}

TEST_CASE("Scenes with bumps have no faces: they ask for both derivatives") {
    Scene scene = meshes();
    scene.features.bumps = true;
    const Faces faces(scene);
    CHECK(faces.data() == nullptr);
    CHECK(faces.memory_bytes() == 0);
}
