#include "formats/meshes/height_field.h"

#include <cmath>

#include "core/error.h"
#include "core/math.h"
#include "formats/file_budget.h"

namespace ambilux {

namespace {

/// Cells from which on each is two triangles.
constexpr uint64_t kManyCells = 1 << 19;

}  // namespace

Mesh mesh_of_heights(const std::string& path, uint32_t width, uint32_t height, const std::vector<float>& heights,
                     bool smooth, const Limits& limits) {
    if (width < 2 || height < 2) throw input_error(path, 0, "a heightfield needs two rows and columns of heights");
    const uint64_t cells = uint64_t(width - 1) * (height - 1);
    const bool middles = cells < kManyCells;
    FileBudget(path, limits)
        .bytes(mesh_bytes(uint64_t(width) * height + (middles ? cells : 0), cells * (middles ? 4 : 2)), 1);
    const auto at = [&](uint32_t x, uint32_t y) { return heights[size_t(y) * width + x]; };
    Mesh mesh;
    const auto add = [&](float x, float y, float z) {
        const float u = x / float(width - 1), v = y / float(height - 1);
        mesh.positions.push_back({2 * u - 1, 2 * v - 1, z});
        mesh.uvs.push_back({u, v});
        return uint32_t(mesh.positions.size() - 1);
    };
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) add(float(x), float(y), at(x, y));
    if (smooth) mesh.normals.assign(mesh.positions.size(), {0, 0, 0});
    for (uint32_t y = 0; y + 1 < height; ++y)
        for (uint32_t x = 0; x + 1 < width; ++x) {
            const uint32_t a = y * width + x, b = a + 1, c = a + width, d = c + 1;
            const float f00 = at(x, y), f10 = at(x + 1, y), f01 = at(x, y + 1), f11 = at(x + 1, y + 1);
            if (smooth) {  // where a cell is as wide as one unit of height
                mesh.normals[a] += normalize(Vec3f{f00 - f10, f00 - f01, 1});
                mesh.normals[b] += normalize(Vec3f{f00 - f10, f10 - f11, 1});
                mesh.normals[c] += normalize(Vec3f{f01 - f11, f00 - f01, 1});
                mesh.normals[d] += normalize(Vec3f{f01 - f11, f10 - f11, 1});
            }
            if (!middles) {
                mesh.faces.insert(mesh.faces.end(), {{a, b, d}, {a, d, c}});
                continue;
            }
            const uint32_t m = add(float(x) + 0.5f, float(y) + 0.5f, (f00 + f10 + f01 + f11) / 4);
            mesh.faces.insert(mesh.faces.end(), {{a, b, m}, {b, d, m}, {d, c, m}, {c, a, m}});
        }
    if (!smooth) return mesh;
    for (Vec3f& n : mesh.normals) n = normalize(n);
    for (uint32_t y = 0; middles && y + 1 < height; ++y)
        for (uint32_t x = 0; x + 1 < width; ++x) {
            const size_t a = size_t(y) * width + x;
            mesh.normals.push_back(mesh.normals[a] + mesh.normals[a + 1] + mesh.normals[a + width] +
                                   mesh.normals[a + width + 1]);
        }
    for (Vec3f& n : mesh.normals)
        n = normalize(Vec3f{n.x * 0.5f * float(width - 1), n.y * 0.5f * float(height - 1), n.z});
    return mesh;
}

Mesh mesh_of_image(const std::string& path, const Texels& texels, double scale, bool smooth, const Limits& limits) {
    std::vector<float> heights(size_t(texels.width) * texels.height);
    for (size_t i = 0; i < heights.size(); ++i) {
        heights[i] = float(scale * double(luminance(texels.linear(i))));
        if (!std::isfinite(heights[i])) throw input_error(path, 0, "a height is not finite");
    }
    return mesh_of_heights(path, texels.width, texels.height, heights, smooth, limits);
}

}  // namespace ambilux
