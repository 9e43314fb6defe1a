// What was behind the largest samples of a render, and behind values that stages dropped.
#pragma once

#include "render/invalid_watch.h"
#include "render/replay/replay.h"
#include "render/sample_watch.h"

namespace ambilux {

/// The largest sample of a pixel and what a replay says of it.
struct Outlier {
    WatchedPixel pixel;
    double replayed[3] = {};  ///< the sample as the replay has it: on CUDA compilers round differently, and paths part
    bool complete = true;     ///< ReplaySample::complete
    ReplayCandidate largest;  ///< contribution of the replay; of fate zero if it found none
};
std::vector<Outlier> find_outliers(const SampleWatch& watch, const Replay& replay, uint32_t count);

/// A value that a stage dropped.
struct InvalidRecord {
    ReplayDrop drop;
    uint32_t sample = 0, x = 0, y = 0;  ///< of an eye subpath
    uint32_t light_subpath = kNone;     ///< of a light subpath, which has no pixel
    ReplayCandidate candidate;          ///< without a kind where it was the throughput or a ray of a subpath
};

/// Values are sought in this many samples, the first that have some, and in each of them among this many eye subpaths
/// and as many light subpaths.
constexpr size_t kMostInvalidSamples = 4;
constexpr uint32_t kMostInvalidSubpaths = 1u << 22;

struct FoundInvalid {
    std::vector<InvalidRecord> found;
    std::vector<uint32_t> samples;  ///< that were searched
};

/// The first `per_stage` of every stage, by replaying samples that `watch` remembers. Fewer than there were if on CUDA
/// a path was another one. The film of `watch` is of no use any more.
FoundInvalid find_invalid(InvalidWatch& watch, const Replay& replay, const Scene& scene, uint32_t per_stage,
                          const volatile bool* interrupt = nullptr);

}  // namespace ambilux
