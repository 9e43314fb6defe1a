#include "backends/mpi/mpi_ranks.h"

#include <mpi.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <deque>

#include "core/error.h"
#include "core/ranks.h"

namespace ambilux {
namespace {

/// A message is its head (kind, bytes of the text, bytes of each array), its text and its arrays, in pieces that an int
/// can count.
constexpr int kHead = 1, kPiece = 2;
constexpr size_t kMostArrays = 2, kHeadValues = 2 + kMostArrays;
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

    void send(int to, int kind, const std::string& bytes, std::span<const std::span<const double>> arrays) override {
        if (arrays.size() > kMostArrays) throw Error(ExitCode::device, "a message has too many arrays");
        std::array<uint64_t, kHeadValues> head = {uint64_t(kind), bytes.size()};
        for (size_t i = 0; i < arrays.size(); ++i) head[2 + i] = arrays[i].size_bytes();
        std::vector<MPI_Request> open;
        const auto begin = [&](const void* from, uint64_t size, int tag) {
            for (uint64_t at = 0; at < size; at += kPieceBytes)
                MPI_Isend(static_cast<const char*>(from) + at, int(std::min(kPieceBytes, size - at)), MPI_BYTE, to, tag,
                          MPI_COMM_WORLD, &open.emplace_back());
        };
        begin(head.data(), head.size() * sizeof(uint64_t), kHead);
        begin(bytes.data(), bytes.size(), kPiece);
        for (const auto& array : arrays) begin(array.data(), array.size_bytes(), kPiece);
        // The other one may wait until its own message to this one is received.
        for (int sent = 0;;) {
            MPI_Testall(int(open.size()), open.data(), &sent, MPI_STATUSES_IGNORE);
            if (sent) return;
            if (std::optional<RankMessage> message = receive(nullptr)) inbox_.push_back(std::move(*message));
        }
    }
    std::optional<RankMessage> poll(Arrays* memory) override {
        if (inbox_.empty()) return receive(memory);
        RankMessage first = std::move(inbox_.front());
        inbox_.pop_front();
        return first;
    }
    void abort(int code) override { MPI_Abort(MPI_COMM_WORLD, code); }

private:
    static std::optional<RankMessage> receive(Arrays* memory) {
        int there = 0;
        MPI_Status status;
        MPI_Iprobe(MPI_ANY_SOURCE, kHead, MPI_COMM_WORLD, &there, &status);
        if (!there) return std::nullopt;
        std::array<uint64_t, kHeadValues> head{};
        const int from = status.MPI_SOURCE;
        const auto take = [from](void* to, uint64_t size, int tag) {
            for (uint64_t at = 0; at < size; at += kPieceBytes)
                MPI_Recv(static_cast<char*>(to) + at, int(std::min(kPieceBytes, size - at)), MPI_BYTE, from, tag,
                         MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        };
        take(head.data(), sizeof head, kHead);
        RankMessage message = {from, int(head[0]), std::string(head[1], '\0'), {}};
        take(message.bytes.data(), head[1], kPiece);
        for (size_t i = 2; i < head.size() && head[i] > 0; ++i) {
            std::vector<double>& array = message.arrays.emplace_back();
            if (memory && !memory->empty()) {
                array = std::move(memory->back());
                memory->pop_back();
            }
            array.resize(head[i] / sizeof(double));
            take(array.data(), head[i], kPiece);
        }
        return message;
    }

    int rank_ = 0, size_ = 1, local_rank_ = 0, local_size_ = 1;
    std::vector<int> local_peers_;
    std::deque<RankMessage> inbox_;  ///< what came while something was sent
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
