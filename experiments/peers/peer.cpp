#include "experiments/peers/peer.h"

#include "experiments/peers/command_peer.h"
#include "experiments/peers/image_peer.h"
#include "experiments/peers/python_peer.h"

namespace ambilux {

std::string setting_value(const Settings& settings, const std::string& key) {
    for (const auto& [name, value] : settings)
        if (name == key) return value;
    return "";
}

const std::vector<PeerKind>& peer_kinds() {
    static const std::vector<PeerKind> kinds = {
        {"mitsuba",
         {"path", "ptracer"},
         {"scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"},
         {},
         {},
         nullptr,
         false,
         true,
         start_python_peer},
        {"luxcore", {"PATHCPU", "BIDIRCPU", "PATHOCL"}, {}, {}, {}, nullptr, false, true, start_python_peer, false},
        {"build", {}, {}, {"module"}, {}, nullptr, true, true, start_python_peer},
        {"command", {}, {}, {"command"}, {}, check_command, false, true, start_command_peer},
        {"images", {}, {}, {"files"}, {"samples", "seconds"}, check_images, false, false, start_image_peer},
    };
    return kinds;
}

const PeerKind* find_peer_kind(const std::string& name) {
    for (const PeerKind& kind : peer_kinds())
        if (kind.name == name) return &kind;
    return nullptr;
}

}  // namespace ambilux
