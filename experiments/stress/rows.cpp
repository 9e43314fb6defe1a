#include "experiments/stress/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

namespace ambilux::stress {

const char* const kRowHeader =
    "cell,family,value,method,backend,verdict,mean,standard_error,expected,expected_error,relative_bias,z,box_z,p,"
    "events,variance,variance_ratio,paths,invalid,lost,seconds,limit,note";
const char* const kExpectedHeader =
    "cell,family,parameter,value,benign,expected,kind,same_as,uniform,region,source,methods,rare,limit,not_mitsuba";

namespace {

/// Text of one cell of a table, without what separates cells and lines.
std::string plain(std::string text) {
    std::replace(text.begin(), text.end(), ',', ';');
    std::replace(text.begin(), text.end(), '\n', ' ');
    std::replace(text.begin(), text.end(), '"', '\'');
    return text;
}

std::vector<std::string> split(const std::string& line) {
    std::vector<std::string> parts(1);
    for (const char c : line) {
        if (c == ',')
            parts.emplace_back();
        else
            parts.back() += c;
    }
    return parts;
}

double to_number(const std::string& text) { return std::strtod(text.c_str(), nullptr); }

std::optional<Verdict> to_verdict(const std::string& name) {
    for (const Verdict v :
         {Verdict::ok, Verdict::failed, Verdict::limit, Verdict::undecided, Verdict::invalid, Verdict::refused})
        if (verdict_name(v) == name) return v;
    return std::nullopt;
}

}  // namespace

std::string row_prefix(const std::string& cell, const std::string& method, const std::string& backend) {
    return fmt::format("{},{},{}", cell, method, backend);
}

std::string row_line(const Row& r) {
    const Comparison& c = r.comparison;
    const double bias = r.answer.value != 0 ? r.mean.value / r.answer.value - 1 : 0;
    return fmt::format(
        "{},{},{:.9g},{},{},{},{:.9g},{:.4g},{:.9g},{:.4g},{:.5g},{:.4g},{:.4g},{:.4g},{:.4g},{:.6g},{:.4g},{:.0f},{},"
        "{},{:.3f},{},{}",
        r.cell, r.family, r.value, r.method, r.backend, verdict_name(r.verdict), r.mean.value, r.mean.error,
        r.answer.value, r.answer.error, bias, c.z, c.box_z, c.p, c.events, r.variance, r.variance_ratio, r.paths,
        r.invalid, r.lost, r.seconds, r.limit, plain(r.note));
}

std::optional<Row> parse_row(const std::string& line) {
    const std::vector<std::string> p = split(line);
    if (p.size() != 23) return std::nullopt;
    const std::optional<Verdict> verdict = to_verdict(p[5]);
    if (!verdict) return std::nullopt;
    Row r;
    r.cell = p[0];
    r.family = p[1];
    r.value = to_number(p[2]);
    r.method = p[3];
    r.backend = p[4];
    r.verdict = *verdict;
    r.mean = {to_number(p[6]), to_number(p[7]), double(kBatches - 1)};
    r.answer = {to_number(p[8]), to_number(p[9]), to_number(p[9]) > 0 ? double(kBatches - 1) : 0.0};
    r.comparison = {to_number(p[11]), to_number(p[12]), to_number(p[13]), to_number(p[14])};
    r.variance = to_number(p[15]);
    r.variance_ratio = to_number(p[16]);
    r.paths = to_number(p[17]);
    r.invalid = std::strtoull(p[18].c_str(), nullptr, 10);
    r.lost = std::strtoull(p[19].c_str(), nullptr, 10);
    r.seconds = to_number(p[20]);
    r.limit = p[21];
    r.note = p[22];
    return r;
}

std::string expected_line(const Family& family, const Cell& cell, const std::vector<std::string>& found) {
    const bool closed = cell.answer.kind == AnswerKind::closed_form;
    std::string methods;
    for (const std::string& m : found) methods += (methods.empty() ? "" : " ") + m;
    const auto benign = std::find_if(family.cells.begin(), family.cells.end(), [](const Cell& c) { return c.benign; });
    return fmt::format("{},{},{},{:.9g},{},{},{},{},{},mean of all pixels and channels,{},{},{},{},{}", cell.name(),
                       family.name, plain(family.parameter), cell.value, int(cell.benign),
                       closed ? fmt::format("{:.12g}", cell.answer.value) : "", closed ? "closed form" : "invariance",
                       closed || benign == family.cells.end() ? "" : benign->name(), int(cell.answer.uniform),
                       plain(cell.answer.source), methods, cell.rare, cell.limit, plain(cell.not_mitsuba));
}

}  // namespace ambilux::stress
