#include "render/fused_shares.h"

#include <algorithm>

namespace ambilux {
namespace {

struct Inside {
    const char* stage;
    std::vector<const char*> of;
};

const std::vector<Inside>& insides() {
    static const std::vector<Inside> all = {{"generate", {"extend"}},
                                            {"connect", {"shade"}},
                                            {"connect_vertices", {"shade"}},
                                            {"connect_camera", {"light_shade"}},
                                            {"mis_weight", {"shade", "light_shade", "connect_vertices"}},
                                            {"accumulate", {"shade", "occlude"}}};
    return all;
}

double seconds_of(const std::vector<StageStats>& stages, const std::string& name) {
    const auto found = std::find_if(stages.begin(), stages.end(), [&](const StageStats& s) { return s.name == name; });
    return found == stages.end() ? 0 : found->seconds;
}

}  // namespace

std::vector<FusedShare> fused_shares(const std::vector<StageStats>& fused, const std::vector<StageStats>& unfused) {
    const auto has_a_clock = [&](const std::string& name) { return seconds_of(fused, name) > 0; };
    std::vector<FusedShare> shares;
    for (const StageStats& host : fused) {
        if (!(host.seconds > 0) || !(seconds_of(unfused, host.name) > 0)) continue;
        std::vector<FusedShare> parts = {{host.name, host.name, seconds_of(unfused, host.name), 0}};
        for (const Inside& guest : insides()) {
            if (has_a_clock(guest.stage) || std::count(guest.of.begin(), guest.of.end(), host.name) == 0) continue;
            double hosts = 0;  // unfused, of those that have a clock
            for (const char* name : guest.of)
                if (has_a_clock(name)) hosts += seconds_of(unfused, name);
            const double part = seconds_of(unfused, guest.stage) * parts[0].seconds / hosts;
            if (part > 0) parts.push_back({guest.stage, host.name, part, 0});
        }
        if (parts.size() == 1) continue;
        double all = 0;
        for (const FusedShare& part : parts) all += part.seconds;
        for (FusedShare& part : parts) {
            part.share = part.seconds / all;
            part.seconds = host.seconds * part.share;
            shares.push_back(part);
        }
    }
    return shares;
}

}  // namespace ambilux
