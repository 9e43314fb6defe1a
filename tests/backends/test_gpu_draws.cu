// libs: ambilux_backends ambilux_core
// labels: gpu
// Draws from a cache of light vertices on a device, where eye vertices that lie together draw together or each by
// itself.
#include <vector>

#include "backends/cuda/device_memory.h"
#include "backends/cuda_device.h"
#include "stages/light_vertex_search.h"
#include "tests/support/catch.h"
#include "tests/support/chi_square.h"
#include "tests/support/skip.h"

using namespace ambilux;

namespace {

/// One draw of every `apart`-th lane of each warp, of which those of lane `lane` are counted. What is wrong: coherent
/// draws that do not lie together, others that are not those of a host.
__global__ void draw(uint32_t lane, uint32_t apart, uint32_t draw, uint32_t size, bool coherent, uint32_t* counts,
                     uint32_t* wrong) {
    const uint32_t thread = blockIdx.x * blockDim.x + threadIdx.x, mine = thread % 32;
    if (mine % apart != 0) return;
    const RngKey key = {5, thread, 17, Stream::eye};
    const uint32_t lanes = __activemask(), at = drawn_vertex(key, 3, draw, size, coherent),
                   first = __shfl_sync(lanes, at, 0);
    const uint32_t expected = coherent ? (first + mine / apart) % size : mul_hi(cache_draw(key, 3, draw).x, size);
    if (at >= size || at != expected) atomicAdd(wrong, 1u);
    if (mine == lane && at < size) atomicAdd(counts + at, 1u);
}

}  // namespace

TEST_CASE("draws from a cache: every light vertex with the same probability; coherent ones neighbours for neighbours") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    constexpr uint32_t kWarps = 1u << 20;
    const uint32_t sizes[] = {1, 2, 7, 31, 32, 33, 1000, 20011}, draws[] = {0, 5};
    const std::pair<uint32_t, uint32_t> lanes[] = {
        {0, 1}, {1, 1}, {31, 1}, {30, 2}, {0, 32}};  // and which of them draw
    const double level = sidak_level(1e-4, std::size(sizes) * std::size(lanes) * std::size(draws));
    for (const uint32_t size : sizes)
        for (const auto& [lane, apart] : lanes)
            for (const uint32_t number : draws)
                for (const bool coherent : {true, false}) {
                    INFO(size << " light vertices, lane " << lane << ", every " << apart << ", draw " << number
                              << ", coherent " << coherent);
                    DeviceBuffer<uint32_t> counts(size), wrong(1);
                    counts.zero();
                    wrong.zero();
                    draw<<<kWarps / 4, 128>>>(lane, apart, number, size, coherent, counts.data(), wrong.data());
                    cuda_check(cudaDeviceSynchronize(), "draws");
                    CHECK(wrong.download()[0] == 0);
                    const std::vector<uint32_t> found = counts.download();
                    CHECK(
                        test::chi_square({found.begin(), found.end()}, std::vector<double>(size, double(kWarps) / size))
                            .p_value > level);
                }
}
