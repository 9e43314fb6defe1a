// Small scenes put together by hand for tests of textures, emitters and sensors, and the statistics those tests share.
// Areas, alias tables and what tables are made from are filled in here, apart from formats/finalize.cpp, so that an
// error there and one in sampling cannot cancel. Cumulative tables are the project's (scene/pick_table.h): only whole
// tickets make sampling and density one thing.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/rng.h"
#include "scene/pick_table.h"
#include "scene/scene.h"
#include "transport/emitter.h"

namespace ambilux::test {

inline Affine affine_from_columns(Vec3f x, Vec3f y, Vec3f z, Vec3f origin) {
    Affine a;
    for (int i = 0; i < 3; ++i) {
        a.m[i][0] = x[i];
        a.m[i][1] = y[i];
        a.m[i][2] = z[i];
        a.m[i][3] = origin[i];
    }
    return a;
}

/// Inverse of a map whose columns are orthogonal.
inline Affine inverse_orthogonal(const Affine& a) {
    Affine r;
    for (int i = 0; i < 3; ++i) {
        const double l2 = double(a.m[0][i]) * a.m[0][i] + double(a.m[1][i]) * a.m[1][i] + double(a.m[2][i]) * a.m[2][i];
        double shift = 0;
        for (int j = 0; j < 3; ++j) {
            r.m[i][j] = float(a.m[j][i] / l2);
            shift -= a.m[j][i] / l2 * a.m[j][3];
        }
        r.m[i][3] = float(shift);
    }
    return r;
}

inline Affine rotation_to(Vec3f axis, Vec3f origin = {0, 0, 0}) {
    const Frame f = frame_from_normal(normalize(axis));
    return affine_from_columns(f.s, f.t, f.n, origin);
}

inline SceneView view_of(const Scene& s) {
    SceneView v{};
    v.vertices = s.vertices.data();
    v.triangles = s.triangles.data();
    v.quadrics = s.quadrics.data();
    v.shapes = s.shapes.data();
    v.materials = s.materials.data();
    v.textures = s.textures.data();
    v.texels = s.texels.data();
    v.emitters = s.emitters.data();
    v.emitter_cdf = s.emitter_cdf.data();
    v.tables = s.tables.data();
    v.environment_rows = s.environment_rows.data();
    v.environment_cells = s.environment_cells.data();
    v.vertex_count = uint32_t(s.vertices.size());
    v.triangle_count = uint32_t(s.triangles.size());
    v.quadric_count = uint32_t(s.quadrics.size());
    v.shape_count = uint32_t(s.shapes.size());
    v.texture_count = uint32_t(s.textures.size());
    v.emitter_count = uint32_t(s.emitters.size());
    v.environment = s.environment;
    v.bounds_center = s.bounds_center;
    v.bounds_radius = s.bounds_radius;
    v.sensor = s.sensor;
    return v;
}

inline Texture blank_texture(uint32_t width, uint32_t height, TexelFormat format) {
    Texture t{};
    t.type = TextureType::bitmap;
    t.format = format;
    t.wrap = WrapMode::repeat;
    t.filter = TextureFilter::bilinear;
    t.width = width;
    t.height = height;
    t.to_uv[0][0] = t.to_uv[1][1] = 1.0f;
    return t;
}

/// Adds a float texture; row 0 of `colors` is at t = 0.
inline int32_t add_texture(Scene& s, uint32_t width, uint32_t height, const std::vector<Rgb>& colors) {
    Texture t = blank_texture(width, height, TexelFormat::rgba32f);
    t.offset = s.texels.size();
    for (Rgb c : colors) {
        const float texel[4] = {c.x, c.y, c.z, 1.0f};
        const auto* bytes = reinterpret_cast<const uint8_t*>(texel);
        s.texels.insert(s.texels.end(), bytes, bytes + 16);
    }
    s.textures.push_back(t);
    return int32_t(s.textures.size()) - 1;
}

/// Adds a mesh. All meshes come before the first quadric: primitive ids of quadrics follow those of triangles.
inline uint32_t add_mesh(Scene& s, const std::vector<Vec3f>& vertices,
                         const std::vector<std::array<uint32_t, 3>>& triangles, const std::vector<Vec2f>& uvs = {}) {
    const uint32_t base = uint32_t(s.vertices.size()), shape = uint32_t(s.shapes.size());
    for (size_t i = 0; i < vertices.size(); ++i) {
        const Vec2f uv = uvs.empty() ? Vec2f{0, 0} : uvs[i];
        s.vertices.push_back({vertices[i], uv.x, {0, 0, 1}, uv.y});
    }
    s.shapes.push_back({0, kNone, uvs.empty() ? 0u : uint32_t(kShapeHasUvs), uint32_t(s.triangles.size()),
                        uint32_t(triangles.size()), 0.0f});
    for (auto t : triangles) s.triangles.push_back({base + t[0], base + t[1], base + t[2], shape});
    return shape;
}

/// Adds an analytic shape: radius, length (cylinder), axis and origin in world space.
inline uint32_t add_quadric(Scene& s, PrimitiveType type, float radius, float length, Vec3f axis, Vec3f origin,
                            bool flip = false) {
    Quadric q{};
    q.type = type;
    q.shape = uint32_t(s.shapes.size());
    q.flip = flip;
    q.radius = radius;
    const Frame f = frame_from_normal(normalize(axis));
    q.to_world = affine_from_columns(f.s * radius, f.t * radius, f.n * length, origin);
    q.to_local = inverse_orthogonal(q.to_world);
    const double r = radius;
    const double area = type == PrimitiveType::sphere
                            ? 4 * M_PI * r * r
                            : (type == PrimitiveType::disk ? M_PI * r * r : 2 * M_PI * r * length);
    s.shapes.push_back({0, kNone, 0, uint32_t(s.triangles.size() + s.quadrics.size()), 1, float(area)});
    s.quadrics.push_back(q);
    return q.shape;
}

inline uint32_t add_sphere(Scene& s, Vec3f center, float radius, bool flip = false) {
    return add_quadric(s, PrimitiveType::sphere, radius, radius, {0.3f, -0.5f, 0.8f}, center, flip);
}

inline Emitter& add_emitter(Scene& s, EmitterType type, Rgb radiance) {
    Emitter e{};
    e.type = type;
    e.shape = kNone;
    e.area_cdf = kNone;
    e.radiance.value = radiance;
    e.to_world = e.to_local = affine_from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0});
    s.emitters.push_back(e);
    if (type == EmitterType::constant || type == EmitterType::envmap) s.environment = uint32_t(s.emitters.size()) - 1;
    return s.emitters.back();
}

inline Emitter& add_area(Scene& s, uint32_t shape, Rgb radiance, int32_t texture = -1) {
    Emitter& e = add_emitter(s, EmitterType::area, radiance);
    e.shape = shape;
    e.radiance.texture = texture;
    s.shapes[shape].emitter = uint32_t(s.emitters.size()) - 1;
    return e;
}

inline Emitter& add_spot(Scene& s, Vec3f position, Vec3f axis, float cutoff_degrees, float beam_degrees,
                         Rgb intensity) {
    Emitter& e = add_emitter(s, EmitterType::spot, intensity);
    e.position = position;
    e.direction = normalize(axis);
    e.to_world = rotation_to(axis, position);
    e.to_local = inverse_orthogonal(e.to_world);
    set_spot_angles(e, double(cutoff_degrees) * (M_PI / 180), double(beam_degrees) * (M_PI / 180));
    return e;
}

inline Emitter& add_envmap(Scene& s, uint32_t width, uint32_t height, const std::vector<Rgb>& colors, Rgb scale,
                           const Affine& to_world) {
    const int32_t texture = add_texture(s, width, height, colors);
    Emitter& e = add_emitter(s, EmitterType::envmap, scale);
    e.radiance.texture = texture;
    e.to_world = to_world;
    e.to_local = inverse_orthogonal(to_world);
    return e;
}

/// Table by which one of entries with these weights is picked, appended to the tables.
inline uint32_t append_pick_table(Scene& s, const std::vector<double>& weights) {
    const uint32_t offset = uint32_t(s.tables.size());
    const std::vector<float> cdf = pick_table(weights);
    s.tables.insert(s.tables.end(), cdf.begin(), cdf.end());
    return offset;
}

/// Tickets of an alias table (scene/alias_table.h) by rounding down; what is left goes to the largest.
inline std::vector<uint32_t> tickets_of(const std::vector<double>& weights) {
    double total = 0;
    for (double w : weights) total += w;
    std::vector<uint32_t> tickets;
    uint32_t sum = 0;
    for (double w : weights) sum += tickets.emplace_back(w > 0 ? std::max(uint32_t(w / total * 16777216.0), 1u) : 0u);
    *std::max_element(tickets.begin(), tickets.end()) += 16777216u - sum;
    return tickets;
}

/// Alias table of n words {threshold, alias} in quadratic time: again and again the emptiest bucket is filled up from
/// the fullest.
inline std::vector<std::array<uint32_t, 2>> alias_table_of(std::vector<uint32_t> tickets) {
    const size_t n = tickets.size();
    const auto first = [&](size_t i) { return uint32_t(std::ceil(double(i) * 16777216.0 / double(n))); };
    std::vector<std::array<uint32_t, 2>> table(n);
    std::vector<int64_t> excess(n);
    std::vector<bool> done(n, false);
    for (size_t i = 0; i < n; ++i) excess[i] = int64_t(tickets[i]) - (first(i + 1) - first(i));
    for (size_t k = 0; k < n; ++k) {
        size_t lo = n, hi = n;
        for (size_t i = 0; i < n; ++i) {
            if (done[i]) continue;
            if (lo == n || excess[i] < excess[lo]) lo = i;
            if (hi == n || excess[i] > excess[hi]) hi = i;
        }
        table[lo] = {uint32_t(first(lo + 1) + excess[lo]), uint32_t(hi)};
        if (lo != hi) excess[hi] += excess[lo];
        done[lo] = true;
    }
    return table;
}

inline void append_environment(Scene& s, const std::vector<double>& rows,
                               const std::vector<std::vector<double>>& cells) {
    const auto row_tickets = tickets_of(rows);
    for (auto b : alias_table_of(row_tickets)) s.environment_rows.push_back({b[0], b[1]});
    for (size_t y = 0; y < rows.size(); ++y) {
        const size_t w = cells[y].size();
        const auto tickets = tickets_of(rows[y] > 0 ? cells[y] : std::vector<double>(w, 1.0));
        const auto table = alias_table_of(tickets);
        const auto pdf = [&](size_t x) {
            return float(row_tickets[y] / 16777216.0 * double(rows.size()) * (tickets[x] / 16777216.0) * double(w));
        };
        for (size_t x = 0; x < w; ++x)
            s.environment_cells.push_back({table[x][0], table[x][1], pdf(x), pdf(table[x][1])});
    }
}

inline float triangle_area(const SceneView& view, uint32_t prim) {
    const Triangle& t = view.triangles[prim];
    const Vec3f p0 = view.vertices[t.v0].p;
    return 0.5f * length(cross(view.vertices[t.v1].p - p0, view.vertices[t.v2].p - p0));
}

/// Fills areas, tables and pick probabilities (uniform, or in proportion to `pick_weights`).
inline void complete(Scene& s, std::vector<double> pick_weights = {}) {
    s.bounds_radius = 10.0f;
    if (s.materials.empty()) s.materials.push_back({0, 0, 0, {1.0f, -1}});  // opaque
    for (Shape& shape : s.shapes) {
        if (shape.first_primitive >= s.triangles.size()) continue;
        double area = 0;
        const SceneView v = view_of(s);
        for (uint32_t i = 0; i < shape.primitive_count; ++i) area += triangle_area(v, shape.first_primitive + i);
        shape.area = float(area);
    }
    for (size_t i = 0; i < s.emitters.size(); ++i) {
        Emitter& e = s.emitters[i];
        if (e.type == EmitterType::area && s.shapes[e.shape].primitive_count > 1) {
            const Shape& shape = s.shapes[e.shape];
            std::vector<double> areas;
            const SceneView v = view_of(s);
            for (uint32_t k = 0; k < shape.primitive_count; ++k)
                areas.push_back(triangle_area(v, shape.first_primitive + k));
            e.area_cdf = append_pick_table(s, areas);
            for (uint32_t k = 0; k < shape.primitive_count; ++k)
                s.tables.push_back(float((s.tables[e.area_cdf + k + 1] - s.tables[e.area_cdf + k]) / areas[k]));
        } else if (e.type == EmitterType::envmap) {
            const Texture t = s.textures[size_t(e.radiance.texture)];
            std::vector<double> rows(t.height, 0.0);
            std::vector<std::vector<double>> cells(t.height, std::vector<double>(t.width));
            const SceneView v = view_of(s);
            for (uint32_t y = 0; y < t.height; ++y)
                for (uint32_t x = 0; x < t.width; ++x) rows[y] += cells[y][x] = envmap_cell_weight(v, e, x, y);
            append_environment(s, rows, cells);
        }
    }
    if (pick_weights.empty()) pick_weights.assign(s.emitters.size(), 1.0);
    s.emitter_cdf = s.emitters.empty() ? std::vector<float>{0.0f} : pick_table(pick_weights);
    for (size_t i = 0; i < s.emitters.size(); ++i)
        s.emitters[i].pick_probability = s.emitter_cdf[i + 1] - s.emitter_cdf[i];
}

/// Rectangle in the plane through `origin` with edges `ex`, `ey` (normal: ex × ey) as 2 n² triangles of unequal size.
inline uint32_t add_rectangle(Scene& s, Vec3f origin, Vec3f ex, Vec3f ey, uint32_t n = 1) {
    std::vector<Vec3f> vertices;
    std::vector<Vec2f> uvs;
    std::vector<std::array<uint32_t, 3>> triangles;
    for (uint32_t j = 0; j <= n; ++j)
        for (uint32_t i = 0; i <= n; ++i) {
            // Cells grow by more than a factor of ten from one side to the other.
            const float a = n == 1 ? float(i) : std::pow(float(i) / float(n), 1.6f);
            const float b = n == 1 ? float(j) : std::pow(float(j) / float(n), 1.6f);
            vertices.push_back(origin + ex * a + ey * b);
            uvs.push_back({a, b});
        }
    for (uint32_t j = 0; j < n; ++j)
        for (uint32_t i = 0; i < n; ++i) {
            const uint32_t k = j * (n + 1) + i;
            triangles.push_back({k, k + 1, k + n + 2});
            triangles.push_back({k, k + n + 2, k + n + 1});
        }
    return add_mesh(s, vertices, triangles, uvs);
}

inline Vec4f random(uint32_t seed, uint32_t index, uint32_t block = 0) {
    return random_floats({seed, index, 0, Stream::test}, block);
}

/// Mean and standard error of samples, in double.
struct Statistics {
    double n = 0, sum = 0, sum2 = 0;
    void add(double x) {
        n += 1;
        sum += x;
        sum2 += x * x;
    }
    double mean() const { return sum / n; }
    double standard_error() const { return std::sqrt(std::max(sum2 / n - mean() * mean(), 0.0) / (n - 1)); }
};

/// Upper bound of a chi-square variable at `z` standard deviations of the normal (Wilson and Hilferty 1931).
inline double chi_square_bound(double degrees, double z) {
    const double a = 2.0 / (9.0 * degrees);
    return degrees * std::pow(1.0 - a + z * std::sqrt(a), 3);
}

}  // namespace ambilux::test
