// Ranks as threads of a test: the protocol of renders over several processes, without a launcher.
#pragma once

#include <atomic>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

#include "core/ranks.h"

namespace ambilux::test {

class ThreadRanks {
public:
    explicit ThreadRanks(int count) : boxes_(size_t(count)), seats_(size_t(count)) {
        for (int i = 0; i < count; ++i) seats_[size_t(i)].sit(this, i);
    }

    /// Each rank in a thread of its own, rank 0 in this one.
    void run(const std::function<void(Ranks&)>& work) {
        std::vector<std::thread> others;
        for (size_t i = 1; i < seats_.size(); ++i) others.emplace_back([&, i] { work(seats_[i]); });
        work(seats_[0]);
        for (std::thread& thread : others) thread.join();
    }
    /// Messages with arrays that a rank got.
    size_t films(int rank) const { return boxes_[size_t(rank)].films; }
    /// Arrays of them that lie in memory that the rank gave.
    size_t reused(int rank) const { return boxes_[size_t(rank)].reused; }

private:
    struct Box {
        std::mutex mutex;
        std::deque<RankMessage> messages;
        std::atomic<size_t> films = 0, reused = 0;
    };
    class Seat final : public Ranks {
    public:
        void sit(ThreadRanks* all, int rank) { all_ = all, rank_ = rank; }
        int rank() const override { return rank_; }
        int size() const override { return int(all_->seats_.size()); }
        int local_rank() const override { return rank_; }
        int local_size() const override { return size(); }
        bool launched() const override { return true; }
        void send(int to, int kind, const std::string& bytes,
                  std::span<const std::span<const double>> arrays) override {
            RankMessage message = {rank_, kind, bytes, {}};
            for (const auto& array : arrays) message.arrays.emplace_back(array.begin(), array.end());
            Box& box = all_->boxes_.at(size_t(to));
            const std::lock_guard lock(box.mutex);
            box.films += arrays.empty() ? 0 : 1;
            box.messages.push_back(std::move(message));
        }
        std::optional<RankMessage> poll(Arrays* memory) override {
            Box& box = all_->boxes_[size_t(rank_)];
            const std::lock_guard lock(box.mutex);
            if (box.messages.empty()) return std::nullopt;
            RankMessage first = std::move(box.messages.front());
            box.messages.pop_front();
            for (std::vector<double>& array : first.arrays) {
                if (!memory || memory->empty()) break;
                std::vector<double> there = std::move(memory->back());
                memory->pop_back();
                there.assign(array.begin(), array.end());
                array = std::move(there);
                ++box.reused;
            }
            return first;
        }

    private:
        ThreadRanks* all_ = nullptr;
        int rank_ = 0;
    };

    std::deque<Box> boxes_;
    std::deque<Seat> seats_;
};

}  // namespace ambilux::test
