// What a replay saw: one sample of a pixel, or one light subpath, as plain data for printers and tests.
#pragma once

#include <string>
#include <vector>

#include "models/parameters.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

/// A number with a name that says its measure: `_sa` per solid angle, `_area` per area.
struct ReplayNumber {
    std::string name;
    double value;
};

/// Russian roulette at a vertex.
struct ReplayRoulette {
    bool played = false;  ///< false: the vertex lies before rr_depth, or nothing was scattered
    float survival = 0;   ///< probability of survival; 0 if that carried nothing on
    float u = 0;
    bool survived = false;
};

/// What was sampled at a vertex for the next ray.
struct ReplayScatter {
    bool sampled = false;
    Vec3f direction{};
    float pdf_sa = 0, pdf_reverse_sa = 0;  ///< of a delta: the probability of the lobe; the way back has none
    bool delta = false;
    Rgb weight{};   ///< f |cos| / pdf
    float eta = 1;  ///< relative index passed through
    ReplayRoulette roulette;
};

/// Where the ray of a subpath of `depth` segments ended.
struct ReplayVertex {
    uint32_t depth = 0;
    Vec3f origin{}, direction{};     ///< of the ray
    Rgb throughput{};                ///< of the ray
    std::vector<ReplayNumber> sums;  ///< of multiple importance sampling, at the vertex; of a miss, of the ray
    bool miss = true;                ///< what follows is of hits only
    float distance = 0;
    Vec3f p{}, ng{}, ns{};
    uint32_t prim = kNone, shape = kNone, material = kNone, emitter = kNone;
    std::string bsdf;
    bool smooth = false;  ///< connections may start here
    ReplayScatter scatter;
    std::string end;  ///< why the subpath ended here; empty: it goes on
};

/// What became of light that a strategy found.
enum class ReplayFate : uint32_t {
    arrived,
    blocked,  ///< its shadow ray met something
    culled,   ///< by Russian roulette before the shadow ray (setting cull)
    zero,     ///< its weight or value rounds to nothing
    invalid,  ///< dropped and counted by a stage (ReplayCandidate::drop)
};

/// A value that a stage dropped because it is no radiance, or no ray.
struct ReplayDrop {
    std::string stage;  ///< empty: nothing was dropped
    std::string what;   ///< NaN, Inf or negative; of a ray NaN stands for both of the first

    bool happened() const { return !stage.empty(); }
};

/// Light that a strategy found, on its way to a pixel.
struct ReplayCandidate {
    const char* kind = "";  ///< hit, environment, next event, connection, camera, merge
    Strategy strategy{};
    bool merged = false;                      ///< both subpaths end at one vertex of the path, which s and t both count
    uint32_t eye_depth = 0, light_depth = 0;  ///< segments of the subpaths that it joins
    uint32_t light_subpath = kNone;           ///< number of the light subpath (ReplayKey::light); kNone: there is none
    uint32_t light_sample = kNone;            ///< its sample, where those of an iteration share light subpaths
    Rgb value{};                              ///< unweighted
    float ratio = 0, weight = 1;              ///< weight = 1 / (1 + ratio)
    std::vector<ReplayNumber> densities;
    Vec3f origin{}, direction{};  ///< of the shadow ray, if there is one
    float tmax = 0;               ///< of the shadow ray; 0: there is none
    Vec2f film{};                 ///< t = 1: where it lands, in pixels of the full film
    float filter = 1;             ///< t = 1: value of the pixel's filter there
    Vec3f eye_p{}, light_p{};     ///< of a merge: the vertices
    Rgb contribution{};           ///< what arrives at the pixel
    ReplayFate fate = ReplayFate::zero;
    ReplayDrop drop;

    /// Of the path.
    uint32_t segments() const { return strategy.segments() - merged; }
};

/// A subpath and what it met. A light subpath has the number round · pixels + pixel of the slot that it started in
/// (queues/wave.h); `part`: which of those of variant streaming, that starts one for every eye vertex.
struct ReplaySubpath {
    Side side = Side::eye;
    uint32_t number = 0, part = 0;
    uint32_t sample = kNone;  ///< as ReplayCandidate::light_sample
    Rgb start{};              ///< light: radiance of the emitter sample
    std::string emitter;
    std::vector<ReplayNumber> start_densities;
    std::vector<ReplayVertex> vertices;
    std::string end;  ///< why there is no first ray; else empty
    ReplayDrop drop;  ///< of a throughput or a ray
};

/// One sample of a pixel.
struct ReplaySample {
    uint32_t x = 0, y = 0, sample = 0;
    uint64_t seed = 0;
    ReplaySubpath eye;
    std::vector<ReplaySubpath> lights;        ///< those that the eye subpath was connected with, or that were asked for
    std::vector<ReplayCandidate> candidates;  ///< of the eye subpath, in the order in which they are added
    std::vector<ReplayCandidate> splats;      ///< of light subpaths that reach the pixel
    Rgb eye_sum{};
    double splat_sum[3] = {}, total[3] = {};
    ReplayDrop drop;       ///< of the whole sample, by update_film
    bool complete = true;  ///< false: a render's sample holds connections that cannot be replayed (`notes` say which)
    std::vector<std::string> notes;
};

}  // namespace ambilux
