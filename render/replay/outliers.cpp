#include "render/replay/outliers.h"

#include <algorithm>
#include <mutex>

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
        r.sample = sample;
        const std::lock_guard<std::mutex> lock(mutex);
        found.push_back(std::move(r));
    }
    void eye_subpath(uint32_t pixel) {
        const uint32_t x = pixel % width, y = pixel / width;
        const ReplaySample s = replay.sample({x, y, sample, {}, false, false});
        for (const ReplayCandidate& c : s.candidates)
            if (c.fate == ReplayFate::invalid) add({c.dropped_by, sample, x, y, kNone, c});
        if (!s.eye.dropped_by.empty()) add({s.eye.dropped_by, sample, x, y, kNone, {}});
    }
    void light_subpath(uint32_t number) {
        if (!replay.has_light_subpath(number)) return;
        std::vector<ReplayCandidate> splats;
        const ReplaySubpath s = replay.light_subpath(number, sample, false, splats);
        for (const ReplayCandidate& c : splats)
            if (c.fate == ReplayFate::invalid) add({c.dropped_by, sample, 0, 0, number, c});
        if (!s.dropped_by.empty()) add({s.dropped_by, sample, 0, 0, number, {}});
    }
};

bool before(const InvalidRecord& a, const InvalidRecord& b) {
    if (a.light_subpath != b.light_subpath) return a.light_subpath > b.light_subpath;  // eye subpaths first
    return a.y != b.y ? a.y < b.y : a.x < b.x;
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

std::vector<InvalidRecord> find_invalid(const SampleWatch& watch, const Replay& replay, const Scene& scene,
                                        uint32_t per_stage) {
    const uint32_t width = scene.sensor.crop_width;
    const uint64_t pixels = uint64_t(width) * scene.sensor.crop_height;
    std::vector<InvalidRecord> kept;
    std::map<std::string, uint32_t> of_stage;
    for (const WatchedInvalid& w : watch.invalid()) {
        InvalidSearch search{replay, w.sample, width, {}, {}};
        parallel_for(
            uint32_t(std::min<uint64_t>(pixels, kMostInvalidSubpaths)),
            [&](uint32_t pixel) { search.eye_subpath(pixel); }, 64u);
        parallel_for(
            std::min(replay.light_subpaths(), kMostInvalidSubpaths),
            [&](uint32_t number) { search.light_subpath(number); }, 64u);
        std::stable_sort(search.found.begin(), search.found.end(), before);
        for (InvalidRecord& r : search.found)
            if (of_stage[r.stage]++ < per_stage) kept.push_back(std::move(r));
        const bool enough = std::all_of(w.by_stage.begin(), w.by_stage.end(),
                                        [&](const auto& stage) { return of_stage[stage.first] >= per_stage; });
        if (enough) break;
    }
    return kept;
}

}  // namespace ambilux
