#include <cmath>

#include "render/replay/print.h"

namespace ambilux {
namespace {

using json = nlohmann::json;

/// Floats are exact in doubles; what is not finite has no number in JSON.
json number(double v) { return std::isfinite(v) ? json(v) : json(nullptr); }
json triple(Vec3f v) { return {number(double(v.x)), number(double(v.y)), number(double(v.z))}; }
json triple(const double (&v)[3]) { return {number(v[0]), number(v[1]), number(v[2])}; }
json place(Vec3f p, const ReplayFormat& format) {
    const std::array<double, 3> at = format.in_file(p);
    return {number(at[0]), number(at[1]), number(at[2])};
}
json index(uint32_t i) { return i == kNone ? json(nullptr) : json(i); }

json to_json(const std::vector<ReplayNumber>& numbers) {
    json all = json::object();
    for (const ReplayNumber& n : numbers) all[n.name] = number(n.value);
    return all;
}

json to_json(const ReplayDrop& d) {
    if (!d.happened()) return nullptr;
    return {{"stage", d.stage}, {"what", d.what}};
}

json to_json(const ReplayScatter& s) {
    if (!s.sampled) return nullptr;
    json j = {{"direction", triple(s.direction)},
              {"delta", s.delta},
              {"weight", triple(s.weight)},
              {"eta", number(double(s.eta))}};
    j[s.delta ? "probability" : "pdf_sa"] = number(double(s.pdf_sa));
    if (!s.delta) j["pdf_reverse_sa"] = number(double(s.pdf_reverse_sa));
    j["roulette"] = nullptr;
    if (s.roulette.played)
        j["roulette"] = {{"survival", number(double(s.roulette.survival))},
                         {"u", number(double(s.roulette.u))},
                         {"survived", s.roulette.survived}};
    return j;
}

json to_json(const ReplayVertex& v, const ReplayFormat& format) {
    json j = {{"depth", v.depth},
              {"origin", place(v.origin, format)},
              {"direction", triple(v.direction)},
              {"throughput", triple(v.throughput)},
              {"sums", to_json(v.sums)},
              {"miss", v.miss},
              {"end", v.end.empty() ? json(nullptr) : json(v.end)}};
    if (v.miss) return j;
    j.update({{"distance", number(double(v.distance))},
              {"p", place(v.p, format)},
              {"ng", triple(v.ng)},
              {"ns", triple(v.ns)},
              {"primitive", v.prim},
              {"shape", v.shape},
              {"material", v.material},
              {"emitter", index(v.emitter)},
              {"bsdf", v.bsdf},
              {"connectible", v.smooth},
              {"scatter", to_json(v.scatter)}});
    return j;
}

const char* name_of(ReplayFate fate) {
    const char* names[] = {"arrived", "blocked", "culled", "zero", "invalid"};
    return names[uint32_t(fate)];
}

json to_json(const ReplayCandidate& c, const ReplayFormat& format) {
    json j = {{"kind", c.kind},
              {"s", c.strategy.s()},
              {"t", c.strategy.t()},
              {"eye_depth", c.eye_depth},
              {"light_depth", c.light_depth},
              {"light_subpath", index(c.light_subpath)},
              {"value", triple(c.value)},
              {"ratio", number(double(c.ratio))},
              {"weight", number(double(c.weight))},
              {"densities", to_json(c.densities)},
              {"fate", name_of(c.fate)},
              {"dropped", to_json(c.drop)},
              {"contribution", triple(c.contribution)}};
    if (c.light_sample != kNone) j["light_sample"] = c.light_sample;
    if (c.merged) j["merge"] = {{"eye_vertex", place(c.eye_p, format)}, {"light_vertex", place(c.light_p, format)}};
    if (c.tmax > 0)
        j["shadow_ray"] = {{"origin", place(c.origin, format)},
                           {"direction", triple(c.direction)},
                           {"length", number(double(c.tmax))}};
    if (c.eye_depth == 0) {
        j["film"] = {number(double(c.film.x)), number(double(c.film.y))};
        j["filter"] = number(double(c.filter));
    }
    return j;
}

json to_json(const ReplaySubpath& s, const ReplayFormat& format) {
    json vertices = json::array();
    for (const ReplayVertex& v : s.vertices) vertices.push_back(to_json(v, format));
    json j = {{"number", s.number}, {"vertices", vertices}, {"dropped", to_json(s.drop)}};
    if (s.side == Side::eye) return j;
    j.update({{"part", s.part},
              {"emitter", s.emitter.empty() ? json(nullptr) : json(s.emitter)},
              {"radiance", triple(s.start)},
              {"densities", to_json(s.start_densities)},
              {"end", s.end.empty() ? json(nullptr) : json(s.end)}});
    if (s.sample != kNone) j["sample"] = s.sample;
    return j;
}

json to_json(const std::vector<ReplayCandidate>& all, const ReplayFormat& format) {
    json j = json::array();
    for (const ReplayCandidate& c : all)
        if (format.shows(c)) j.push_back(to_json(c, format));
    return j;
}

}  // namespace

json replay_json(const ReplaySample& r, const ReplayFormat& format) {
    json lights = json::array();
    for (const ReplaySubpath& s : r.lights) lights.push_back(to_json(s, format));
    return {{"pixel", {r.x, r.y}},
            {"sample", r.sample},
            {"seed", r.seed},
            {"eye_subpath", to_json(r.eye, format)},
            {"light_subpaths", lights},
            {"candidates", to_json(r.candidates, format)},
            {"splats", to_json(r.splats, format)},
            {"eye", triple(r.eye_sum)},
            {"splat_sum", triple(r.splat_sum)},
            {"total", triple(r.total)},
            {"dropped", to_json(r.drop)},
            {"scene_origin", format.origin},
            {"complete", r.complete},
            {"notes", r.notes}};
}

json replay_json(const ReplaySubpath& subpath, const std::vector<ReplayCandidate>& splats, const ReplayFormat& format) {
    return {{"scene_origin", format.origin},
            {"light_subpath", to_json(subpath, format)},
            {"splats", to_json(splats, format)}};
}

}  // namespace ambilux
