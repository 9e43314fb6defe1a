// What an experiment would do, without doing it.
#pragma once

#include <string>

#include "experiments/runner.h"
#include "session/hooks.h"

namespace ambilux {

/// The plan of an experiment as text: scenes, runs, seeds, checkpoints, references that are cached, to extend or to
/// make, and an estimate of time, memory and disk space. What a run would refuse is refused. Writes no file. Times come
/// from budgets in seconds, and for samples from a pilot of about a quarter of a second per scene and run on this
/// machine. `request.output` may be empty, or a folder that holds a part of the experiment. Throws Error.
std::string describe_plan(const ExperimentRequest& request, const Hooks& hooks);

}  // namespace ambilux
