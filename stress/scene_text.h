// Mitsuba XML of the stress scenes: a few shapes, lamps and cameras, all placed by one frame.
#pragma once

#include <string>

namespace ambilux::stress {

struct Point {
    double x, y, z;
};

/// Where a scene lies in the world. Points are mirrored, scaled, then moved rigidly.
struct Frame {
    double scale = 1;
    std::string mirror = {};  ///< XML elements for shapes alone; they map the scene onto itself
    std::string rigid = {};   ///< XML elements: rotations and translations

    /// `elements` followed by those of the frame, as the attribute to_world of a shape.
    std::string place(const std::string& elements) const;
};

std::string scale_xyz(double x, double y, double z);
std::string translate(double x, double y, double z);
std::string rotate(double x, double y, double z, double degrees);

std::string diffuse(double reflectance);
/// A parameter of a shape.
std::string radius(double value);
std::string center(Point p);
std::string area_emitter(double radiance);
/// A shape of that type with `parameters`, such as a file name, BSDF and emitter, placed by `frame`.
std::string shape(const std::string& type, const Frame& frame, const std::string& elements, const std::string& inside);
/// A rectangle of those half sides in the plane z = height; it faces up, or down.
std::string rectangle(const Frame& frame, double half_x, double half_y, double height, bool down,
                      const std::string& inside);

struct Film {
    unsigned width = 16, height = 16;
};
/// A camera at `origin`, of field of view `fov` in degrees along x. Clipping planes lie at `near` and 1e5 times that.
std::string perspective(const Frame& frame, Point origin, Point target, Point up, double fov, double near,
                        const Film& film = {});
/// A camera of parallel rays that sees `half` to all sides.
std::string orthographic(const Frame& frame, Point origin, Point target, Point up, double half, double near,
                         const Film& film = {});

/// A whole scene file. `rr_depth`: segments from which on roulette may end paths.
std::string scene_xml(int max_depth, const std::string& inside, int rr_depth = 5);

}  // namespace ambilux::stress
