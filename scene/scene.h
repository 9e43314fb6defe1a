// A loaded scene: owns the arrays that a SceneView points to, and what only the host needs to know.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/shared_array.h"
#include "scene/alias_table.h"
#include "scene/view.h"

namespace ambilux {

/// What the file asks of the integrator; the command line has the last word.
struct IntegratorHint {
    std::string type = "path";
    int max_depth = -1;
    int rr_depth = 5;
    int spp = 16;
    bool hide_emitters = false;
};

/// Copies share the large arrays.
struct Scene {
    std::string path;  ///< file it came from
    /// Coordinates of the file that are this scene's (0,0,0). The loader moves scenes that lie far from the origin of
    /// their file, where floats have lost their digits.
    std::array<double, 3> origin{};
    std::array<uint8_t, 32>
        content_hash{};                 ///< over the XML and every file it names, and the options that change the image
    std::vector<std::string> warnings;  ///< substitutions made by --lenient, parameters without effect
    std::vector<std::string> notes;     ///< what is done in another way than the file says, with the same image
    uint64_t degenerate_triangles = 0;  ///< triangles without area that the loader left out
    IntegratorHint integrator;
    std::string light_picking = "power";  ///< how next event estimation and light subpaths choose an emitter; tree: by
                                          ///< power, and renders shall have light_picking=tree

    SharedArray<MeshVertex> vertices;
    SharedArray<Triangle> triangles;
    SharedArray<Quadric> quadrics;
    std::vector<Group> groups;  ///< in the order of their triangles, which are the last ones
    SharedArray<Instance> instances;
    std::vector<Shape> shapes;
    std::vector<Material> materials;
    std::vector<BsdfRecord> bsdfs;
    std::vector<Texture> textures;
    SharedArray<uint8_t> texels;
    std::vector<uint16_t> sort_keys;  ///< per primitive (SceneView::sort_keys)
    std::vector<Emitter> emitters;
    std::vector<float> emitter_cdf;
    SharedArray<float> tables;
    SharedArray<AliasBucket> environment_rows;  ///< SceneView::environment_rows
    SharedArray<EnvironmentCell> environment_cells;
    uint32_t environment = kNone;
    double environment_mean =
        0;  ///< luminance of an environment map over the sphere, over the largest component of its scale
    Vec3f bounds_center{};
    float bounds_radius = 0;
    Sensor sensor{};
    Features features;  ///< the smallest set that covers the scene

    /// View into this object's arrays; valid while they are not changed.
    SceneView view() const;
    /// Bytes of all arrays.
    uint64_t memory_bytes() const;
};

/// Whether both have the same shapes in the same memory.
bool same_geometry(const Scene& a, const Scene& b);

}  // namespace ambilux
