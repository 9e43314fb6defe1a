// Small scenes and rays for the tests of acceleration structures.
#pragma once

#include <cmath>
#include <vector>

#include "core/rng.h"
#include "core/sampling.h"
#include "scene/scene.h"

namespace ambilux::accel_test {

/// Stream of uniform numbers for tests.
struct Random {
    RngKey key{1, 0, 0, Stream::test};
    uint32_t block = 0;
    explicit Random(uint64_t seed) { key.seed = seed; }
    Vec4f next() { return random_floats(key, block++); }
    float uniform() { return next().x; }
    Vec3f direction() {
        const Vec4f u = next();
        return square_to_sphere({u.x, u.y});
    }
    Vec3f in_box(float half) {
        const Vec4f u = next();
        return {(2 * u.x - 1) * half, (2 * u.y - 1) * half, (2 * u.z - 1) * half};
    }
    uint32_t index(uint32_t n) { return uint32_t(uniform() * float(n)) % n; }
};

inline uint32_t add_diffuse(Scene& scene) {
    scene.bsdfs.push_back({});
    scene.materials.push_back({uint32_t(scene.bsdfs.size() - 1), uint32_t(scene.bsdfs.size() - 1), 0, {1.0f, -1}});
    return uint32_t(scene.materials.size() - 1);
}

inline void set_uvs(Scene& scene, const std::vector<Vec2f>& uvs) {
    for (size_t i = 0; i < uvs.size(); ++i)
        scene.vertices.edit()[i].u = uvs[i].x, scene.vertices.edit()[i].v = uvs[i].y;
}

inline void set_normals(Scene& scene, const std::vector<Vec3f>& normals) {
    for (size_t i = 0; i < normals.size(); ++i) scene.vertices.edit()[i].n = normals[i];
}

/// A new shape of triangles; positions and triples of indices into them. Call before any quadric is added.
inline void add_mesh(Scene& scene, const std::vector<Vec3f>& positions, const std::vector<uint32_t>& indices) {
    if (scene.materials.empty()) add_diffuse(scene);
    const uint32_t base = uint32_t(scene.vertices.size()), shape = uint32_t(scene.shapes.size());
    scene.shapes.push_back({0, kNone, 0, uint32_t(scene.triangles.size()), uint32_t(indices.size() / 3), 0.0f});
    for (const Vec3f p : positions) {
        scene.vertices.push_back({p, 0, {0, 0, 1}, 0});
    }
    for (size_t i = 0; i + 2 < indices.size(); i += 3)
        scene.triangles.push_back({base + indices[i], base + indices[i + 1], base + indices[i + 2], shape});
    scene.features.primitives |= bit(PrimitiveType::triangle);
}

/// An analytic shape with axes s,t,n (unit, orthogonal), radius and, for cylinders, length.
inline void add_quadric(Scene& scene, PrimitiveType type, Vec3f center, Frame f, float radius, float length = 1.0f,
                        bool flip = false) {
    if (scene.materials.empty()) add_diffuse(scene);
    Quadric q = {};
    q.type = type;
    q.shape = uint32_t(scene.shapes.size());
    q.flip = flip;
    q.radius = radius;
    const Vec3f axes[3] = {f.s, f.t, f.n};
    double m[3][3];
    for (int c = 0; c < 3; ++c) {
        const double scale = type == PrimitiveType::cylinder && c == 2 ? length : radius;
        for (int r = 0; r < 3; ++r) m[r][c] = axes[c][r] * scale;
    }
    // Inverse by cofactors, in double precision, as a loader does it.
    double inverse[3][3], det = 0;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) {
            const int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3;
            inverse[r][c] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    for (int c = 0; c < 3; ++c) det += m[0][c] * inverse[c][0];
    for (int r = 0; r < 3; ++r) {
        double offset = 0;
        for (int c = 0; c < 3; ++c) {
            q.to_world.m[r][c] = float(m[r][c]);
            q.to_local.m[r][c] = float(inverse[r][c] / det);
            offset -= inverse[r][c] / det * center[c];
        }
        q.to_world.m[r][3] = center[r];
        q.to_local.m[r][3] = float(offset);
    }
    scene.shapes.push_back({0, kNone, 0, uint32_t(scene.triangles.size() + scene.quadrics.size()), 1, 0.0f});
    scene.quadrics.push_back(q);
    scene.features.primitives |= bit(type);
}

/// `count` random triangles with edges up to `size` in the cube [-1,1]³, all times `scale`; every fifth is
/// axis-aligned, every seventh a sliver.
inline Scene triangle_soup(uint32_t count, float size, float scale, uint64_t seed) {
    Random random(seed);
    std::vector<Vec3f> positions;
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i < count; ++i) {
        const Vec3f c = random.in_box(1.0f);
        Vec3f a = random.in_box(size), b = random.in_box(size);
        if (i % 5 == 0) a[int(i / 5 % 3)] = b[int(i / 5 % 3)] = 0.0f;
        if (i % 7 == 0) b = a * 0.5f + b * 1e-3f;
        for (const Vec3f p : {c, c + a, c + b}) {
            indices.push_back(uint32_t(positions.size()));
            positions.push_back(p * scale);
        }
    }
    Scene scene;
    add_mesh(scene, positions, indices);
    return scene;
}

/// Closed sphere mesh around `center` with shared vertices and poles of many triangles; radii vary by `roughness`.
inline void add_ball(Scene& scene, Vec3f center, float radius, uint32_t rings, float roughness, uint64_t seed) {
    Random random(seed);
    const uint32_t sectors = 2 * rings;
    std::vector<Vec3f> positions = {center + Vec3f{0, 0, radius}, center + Vec3f{0, 0, -radius}};
    std::vector<uint32_t> indices;
    for (uint32_t i = 1; i < rings; ++i)
        for (uint32_t j = 0; j < sectors; ++j) {
            const float theta = kPi * float(i) / float(rings), phi = 2 * kPi * float(j) / float(sectors);
            const float r = radius * (1.0f + roughness * (random.uniform() - 0.5f));
            positions.push_back(center + Vec3f{sinf(theta) * cosf(phi), sinf(theta) * sinf(phi), cosf(theta)} * r);
        }
    const auto at = [&](uint32_t i, uint32_t j) { return 2 + (i - 1) * sectors + j % sectors; };
    for (uint32_t j = 0; j < sectors; ++j) {
        indices.insert(indices.end(), {0, at(1, j), at(1, j + 1)});
        indices.insert(indices.end(), {1, at(rings - 1, j + 1), at(rings - 1, j)});
        for (uint32_t i = 1; i + 1 < rings; ++i) {
            indices.insert(indices.end(), {at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            indices.insert(indices.end(), {at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    }
    add_mesh(scene, positions, indices);
}

/// Axis-aligned box as a closed mesh of n x n x 2 triangles per side, corners at ±half.
inline void add_box(Scene& scene, float half, uint32_t n) {
    std::vector<Vec3f> positions;
    std::vector<uint32_t> indices;
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
            const uint32_t base = uint32_t(positions.size());
            for (uint32_t i = 0; i <= n; ++i)
                for (uint32_t j = 0; j <= n; ++j) {
                    Vec3f p;
                    p[axis] = side ? half : -half;
                    p[(axis + 1) % 3] = half * (2.0f * float(i) / float(n) - 1.0f);
                    p[(axis + 2) % 3] = half * (2.0f * float(j) / float(n) - 1.0f);
                    positions.push_back(p);
                }
            for (uint32_t i = 0; i < n; ++i)
                for (uint32_t j = 0; j < n; ++j) {
                    const uint32_t a = base + i * (n + 1) + j, b = a + n + 1;
                    indices.insert(indices.end(), {a, b, b + 1, a, b + 1, a + 1});
                }
        }
    add_mesh(scene, positions, indices);
}

/// Spheres, disks and cylinders at random places, sizes and orientations.
inline void add_random_quadrics(Scene& scene, uint32_t count, float scale, uint64_t seed) {
    Random random(seed);
    for (uint32_t i = 0; i < count; ++i) {
        const PrimitiveType type = PrimitiveType(1 + i % 3);
        const Frame frame = frame_from_normal(random.direction());
        add_quadric(scene, type, random.in_box(scale), frame, scale * (0.02f + 0.2f * random.uniform()),
                    scale * (0.1f + random.uniform()), i % 2);
    }
}

}  // namespace ambilux::accel_test
