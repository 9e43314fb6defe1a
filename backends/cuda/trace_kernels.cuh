// Ray traversal on a CUDA device: persistent warps that fetch rays as lanes fall idle (Aila and Laine 2009, "Understanding the Efficiency of Ray
// Traversal on GPUs") over the compressed wide BVH (Ylitie et al. 2017), with primitives postponed until enough lanes hold some. Node and primitive
// tests are those of scene/accel, so hits agree with the host's.
#pragma once

#include <cuda_runtime.h>

#include "backends/traversal_features.h"
#include "scene/accel/cwbvh.h"

namespace ambilux {

/// When a warp changes what it does. Values are counts of lanes.
struct TraceTuning {
    uint32_t refill_below = 20;   ///< fetch rays when fewer lanes than this are busy; 1 waits for the whole warp, best for coherent rays
    uint32_t primitives_at = 12;  ///< test primitives when this many lanes hold some
};

/// For rays in no order, and for neighbouring rays that stay together.
constexpr TraceTuning kIncoherentTuning = {20, 12};
constexpr TraceTuning kCoherentTuning = {1, 1};

constexpr uint32_t kTraceBlock = 128;
/// Resident blocks per multiprocessor that kernels are compiled for: 64 registers per thread.
constexpr uint32_t kTraceBlocksPerSm = 8;

namespace detail {

/// Rank of this lane among the lanes of `mask`.
__device__ inline uint32_t lane_rank(uint32_t mask) {
    uint32_t below;
    asm("mov.u32 %0, %%lanemask_lt;" : "=r"(below));
    return uint32_t(__popc(mask & below));
}

/// The loop behind trace_closest_persistent and trace_any_persistent. `finish(i, hit)` is called once per fetched ray.
template <Features F, bool AnyHit, class Fetch, class Finish>
__device__ void trace_persistent(const SceneView& scene, const CwbvhTracer& tracer, Fetch fetch, Finish finish, const uint32_t* count,
                                 uint32_t* next_ray, TraceTuning tuning) {
    constexpr uint32_t kWarp = 0xffffffffu;
    const uint32_t ray_count = *count;
    CwbvhGroup stack[kCwbvhStackSize];
    int top = 0;
    Ray ray = {};
    CwbvhRay box_ray = {};
    RayShear shear = {};
    Hit hit = {};
    CwbvhGroup group = {0, 0}, primitives = {0, 0};
    uint32_t index = 0;
    bool busy = false, drained = false;

    for (;;) {
        const uint32_t idle = __ballot_sync(kWarp, !busy);
        if (!drained && 32u - uint32_t(__popc(idle)) < tuning.refill_below) {
            uint32_t first = 0;
            const int leader = __ffs(int(idle)) - 1;
            if (int(threadIdx.x & 31u) == leader) first = atomicAdd(next_ray, uint32_t(__popc(idle)));
            first = __shfl_sync(kWarp, first, leader);
            drained = first + uint32_t(__popc(idle)) >= ray_count;
            if (!busy) {
                index = first + lane_rank(idle);
                if (index < ray_count && fetch(index, ray)) {
                    hit = {ray.tmax, 0.0f, 0.0f, kNone};
                    if (is_traceable(ray)) {
                        busy = true;
                        box_ray = make_cwbvh_ray(ray.o, ray.d);
                        shear = make_ray_shear(ray.d);
                        group = {0, 0x80000000u};
                        primitives = {0, 0};
                        top = 0;
                    } else {
                        finish(index, hit);
                    }
                }
            }
        }
        if (!__any_sync(kWarp, busy)) {
            if (drained) return;
            continue;
        }

        if (busy && primitives.hits == 0) {
            if (!(group.hits & kCwbvhInnerBits)) group = stack[--top];
            const uint32_t child = take_child(group, box_ray.octant_inverse);
            if (group.hits & kCwbvhInnerBits) stack[top++] = group;
            const CwbvhNode node = load_record(tracer.nodes + child);
            const uint32_t hits = child_hits(node, box_ray, hit.t);
            group = {node.first_child, (hits & kCwbvhInnerBits) | node.inner_mask};
            primitives = {node.first_primitive, hits & ~kCwbvhInnerBits};
        }

        // Lanes with primitives wait until enough others have some too, or until no lane can go on without.
        const bool dry = !(group.hits & kCwbvhInnerBits) && top == 0;
        const uint32_t waiting = __ballot_sync(kWarp, busy && primitives.hits != 0);
        const uint32_t walking = __ballot_sync(kWarp, busy && primitives.hits == 0 && !dry);
        if (waiting && (walking == 0 || uint32_t(__popc(waiting)) >= tuning.primitives_at)) {
            while (busy && primitives.hits) {
                const int bit = lowest_bit(primitives.hits);
                primitives.hits &= primitives.hits - 1;
                if (tracer.intersect_primitive<F>(scene, ray, shear, primitives.base + uint32_t(bit), hit) && AnyHit) {
                    finish(index, hit);
                    busy = false;
                }
            }
            __syncwarp();
        }
        if (busy && primitives.hits == 0 && dry) {
            finish(index, hit);
            busy = false;
        }
    }
}

}  // namespace detail

/// Nearest hits of *count rays. Call it from all threads of the grid; blocks are of whole warps. fetch(i, ray) loads ray i and returns false to leave it
/// out; emit(i, hit) is called for every other ray, hit or not (hit.prim == kNone). *next_ray_counter must be 0 when the kernel starts. Both
/// counts live on the device, so no host round trip is needed between the stage that makes rays and this one.
template <Features F, class Fetch, class Emit>
__device__ void trace_closest_persistent(const SceneView& scene, const CwbvhTracer& tracer, Fetch fetch, Emit emit, const uint32_t* count,
                                         uint32_t* next_ray_counter, TraceTuning tuning = kIncoherentTuning) {
    detail::trace_persistent<F, false>(scene, tracer, fetch, emit, count, next_ray_counter, tuning);
}

/// Whether anything blocks each of *count rays; emit(i, blocked). The rest is as for trace_closest_persistent.
template <Features F, class Fetch, class Emit>
__device__ void trace_any_persistent(const SceneView& scene, const CwbvhTracer& tracer, Fetch fetch, Emit emit, const uint32_t* count,
                                     uint32_t* next_ray_counter, TraceTuning tuning = kIncoherentTuning) {
    detail::trace_persistent<F, true>(
        scene, tracer, fetch, [&](uint32_t i, const Hit& hit) { emit(i, hit.prim != kNone); }, count, next_ray_counter, tuning);
}

/// Ray i of an array whose start is aligned to 16 bytes.
__device__ inline Ray load_ray(const Ray* rays, uint32_t i) {
    const float4* words = reinterpret_cast<const float4*>(rays) + size_t(i) * 2;
    const float4 a = __ldcs(words), b = __ldcs(words + 1);
    return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, __float_as_uint(b.w)};
}

__device__ inline void store_hit(Hit* hits, uint32_t i, const Hit& h) {
    __stcs(reinterpret_cast<float4*>(hits) + i, make_float4(h.t, h.u, h.v, __uint_as_float(h.prim)));
}

/// Nearest hits of an array of rays; `Set` is a FeatureSet. Launch with persistent_grid() blocks of kTraceBlock threads and *next_ray_counter == 0.
template <class Set>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_closest_kernel(const __grid_constant__ SceneView scene, const CwbvhTracer tracer, const Ray* rays, Hit* hits, const uint32_t* count,
                         uint32_t* next_ray_counter, const TraceTuning tuning) {
    trace_closest_persistent<Set::value>(
        scene, tracer,
        [=](uint32_t i, Ray& ray) {
            ray = load_ray(rays, i);
            return true;
        },
        [=](uint32_t i, const Hit& hit) { store_hit(hits, i, hit); }, count, next_ray_counter, tuning);
}

/// Any hit: 1 where a ray is blocked, else 0. Launch as trace_closest_kernel.
template <class Set>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_any_kernel(const __grid_constant__ SceneView scene, const CwbvhTracer tracer, const Ray* rays, uint8_t* blocked, const uint32_t* count,
                     uint32_t* next_ray_counter, const TraceTuning tuning) {
    trace_any_persistent<Set::value>(
        scene, tracer,
        [=](uint32_t i, Ray& ray) {
            ray = load_ray(rays, i);
            return true;
        },
        [=](uint32_t i, bool hit) { blocked[i] = hit; }, count, next_ray_counter, tuning);
}

/// The same answers, one thread per ray and the loop of the host: the yardstick for the kernels above.
template <class Set>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_closest_plain_kernel(const __grid_constant__ SceneView scene, const CwbvhTracer tracer, const Ray* rays, Hit* hits, uint32_t count) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= count) return;
    Hit hit;
    tracer.closest<Set::value>(scene, load_ray(rays, i), hit);
    store_hit(hits, i, hit);
}

template <class Set>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_any_plain_kernel(const __grid_constant__ SceneView scene, const CwbvhTracer tracer, const Ray* rays, uint8_t* blocked, uint32_t count) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < count) blocked[i] = tracer.occluded<Set::value>(scene, load_ray(rays, i));
}

/// Blocks that keep every multiprocessor full with a kernel of `threads` threads per block.
template <class Kernel>
uint32_t persistent_grid(Kernel* kernel, uint32_t threads = kTraceBlock) {
    int device = 0, multiprocessors = 0, blocks = 0;
    cudaGetDevice(&device);
    cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device);
    cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, kernel, int(threads), 0);
    return uint32_t(multiprocessors) * uint32_t(blocks > 0 ? blocks : 1);
}

}  // namespace ambilux
