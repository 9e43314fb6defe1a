// The processes that a launcher started together, such as `mpirun -n 4 ambilux ...`.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace ambilux {

using Arrays = std::vector<std::vector<double>>;

struct RankMessage {
    int from = 0, kind = 0;
    std::string bytes;
    Arrays arrays;
};

/// This one by itself, where nothing else is installed (backends/mpi/).
class Ranks {
public:
    virtual ~Ranks() = default;
    virtual int rank() const { return 0; }
    virtual int size() const { return 1; }
    /// Among those on the same host.
    virtual int local_rank() const { return 0; }
    virtual int local_size() const { return 1; }
    /// Process numbers of the others on the same host.
    virtual std::vector<int> local_peers() const { return {}; }
    /// True if a launcher started this process, be it alone.
    virtual bool launched() const { return false; }
    /// Returns once `bytes` and `arrays` may be changed. Meanwhile messages are received, for poll(): two ranks may
    /// send to each other.
    virtual void send(int to, int kind, const std::string& bytes, std::span<const std::span<const double>> arrays = {});
    /// A message that has come; those of one rank come in their order. Its arrays lie in memory of `memory` as far as
    /// that goes: memory that was not touched before costs several times what receiving does.
    virtual std::optional<RankMessage> poll(Arrays* memory = nullptr);
    /// Ends all ranks at once. Without others, returns.
    virtual void abort(int code);
};

Ranks& ranks();
void set_ranks(std::unique_ptr<Ranks> installed);

/// Processes that a launcher says it started, from the environment; 1 without one.
int launched_ranks();

std::string host_name();

}  // namespace ambilux
