#include "session/replays.h"

#include <fmt/format.h>

#include "core/error.h"
#include "render/replay/print.h"
#include "session/statistics.h"

namespace ambilux {

std::unique_ptr<SampleWatch> watch_samples(std::unique_ptr<Renderer> renderer, const RenderSettings& settings,
                                           const std::string& prefix) {
    check_replay(used_settings(settings, renderer->stats()));
    if (const uint32_t together = renderer->iteration_samples(); together > 1)
        throw Error(
            ExitCode::usage,
            fmt::format("{}outliers: this render adds {} samples of a pixel to the film at once; single ones are "
                        "seen with merge_samples=1 or guide_samples=1",
                        prefix, together));
    return std::make_unique<SampleWatch>(std::move(renderer));
}

nlohmann::json contribution_json(const ReplayCandidate& c) {
    if (c.fate != ReplayFate::arrived && c.fate != ReplayFate::invalid) return nullptr;
    if (c.kind[0] == '\0') return nullptr;
    return {{"kind", c.kind},
            {"strategy", strategy_text({c.strategy, c.merged})},
            {"eye_depth", c.eye_depth},
            {"light_depth", c.light_depth},
            {"light_subpath", c.light_subpath == kNone ? nlohmann::json(nullptr) : nlohmann::json(c.light_subpath)},
            {"contribution", {c.contribution.x, c.contribution.y, c.contribution.z}}};
}

nlohmann::json outlier_json(const Outlier& o) {
    const WatchedPixel& p = o.pixel;
    return {{"pixel", {p.x, p.y}},
            {"sample", p.sample},
            {"value", p.value},
            {"excess", p.excess},
            {"replayed", o.replayed},
            {"complete", o.complete},
            {"largest", contribution_json(o.largest)}};
}

nlohmann::json by_length_json(const std::vector<LengthComparison>& lengths) {
    nlohmann::json list = nlohmann::json::array();
    for (const LengthComparison& c : lengths)
        list.push_back({{"segments", c.segments},
                        {"or_more", c.or_more},
                        {"rendered", c.rendered},
                        {"replayed", c.replayed},
                        {"differs", c.differs}});
    return list;
}

}  // namespace ambilux
