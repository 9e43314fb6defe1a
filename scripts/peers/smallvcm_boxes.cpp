// SmallVCM's renderers on the boxes of scenes/boxes, or on boxes of its own, to compare with this program: its command
// line has no boxes under an area light with small or glass spheres, no seed and no film size. Uses its classes;
// nothing of it is here.
//   g++ -std=c++17 -O3 -march=native -fopenmp -I SMALLVCM/src scripts/peers/smallvcm_boxes.cpp -o smallvcm_boxes
//   smallvcm_boxes BOX vcm|bpt|bpm|ppm|pt SECONDS SEED THREADS SIZE OUT.pfm
// BOX: small, large_glass, large_mirror, sky, point (scenes/boxes/BOX.xml), or a number: the sum of flags of
// Scene::BoxMask. Up to 10 segments, radius factor 0.003, alpha 0.75. Every thread renders iterations of its own; their
// numbers, which the radius follows, are shared, and threads count by their iterations. Prints iterations and seconds
// of wall clock.
#include <omp.h>

#include <atomic>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

// clang-format off
#include "math.hxx"
#include "ray.hxx"
#include "geometry.hxx"
#include "camera.hxx"
#include "framebuffer.hxx"
#include "scene.hxx"
#include "eyelight.hxx"
#include "pathtracer.hxx"
#include "bsdf.hxx"
#include "vertexcm.hxx"
// clang-format on

namespace {

enum { kLamp1, kLamp2, kWhite, kBlue, kOrange, kMirror, kGlass };  // a material of its own makes a triangle a light

int diffuse(Scene& scene, float r, float g, float b) {
    Material m;
    m.mDiffuseReflectance = Vec3f(r, g, b);
    scene.mMaterials.push_back(m);
    return int(scene.mMaterials.size()) - 1;
}

/// Corners against the clock as seen from the side that counts.
void quad(GeometryList& list, const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, int first, int second) {
    list.mGeometry.push_back(new Triangle(a, b, c, first));
    list.mGeometry.push_back(new Triangle(a, c, d, second));
}

/// scenes/boxes/NAME.xml: the room [-1,1]^3, open towards the camera at +z.
bool own_box(Scene& scene, const std::string& name, int size) {
    const bool small = name == "small" || name == "sky", sky = name == "sky", point = name == "point";
    if (!small && !point && name != "large_glass" && name != "large_mirror") return false;
    scene.mCamera.Setup(Vec3f(0, 0, 3.8f), Vec3f(0, 0, -1), Vec3f(0, 1, 0), Vec2f(float(size), float(size)), 40);
    diffuse(scene, 0, 0, 0), diffuse(scene, 0, 0, 0);
    diffuse(scene, 0.78f, 0.76f, 0.72f), diffuse(scene, 0.16f, 0.18f, 0.70f), diffuse(scene, 0.75f, 0.35f, 0.08f);
    Material mirror;
    mirror.mMirrorReflectance = Vec3f(1);
    scene.mMaterials.push_back(mirror);
    mirror.mIOR = 1.6f;
    scene.mMaterials.push_back(mirror);

    auto* list = new GeometryList;
    scene.mGeometry = list;
    const auto at = [](float x, float y, float z) { return Vec3f(x, y, z); };
    quad(*list, at(-1, -1, 1), at(1, -1, 1), at(1, -1, -1), at(-1, -1, -1), kWhite, kWhite);
    quad(*list, at(-1, -1, -1), at(1, -1, -1), at(1, 1, -1), at(-1, 1, -1), kWhite, kWhite);
    quad(*list, at(-1, -1, 1), at(-1, -1, -1), at(-1, 1, -1), at(-1, 1, 1), kBlue, kBlue);
    quad(*list, at(1, -1, -1), at(1, -1, 1), at(1, 1, 1), at(1, 1, -1), kOrange, kOrange);
    if (!sky) quad(*list, at(-1, 1, -1), at(1, 1, -1), at(1, 1, 1), at(-1, 1, 1), kWhite, kWhite);
    if (small) {
        list->mGeometry.push_back(new Sphere(at(-0.45f, -0.78f, -0.3f), 0.22f, kMirror));
        list->mGeometry.push_back(new Sphere(at(0.42f, -0.78f, 0.25f), 0.22f, kGlass));
    } else if (!point) {
        list->mGeometry.push_back(new Sphere(at(0, -0.35f, 0), 0.62f, name == "large_glass" ? kGlass : kMirror));
    }

    if (sky) {
        scene.mBackground = new BackgroundLight;
        scene.mBackground->mBackgroundColor = Vec3f(0.55f, 0.7f, 1);
        scene.mLights.push_back(scene.mBackground);
    } else if (point) {
        auto* light = new PointLight(at(0, 0.7f, -0.2f));
        light->mIntensity = Vec3f(1.6f);
        scene.mLights.push_back(light);
    } else {
        const Vec3f a = at(-0.2f, 0.99f, -0.2f), b = at(0.2f, 0.99f, -0.2f), c = at(0.2f, 0.99f, 0.2f),
                    d = at(-0.2f, 0.99f, 0.2f);
        quad(*list, a, b, c, d, kLamp1, kLamp2);
        for (auto* light : {new AreaLight(a, b, c), new AreaLight(a, c, d)}) {
            light->mIntensity = Vec3f(24, 23, 21);
            scene.mMaterial2Light[int(scene.mLights.size())] = int(scene.mLights.size());
            scene.mLights.push_back(light);
        }
    }
    return true;
}

std::unique_ptr<AbstractRenderer> make(const Scene& scene, const std::string& name, int seed) {
    if (name == "pt") return std::make_unique<PathTracer>(scene, seed);
    for (const auto& [acronym, type] : {std::pair<const char*, VertexCM::AlgorithmType>{"vcm", VertexCM::kVcm},
                                        {"bpt", VertexCM::kBpt},
                                        {"bpm", VertexCM::kBpm},
                                        {"ppm", VertexCM::kPpm}})
        if (name == acronym) return std::make_unique<VertexCM>(scene, type, 0.003f, 0.75f, seed);
    return nullptr;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 8) {
        std::fprintf(stderr, "usage: %s BOX vcm|bpt|bpm|ppm|pt SECONDS SEED THREADS SIZE OUT.pfm\n", argv[0]);
        return 2;
    }
    const std::string box = argv[1], algorithm = argv[2];
    const double seconds = std::atof(argv[3]);
    const int seed = std::atoi(argv[4]), threads = std::atoi(argv[5]), size = std::atoi(argv[6]);
    Scene scene;
    if (std::isdigit(box[0]))
        scene.LoadCornellBox(Vec2i(size, size), uint(std::atoi(argv[1])));
    else if (!own_box(scene, box, size))
        return std::fprintf(stderr, "no box %s\n", argv[1]), 2;
    scene.BuildSceneSphere();

    std::vector<std::unique_ptr<AbstractRenderer>> renderers;
    std::vector<int> counts(threads, 0);
    for (int i = 0; i < threads; i++) {
        renderers.push_back(make(scene, algorithm, seed * 1000 + i));
        if (!renderers.back()) return std::fprintf(stderr, "no algorithm %s\n", argv[2]), 2;
        renderers.back()->mMaxPathLength = 10;
        renderers.back()->mMinPathLength = 0;
    }
    std::atomic<int> next{0};
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
#pragma omp parallel num_threads(threads)
    {
        const int me = omp_get_thread_num();
        while (elapsed() < seconds) renderers[me]->RunIteration(next++), counts[me]++;
    }
    const double took = elapsed();

    Framebuffer sum, one;
    sum.Setup(Vec2f(float(size), float(size)));
    for (int i = 0; i < threads; i++)
        if (counts[i] > 0) {
            renderers[i]->GetFramebuffer(one);  // the mean over its iterations
            one.Scale(float(counts[i]) / float(next));
            sum.Add(one);
        }
    sum.SavePFM(argv[7]);
    std::printf("iterations: %d\nseconds: %.4f\n", int(next), took);
}
