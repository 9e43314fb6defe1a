// A scene in double precision.
#pragma once

#include <memory>
#include <vector>

#include "render/twin/in_double/scene/view.h"
#include "scene/scene.h"

namespace ambilux::twin {

/// The records of a scene with doubles in place of floats. Numbers that the scene states once are the same to the bit.
/// What follows from others is derived again, since formulas rely on it within rounding: inverses of matrices, axes at
/// right angles and unit directions. Tables, texels and areas of shapes are those of the scene, good to 2^-24.
class DoubleScene {
public:
    /// `scene` must outlive it. Instances become copies.
    explicit DoubleScene(const ambilux::Scene& scene);

    SceneView view() const;
    uint64_t memory_bytes() const;

private:
    std::unique_ptr<const ambilux::Scene> flat_;  ///< of a scene with instances
    const ambilux::Scene& scene_;
    std::vector<MeshVertex> vertices_;
    std::vector<Triangle> triangles_;
    std::vector<Quadric> quadrics_;
    std::vector<Shape> shapes_;
    std::vector<Material> materials_;
    std::vector<BsdfRecord> bsdfs_;
    std::vector<Texture> textures_;
    std::vector<Emitter> emitters_;
    Sensor sensor_;
};

}  // namespace ambilux::twin
