#include "render/replay/outliers.h"

#include <algorithm>
#include <mutex>
#include <tuple>

#include "core/flag.h"
#include "core/parallel.h"

namespace ambilux {
namespace {

/// Records of one sample, gathered by many threads.
struct InvalidSearch {
    const Replay& replay;
    uint32_t sample, width;
    std::mutex mutex;
    std::vector<InvalidRecord> found;

    void add(InvalidRecord r) {
        const std::lock_guard<std::mutex> lock(mutex);
        found.push_back(std::move(r));
    }
    void eye_subpath(uint32_t pixel) {
        const uint32_t x = pixel % width, y = pixel / width;
        const ReplaySample s = replay.sample({x, y, sample, {}, false, false});
        for (const ReplayCandidate& c : s.candidates)
            if (c.fate == ReplayFate::invalid) add({c.drop, sample, x, y, kNone, c});
        for (const ReplayDrop& d : {s.eye.drop, s.drop})
            if (d.happened()) add({d, sample, x, y, kNone, {}});
    }
    void light_subpath(uint32_t number) {
        if (!replay.has_light_subpath(number)) return;
        std::vector<ReplayCandidate> splats;
        const ReplaySubpath s = replay.light_subpath(number, sample, false, splats);
        for (const ReplayCandidate& c : splats)
            if (c.fate == ReplayFate::invalid) add({c.drop, sample, 0, 0, number, c});
        if (s.drop.happened()) add({s.drop, sample, 0, 0, number, {}});
    }
};

bool before(const InvalidRecord& a, const InvalidRecord& b) {
    // Those of one search are of eye subpaths alone, which have none, or of light subpaths alone.
    return std::tie(a.light_subpath, a.y, a.x) < std::tie(b.light_subpath, b.y, b.x);
}

/// What was found, and when that is enough.
struct InvalidList {
    uint32_t per_stage;
    std::vector<InvalidRecord> kept;
    std::map<std::string, uint32_t> of_stage;

    /// Of samples that dropped `wanted`; `earlier`: of_stage when their search began.
    bool has_enough(const std::map<std::string, InvalidCounts>& wanted, std::map<std::string, uint32_t> earlier = {}) {
        return std::all_of(wanted.begin(), wanted.end(), [&](const auto& stage) {
            const uint32_t found = of_stage[stage.first];
            return found >= per_stage || found - earlier[stage.first] >= stage.second.total();
        });
    }
    void add(std::vector<InvalidRecord>& found) {
        std::stable_sort(found.begin(), found.end(), before);
        for (InvalidRecord& r : found)
            if (of_stage[r.drop.stage]++ < per_stage) kept.push_back(std::move(r));
        found.clear();
    }
};

/// Looks through one sample of `batch`, eye subpaths and light subpaths in turns, until there is enough of each stage
/// that dropped something in it.
void search_sample(const InvalidBatch& batch, uint32_t sample, const Replay& replay, const Scene& scene,
                   InvalidList& list, const volatile bool* interrupt) {
    constexpr uint32_t kTogether = 1u << 15, kOfTask = 64;
    const uint32_t width = scene.sensor.crop_width;
    const uint64_t pixels = uint64_t(width) * scene.sensor.crop_height;
    const uint32_t eyes = uint32_t(std::min<uint64_t>(pixels, kMostInvalidSubpaths));
    const uint32_t lights = std::min(replay.light_subpaths(), kMostInvalidSubpaths);
    const std::map<std::string, uint32_t> earlier = list.of_stage;
    InvalidSearch search{replay, sample, width, {}, {}};
    const auto share = [&](uint32_t first, uint32_t all, auto look) {
        if (first < all) parallel_for(std::min(kTogether, all - first), [&](uint32_t i) { look(first + i); }, kOfTask);
        list.add(search.found);
    };
    for (uint32_t first = 0; first < std::max(eyes, lights) && !is_set(interrupt); first += kTogether) {
        share(first, eyes, [&](uint32_t pixel) { search.eye_subpath(pixel); });
        if (list.has_enough(batch.by_stage, earlier)) return;
        share(first, lights, [&](uint32_t number) { search.light_subpath(number); });
        if (list.has_enough(batch.by_stage, earlier)) return;
    }
}

}  // namespace

std::vector<Outlier> find_outliers(const SampleWatch& watch, const Replay& replay, uint32_t count) {
    std::vector<Outlier> outliers;
    for (const WatchedPixel& pixel : watch.worst(count)) {
        const ReplaySample s = replay.sample({pixel.x, pixel.y, pixel.sample, {}, true, false});
        Outlier o;
        o.pixel = pixel;
        o.complete = s.complete;
        std::copy(std::begin(s.total), std::end(s.total), o.replayed);
        for (const auto* all : {&s.candidates, &s.splats})
            for (const ReplayCandidate& c : *all)
                if (c.fate == ReplayFate::arrived && (o.largest.fate != ReplayFate::arrived ||
                                                      largest(c.contribution) > largest(o.largest.contribution)))
                    o.largest = c;
        outliers.push_back(std::move(o));
    }
    return outliers;
}

FoundInvalid find_invalid(InvalidWatch& watch, const Replay& replay, const Scene& scene, uint32_t per_stage,
                          const volatile bool* interrupt) {
    InvalidList list{per_stage, {}, {}};
    const std::map<std::string, InvalidCounts> all = watch.by_stage();
    std::vector<uint32_t> searched;
    for (const InvalidBatch& batch : watch.batches())
        for (const InvalidBatch& sample : watch.samples(batch, kMostInvalidSamples - searched.size(), interrupt)) {
            if (searched.size() == kMostInvalidSamples || list.has_enough(all) || is_set(interrupt))
                return {std::move(list.kept), std::move(searched)};
            searched.push_back(sample.first);
            for (uint32_t k = 0; k < sample.count; ++k)
                search_sample(sample, sample.first + k, replay, scene, list, interrupt);
        }
    return {std::move(list.kept), std::move(searched)};
}

}  // namespace ambilux
