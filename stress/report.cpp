#include <fmt/format.h>

#include <algorithm>

#include "stress/runner.h"

namespace ambilux::stress {

size_t Summary::count(Verdict verdict) const {
    return size_t(std::count_if(rows.begin(), rows.end(), [&](const Row& r) { return r.verdict == verdict; }));
}

std::string report(const Summary& summary) {
    constexpr Verdict order[] = {Verdict::failed, Verdict::invalid, Verdict::refused, Verdict::limit,
                                 Verdict::noisy,  Verdict::ok,      Verdict::left_out};
    std::string text;
    for (const Verdict verdict : {Verdict::failed, Verdict::invalid, Verdict::refused, Verdict::limit})
        for (const Row& r : summary.rows) {
            if (r.verdict != verdict) continue;
            if (text.empty())
                text = fmt::format("{:<34} {:<16} {:>9} {:>12} {:>12} {:>9} {:>8} {:>8}  {}\n", "cell", "method",
                                   "verdict", "mean", "expected", "bias", "z", "box z", "invalid, lost, note");
            const std::string dropped = r.invalid + r.lost ? fmt::format("{} {} ", r.invalid, r.lost) : "";
            text += fmt::format("{:<34} {:<16} {:>9} {:>12.6g} {:>12.6g} {:>8.2f}% {:>8.1f} {:>8.1f}  {}{}\n", r.cell,
                                r.method, verdict_name(r.verdict), r.mean.value, r.answer.value,
                                100 * r.comparison.bias, r.comparison.z, r.comparison.box_z, dropped, r.note);
        }
    for (const Verdict v : order)
        text += fmt::format("{}{} {}", v == order[0] ? "" : ", ", summary.count(v), verdict_name(v));
    return text + fmt::format(" of {} rows\n", summary.planned);
}

}  // namespace ambilux::stress
