// How the kernels of stages are compiled: blocks of kStageBlock threads that are to be resident on a multiprocessor, so
// many registers less for a thread, measured on an H200 (docs/performance.md).
#pragma once

#include "models/features.h"

namespace ambilux {

// Declared alone: what they include would make every launch depend on all BSDFs.
template <Features F, class Mis, class EmissionOut, class AtVertex>
struct EyeVertex;
template <Features F, class Mis, class AtVertex>
struct LightVertex;
template <class Mis>
struct LightVertexSource;
template <Features F, class Out, class Source>
struct ConnectVertices;
template <Features F, class Tracer, class Shadows, class Source>
struct ConnectAndOcclude;
template <Features F, class Mis, class EmissionOut>
struct StreamEyeVertex;
template <Features F, class Mis>
struct StreamLightVertex;
template <Features F, class Mis, class Out>
struct StreamConnect;

constexpr uint32_t kStageBlock = 128;
/// The megakernel has one block on each multiprocessor, whose threads go through its parts together.
constexpr uint32_t kPathBlock = 512;

/// 1 leaves registers to the compiler. kGathers: hits are in no order, and misses of no use.
template <class Stage>
struct LaunchTraits {
    static constexpr uint32_t kBlocksPerSm = 1;
    static constexpr bool kGathers = false;
};

template <uint32_t kBlocks, bool kGathersHits = false>
struct BlocksPerSm {
    static constexpr uint32_t kBlocksPerSm = kBlocks;
    static constexpr bool kGathers = kGathersHits;
};

constexpr bool is_diffuse(Features f) { return f.bsdfs == bit(BsdfType::diffuse); }
constexpr bool needs_no_misses(Features f) { return !f.several_bsdfs() && !f.has_environment(); }

/// Of an eye vertex.
constexpr uint32_t eye_blocks(Features f, bool bidirectional) {
    return (is_diffuse(f) ? 5 : 4) + (!bidirectional && (is_diffuse(f) || !f.textures));
}

template <Features F, class Mis, class EmissionOut, class AtVertex>
struct LaunchTraits<EyeVertex<F, Mis, EmissionOut, AtVertex>>
    : BlocksPerSm<eye_blocks(F, Mis::kBidirectional), needs_no_misses(F)> {};
template <Features F, class Mis, class AtVertex>
struct LaunchTraits<LightVertex<F, Mis, AtVertex>> : BlocksPerSm<is_diffuse(F) ? 5 : 4> {};
template <Features F, class Out, class Mis>
struct LaunchTraits<ConnectVertices<F, Out, LightVertexSource<Mis>>> : BlocksPerSm<is_diffuse(F) ? 7 : 4> {};
template <Features F, class Tracer, class Shadows, class Source>
struct LaunchTraits<ConnectAndOcclude<F, Tracer, Shadows, Source>> : BlocksPerSm<8> {};
template <Features F, class Mis, class EmissionOut>
struct LaunchTraits<StreamEyeVertex<F, Mis, EmissionOut>> : BlocksPerSm<is_diffuse(F) ? 5 : 4> {};
template <Features F, class Mis>
struct LaunchTraits<StreamLightVertex<F, Mis>> : BlocksPerSm<is_diffuse(F) ? 5 : 4> {};
template <Features F, class Mis, class Out>
struct LaunchTraits<StreamConnect<F, Mis, Out>> : BlocksPerSm<is_diffuse(F) ? 7 : 4> {};

}  // namespace ambilux
