// Runs of other renderers in an experiment: who takes part, and why not the others.
#pragma once

#include <map>

#include "experiments/peers/agreement.h"
#include "experiments/run_maker.h"
#include "experiments/runner.h"

namespace ambilux {

/// Keeps peers.json of the experiment's folder: for each scene and run of a peer its state, "agrees", "differs",
/// "undecided" (too few samples to tell), "untested" (images made elsewhere), "missing" (not installed) or "refused",
/// with the reason, what the conversion changed, in what it differs, times to load and to compile, and the agreement.
/// Only what agrees, or cannot be tested, is timed.
class PeerRuns : public RunMaker {
public:
    /// With what an earlier part found. Reasons of absence are forgotten: it may be there now.
    PeerRuns(const ExperimentRequest& request, const ExperimentConfig& config);

    /// Finds the state of a run on a scene unless it is known; false if interrupted.
    bool examine(const RenderOf& render, const Reference& reference);
    /// That it is to be rendered.
    bool agrees(const LoadedEntry& scene, const RunEntry& run) const;

    /// A render of it ended before its time, such as for want of an image: said with the results.
    void lose(const LoadedEntry& scene, const RunEntry& run, uint64_t seed, const std::string& reason);
    /// The same render is there now.
    void found_again(const LoadedEntry& scene, const RunEntry& run, uint64_t seed);

    std::unique_ptr<Renderer> make(const RenderOf& render, const RenderStats& earlier) override;
    MethodNames names(const RenderOf& render, const RenderStats& stats) const override;
    nlohmann::json statistics(const RenderOf& render, const RenderStats& stats) const override;
    Attributes attributes(const RenderOf& render, const RenderStats& stats) const override;

private:
    std::unique_ptr<PeerRenderer> start(const RenderOf& render) const;
    nlohmann::json find_state(const RenderOf& render, const Reference& reference) const;
    const nlohmann::json* find(const LoadedEntry& scene, const RunEntry& run) const;
    nlohmann::json* entry_of(const LoadedEntry& scene, const RunEntry& run);
    void write() const;

    const ExperimentRequest& request_;  ///< its `interrupt` is set when all is prepared
    const ExperimentConfig& config_;
    nlohmann::json found_ = nlohmann::json::array();
};

}  // namespace ambilux
