// libs: ambilux_backends ambilux_core
// labels: gpu
// Draws from a cache of light vertices on a device, where eye vertices that lie together draw together.
#include <vector>

#include "backends/cuda/device_memory.h"
#include "backends/cuda_device.h"
#include "stages/eye_walk.h"
#include "tests/catch.h"
#include "tests/chi_square.h"

using namespace ambilux;

namespace {

/// One draw of each of `groups` groups, of its vertex `lane`.
__global__ void draw(Wave wave, uint32_t lane, uint32_t draw, uint32_t size, uint32_t groups, uint32_t* counts, uint32_t* wrong) {
    const uint32_t group = blockIdx.x * blockDim.x + threadIdx.x;
    if (group >= groups) return;
    const uint32_t vertex = group * kDrawsTogether + lane, first = vertex - lane;
    const uint32_t at = drawn_vertex(wave, vertex, 0, 3, draw, size);
    if (at >= size || at != (drawn_vertex(wave, first, 0, 3, draw, size) + lane) % size) {
        atomicAdd(wrong, 1u);
        return;
    }
    atomicAdd(counts + at, 1u);
}

}  // namespace

TEST_CASE("draws from a cache: every light vertex with the same probability, neighbours for neighbours") {
    if (!cuda_device_present()) {
        WARN("no CUDA device: skipped");
        return;
    }
    constexpr uint32_t kGroups = 1u << 20;
    const uint32_t sizes[] = {1, 2, 7, 31, 32, 33, 1000, 20011}, lanes[] = {0, 1, 31}, draws[] = {0, 5};
    const double level = test::sidak_level(1e-4, std::size(sizes) * std::size(lanes) * std::size(draws));
    const std::vector<WaveState> states(1, WaveState{0, 17, 1, 0, 0, 0, 0});
    const DeviceBuffer<WaveState> state{std::span<const WaveState>(states)};
    Wave wave{};
    wave.state = state.data();
    wave.seed = 5;
    for (const uint32_t size : sizes)
        for (const uint32_t lane : lanes)
            for (const uint32_t number : draws) {
                INFO(size << " light vertices, lane " << lane << ", draw " << number);
                DeviceBuffer<uint32_t> counts(size), wrong(1);
                counts.zero();
                wrong.zero();
                draw<<<kGroups / 128, 128>>>(wave, lane, number, size, kGroups, counts.data(), wrong.data());
                cuda_check(cudaDeviceSynchronize(), "draws");
                CHECK(wrong.download()[0] == 0);
                const std::vector<uint32_t> found = counts.download();
                CHECK(test::chi_square({found.begin(), found.end()}, std::vector<double>(size, double(kGroups) / size)).p_value > level);
            }
}
