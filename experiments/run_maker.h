// Who renders a run: this program, or another one (experiments/peers). The runner asks no further.
#pragma once

#include <nlohmann/json.hpp>

#include "experiments/prepare.h"
#include "film/exr_io.h"
#include "session/hooks.h"

namespace ambilux {

/// One render: of which scene, by which run.
struct RenderOf {
    const LoadedEntry& scene;
    const RunEntry& run;
    const RenderSettings& settings;  ///< as asked for, seed included
};

/// What the table of results calls it.
struct MethodNames {
    std::string integrator, variant, estimator, method, bias;
};

class RunMaker {
public:
    virtual ~RunMaker() = default;
    /// `earlier`: what a part before an interruption said.
    virtual std::unique_ptr<Renderer> make(const RenderOf& render, const RenderStats& earlier) = 0;
    virtual MethodNames names(const RenderOf& render, const RenderStats& stats) const = 0;
    virtual nlohmann::json statistics(const RenderOf& render, const RenderStats& stats) const = 0;
    virtual Attributes attributes(const RenderOf& render, const RenderStats& stats) const = 0;
};

/// Runs of this program.
class OwnRuns : public RunMaker {
public:
    OwnRuns(const ExperimentConfig& config, const Hooks& hooks) : config_(config), hooks_(hooks) {}
    std::unique_ptr<Renderer> make(const RenderOf& render, const RenderStats& earlier) override;
    MethodNames names(const RenderOf& render, const RenderStats& stats) const override;
    nlohmann::json statistics(const RenderOf& render, const RenderStats& stats) const override;
    Attributes attributes(const RenderOf& render, const RenderStats& stats) const override;

private:
    const ExperimentConfig& config_;
    const Hooks& hooks_;
};

}  // namespace ambilux
