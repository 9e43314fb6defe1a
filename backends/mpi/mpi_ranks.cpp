#include "backends/mpi/mpi_ranks.h"

#include <mpi.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "core/ranks.h"

namespace ambilux {
namespace {

/// A message is its head and its bytes, in pieces that an int can count.
constexpr int kHead = 1, kPiece = 2;
constexpr uint64_t kPieceBytes = 1u << 30;

/// Called by the main thread only.
class MpiRanks final : public Ranks {
public:
    MpiRanks() {
        int provided = 0;
        MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
        MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
        MPI_Comm_size(MPI_COMM_WORLD, &size_);
        MPI_Comm host;
        MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &host);
        MPI_Comm_rank(host, &local_rank_);
        MPI_Comm_size(host, &local_size_);
        const int own = int(::getpid());
        local_peers_.resize(size_t(local_size_));
        MPI_Allgather(&own, 1, MPI_INT, local_peers_.data(), 1, MPI_INT, host);
        std::erase(local_peers_, own);
        MPI_Comm_free(&host);
    }
    int rank() const override { return rank_; }
    int size() const override { return size_; }
    int local_rank() const override { return local_rank_; }
    int local_size() const override { return local_size_; }
    std::vector<int> local_peers() const override { return local_peers_; }
    bool launched() const override { return true; }

    void send(int to, int kind, const std::string& bytes) override {
        const uint64_t head[2] = {uint64_t(kind), bytes.size()};
        MPI_Send(head, 2, MPI_UINT64_T, to, kHead, MPI_COMM_WORLD);
        for (uint64_t at = 0; at < bytes.size(); at += kPieceBytes)
            MPI_Send(bytes.data() + at, int(std::min(kPieceBytes, bytes.size() - at)), MPI_BYTE, to, kPiece,
                     MPI_COMM_WORLD);
    }
    std::optional<RankMessage> poll() override {
        int there = 0;
        MPI_Status status;
        MPI_Iprobe(MPI_ANY_SOURCE, kHead, MPI_COMM_WORLD, &there, &status);
        if (!there) return std::nullopt;
        uint64_t head[2];
        const int from = status.MPI_SOURCE;
        MPI_Recv(head, 2, MPI_UINT64_T, from, kHead, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        RankMessage message = {from, int(head[0]), std::string(head[1], '\0')};
        for (uint64_t at = 0; at < head[1]; at += kPieceBytes)
            MPI_Recv(message.bytes.data() + at, int(std::min(kPieceBytes, head[1] - at)), MPI_BYTE, from, kPiece,
                     MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        return message;
    }
    void abort(int code) override { MPI_Abort(MPI_COMM_WORLD, code); }

private:
    int rank_ = 0, size_ = 1, local_rank_ = 0, local_size_ = 1;
    std::vector<int> local_peers_;
};

}  // namespace

void join_mpi() {
    const bool launched = std::getenv("OMPI_COMM_WORLD_SIZE") || std::getenv("PMI_SIZE") || std::getenv("PMIX_RANK");
    if (launched) set_ranks(std::make_unique<MpiRanks>());
}

void leave_mpi() {
    if (!ranks().launched()) return;
    set_ranks(std::make_unique<Ranks>());
    MPI_Finalize();
}

}  // namespace ambilux
