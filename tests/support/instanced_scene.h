// A small scene with a group in four places, one of them a mirror.
#pragma once

#include <cmath>
#include <cstdio>

#include "tests/support/accel_scenes.h"
#include "tests/support/mitsuba_text.h"

namespace ambilux::test {

/// A bumpy ball with normals and texture coordinates: 2 * rows * columns - 2 * columns triangles.
inline std::string ball(int rows, int columns, double bumps) {
    std::string text;
    for (int i = 0; i <= rows; ++i)
        for (int j = 0; j <= columns; ++j) {
            const double theta = M_PI * i / rows, phi = 2 * M_PI * j / columns;
            const double r = 1 + bumps * std::sin(5 * theta) * std::cos(4 * phi);
            const double x = std::sin(theta) * std::cos(phi), y = std::sin(theta) * std::sin(phi), z = std::cos(theta);
            char line[200];
            std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\nvn %.9g %.9g %.9g\nvt %.9g %.9g\n", r * x, r * y, r * z,
                          x, y, z, double(j) / columns, double(i) / rows);
            text += line;
        }
    const auto face = [&](int a, int b, int c) {
        text += "f";
        for (int v : {a, b, c}) {
            const std::string n = std::to_string(v + 1);
            text += " " + n + "/" + n + "/" + n;
        }
        text += "\n";
    };
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j) {
            const int a = i * (columns + 1) + j, b = a + columns + 1;
            if (i > 0) face(a, b, a + 1);
            if (i + 1 < rows) face(a + 1, b, b + 1);
        }
    return text;
}

inline const char* const kPlaces[] = {
    "<translate x='-1.6'/>",
    "<rotate x='1' y='1' angle='50'/><translate x='1.5' y='0.3'/>",
    "<scale x='0.5' y='1.2' z='0.8'/><rotate z='1' angle='30'/><translate y='1.8' z='0.5'/>",
    "<scale x='-0.7' y='0.7' z='0.7'/><rotate y='1' angle='20'/><translate y='-1.7' x='0.4'/>",
};

inline std::string placed(const std::string& id, const std::string& transform) {
    return "<shape type='instance'><ref id='" + id + "'/><transform name='to_world'>" + transform +
           "</transform></shape>";
}

/// Four places of a group of two meshes, one of them of flat triangles, on a floor under a light.
inline std::string forest(const std::string& bsdf) {
    std::string body =
        "<shape type='shapegroup' id='g'><shape type='obj'><string name='filename' value='ball.obj'/>" + bsdf +
        "</shape><shape type='cube'><transform name='to_world'><scale value='0.3'/><translate z='1.2'/></transform>" +
        bsdf + "</shape></shape>";
    for (const char* place : kPlaces) body += placed("g", place);
    return body +
           "<shape type='rectangle'><transform name='to_world'><scale value='8'/><translate z='-1.5'/></transform>"
           "</shape><shape type='sphere'><float name='radius' value='0.4'/></shape>"
           "<shape type='rectangle'><transform name='to_world'><scale value='0.7'/><rotate x='1' angle='180'/>"
           "<translate z='5'/></transform><emitter type='area'><rgb name='radiance' value='12'/></emitter></shape>"
           "<sensor type='perspective'><float name='fov' value='50'/><transform name='to_world'>"
           "<lookat origin='0,-7,4' target='0,0,0' up='0,0,1'/></transform><film type='hdrfilm'>"
           "<integer name='width' value='48'/><integer name='height' value='40'/></film></sensor>";
}

inline const char* const kMaskBsdf =
    "<bsdf type='mask'><float name='opacity' value='0.5'/><bsdf type='diffuse'/></bsdf>";

/// Options by which every group in several places is shared.
inline LoadOptions shared() {
    LoadOptions options;
    options.limits.copies = 0;
    return options;
}

inline Scene load_forest(const std::string& bsdf, const LoadOptions& options = shared(), double bumps = 0.15) {
    const TempFolder folder;
    folder.write("ball.obj", ball(12, 16, bumps));
    return load(forest(bsdf), options, "3.0.0", &folder);
}

/// Rays around the forest, a quarter of them short, every second one towards its middle.
inline std::vector<Ray> rays_around(uint32_t count, uint64_t seed) {
    accel_test::Random random(seed);
    std::vector<Ray> rays;
    for (uint32_t i = 0; i < count; ++i) {
        const Vec3f o = random.in_box(4.0f), to = random.in_box(2.0f);
        rays.push_back({o, i % 4 ? kInfinity : 3.0f * random.uniform(), i % 2 ? normalize(to - o) : random.direction(),
                        i * 2654435761u});
    }
    return rays;
}

}  // namespace ambilux::test
