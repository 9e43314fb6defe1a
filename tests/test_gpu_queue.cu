// libs: ambilux_backends ambilux_queues ambilux_core
// labels: gpu
// Queues on a device: pushes of divergent threads, warp by warp.
#include <algorithm>
#include <vector>

#include "backends/cuda/device_memory.h"
#include "backends/cuda_device.h"
#include "queues/queue.h"
#include "tests/catch.h"

using namespace ambilux;

namespace {

struct Item {
    uint32_t word[8];
};

/// Threads that `keep` selects push their number.
__global__ void push_some(Queue<Item> queue, uint32_t n, uint32_t keep) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= n) return;
    // Two places that push, so that warps diverge.
    if (i % keep == 0)
        queue.push({{i, 0, 0, 0, 0, 0, 0, i}});
    else if (keep == 3 && i % keep == 1)
        queue.push({{i, 0, 0, 0, 0, 0, 0, i}});
}

}  // namespace

TEST_CASE("queue on a device: every push arrives once, for any size and divergence") {
    if (!cuda_device_present()) {
        WARN("no CUDA device: skipped");
        return;
    }
    for (const uint32_t n : {1u, 31u, 32u, 33u, 1000u, (1u << 20) + 1}) {
        for (const uint32_t keep : {1u, 2u, 3u, 33u}) {
            const uint32_t expected = keep == 3 ? (n + 2) / 3 + (n + 1) / 3 : (n + keep - 1) / keep;
            const uint32_t capacity = std::max(1u, expected);
            DeviceBuffer<Lane> memory(size_t(capacity) * 2);
            std::vector<QueueCounter> counters(1);
            counters[0].capacity = capacity;
            DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
            push_some<<<(n + 127) / 128, 128>>>(Queue<Item>{memory.data(), counter.data(), capacity}, n, keep);
            cuda_check(cudaDeviceSynchronize(), "push_some");
            REQUIRE(counter.download()[0].count == expected);
            const std::vector<Lane> lanes = memory.download();
            std::vector<uint32_t> seen;
            bool whole = true;
            for (uint32_t i = 0; i < expected; ++i) {
                seen.push_back(lanes[i].word[0]);
                whole &= lanes[i].word[0] == lanes[capacity + i].word[3];
            }
            CHECK(whole);
            std::sort(seen.begin(), seen.end());
            uint64_t wrong = 0;
            for (uint32_t i = 0, k = 0; i < n; ++i)
                if (i % keep == 0 || (keep == 3 && i % keep == 1)) wrong += seen[k++] != i;
            CHECK(wrong == 0);
        }
    }
}

TEST_CASE("G3: a full queue on a device loses items by count, not in silence") {
    if (!cuda_device_present()) {
        WARN("no CUDA device: skipped");
        return;
    }
    DeviceBuffer<Lane> memory(200);
    std::vector<QueueCounter> counters(1);
    counters[0].capacity = 100;
    DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
    push_some<<<8, 128>>>(Queue<Item>{memory.data(), counter.data(), 100}, 1000, 1);
    cuda_check(cudaDeviceSynchronize(), "push_some");
    QueueCounter c = counter.download()[0];
    CHECK(c.count == 1000);
    CHECK(c.size() == 100);
    c.finish();
    CHECK(c.overflow == 900);
}
