#include <algorithm>
#include <cmath>

#include "stress/families.h"
#include "stress/scenes.h"

namespace ambilux::stress {
namespace {

struct Depth {
    double albedo;
    int segments;
    bool quick;
};

enum class Ends { roulette, kind_roulette, nothing };

/// Furnaces whose light comes from paths as long as `segments`.
Family depths(const std::string& name, const std::string& parameter, std::initializer_list<Depth> list, Ends ends) {
    Family family{name, parameter, {}};
    for (const Depth& d : list) {
        Furnace furnace;
        furnace.reflectance = d.albedo;
        furnace.max_depth = d.segments;
        furnace.rr_depth = ends == Ends::nothing ? d.segments + 1 : 5;
        // Connections of paired subpaths grow with the square of their length: few paths must do.
        if (ends == Ends::nothing) furnace.film = {8, 8};
        if (d.segments > 20) furnace.film = {8, 4};
        if (d.segments > 400) furnace.film = {4, 2};
        Cell cell{name, decade(d.albedo), d.albedo, furnace_answer(furnace),
                  [furnace] { return SceneFiles{furnace_scene(furnace)}; }};
        cell.benign = family.cells.empty();
        cell.quick = d.quick;
        cell.effort = std::min(1.0, std::pow(20.0 / d.segments, 2));
        // Survival is at most 0.95: squares of the throughput grow by albedo²/0.95 at every vertex.
        if (ends == Ends::roulette && d.albedo > 0.974) cell.limit = "Roulette cap";
        if (ends == Ends::kind_roulette) {
            cell.settings = {{"rr_cap", "0.999"}};
            cell.not_mitsuba = "its roulette has a fixed cap of 0.95";
        }
        family.cells.push_back(cell);
    }
    return family;
}

/// Samples of one pixel, more than 32 bits count among them.
Family samples() {
    Family family{"samples", "samples of a pixel", {}};
    for (const int k : {16, 20, 24, 28, 31, 33}) {
        Furnace furnace;
        furnace.max_depth = 2;
        furnace.film = {1, 1};
        const double count = std::exp2(k);
        Cell cell{family.name, whole(count), count, furnace_answer(furnace),
                  [furnace] { return SceneFiles{furnace_scene(furnace)}; }};
        cell.benign = k == 16;
        cell.quick = k == 16 || k == 33;
        cell.samples = uint64_t(1) << k;
        cell.device_only = k > 24 && k < 33;
        if (k > 31) cell.limit = "Samples of a pixel";
        if (k > 24) cell.not_mitsuba = "it takes minutes";
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
                   Ends::roulette),
            depths("depth-rr-cap", "albedo of a furnace of up to 1000 segments, with roulette and rr_cap=0.999",
                   {{0.5, 20, true}, {0.9, 200, false}, {0.99, 300, true}, {0.999, 1000, false}}, Ends::kind_roulette),
            depths("depth-no-roulette", "albedo of a furnace of up to 1000 segments, without roulette",
                   {{0.5, 20, true}, {0.9, 50, true}, {0.99, 200, false}, {0.999, 1000, false}}, Ends::nothing),
            samples()};
}

}  // namespace ambilux::stress
