#include "stress/elsewhere.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <sstream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "stress/methods.h"

namespace ambilux::stress {
namespace {

constexpr const char* kHeader = "cell,method,backend,boxes_x,boxes_y,samples,pixels,seconds,invalid,state,note,boxes";
enum Place {
    cell,
    method,
    backend,
    boxes_x,
    boxes_y,
    samples,
    pixels,
    seconds,
    invalid,
    state,
    note,
    boxes,
    place_count
};

class Table {
public:
    Table(const std::string& path, const std::vector<Family>& all) : path_(path), all_(all) {}

    std::vector<Row> rows() {
        std::istringstream in(read_file(path_));
        std::string line;
        if (!std::getline(in, line) || line != kHeader) throw error(1, fmt::format("the header is not {}", kHeader));
        std::vector<std::string> lines;
        while (std::getline(in, line)) lines.push_back(line);
        std::vector<Row> rows(lines.size());
        // Benign cells first, wherever they stand: others are compared with them.
        for (const bool benign : {true, false})
            for (size_t i = 0; i < lines.size(); ++i) {
                const int number = int(i) + 2;
                const std::vector<std::string> parts = parts_of(lines[i], number);
                const auto [family, c] = find(parts[cell], number);
                if (c->benign == benign) rows[i] = row_of(parts, number, *family, *c, rows);
            }
        return rows;
    }

private:
    Error error(int line, const std::string& what) const { return input_error(path_, line, what); }

    double number(const std::string& text, int line) const {
        double value = 0;
        const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (code != std::errc() || end != text.data() + text.size())
            throw error(line, fmt::format("'{}' is no number", text));
        return value;
    }

    std::pair<const Family*, const Cell*> find(const std::string& name, int line) const {
        for (const Family& family : all_)
            for (const Cell& c : family.cells)
                if (c.name() == name) return {&family, &c};
        throw error(line, fmt::format("there is no cell '{}'", name));
    }

    std::vector<std::string> parts_of(const std::string& text, int line) const {
        std::vector<std::string> parts;
        std::istringstream in(text);
        for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
        if (parts.size() == boxes) parts.emplace_back();
        if (parts.size() != place_count)
            throw error(line, fmt::format("{} columns where there are {}", parts.size(), int(place_count)));
        return parts;
    }

    /// `rows`: of all lines, blank where they are not made yet.
    Row row_of(const std::vector<std::string>& parts, int line, const Family& family, const Cell& known,
               const std::vector<Row>& rows) const {
        // Our limits are not theirs; what our light tracer finds rarely theirs does, under another name.
        Cell c = known;
        c.limit.clear();
        if (has_prefix_of(c.rare, "light")) c.rare += " ptracer";
        const Row* benign = nullptr;
        for (const Row& row : rows)
            if (!c.benign && row.cell == family.cells.front().name() && row.method == parts[method] && row.samples > 0)
                benign = &row;
        Row row = blank_row(c, parts[method], parts[backend], benign);
        if (parts[boxes].empty()) {
            if (parts[state] != "refused" && parts[state] != "left out")
                throw error(
                    line, fmt::format("no means, and the state '{}' instead of 'refused' or 'left out'", parts[state]));
            if (parts[state] == "refused")
                refuse_row(row, c, parts[note]);
            else
                leave_out(row, parts[note]);
            return row;
        }
        Measurement m;
        std::istringstream values(parts[boxes]);
        for (std::string value; values >> value;) m.batches.boxes.push_back(number(value, line));
        m.batches.boxes_x = uint32_t(number(parts[boxes_x], line));
        m.batches.boxes_y = uint32_t(number(parts[boxes_y], line));
        const size_t per_batch = m.batches.box_count();
        if (per_batch == 0 || m.batches.boxes.size() % per_batch != 0 || m.batches.boxes.size() < 2 * per_batch)
            throw error(line,
                        fmt::format("{} means are no two batches of {} boxes", m.batches.boxes.size(), per_batch));
        m.samples = uint64_t(number(parts[samples], line));
        m.paths = double(m.samples) * number(parts[pixels], line);
        m.seconds = number(parts[seconds], line);
        m.invalid = uint64_t(number(parts[invalid], line));
        fill_row(row, c, m, benign, double(rows.size()));
        if (row.note.empty()) row.note = parts[note];
        return row;
    }

    const std::string& path_;
    const std::vector<Family>& all_;
};

}  // namespace

std::vector<Row> judge_elsewhere(const std::string& path, const std::vector<Family>& all) {
    return Table(path, all).rows();
}

}  // namespace ambilux::stress
