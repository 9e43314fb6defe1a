#include "formats/report.h"

namespace ambilux {

using document::Where;

void Report::List::add(const Where& where, const std::string& text) {
    const auto [place, is_new] = places.try_emplace(text, entries.size());
    if (is_new) entries.push_back({text, where, 0});
    ++entries[place->second].count;
}

std::vector<std::string> Report::List::lines() const {
    std::vector<std::string> lines;
    for (const Entry& e : entries)
        lines.push_back(e.where.text() + ": " + e.text +
                        (e.count > 1 ? " (" + std::to_string(e.count) + " times)" : ""));
    return lines;
}

void Report::note(const Where& where, const std::string& text) { notes_.add(where, text); }

void Report::refuse(const Where& where, const std::string& problem, const std::string& instead) {
    if (!lenient_) document::fail(where, problem);
    warnings_.add(where, problem + "; " + instead);
}

void Report::write(document::Document& document) const {
    for (const std::string& note : notes_.lines()) document.notes.push_back(note);
    document.warnings = warnings_.lines();
}

}  // namespace ambilux
