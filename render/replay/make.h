// Replays by variant.
#pragma once

#include "accel/host_tracer.h"
#include "integrators/registry.h"
#include "render/replay/replay.h"

namespace ambilux {

/// "path, light and bdpt"
std::string listed(std::vector<std::string> names);

struct BidirectionalMis;
struct MergingMis;
template <class Base>
struct GuidedMis;
struct GuidePolicy;
template <class Mis>
struct BdptPolicyOf;
template <class Mis>
struct VcmPolicyOf;

std::unique_ptr<Replay> make_bdpt_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
                                         const BdptPolicyOf<BidirectionalMis>& policy, ReplayPairing pairing);
std::unique_ptr<Replay> make_guided_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer,
                                           const BdptPolicyOf<GuidedMis<BidirectionalMis>>& policy,
                                           const GuidePolicy& guide);
std::unique_ptr<Replay> make_merging_replay(const Scene& scene, const RenderSettings& settings,
                                            const HostTracer& tracer, const VcmPolicyOf<MergingMis>& policy);

using MakeReplay = std::unique_ptr<Replay> (*)(const Scene&, const RenderSettings&, const HostTracer&);
/// Null: there is no replay of it.
MakeReplay replay_of(const Variant& variant);

}  // namespace ambilux
