#include "stress/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "stress/methods.h"

namespace ambilux::stress {

const char* const kExpectedHeader =
    "cell,family,parameter,value,benign,expected,kind,same_as,uniform,rounding,region,source,rare,limit,not_mitsuba";

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

void set(std::string& field, const std::string& text) { field = text; }
void set(double& field, const std::string& text) { field = std::strtod(text.c_str(), nullptr); }
void set(uint64_t& field, const std::string& text) { field = std::strtoull(text.c_str(), nullptr, 10); }
void set(Verdict& field, const std::string& text) {
    for (int v = 0; v <= int(Verdict::left_out); ++v)
        if (verdict_name(Verdict(v)) == text) field = Verdict(v);
}

std::string text_of(const std::string& field) { return plain(field); }
std::string text_of(double field) { return fmt::format("{:.10g}", field); }
std::string text_of(uint64_t field) { return fmt::format("{}", field); }
std::string text_of(Verdict field) { return verdict_name(field); }

/// All columns in their order: column(name, field). `Row`: const or not.
template <class R, class Function>
void for_each_column(R& r, Function&& column) {
    column("cell", r.cell);
    column("family", r.family);
    column("value", r.value);
    column("method", r.method);
    column("backend", r.backend);
    column("verdict", r.verdict);
    column("mean", r.mean.value);
    column("standard_error", r.mean.error);
    column("dof", r.mean.dof);
    column("expected", r.answer.value);
    column("expected_error", r.answer.error);
    column("relative_bias", r.comparison.bias);
    column("z", r.comparison.z);
    column("box_z", r.comparison.box_z);
    column("p", r.comparison.p);
    column("events", r.comparison.events);
    column("variance", r.variance);
    column("variance_ratio", r.variance_ratio);
    column("first", r.first);
    column("samples", r.samples);
    column("paths", r.paths);
    column("invalid", r.invalid);
    column("lost", r.lost);
    column("underflow", r.underflow);
    column("seconds", r.seconds);
    column("limit", r.limit);
    column("note", r.note);
}

}  // namespace

Row blank_row(const Cell& cell, const std::string& method, const std::string& backend, const Row* benign) {
    Row row;
    row.cell = cell.name();
    row.family = cell.family;
    row.value = cell.value;
    row.method = method;
    row.backend = backend;
    row.limit = cell.limit;
    const double value = cell.answer.value;
    if (cell.answer.kind == AnswerKind::closed_form)
        row.answer = {value, 0, 0};
    else if (benign)
        row.answer = {value * benign->mean.value, value * benign->mean.error, benign->mean.dof};
    return row;
}

void leave_out(Row& row, const std::string& why) {
    row.note = why;
    row.verdict = Verdict::left_out;
}

void fill_row(Row& row, const Cell& cell, const Measurement& m, const Row* benign, double rows, double bias) {
    row.mean = mean_of(m.batches);
    row.first = m.first;
    row.samples = double(m.samples);
    row.paths = m.paths;
    row.seconds = m.seconds;
    row.invalid = m.invalid;
    row.lost = m.lost;
    row.underflow = m.underflow;
    set(row.variance, text_of(relative_variance(row.mean, m.paths)));  // as a sweep that goes on reads it
    if (benign && benign->variance > 0) row.variance_ratio = row.variance / benign->variance;
    if (cell.answer.kind == AnswerKind::invariance && !benign) {
        // The benign cell of an invariance is its own answer: it is the others that are judged.
        if (cell.benign)
            row.answer = row.mean;
        else
            return leave_out(row, "the benign cell, which is the answer, has no mean");
    }
    row.comparison = compare(m.batches, row.answer, cell.answer.uniform, cell.answer.rounding, bias);
    row.verdict = judge({row.comparison, row.mean.value, has_prefix_of(cell.rare, row.method), !cell.limit.empty(),
                         row.invalid + row.lost},
                        rows);
    if (m.samples < cell.samples)
        row.note = fmt::format("{} of {} samples in the time that it had", m.samples, cell.samples);
}

void refuse_row(Row& row, const Cell& cell, const std::string& why) {
    row.note = why;
    row.verdict = cell.limit.empty() ? Verdict::refused : Verdict::limit;
}

std::string row_header() {
    std::string header;
    const Row row;
    for_each_column(
        row, [&](const char* name, const auto&) { header += fmt::format("{}{}", header.empty() ? "" : ",", name); });
    return header;
}

std::string row_line(const Row& row) {
    std::string line;
    for_each_column(row, [&](const char*, const auto& field) { line += text_of(field) + ","; });
    line.pop_back();
    return line;
}

std::string rows_text(const std::vector<Row>& rows) {
    std::string text = row_header() + "\n";
    for (const Row& row : rows) text += row_line(row) + "\n";
    return text;
}

std::optional<Row> parse_row(const std::string& line) {
    const std::vector<std::string> parts = split(line);
    Row row;
    size_t column = 0;
    for_each_column(row, [&](const char*, auto& field) {
        if (column < parts.size()) set(field, parts[column]);
        ++column;
    });
    return column == parts.size() ? std::optional(row) : std::nullopt;
}

std::string expected_line(const Family& family, const Cell& cell) {
    const bool closed = cell.answer.kind == AnswerKind::closed_form;
    const auto benign = std::find_if(family.cells.begin(), family.cells.end(), [](const Cell& c) { return c.benign; });
    return fmt::format("{},{},{},{:.9g},{},{:.12g},{},{},{},{:.3g},mean of all pixels and channels,{},{},{},{}",
                       cell.name(), family.name, plain(family.parameter), cell.value, int(cell.benign),
                       cell.answer.value, closed ? "radiance" : "factor", closed ? "" : benign->name(),
                       int(cell.answer.uniform), cell.answer.rounding, plain(cell.answer.source), cell.rare,
                       plain(cell.limit), plain(cell.not_mitsuba));
}

}  // namespace ambilux::stress
