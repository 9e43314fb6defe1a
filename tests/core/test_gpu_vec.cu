// libs: ambilux_render ambilux_core
// labels: gpu
// Scalar products on a device, bit by bit those of the host, whatever they are inlined into.
#include <cuda_runtime.h>

#include <vector>

#include "core/rng.h"
#include "core/vec.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

namespace {

struct Product {
    Vec3f a, b;
    float forth, back, sum;  ///< a·b, -(a·-b), and a·b + a·-b
};

__global__ void multiply(Product* products, uint32_t n) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= n) return;
    Product& p = products[i];
    p.forth = dot(p.a, p.b);
    p.back = -dot(p.a, -p.b);
    p.sum = dot(p.a, p.b) + dot(p.a, -p.b);
}

}  // namespace

TEST_CASE("scalar products of nearly perpendicular directions are those of the host, and odd in either") {
    if (!device()) return;
    // The first pair is of a ray that grazed a spherical lamp: one function took it to be lit, another one took the
    // cosine to be 0, and the weight of the light was 0 / 0.
    std::vector<Product> products = {
        {{-0.565849543f, -0.218105435f, -0.795137882f}, {-0.212186277f, 0.970417142f, -0.115184724f}, 0, 0, 0}};
    for (uint32_t i = 1; i < 1u << 20; ++i) {
        const auto random = [&](uint32_t k) { return hash_float(i, k) * 2.0f - 1.0f; };
        const Vec3f a = normalize({random(1), random(2), random(3)});
        products.push_back({a, normalize(cross(a, {random(4), random(5), random(6)})), 0, 0, 0});
    }
    Product* on_device = nullptr;
    const size_t bytes = products.size() * sizeof(Product);
    REQUIRE(cudaMalloc(&on_device, bytes) == cudaSuccess);
    REQUIRE(cudaMemcpy(on_device, products.data(), bytes, cudaMemcpyHostToDevice) == cudaSuccess);
    multiply<<<unsigned(products.size() / 256), 256>>>(on_device, uint32_t(products.size()));
    REQUIRE(cudaMemcpy(products.data(), on_device, bytes, cudaMemcpyDeviceToHost) == cudaSuccess);
    cudaFree(on_device);
    size_t different = 0;
    for (const Product& p : products) different += p.forth != dot(p.a, p.b) || p.back != p.forth || p.sum != 0.0f;
    CHECK(different == 0);
}
