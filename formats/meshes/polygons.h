// Faces of more than three corners.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/vec3d.h"

namespace ambilux {

using Triangles = std::vector<std::array<uint32_t, 3>>;

/// Numbers of the corners of triangles that cover a polygon: a fan from the first corner, or where that would reach
/// beyond a concave polygon, its ears. There are two triangles fewer than corners. False if some reach beyond it: what
/// crosses itself, or is concave and has more than 1000 corners, becomes a fan.
bool cut_polygon(const std::vector<Vec3d>& corners, Triangles& triangles);

/// Makes faces of a mesh from polygons, one at a time. `place` of a vertex is where it lies.
struct PolygonCutter {
    std::vector<uint32_t> polygon;  ///< vertices
    Triangles triangles;            ///< of its corners
    std::vector<Vec3d> places;      ///< of its corners
    size_t thin = 0;                ///< polygons of fewer than three corners
    size_t uncovered = 0;           ///< polygons whose triangles reach beyond them

    template <class Place>
    void add_to(Triangles& faces, const Place& place) {
        if (polygon.size() < 3) return void(++thin);
        places.clear();
        for (const uint32_t v : polygon) places.push_back(place(v));
        uncovered += !cut_polygon(places, triangles);
        for (const auto& t : triangles) faces.push_back({polygon[t[0]], polygon[t[1]], polygon[t[2]]});
    }
    /// The polygon of the fan from face `first` to the last one.
    template <class Place>
    void cut_fan(Triangles& faces, size_t first, const Place& place) {
        polygon = {faces[first][0], faces[first][1]};
        for (size_t i = first; i < faces.size(); ++i) polygon.push_back(faces[i][2]);
        faces.resize(first);
        add_to(faces, place);
    }
    void add_notes(std::vector<std::string>& notes) const {
        if (thin > 0) notes.push_back("faces of fewer than three corners are left out: " + std::to_string(thin));
        if (uncovered > 0)
            notes.push_back(
                "concave faces that cross themselves or have more than 1000 corners are cut into fans, which "
                "reach beyond them: " +
                std::to_string(uncovered));
    }
};

}  // namespace ambilux
