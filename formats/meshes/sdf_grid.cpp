#include "formats/meshes/sdf_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <unordered_map>

#include "core/error.h"
#include "formats/file_budget.h"

namespace ambilux {

namespace {

/// Cells with surface up to which they are halved.
constexpr uint64_t kFewCells = 200000;

struct Surface {
    const DistanceGrid& grid;
    GridNormals normals;
    uint32_t parts;  ///< of a cell along each axis
    Mesh mesh;
    std::unordered_map<uint64_t, uint32_t>
        edges;  ///< vertices by the ends of edges, and by cell where they are its own

    /// The interpolant of cell `c` at `p` in units of cells.
    double value(const uint32_t c[3], const double p[3]) const {
        double sum = 0;
        for (uint32_t k = 0; k < 8; ++k) {
            double weight = 1;
            for (int a = 0; a < 3; ++a) weight *= k >> a & 1 ? p[a] - c[a] : 1 - (p[a] - c[a]);
            sum += weight * corner(c, k);
        }
        return sum;
    }
    double corner(const uint32_t c[3], uint32_t k) const {
        return grid.at(c[0] + (k & 1), c[1] + (k >> 1 & 1), c[2] + (k >> 2));
    }

    /// Gradient by coordinates in [0,1]³.
    void gradient(const uint32_t c[3], const double p[3], double out[3]) const {
        for (int a = 0; a < 3; ++a) {
            double low[3] = {p[0], p[1], p[2]}, high[3] = {p[0], p[1], p[2]};
            low[a] = c[a], high[a] = c[a] + 1;
            out[a] = (value(c, high) - value(c, low)) * (grid.size[a] - 1);
        }
    }

    /// Gradients of the eight cells around the corner next to `p`, each continued to p, their directions blended
    /// between the middles of these cells.
    void smooth_gradient(const uint32_t c[3], const double p[3], double out[3]) const {
        double difference[3][2], share[3];
        bool exists[3];
        for (int a = 0; a < 3; ++a) {
            const auto lower = int64_t(std::lround(p[a])) - 1;
            exists[a] = lower >= 0;
            share[a] = exists[a] ? p[a] - double(lower) - 0.5 : 1;
            const auto plane = [&](int64_t q) {
                double sum = 0;
                const int b = (a + 1) % 3, d = (a + 2) % 3;
                for (uint32_t k = 0; k < 4; ++k) {
                    uint32_t i[3];
                    i[a] = uint32_t(std::clamp<int64_t>(q, 0, grid.size[a] - 1));
                    i[b] = c[b] + (k & 1), i[d] = c[d] + (k >> 1);
                    const double wb = p[b] - c[b], wd = p[d] - c[d];
                    sum += (k & 1 ? wb : 1 - wb) * (k >> 1 ? wd : 1 - wd) * grid.at(i[0], i[1], i[2]);
                }
                return sum;
            };
            for (int64_t k = 0; k < 2; ++k)
                difference[a][k] = (plane(lower + k + 1) - plane(lower + k)) * (grid.size[a] - 1);
        }
        out[0] = out[1] = out[2] = 0;
        for (int k = 0; k < 8; ++k) {
            double weight = 1, g[3], l2 = 0;
            for (int a = 0; a < 3; ++a) {
                const int bit = k >> a & 1;
                weight *= bit ? share[a] : (exists[a] ? 1 - share[a] : 0);
                g[a] = difference[a][bit];
                l2 += g[a] * g[a];
            }
            if (!(l2 > 0)) continue;
            for (int a = 0; a < 3; ++a) out[a] += weight * g[a] / std::sqrt(l2);
        }
    }

    /// The vertex between two points of the finer grid, of different sign.
    uint32_t vertex(const uint32_t c[3], uint64_t cell, const uint32_t a[3], const uint32_t b[3]) {
        const auto id = [&](const uint32_t q[3]) {
            return (uint64_t(q[2]) * (uint64_t(grid.size[1]) * parts) + q[1]) * (uint64_t(grid.size[0]) * parts) + q[0];
        };
        // Edges have seven directions; they go upwards along all axes.
        const uint64_t way = uint64_t(b[0] - a[0]) | uint64_t(b[1] - a[1]) << 1 | uint64_t(b[2] - a[2]) << 2;
        uint64_t key = id(a) << 3 | way;
        if (normals == GridNormals::analytic) key = (key + 1) * 0x9e3779b97f4a7c15ull ^ cell;
        const auto [it, added] = edges.try_emplace(key, uint32_t(mesh.positions.size()));
        if (!added) return it->second;
        double from[3], to[3], p[3], low = 0, high = 1;
        for (int k = 0; k < 3; ++k) from[k] = double(a[k]) / parts, to[k] = double(b[k]) / parts;
        const auto at = [&](double t) {
            for (int k = 0; k < 3; ++k) p[k] = from[k] + (to[k] - from[k]) * t;
            return value(c, p);
        };
        const bool first = at(0) < 0;
        for (int k = 0; k < 40; ++k) {
            const double middle = 0.5 * (low + high);
            ((at(middle) < 0) == first ? low : high) = middle;
        }
        at(0.5 * (low + high));
        double n[3];
        normals == GridNormals::analytic ? gradient(c, p, n) : smooth_gradient(c, p, n);
        const auto scaled = [&](int k) { return float(p[k] / (grid.size[k] - 1)); };
        mesh.positions.push_back({scaled(0), scaled(1), scaled(2)});
        mesh.normals.push_back({float(n[0]), float(n[1]), float(n[2])});
        return it->second;
    }

    void triangle(uint32_t a, uint32_t b, uint32_t c) {
        if (a == b || b == c || c == a) return;
        const Vec3f n = cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]);
        if (dot(n, mesh.normals[a] + mesh.normals[b] + mesh.normals[c]) < 0) std::swap(b, c);
        mesh.faces.push_back({a, b, c});
    }

    /// Six tetrahedra around the diagonal of the finer cell whose lowest corner is `q`: one for every order of the
    /// axes.
    void cut(const uint32_t c[3], uint64_t cell, const uint32_t q[3]) {
        static constexpr int kOrders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
        for (const auto& order : kOrders) {
            uint32_t corners[4][3];
            bool inside[4];
            int count = 0;
            for (int i = 0; i < 4; ++i) {
                double p[3];
                for (int a = 0; a < 3; ++a) corners[i][a] = i == 0 ? q[a] : corners[i - 1][a];
                if (i > 0) ++corners[i][order[i - 1]];
                for (int a = 0; a < 3; ++a) p[a] = double(corners[i][a]) / parts;
                inside[i] = value(c, p) < 0;
                count += inside[i];
            }
            if (count == 0 || count == 4) continue;
            std::vector<uint32_t> found;
            for (int i = 0; i < 4; ++i)
                for (int j = i + 1; j < 4; ++j)
                    if (inside[i] != inside[j]) found.push_back(vertex(c, cell, corners[i], corners[j]));
            triangle(found[0], found[1], found[2]);
            // Two inside: edges came as (i,k), (i,l), (j,k), (j,l), so that the diagonal is from the second to the
            // third.
            if (found.size() == 4) triangle(found[1], found[2], found[3]);
        }
    }

    bool has_surface(const uint32_t c[3]) const {
        int inside = 0;
        for (uint32_t k = 0; k < 8; ++k) inside += corner(c, k) < 0;
        return inside > 0 && inside < 8;
    }
    template <class Op>
    void for_each_cell(Op op) const {
        uint64_t index = 0;
        for (uint32_t z = 0; z + 1 < grid.size[2]; ++z)
            for (uint32_t y = 0; y + 1 < grid.size[1]; ++y)
                for (uint32_t x = 0; x + 1 < grid.size[0]; ++x, ++index)
                    if (const uint32_t c[3] = {x, y, z}; has_surface(c)) op(c, index);
    }
};

}  // namespace

DistanceGrid read_distance_grid(const std::string& path, std::string_view bytes, const Limits& limits) {
    constexpr size_t kHeader = 48;
    FileBudget budget(path, limits);
    if (bytes.size() < kHeader || bytes.substr(0, 3) != "VOL") budget.fail("is not a volume grid: no VOL at its start");
    if (bytes[3] != 3) budget.fail("volume grids of version " + std::to_string(int(bytes[3])) + " are not supported");
    int32_t numbers[5];
    memcpy(numbers, bytes.data() + 4, sizeof numbers);
    if (numbers[0] != 1) budget.fail("volume grids of values other than 32-bit floats are not supported");
    if (numbers[4] != 1) budget.fail("the grid has " + std::to_string(numbers[4]) + " channels; distances have one");
    DistanceGrid grid{};
    uint64_t count = 1;
    for (int a = 0; a < 3; ++a) {
        if (numbers[1 + a] < 2 || numbers[1 + a] > 1 << 16)
            budget.fail("the grid has " + std::to_string(numbers[1 + a]) +
                        " values along an axis; 2 to 65536 are possible");
        grid.size[a] = uint32_t(numbers[1 + a]);
        count *= grid.size[a];
        budget.bytes(count, sizeof(float));
    }
    if (bytes.size() < kHeader + count * sizeof(float)) budget.fail("the file ends before the values of its grid");
    grid.values.resize(count);
    memcpy(grid.values.data(), bytes.data() + kHeader, count * sizeof(float));
    for (const float v : grid.values)
        if (!std::isfinite(v)) budget.fail("a value of the grid is not finite");
    return grid;
}

Mesh mesh_of_grid(const std::string& path, const DistanceGrid& grid, GridNormals normals) {
    Surface surface{grid, normals, 2, {}, {}};
    uint64_t cells = 0;
    surface.for_each_cell([&](const uint32_t*, uint64_t) { ++cells; });
    if (cells == 0) throw input_error(path, 0, "the grid has no surface: all of its values have one sign");
    if (cells > kFewCells) surface.parts = 1;
    surface.for_each_cell([&](const uint32_t* c, uint64_t index) {
        for (uint32_t k = 0; k < surface.parts * surface.parts * surface.parts; ++k) {
            const uint32_t n = surface.parts;
            const uint32_t q[3] = {c[0] * n + k % n, c[1] * n + k / n % n, c[2] * n + k / (n * n)};
            surface.cut(c, index, q);
        }
    });
    surface.mesh.uvs.assign(surface.mesh.positions.size(), {0, 0});  // there are none
    return surface.mesh;
}

}  // namespace ambilux
