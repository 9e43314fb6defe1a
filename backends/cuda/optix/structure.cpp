#include "backends/cuda/optix/structure.h"

#include <fmt/format.h>
#include <optix_stubs.h>

#include <algorithm>
#include <cstring>

#include "backends/cuda/optix/params.h"
#include "core/error.h"
#include "scene/primitive_bounds.h"

namespace ambilux {
namespace {

CUdeviceptr address_of(const void* pointer) { return reinterpret_cast<CUdeviceptr>(pointer); }

/// What a tree is built over. It must stay where it is: inputs point into it.
struct Input {
    OptixBuildInput input = {};  ///< of type 0: nothing
    CUdeviceptr buffer = 0;
    unsigned flags = OPTIX_GEOMETRY_FLAG_NONE;
    OptixAccelBufferSizes sizes = {};

    Input() = default;
    Input(const Input&) = delete;
    Input& operator=(const Input&) = delete;

    void of_triangles(const SceneView& scene, uint32_t first, uint32_t count) {
        if (count == 0) return;
        input.type = OPTIX_BUILD_INPUT_TYPE_TRIANGLES;
        OptixBuildInputTriangleArray& t = input.triangleArray;
        buffer = address_of(scene.vertices);
        t.vertexBuffers = &buffer;
        t.numVertices = scene.vertex_count;
        t.vertexFormat = OPTIX_VERTEX_FORMAT_FLOAT3;
        t.vertexStrideInBytes = sizeof(MeshVertex);
        t.indexBuffer = address_of(scene.triangles + first);
        t.numIndexTriplets = count;
        t.indexFormat = OPTIX_INDICES_FORMAT_UNSIGNED_INT3;
        t.indexStrideInBytes = sizeof(Triangle);
        t.flags = &flags;
        t.numSbtRecords = 1;
    }
    void of_quadrics(const DeviceBuffer<OptixAabb>& boxes) {
        if (boxes.size() == 0) return;
        input.type = OPTIX_BUILD_INPUT_TYPE_CUSTOM_PRIMITIVES;
        OptixBuildInputCustomPrimitiveArray& q = input.customPrimitiveArray;
        buffer = address_of(boxes.data());
        q.aabbBuffers = &buffer;
        q.numPrimitives = unsigned(boxes.size());
        q.flags = &flags;
        q.numSbtRecords = 1;
    }
    void of_instances(const DeviceBuffer<OptixInstance>& instances, size_t count) {
        if (count == 0) return;
        input.type = OPTIX_BUILD_INPUT_TYPE_INSTANCES;
        input.instanceArray.instances = address_of(instances.data());
        input.instanceArray.numInstances = unsigned(count);
    }
};

/// Trees over primitives are compacted: that over instances is small.
bool is_compacted(const OptixBuildInput& input) { return input.type != OPTIX_BUILD_INPUT_TYPE_INSTANCES; }

OptixAccelBuildOptions options_of(const OptixBuildInput& input) {
    OptixAccelBuildOptions o = {};
    o.buildFlags = OPTIX_BUILD_FLAG_PREFER_FAST_TRACE;
    if (is_compacted(input)) o.buildFlags |= OPTIX_BUILD_FLAG_ALLOW_COMPACTION;
    o.operation = OPTIX_BUILD_OPERATION_BUILD;
    return o;
}

/// Larger by what OptiX's test of a box may be rounded.
std::vector<OptixAabb> boxes_of(const SharedArray<Quadric>& quadrics) {
    std::vector<OptixAabb> boxes;
    for (const Quadric& q : quadrics) {
        const Bounds3f b = quadric_bounds(q);
        const Vec3f pad = max(abs(b.lower), abs(b.upper)) * 0x1p-20f;
        const Vec3f lower = b.lower - pad, upper = b.upper + pad;
        boxes.push_back({lower.x, lower.y, lower.z, upper.x, upper.y, upper.z});
    }
    return boxes;
}

OptixInstance instance_of(OptixTraversableHandle tree, uint32_t id, uint32_t hit_group, const Affine& to_world) {
    OptixInstance i = {};
    static_assert(sizeof(i.transform) == sizeof(to_world.m));
    std::memcpy(i.transform, to_world.m, sizeof(i.transform));
    i.instanceId = id;
    i.sbtOffset = hit_group;
    i.visibilityMask = 255;
    i.traversableHandle = tree;
    return i;
}

class Builder {
public:
    Builder(const OptixContext& optix, const Scene& scene, const SceneView& on_device)
        : optix_(optix), scene_(scene), inputs_(2 + scene.groups.size()),
          boxes_(boxes_of(scene.quadrics), "boxes of shapes for OptiX") {
        // Of the host's view: that of the device knows its groups there.
        inputs_[0].of_triangles(on_device, 0, scene.view().ungrouped_count());
        inputs_[1].of_quadrics(boxes_);
        for (size_t g = 0; g < scene.groups.size(); ++g)
            inputs_[2 + g].of_triangles(on_device, scene.groups[g].first_triangle, scene.groups[g].triangle_count);
        made_.two_levels = !scene.quadrics.empty() || !scene.instances.empty();
        if (made_.two_levels)
            instances_ = DeviceBuffer<OptixInstance>(2 + scene.instances.size(), "instances for OptiX");
        top_.of_instances(instances_, instances_.size());
    }

    OptixStructure build(uint64_t room) {
        made_.predicted_peak_bytes = predict();
        if (made_.predicted_peak_bytes > room)
            throw Error(ExitCode::device,
                        fmt::format("accel=optix: its structure needs {} MiB for a while, of {} there are; make the "
                                    "scene smaller, or take accel=cwbvh",
                                    (made_.predicted_peak_bytes + (1 << 20) - 1) >> 20, room >> 20));
        std::vector<OptixTraversableHandle> trees;
        for (const Input& input : inputs_) trees.push_back(build(input));
        made_.root = made_.two_levels ? build_top(trees) : trees[0];
        return std::move(made_);
    }

private:
    uint64_t bytes_beside() const { return boxes_.bytes() + instances_.bytes() + sizeof(uint64_t); }

    /// Of all trees as they are at first, and of what the largest needs beside it while it is built.
    uint64_t predict() {
        uint64_t all = bytes_beside(), most = 0;
        const auto add = [&](Input& input) {
            if (!input.input.type) return;
            const OptixAccelBuildOptions o = options_of(input.input);
            optix_.check(optixAccelComputeMemoryUsage(optix_.get(), &o, &input.input, 1, &input.sizes),
                         "the bytes of its structure");
            all += input.sizes.outputSizeInBytes;
            most = std::max<uint64_t>({most, input.sizes.tempSizeInBytes, input.sizes.outputSizeInBytes});
        };
        for (Input& input : inputs_) add(input);
        add(top_);
        return all + most;
    }

    OptixTraversableHandle build_top(const std::vector<OptixTraversableHandle>& trees) {
        constexpr Affine kHere = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
        std::vector<OptixInstance> list;
        const auto add = [&](size_t tree, uint32_t id, uint32_t hit_group, const Affine& to_world) {
            if (trees[tree]) list.push_back(instance_of(trees[tree], id, hit_group, to_world));
        };
        add(0, kOptixTriangles, kTriangleGroup, kHere);
        add(1, kOptixQuadrics, kQuadricGroup, kHere);
        for (uint32_t i = 0; i < scene_.instances.size(); ++i)
            add(2 + scene_.instances[i].group, kOptixFirstInstance + i, kTriangleGroup, scene_.instances[i].to_world);
        if (list.empty()) return 0;
        DeviceMemory::put(instances_.data(), list.data(), list.size() * sizeof(OptixInstance));
        top_.of_instances(instances_, list.size());
        return build(top_);
    }

    OptixTraversableHandle build(const Input& input) {
        if (!input.input.type) return 0;
        const OptixAccelBuildOptions o = options_of(input.input);
        DeviceBuffer<uint64_t> compacted(1, "size of a structure");
        const OptixAccelEmitDesc emit = {address_of(compacted.data()), OPTIX_PROPERTY_TYPE_COMPACTED_SIZE};
        OptixTraversableHandle handle = 0;
        DeviceBuffer<std::byte> tree(input.sizes.outputSizeInBytes, "OptiX's structure");
        DeviceBuffer<std::byte> temporary(input.sizes.tempSizeInBytes, "memory of OptiX's builder");
        optix_.check(optixAccelBuild(optix_.get(), nullptr, &o, &input.input, 1, address_of(temporary.data()),
                                     temporary.bytes(), address_of(tree.data()), tree.bytes(), &handle,
                                     is_compacted(input.input) ? &emit : nullptr, is_compacted(input.input)),
                     "building its structure");
        wait_for_default_stream("building OptiX's structure");
        note_peak(tree.bytes() + temporary.bytes());
        temporary = {};
        const uint64_t smaller = is_compacted(input.input) ? compacted.download()[0] : 0;
        if (smaller > 0 && smaller < tree.bytes()) {
            DeviceBuffer<std::byte> copy(smaller, "OptiX's structure");
            optix_.check(
                optixAccelCompact(optix_.get(), nullptr, handle, address_of(copy.data()), copy.bytes(), &handle),
                "compaction of its structure");
            wait_for_default_stream("compaction of OptiX's structure");
            note_peak(tree.bytes() + copy.bytes());
            tree = std::move(copy);
        }
        made_.bytes += tree.bytes();
        made_.trees.push_back(std::move(tree));
        return handle;
    }
    void note_peak(uint64_t now) { made_.peak_bytes = std::max(made_.peak_bytes, made_.bytes + now + bytes_beside()); }

    const OptixContext& optix_;
    const Scene& scene_;
    std::vector<Input> inputs_;
    Input top_;
    DeviceBuffer<OptixAabb> boxes_;
    DeviceBuffer<OptixInstance> instances_;
    OptixStructure made_;
};

}  // namespace

OptixStructure build_optix_structure(const OptixContext& optix, const Scene& scene, const SceneView& on_device,
                                     uint64_t room) {
    return Builder(optix, scene, on_device).build(room);
}

}  // namespace ambilux
