#include "render/replay/print.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "core/error.h"

namespace ambilux {
namespace {

std::string text_of(Vec3f v) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", v.x, v.y, v.z); }
std::string place_text(Vec3f p, const ReplayFormat& format) {
    const std::array<double, 3> at = format.in_file(p);
    std::string text;
    for (int c = 0; c < 3; ++c) {
        // The digits of a scene that was moved stand behind those of its place.
        const bool far = std::abs(format.origin[size_t(c)]) > 16 * std::abs(double(p[c]));
        text += fmt::format("{}{:.{}g}", c ? ", " : "", at[size_t(c)], far ? 13 : 6);
    }
    return "(" + text + ")";
}
std::string text_of(const double (&v)[3]) { return fmt::format("({:.9g}, {:.9g}, {:.9g})", v[0], v[1], v[2]); }

std::string text_of(const std::vector<ReplayNumber>& numbers) {
    std::string text;
    for (const ReplayNumber& n : numbers) text += fmt::format("{}{} {:.6g}", text.empty() ? "" : ", ", n.name, n.value);
    return text;
}

void print_scatter(const ReplayScatter& s, std::string& out) {
    if (!s.sampled) return;
    if (s.delta)
        out +=
            fmt::format("       scattered by a delta lobe of probability {:.6g} to {}", s.pdf_sa, text_of(s.direction));
    else
        out += fmt::format("       scattered to {}, pdf_sa {:.6g}, pdf_reverse_sa {:.6g}", text_of(s.direction),
                           s.pdf_sa, s.pdf_reverse_sa);
    out += fmt::format(", weight {}{}\n", text_of(s.weight), s.eta == 1 ? "" : fmt::format(", eta {:.6g}", s.eta));
    if (s.roulette.played)
        out += fmt::format("       roulette: survival {:.6g}, u {:.6g}: {}\n", s.roulette.survival, s.roulette.u,
                           s.roulette.survived ? "survives" : "ends");
}

void print_vertex(const ReplayVertex& v, const ReplayFormat& format, std::string& out) {
    out += fmt::format("  {:>3}  ray from {} along {}, throughput {}\n", v.depth, place_text(v.origin, format),
                       text_of(v.direction), text_of(v.throughput));
    if (v.miss) {
        out += fmt::format("       meets nothing; {}\n", text_of(v.sums));
    } else {
        out += fmt::format("       meets shape {} (primitive {}, material {}, {}{}) after {:.6g} at {}\n", v.shape,
                           v.prim, v.material, v.bsdf, v.emitter == kNone ? "" : fmt::format(", emitter {}", v.emitter),
                           v.distance, place_text(v.p, format));
        out += fmt::format("       ng {}, ns {}; {}\n", text_of(v.ng), text_of(v.ns), text_of(v.sums));
    }
    print_scatter(v.scatter, out);
    if (!v.end.empty()) out += fmt::format("       ends: {}\n", v.end);
}

/// Of a light subpath.
std::string of_sample(uint32_t sample) { return sample == kNone ? "" : fmt::format(" of sample {}", sample); }

void print_subpath(const ReplaySubpath& s, const ReplayFormat& format, std::string& out) {
    if (s.side == Side::eye)
        out += "eye subpath\n";
    else
        out += fmt::format("light subpath {}{}{}\n", s.number, of_sample(s.sample),
                           s.part ? fmt::format(", part {}", s.part) : "");
    if (!s.emitter.empty())
        out += fmt::format("    0  starts on emitter of type {}, radiance {}; {}\n", s.emitter, text_of(s.start),
                           text_of(s.start_densities));
    for (const ReplayVertex& v : s.vertices) print_vertex(v, format, out);
    if (!s.end.empty()) out += fmt::format("       no ray: {}\n", s.end);
    if (s.drop.happened())
        out += fmt::format("       invalid: stage {} dropped a throughput or a ray ({})\n", s.drop.stage, s.drop.what);
}

void print_origin(const ReplayFormat& format, std::string& out) {
    if (format.moved())
        out += fmt::format(
            "positions are those of the file; rounding is that of a scene with its origin at ({:.9g}, "
            "{:.9g}, {:.9g})\n",
            format.origin[0], format.origin[1], format.origin[2]);
}

std::string fate_text(const ReplayCandidate& c) {
    switch (c.fate) {
        case ReplayFate::arrived: return "contribution " + text_of(c.contribution);
        case ReplayFate::blocked: return "blocked";
        case ReplayFate::culled: return "culled before its shadow ray";
        case ReplayFate::zero: return "nothing: value times weight rounds to 0";
        default: return fmt::format("invalid ({}): dropped by stage {}", c.drop.what, c.drop.stage);
    }
}

void print_candidate(const ReplayCandidate& c, const ReplayFormat& format, std::string& out) {
    std::string ends = c.eye_depth ? fmt::format("eye vertex {}", c.eye_depth) : "";
    if (c.light_subpath != kNone)
        ends += fmt::format("{}light subpath {}{} vertex {}", ends.empty() ? "" : ", ", c.light_subpath,
                            of_sample(c.light_sample), c.light_depth);
    out += fmt::format("  {:<8} {}, {}", strategy_text({c.strategy, c.merged}), c.kind, ends);
    // What a stage drops before it has a weight is not kept.
    const bool kept = c.fate != ReplayFate::invalid || !is_zero(c.value);
    out += kept ? fmt::format(": value {}, ratio {:.6g}, weight {:.6g}\n", text_of(c.value), c.ratio, c.weight) : "\n";
    if (!c.densities.empty()) out += fmt::format("           {}\n", text_of(c.densities));
    if (c.merged)
        out += fmt::format("           eye vertex at {}, light vertex at {}\n", place_text(c.eye_p, format),
                           place_text(c.light_p, format));
    if (c.tmax > 0)
        out += fmt::format("           shadow ray from {} along {}, {:.6g} long: {}\n", place_text(c.origin, format),
                           text_of(c.direction), c.tmax,
                           c.fate == ReplayFate::arrived   ? "free"
                           : c.fate == ReplayFate::blocked ? "blocked"
                                                           : "not traced");
    if (c.eye_depth == 0)
        out += fmt::format("           on the film at ({:.6g}, {:.6g}), filter {:.6g}\n", c.film.x, c.film.y, c.filter);
    out += fmt::format("           {}\n", fate_text(c));
}

void print_candidates(const char* title, const std::vector<ReplayCandidate>& all, const ReplayFormat& format,
                      std::string& out) {
    size_t shown = 0;
    std::string text;
    for (const ReplayCandidate& c : all) {
        if (!format.shows(c)) continue;
        ++shown;
        print_candidate(c, format, text);
    }
    const std::string of = format.only ? fmt::format(" of {}", all.size()) : "";
    out += fmt::format("{}: {}{}\n{}", title, shown, of, text);
}

/// Sum of what arrived by the strategies of a format.
void add_shown(const std::vector<ReplayCandidate>& all, const ReplayFormat& format, double (&sum)[3]) {
    for (const ReplayCandidate& c : all)
        if (format.shows(c) && c.fate == ReplayFate::arrived)
            for (int k = 0; k < 3; ++k) sum[k] += double(c.contribution[k]);
}

}  // namespace

std::string strategy_text(ReplayStrategy s) {
    return fmt::format("s{}{}t{}", s.strategy.s(), s.merged ? "+" : "", s.strategy.t());
}

ReplayStrategy parse_strategy(const std::string& text) {
    const char* const end = text.data() + text.size();
    const size_t at = text.find('t');
    uint32_t s = 0, t = 0;
    if (text[0] == 's' && at != std::string::npos) {
        const bool merged = text[at - 1] == '+';
        const char* const middle = text.data() + at - merged;
        const auto first = std::from_chars(text.data() + 1, middle, s);
        const auto second = std::from_chars(text.data() + at + 1, end, t);
        if (first.ec == std::errc() && first.ptr == middle && second.ec == std::errc() && second.ptr == end &&
            (merged ? s >= 2 && t >= 2 : t >= 1 && s + t >= 2) && s < 0x10000 && t < 0x10000)
            return {Strategy::make(s, t), merged};
    }
    throw Error(ExitCode::usage,
                fmt::format("--strategy {}: write it as s1t3, one vertex from the light and three from the camera, "
                            "with t at least 1 and s + t at least 2; merges as s2+t3, with both at least 2",
                            text));
}

std::string replay_text(const ReplaySample& sample, const ReplayFormat& format) {
    std::string out = fmt::format("pixel {},{}, sample {}, seed {}\n", sample.x, sample.y, sample.sample, sample.seed);
    print_origin(format, out);
    print_subpath(sample.eye, format, out);
    for (const ReplaySubpath& s : sample.lights) print_subpath(s, format, out);
    print_candidates("found by the eye subpath", sample.candidates, format, out);
    if (!sample.splats.empty()) print_candidates("splats of light subpaths", sample.splats, format, out);
    for (const std::string& note : sample.notes) out += fmt::format("note: {}\n", note);
    if (format.only) {
        double sum[3] = {};
        add_shown(sample.candidates, format, sum);
        add_shown(sample.splats, format, sum);
        out += fmt::format("{:<22}{}\n", "by strategy " + strategy_text(*format.only), text_of(sum));
    }
    out += fmt::format("{:<22}{}\n", "by the eye subpath", text_of(sample.eye_sum));
    if (!sample.splats.empty()) out += fmt::format("{:<22}{}\n", "by splats", text_of(sample.splat_sum));
    out += fmt::format("{:<22}{}{}\n", "sample", text_of(sample.total),
                       sample.complete ? "" : " without what the notes say is missing");
    if (sample.drop.happened())
        out += fmt::format("invalid ({}): dropped by stage {}\n", sample.drop.what, sample.drop.stage);
    return out;
}

std::string replay_text(const ReplaySubpath& subpath, const std::vector<ReplayCandidate>& splats,
                        const ReplayFormat& format) {
    std::string out;
    print_origin(format, out);
    print_subpath(subpath, format, out);
    print_candidates("splats", splats, format, out);
    return out;
}

}  // namespace ambilux
