// Scenes that several families share, with their answers.
#pragma once

#include "stress/cell.h"
#include "stress/scene_text.h"

namespace ambilux::stress {

/// A black lamp in the centre of a sphere of radius 1, seen from inside so that the camera sees the wall alone
/// (answers.h, integrating_sphere).
struct Cavity {
    double reflectance = 0.8, lamp_radius = 0.25, radiance = 1;
    int max_depth = 20;
    Film film = {};
    Frame frame = {};
};
std::string cavity_scene(const Cavity& cavity);
Answer cavity_answer(const Cavity& cavity);

/// A square floor, half side 2, under a black square lamp that faces it; the camera, between the two, sees the square
/// of half side `seen` around the centre. Direct light alone.
struct Plate {
    double reflectance = 0.5, radiance = 1, height = 1, lamp_half = 0.5, seen = 0.5;
    int max_depth = 2;
    Film film = {};
    Frame frame = {};
};
/// `floor` and `lamp` replace the shapes, if they are given.
std::string plate_scene(const Plate& plate, const std::string& floor = {}, const std::string& lamp = {});
Answer plate_answer(const Plate& plate);
std::string plate_camera(const Plate& plate);
std::string plate_floor(const Plate& plate);

/// A black sphere of radius 0.5 that the camera never sees.
std::string stone(const Frame& frame, Point at);

/// A triangle mesh in OBJ. Faces count vertices from 1; `normals`, if any, one for each vertex.
std::string obj_text(const std::vector<Point>& vertices, const std::vector<unsigned>& faces,
                     const std::vector<Point>& normals = {});
/// A shape of an OBJ file.
std::string obj_shape(const Frame& frame, const std::string& file, const std::string& elements,
                      const std::string& inside);

/// A closed cube, [-1,1] along each axis, whose walls emit and reflect.
struct Furnace {
    double reflectance = 0.5, radiance = 1;
    int max_depth = 10, rr_depth = 5;
    Point origin = {0.1, -0.2, 0.3}, target = {1, 0.4, 0.2};
    double fov = 60;
    Film film = {};
    Frame frame = {};
};
std::string furnace_scene(const Furnace& furnace);
Answer furnace_answer(const Furnace& furnace);

/// "1e-06" of 1e-6; decades are short.
std::string decade(double value);
/// "2097152" of a whole number.
std::string whole(double value);

}  // namespace ambilux::stress
