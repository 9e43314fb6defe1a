// Where a render and its replay part: the light of paths of one segment, of two and so on, by both.
#pragma once

#include <functional>

#include "film/moments.h"
#include "render/replay/replay.h"

namespace ambilux {

/// What paths of this many segments brought to a sample or, where those of an iteration share light subpaths, to all
/// of the iteration.
struct LengthComparison {
    uint32_t segments = 0;
    bool or_more = false;
    double rendered[3] = {}, replayed[3] = {};

    bool differs = false;  ///< by more than roundings of values do
};

/// The film of one sample of a render with these settings, or of its iteration.
using FilmOf = std::function<FilmMoments(const RenderSettings& settings, uint32_t sample)>;
FilmMoments rendered_film(const Scene& scene, const RenderSettings& settings, uint32_t sample);

/// Renders the sample and replays it for each max_depth up to that of `settings` or, if that is less, one segment more
/// than the longest path that the replay finds. If there may be longer ones, the last entry is of all of them.
/// Throws Error(usage) where replays are not complete (ReplaySample::complete).
std::vector<LengthComparison> compare_by_length(const Scene& scene, RenderSettings settings,
                                                const ReplayRequest& request, SharedAccels& accels, const FilmOf& film);

/// A table, and a sentence on where they part.
std::string by_length_text(const std::vector<LengthComparison>& lengths);

}  // namespace ambilux
