// Lights of pbrt with an image, as projectors: their texels hold intensity times cos³, because a projector lights the
// plane in front of it evenly (transport/emitter/projector.h).
#include <algorithm>

#include "formats/pbrt/environment.h"
#include "formats/pbrt/light_parameters.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

/// Texels a side that an image has at least.
constexpr int kLeastTexels = 1024;

/// cos³ of the angle to the axis of a point of the plane z = 1.
double cube_of_cosine(double x, double y) {
    const double cosine = 1 / std::sqrt(1 + x * x + y * y);
    return cosine * cosine * cosine;
}

/// A projector at `to_world`, whose image is to be filled.
Texels& add_projector(SceneMaker& scene, const Where& where, const Matrix& to_world, double fov, double scale,
                      const char* filter, uint32_t width, uint32_t height) {
    Document& document = scene.document;
    FileBudget(where.file, document.limits).bytes(uint64_t(width) * height, 16);
    Object& object = add_to_scene(document, "emitter", "projector", where);
    set_transform(object, "to_world", to_world);
    set_number(object, "fov", fov);
    set_text(object, "fov_axis", "smaller");
    set_number(object, "scale", scale / M_PI);
    const std::string name = "light " + std::to_string(document.images.size());
    add_child(object, add_bitmap(document, where, name, filter), "irradiance");
    return add_image(document, name, width, height);
}

/// Faces of a cube: axis of the projector, and where its +x and +y point.
struct Face {
    Vec3d x, y, z;
};
constexpr Face kFaces[6] = {{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}, {{0, 1, 0}, {0, 0, -1}, {-1, 0, 0}},
                            {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}},
                            {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};

}  // namespace

void add_projection(SceneMaker& scene, const Described& light) {
    const Parameters& in = light.in;
    const std::string path = resolve(scene.folder, in.filename(), in.where_of("filename"));
    const double fov = in.number("fov", 90), scale = in.number("scale", 1) * scene.exposure;
    if (!(fov > 0 && fov < 180)) fail(in.where_of("fov"), "fov must lie between 0 and 180 degrees");
    if (!(scale >= 0)) fail(in.where_of("scale"), "the scale of a light must not be negative");
    const Texture texture = texture_of_file(path, in.where);
    const TextureImage& source = scene.textures.texels_of(texture);
    const int w = int(source.width), h = int(source.height);
    const double half = std::tan(fov * (M_PI / 360)), aspect = double(w) / h, half_x = half * std::max(aspect, 1.0),
                 half_y = half * std::max(1 / aspect, 1.0);
    const auto cosine_at = [&](double x, double y) {  // of a place in the image, in shares of its size
        return cube_of_cosine(half_x * (2 * x - 1), half_y * (2 * y - 1));
    };
    double power = 0;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
            power += luminance(source.texels[size_t(y) * size_t(w) + size_t(x)]) *
                     cosine_at((x + 0.5) / w, (y + 0.5) / h) * 4 * half_x * half_y / (double(w) * h);
    // pbrt's x points to the right of the image, that of a projector to its left.
    const int fine = (kLeastTexels + std::max(w, h) - 1) / std::max(w, h);
    Texels& image = add_projector(scene, in.where, unscaled(scene.state.ctm) * scaling(-1, 1, 1), fov,
                                  scale * (power > 0 ? power_factor(light, "power", power) : 1), "nearest",
                                  uint32_t(w * fine), uint32_t(h * fine));
    for (int y = 0; y < h * fine; ++y)
        for (int x = 0; x < w * fine; ++x) {
            const Rgb c = max(source.texels[size_t(y / fine) * size_t(w) + size_t(x / fine)], splat(0)) *
                          float(cosine_at((x + 0.5) / (w * fine), (y + 0.5) / (h * fine)));
            for (int i = 0; i < 3; ++i) image.floats[4 * (size_t(y) * size_t(w * fine) + size_t(x)) + size_t(i)] = c[i];
        }
    scene.report.note(in.where, "projection lights are projectors, whose finer image includes the falloff");
}

void add_goniometric(SceneMaker& scene, const Described& light) {
    const Parameters& in = light.in;
    const Emission e = emission(scene, light, "I");
    const std::string path = resolve(scene.folder, in.filename(), in.where_of("filename"));
    const SphereImage sphere = read_sphere_image(scene.document, path, in.where, "a goniometric light");
    const auto mean = [](Rgb c) { return (double(c.x) + c.y + c.z) / 3; };
    double power = 0;
    for (const Rgb& texel : sphere.texels) power += mean(texel) * 4 * M_PI / double(sphere.texels.size());
    if (!(power > 0)) return scene.report.note(in.where, "a goniometric light without any light is left out");
    const Rgb intensity = e.scaled(power_factor(light, "power", power));
    const int n = int(std::clamp<size_t>(4 * sphere.size, 256, 1024));
    constexpr int kSub = 4;
    for (const Face& face : kFaces) {
        std::vector<float> values(size_t(n) * size_t(n));
        for (int row = 0; row < n; ++row)
            for (int column = 0; column < n; ++column) {
                double sum = 0;
                for (int k = 0; k < kSub * kSub; ++k) {
                    // As the image of a camera: +x is left, +y up, and the first row on top.
                    const double a = 1 - 2 * (column + (k % kSub + 0.5) / kSub) / n,
                                 b = 1 - 2 * (row + (k / kSub + 0.5) / kSub) / n, l = 1 / std::sqrt(1 + a * a + b * b);
                    const Vec3d d = (face.x * a + face.y * b + face.z) * l;
                    // Images stand upright along y.
                    sum += mean(sphere.at(d.x, d.z, d.y)) * l * l * l;
                }
                values[size_t(row) * size_t(n) + size_t(column)] = float(sum / (kSub * kSub));
            }
        if (std::all_of(values.begin(), values.end(), [](float v) { return v == 0; })) continue;
        const Matrix turn = from_columns(face.x, face.y, face.z);
        Texels& image = add_projector(scene, in.where, unscaled(scene.state.ctm) * turn, 90, 1, "bilinear", uint32_t(n),
                                      uint32_t(n));
        for (size_t i = 0; i < values.size(); ++i)
            for (int c = 0; c < 3; ++c) image.floats[4 * i + size_t(c)] = intensity[c] * values[i];
    }
    scene.report.note(in.where, "goniometric lights are six projectors, whose images include the intensity");
}

}  // namespace ambilux::pbrt
