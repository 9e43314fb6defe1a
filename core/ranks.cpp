#include "core/ranks.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "core/error.h"

namespace ambilux {
namespace {

std::unique_ptr<Ranks>& installed_ranks() {
    static std::unique_ptr<Ranks> installed = std::make_unique<Ranks>();
    return installed;
}

}  // namespace

void Ranks::send(int, int, const std::string&, std::span<const std::span<const double>>) {
    throw Error(ExitCode::device, "there is no other rank");
}
std::optional<RankMessage> Ranks::poll(Arrays*) { return std::nullopt; }
void Ranks::abort(int) {}

Ranks& ranks() { return *installed_ranks(); }
void set_ranks(std::unique_ptr<Ranks> installed) { installed_ranks() = std::move(installed); }

int launched_ranks() {
    // Open MPI's mpirun; MPICH's and Slurm's interfaces.
    for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
        if (const char* size = std::getenv(name)) return std::max(1, std::atoi(size));
    // Slurm sets the number of tasks for whatever it starts; only srun --mpi=pmix says that they belong together.
    if (std::getenv("PMIX_RANK"))
        if (const char* size = std::getenv("SLURM_NTASKS")) return std::max(1, std::atoi(size));
    return 1;
}

std::string host_name() {
    std::array<char, 256> name{};
    if (::gethostname(name.data(), name.size() - 1) != 0) return "unknown";
    return name.data();
}

}  // namespace ambilux
