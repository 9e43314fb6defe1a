#include "render/aov.h"

#include <algorithm>

#include "accel/host_tracer.h"
#include "accel/shared_accels.h"
#include "core/parallel.h"
#include "transport/subpath/start.h"
#include "transport/surface_scattering.h"

namespace ambilux {
namespace {

constexpr Features kFeatures = kAllFeatures;
/// Mirrors and glass that a path follows at most; beyond, it has met nothing else.
constexpr uint32_t kMostDeltas = 32;

/// Sums of a pixel.
struct PixelSums {
    Rgb albedo{}, normal{}, position{};
    float depth = 0;
    uint32_t hits = 0;
};

class AovSampler {
public:
    AovSampler(const SceneView& view, const HostTracer& tracer, uint64_t seed)
        : view_(view), tracer_(tracer), seed_(seed) {}

    void add(uint32_t x, uint32_t y, uint32_t sample, PixelSums& sums) const {
        const RandomNumbers numbers = {{seed_, y * view_.sensor.crop_width + x, sample, Stream::eye}};
        const CameraSample camera = camera_sample<kAllFeatures>(view_, x, y, numbers);
        Ray ray = {camera.o, camera.tmax, camera.d, 0};
        Rgb seen = {1.0f, 1.0f, 1.0f};
        for (uint32_t depth = 1; depth <= kMostDeltas; ++depth) {
            ray.alpha_seed = numbers.opacity_seed(depth);
            Hit hit = {ray.tmax, 0.0f, 0.0f, kNone};
            if (!tracer_.closest<kFeatures>(view_, ray, hit)) return;
            const SurfacePoint point = surface_at<kFeatures>(view_, hit.prim, hit.u, hit.v);
            if (depth == 1) {
                sums.depth += length(point.p - camera.o);
                sums.position = sums.position + point.p;
                ++sums.hits;
            }
            const Scattering s = make_scattering<kFeatures>(view_, point, -ray.d);
            const Vec4f v = numbers.scatter(Side::eye, depth);
            ScatterSample next;
            const bool scatters = scatter_sample<kFeatures>(s, {v.x, v.y, v.z}, TransportMode::radiance, next);
            if (!scatters || !(next.flags & kScatterDelta)) {
                if (scatters) sums.albedo = sums.albedo + seen * next.weight;
                sums.normal = sums.normal + s.frame.n;
                return;
            }
            // Refraction changes radiance by the squared index; that is no share of light.
            seen = seen * next.weight * sqr(next.eta);
            ray = {offset_ray_origin(point.p, point.p_error, point.ng, next.wo), kInfinity, next.wo, 0};
        }
    }

private:
    SceneView view_;
    HostTracer tracer_;
    uint64_t seed_;
};

void store(float* out, Rgb value) {
    out[0] = value.x;
    out[1] = value.y;
    out[2] = value.z;
}

}  // namespace

const std::vector<std::string>& aov_names() {
    static const std::vector<std::string> names = {"albedo", "normal", "depth", "position"};
    return names;
}

std::vector<Layer> sample_aovs(const Scene& scene, const RenderSettings& settings, uint32_t samples) {
    SharedAccels accels(scene);
    const auto accel = accels.get<EmbreeAccel>();
    const AovSampler sampler(scene.view(), HostTracer(accel->tracer()), settings.seed);
    const uint32_t width = scene.sensor.crop_width, height = scene.sensor.crop_height;
    const size_t pixels = size_t(width) * height;
    std::vector<Layer> layers = {{"albedo", {"R", "G", "B"}, std::vector<float>(3 * pixels)},
                                 {"normal", {"X", "Y", "Z"}, std::vector<float>(3 * pixels)},
                                 {"depth", {"Z"}, std::vector<float>(pixels)},
                                 {"position", {"X", "Y", "Z"}, std::vector<float>(3 * pixels)}};
    parallel_for(height, [&](uint32_t y) {
        for (uint32_t x = 0; x < width; ++x) {
            PixelSums sums;
            for (uint32_t i = 0; i < samples; ++i) sampler.add(x, y, i, sums);
            const size_t pixel = size_t(y) * width + x;
            const float all = 1.0f / float(samples), met = sums.hits ? 1.0f / float(sums.hits) : 0.0f;
            const Rgb albedo = sums.albedo * all;
            store(&layers[0].values[3 * pixel], {std::clamp(albedo.x, 0.0f, 1.0f), std::clamp(albedo.y, 0.0f, 1.0f),
                                                 std::clamp(albedo.z, 0.0f, 1.0f)});
            store(&layers[1].values[3 * pixel], sums.normal * all);
            layers[2].values[pixel] = sums.depth * met;
            store(&layers[3].values[3 * pixel], sums.position * met);
        }
    });
    return layers;
}

}  // namespace ambilux
