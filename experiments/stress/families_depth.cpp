#include "experiments/stress/families.h"
#include "experiments/stress/scenes.h"

namespace ambilux::stress {
namespace {

struct Depth {
    double albedo;
    int segments;
    bool quick;
};

/// Furnaces whose light comes from paths as long as `segments`.
Family depths(const std::string& name, const std::string& parameter, std::initializer_list<Depth> list, bool roulette) {
    Family family{name, parameter, {}};
    for (const Depth& d : list) {
        Furnace furnace;
        furnace.reflectance = d.albedo;
        furnace.max_depth = d.segments;
        furnace.rr_depth = roulette ? 5 : d.segments + 1;
        Cell cell{name, decade(d.albedo), d.albedo, furnace_answer(furnace),
                  [furnace] { return SceneFiles{furnace_scene(furnace)}; }};
        cell.benign = family.cells.empty();
        cell.quick = d.quick;
        // Survival is at most 0.95: squares of the throughput grow by albedo²/0.95 at every vertex.
        if (roulette && d.albedo > 0.974) cell.limit = "roulette-cap";
        if (!roulette) cell.effort = 20.0 / d.segments;
        family.cells.push_back(cell);
    }
    return family;
}

}  // namespace

std::vector<Family> depth_families() {
    return {depths("depth", "albedo of a furnace of up to 1000 segments, with roulette",
                   {{0.5, 20, true},
                    {0.9, 200, true},
                    {0.95, 400, false},
                    {0.97, 1000, false},
                    {0.99, 1000, false},
                    {0.999, 1000, true}},
                   true),
            depths("depth-no-roulette", "albedo of a furnace of up to 1000 segments, without roulette",
                   {{0.5, 20, true}, {0.9, 50, false}, {0.99, 200, true}, {0.999, 1000, false}}, false)};
}

}  // namespace ambilux::stress
