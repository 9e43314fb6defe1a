// An experiment over several ranks: the first one deals out references and renders, and holds the folder.
#pragma once

#include <deque>

#include "experiments/experiment_folder.h"
#include "experiments/runner.h"

namespace ambilux {

struct ExperimentTask {
    bool reference = false;  ///< that of a scene; else a render
    size_t scene = 0, run = 0;
    uint64_t seed = 0;
};

/// For tables of ranks other than the first.
ResultTable::Tell tell_first_rank(const std::string& table);

/// Of the first rank. It renders too: what others say is heard between its batches, where no clock of a render runs.
class TaskDealer {
public:
    explicit TaskDealer(ExperimentFolder& folder) : folder_(folder) {}

    /// Waits until the others have loaded the same experiment, and says in the manifest who they are. Throws
    /// Error(usage) where ranks share a device or a core though times are compared.
    void greet(const Prepared& prepared, const ExperimentRequest& request, ExperimentFolder& folder);

    /// That ranks share devices or cores: they slow each other down.
    bool has_shares() const { return !shared_.empty(); }

    /// `work(task, here)`: does a task here and returns false if it was interrupted; or, not `here`, whether it is to
    /// be sent to another rank. Returns when all are done; false if interrupted.
    bool deal(const std::vector<ExperimentTask>& tasks,
              const std::function<bool(const ExperimentTask&, bool here)>& work);

    /// Hears what has come, and gives those who wait something to do.
    void listen();
    /// Lets the others end.
    void stop();
    /// After an interrupt: until the others have saved what they have, some seconds at most.
    void wait_for_others();

private:
    bool hear_one();
    void feed();

    ExperimentFolder& folder_;
    const volatile bool* interrupt_ = nullptr;
    std::deque<ExperimentTask> open_;
    std::function<bool(const ExperimentTask&, bool)> work_;
    std::vector<int> idle_;  ///< ranks
    int busy_ = 0, gone_ = 0;
    std::string shared_;
    nlohmann::json greetings_ = nlohmann::json::array();
};

/// Of the other ranks: `work` returns false if it was interrupted.
void serve_tasks(const Prepared& prepared, const ExperimentRequest& request,
                 const std::function<bool(const ExperimentTask&)>& work);

}  // namespace ambilux
