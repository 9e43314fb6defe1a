// Ray traversal on a CUDA device: persistent warps that fetch rays as lanes fall idle (Aila and Laine 2009,
// "Understanding the Efficiency of Ray Traversal on GPUs") over the compressed wide BVH (Ylitie et al. 2017), with
// primitives postponed until enough lanes hold some. A lane that holds some goes on walking until it meets the next
// (their speculative traversal). Node and primitive tests are those of scene/accel, so hits agree with the host's.
#pragma once

#include <cuda_runtime.h>

#include "accel/cwbvh.h"
#include "accel/pair_bvh.h"
#include "backends/cuda/instance_cursor.cuh"
#include "backends/traversal_features.h"
#include "core/warp.h"

namespace ambilux {

/// When a warp changes what it does. Values are counts of lanes.
struct TraceTuning {
    uint32_t refill_below =
        28;  ///< fetch rays when fewer lanes than this are busy; 1 waits for the whole warp, best for coherent rays
    uint32_t walk_at = 16;       ///< visit nodes again without asking for anything else while this many lanes can
    uint32_t primitives_at = 8;  ///< likewise for primitives
};

/// For rays in no order, and for neighbouring rays that stay together.
constexpr TraceTuning kIncoherentTuning = {28, 16, 8};
constexpr TraceTuning kCoherentTuning = {1, 1, 1};

constexpr uint32_t kTraceBlock = 128;
/// Resident blocks per multiprocessor that kernels are compiled for: 64 registers per thread.
constexpr uint32_t kTraceBlocksPerSm = 8;

namespace detail {

/// Where a ray is in a CWBVH: nodes to visit, and up to two groups of primitives to test. The stack is an array of its
/// own, so that the rest can be in registers; its last entry holds the barycentrics of the nearest hit: few are found,
/// and every register counts.
template <bool AnyHit>
struct CwbvhCursor {
    using Entry = CwbvhGroup;
    static constexpr int kEntries = kCwbvhStackSize + 1;
    int top = 0;
    CwbvhGroup group = {0, 0};
    CwbvhLeaves leaves = {0, 0, 0}, later = {0, 0, 0};

    __device__ void begin(const CwbvhTracer&, Entry*) { group = {0, 0x80000000u}; }
    __device__ bool has_nodes() const { return (group.hits & kCwbvhInnerBits) || top > 0; }
    __device__ bool can_step() const { return later.hits == 0 && has_nodes(); }
    __device__ bool has_primitives() const { return leaves.hits != 0; }
    __device__ void step(const CwbvhTracer& tracer, Entry* stack, const CwbvhRay& ray, float tmax) {
        // Any order will do to find any hit.
        const uint32_t order = AnyHit ? 0u : ray.order;
        if (!(group.hits & kCwbvhInnerBits)) group = stack[--top];
        const uint32_t child = take_child(group, order);
        if (group.hits & kCwbvhInnerBits) stack[top++] = group;
        const CwbvhNode node = load_record(tracer.nodes + child);
        const uint32_t hits = child_hits(node, ray, tmax);
        group = inner_hits(node, hits, order);
        if (leaves.hits)
            later = leaf_hits(node, hits);
        else
            leaves = leaf_hits(node, hits);
    }
    __device__ uint32_t take() { return take_primitive(leaves); }
    __device__ void after_primitive(Entry*) {
        if (leaves.hits) return;
        leaves = later;
        later.hits = 0;
    }
    __device__ void end() {
        group.hits = leaves.hits = later.hits = 0;
        top = 0;
    }
    static __device__ void keep(Entry* stack, float u, float v) {
        stack[kCwbvhStackSize] = {float_bits(u), float_bits(v)};
    }
    static __device__ Hit kept(const Entry* stack, float t, uint32_t prim) {
        return {t, bits_float(stack[kCwbvhStackSize].base), bits_float(stack[kCwbvhStackSize].hits), prim};
    }
};

/// The same for a binary BVH: `at` is the reference to look at next, leaves are references too, of which primitives are
/// taken from the front.
template <bool AnyHit>
struct PairCursor {
    using Entry = uint32_t;
    static constexpr int kEntries = kPairStackSize + 2;
    int top = 0;
    uint32_t at = kNone;
    uint32_t leaf = 0, later = 0;  ///< 0: none

    __device__ void begin(const PairTracer& tracer, Entry* stack) {
        at = tracer.root;
        keep_leaves(stack);
    }
    __device__ bool has_nodes() const { return at != kNone; }
    /// What is next is no leaf unless two are kept already.
    __device__ bool can_step() const { return !(at & kPairLeaf); }
    __device__ bool has_primitives() const { return leaf != 0; }
    __device__ void step(const PairTracer& tracer, Entry* stack, const CwbvhRay& ray, float tmax) {
        uint32_t second;
        pair_hits(load_record(tracer.nodes + at), ray, tmax, at, second);
        if (second != kNone) stack[top++] = second;
        if (at == kNone && top > 0) at = stack[--top];
        keep_leaves(stack);
    }
    __device__ uint32_t take() {
        const uint32_t index = (leaf & ~kPairLeaf) >> 3;
        leaf = (leaf & 7u) > 1 ? leaf + 8u - 1u : 0u;
        return index;
    }
    __device__ void after_primitive(Entry* stack) {
        if (leaf) return;
        leaf = later;
        later = 0;
        keep_leaves(stack);
    }
    __device__ void end() {
        at = kNone;
        leaf = later = 0;
        top = 0;
    }
    static __device__ void keep(Entry* stack, float u, float v) {
        stack[kPairStackSize] = float_bits(u), stack[kPairStackSize + 1] = float_bits(v);
    }
    static __device__ Hit kept(const Entry* stack, float t, uint32_t prim) {
        return {t, bits_float(stack[kPairStackSize]), bits_float(stack[kPairStackSize + 1]), prim};
    }
    __device__ void keep_leaves(const Entry* stack) {
        while (at != kNone && (at & kPairLeaf) && later == 0) {
            (leaf == 0 ? leaf : later) = at;
            at = top > 0 ? stack[--top] : kNone;
        }
    }
};

/// Binary BVHs have one level.
template <Features F, class Tracer>
constexpr bool kTwoLevels = F.instances && !std::is_same_v<Tracer, PairTracer>;

template <Features F, class Tracer, bool AnyHit>
using Walk = std::conditional_t<
    std::is_same_v<Tracer, PairTracer>, PairCursor<AnyHit>,
    std::conditional_t<kTwoLevels<F, Tracer>, InstanceCursor<CwbvhCursor<AnyHit>>, CwbvhCursor<AnyHit>>>;

/// Items that a warp has claimed and not begun.
struct WarpItems {
    uint32_t begin = 0, end = 0;

    /// The next item of each of the lanes `idle`, which may lie past the last of all, from `*counter` on if none are
    /// left: then `batch` of them, at least 32. The whole warp calls it.
    __device__ uint32_t claim(uint32_t idle, uint32_t* counter, uint32_t batch) {
        const uint32_t wanted = uint32_t(__popc(idle)), kept = end - begin, rank = lane_rank(idle);
        uint32_t fresh = begin;
        if (wanted > kept) {
            if ((threadIdx.x & 31u) == 0) fresh = atomicAdd(counter, batch);
            fresh = __shfl_sync(0xffffffffu, fresh, 0);
            end = fresh + batch;
            fresh -= kept;
        }
        const uint32_t next = (rank < kept ? begin : fresh) + rank;
        begin = fresh + wanted;
        return next;
    }
};

/// A turn of a warp: its lanes visit nodes as long as many can, then test primitives. `any_hit`: a bool, or a constant;
/// the lane's ray ends with its first hit. Lanes without a ray take part. With two levels the ray is in the coordinates
/// of the tree that the lane is in.
template <Features F, class AnyHit, class Cursor, class Tracer>
__device__ __forceinline__ void walk_together(const SceneView& scene, const Tracer& tracer, TraceTuning tuning,
                                              AnyHit any_hit, Cursor& walk, typename Cursor::Entry* stack, Ray& ray,
                                              CwbvhRay& box_ray, RayShear& shear, float& t, uint32_t& prim) {
    constexpr uint32_t kWarp = 0xffffffffu;
    uint32_t walking;
    do {
        bool walks = walk.can_step();
        if (walks) {
            if constexpr (kTwoLevels<F, Tracer>)
                walk.step(tracer, stack, ray, box_ray, shear, t, any_hit ? 0u : ~0u);
            else
                walk.step(tracer, stack, box_ray, t);
            walks = walk.can_step();
        }
        walking = uint32_t(__popc(__ballot_sync(kWarp, walks)));
    } while (walking >= tuning.walk_at);

    // All are asked anew after each round: lanes with many primitives would make the others wait.
    uint32_t waiting = uint32_t(__popc(__ballot_sync(kWarp, walk.has_primitives())));
    if (waiting >= tuning.primitives_at || waiting >= walking) {
        do {
            if (walk.has_primitives()) {
                Hit hit = {t, 0.0f, 0.0f, kNone};
                bool met;
                if constexpr (kTwoLevels<F, Tracer>)
                    met = tracer.template intersect_primitive<F>(scene, ray, shear, walk.take(), any_hit, hit,
                                                                 walk.id_offset);
                else
                    met = tracer.template intersect_primitive<F>(scene, ray, shear, walk.take(), any_hit, hit);
                if (met) {
                    t = hit.t;
                    prim = hit.prim;
                    walk.keep(stack, hit.u, hit.v);
                    if (any_hit) walk.end();
                }
                walk.after_primitive(stack);
            }
            waiting = uint32_t(__popc(__ballot_sync(kWarp, walk.has_primitives())));
        } while (waiting >= tuning.primitives_at);
    }
}

/// The loop behind trace_closest_persistent and trace_any_persistent. `finish(i, hit)` is called once per fetched ray:
/// for all that have ended when the warp fetches others, since the whole warp waits for what it loads.
template <Features F, bool AnyHit, class Tracer, class Fetch, class Finish>
__device__ void trace_persistent(const SceneView& scene, const Tracer& tracer, Fetch fetch, Finish finish,
                                 const uint32_t* count, uint32_t* next_ray, TraceTuning tuning) {
    constexpr uint32_t kWarp = 0xffffffffu;
    // Of many rays a warp takes more at a time, since all warps add to the counter, one after the other. What is
    // visible or not is known so fast that waiting for it shows earlier.
    const uint32_t ray_count = *count, per_thread = ray_count / (gridDim.x * blockDim.x),
                   batch = per_thread >= 32             ? 128
                           : AnyHit && per_thread >= 16 ? 64
                                                        : 32;
    Walk<F, Tracer, AnyHit> walk;
    typename Walk<F, Tracer, AnyHit>::Entry stack[Walk<F, Tracer, AnyHit>::kEntries];
    Ray ray = {};
    CwbvhRay box_ray = {};
    RayShear shear = {};
    float t = 0.0f;
    uint32_t prim = kNone;
    uint32_t index = kNone;  // of the ray; kNone while idle
    bool drained = false;
    WarpItems rays;

    for (;;) {
        const bool done = !walk.has_primitives() && !walk.has_nodes();  // or never begun
        const uint32_t idle = __ballot_sync(kWarp, done);
        if (uint32_t(__popc(idle)) > 32u - tuning.refill_below && (!drained || idle == kWarp)) {
            if (done && index != kNone) {
                finish(index, prim == kNone ? Hit{t, 0.0f, 0.0f, kNone} : walk.kept(stack, t, prim));
                index = kNone;
            }
            if (drained) return;
            const uint32_t next = rays.claim(idle, next_ray, batch);
            drained = rays.begin >= ray_count;
            if (done && next < ray_count && fetch(next, ray)) {
                if (is_traceable(ray)) {
                    index = next;
                    t = ray.tmax;
                    prim = kNone;
                    box_ray = make_cwbvh_ray(ray.o, ray.d);
                    shear = make_ray_shear(ray.d);
                    walk.begin(tracer, stack);
                } else {
                    finish(next, Hit{ray.tmax, 0.0f, 0.0f, kNone});
                }
            }
        }

        walk_together<F>(scene, tracer, tuning, std::bool_constant<AnyHit>(), walk, stack, ray, box_ray, shear, t,
                         prim);
    }
}

}  // namespace detail

/// Nearest hits of *count rays. Call it from all threads of the grid; blocks are of whole warps. fetch(i, ray) loads
/// ray i and returns false to leave it out; emit(i, hit) is called for every other ray, hit or not (hit.prim == kNone).
/// *next_ray_counter must be 0 when the kernel starts. Both counts live on the device, so no host round trip is needed
/// between the stage that makes rays and this one.
template <Features F, class Tracer, class Fetch, class Emit>
__device__ void trace_closest_persistent(const SceneView& scene, const Tracer& tracer, Fetch fetch, Emit emit,
                                         const uint32_t* count, uint32_t* next_ray_counter,
                                         TraceTuning tuning = kIncoherentTuning) {
    detail::trace_persistent<F, false>(scene, tracer, fetch, emit, count, next_ray_counter, tuning);
}

/// Whether anything blocks each of *count rays; emit(i, blocked). The rest is as for trace_closest_persistent.
template <Features F, class Tracer, class Fetch, class Emit>
__device__ void trace_any_persistent(const SceneView& scene, const Tracer& tracer, Fetch fetch, Emit emit,
                                     const uint32_t* count, uint32_t* next_ray_counter,
                                     TraceTuning tuning = kIncoherentTuning) {
    detail::trace_persistent<F, true>(
        scene, tracer, fetch, [&](uint32_t i, const Hit& hit) { emit(i, hit.prim != kNone); }, count, next_ray_counter,
        tuning);
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

/// Nearest hits of an array of rays; `Set` is a FeatureSet. Launch with persistent_grid() blocks of kTraceBlock threads
/// and *next_ray_counter == 0.
template <class Set, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_closest_kernel(const __grid_constant__ SceneView scene, const Tracer tracer, const Ray* rays, Hit* hits,
                         const uint32_t* count, uint32_t* next_ray_counter, const TraceTuning tuning) {
    trace_closest_persistent<Set::value>(
        scene, tracer,
        [=](uint32_t i, Ray& ray) {
            ray = load_ray(rays, i);
            return true;
        },
        [=](uint32_t i, const Hit& hit) { store_hit(hits, i, hit); }, count, next_ray_counter, tuning);
}

/// Any hit: 1 where a ray is blocked, else 0. Launch as trace_closest_kernel.
template <class Set, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_any_kernel(const __grid_constant__ SceneView scene, const Tracer tracer, const Ray* rays, uint8_t* blocked,
                     const uint32_t* count, uint32_t* next_ray_counter, const TraceTuning tuning) {
    trace_any_persistent<Set::value>(
        scene, tracer,
        [=](uint32_t i, Ray& ray) {
            ray = load_ray(rays, i);
            return true;
        },
        [=](uint32_t i, bool hit) { blocked[i] = hit; }, count, next_ray_counter, tuning);
}

/// The same answers, one thread per ray and the loop of the host: the yardstick for the kernels above.
template <class Set, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_closest_plain_kernel(const __grid_constant__ SceneView scene, const Tracer tracer, const Ray* rays, Hit* hits,
                               uint32_t count) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= count) return;
    Hit hit;
    tracer.template closest<Set::value>(scene, load_ray(rays, i), hit);
    store_hit(hits, i, hit);
}

template <class Set, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    trace_any_plain_kernel(const __grid_constant__ SceneView scene, const Tracer tracer, const Ray* rays,
                           uint8_t* blocked, uint32_t count) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < count) blocked[i] = tracer.template occluded<Set::value>(scene, load_ray(rays, i));
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
