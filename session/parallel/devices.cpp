#include "session/parallel/devices.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "backends/cuda_device.h"
#include "core/error.h"

namespace ambilux {
namespace {

Device parse(const std::string& name) {
    if (name == "cpu") return {};
    Device device;
    const char* const end = name.data() + name.size();
    const auto [rest, error] = std::from_chars(name.data(), end, device.cuda);
    if (error != std::errc() || rest != end || device.cuda < 0)
        throw Error(ExitCode::usage, fmt::format("--devices {}: numbers of CUDA devices or cpu are known", name));
    return device;
}

}  // namespace

std::vector<Device> choose_devices(const std::vector<std::string>& names, const RenderSettings& settings,
                                   const Ranks& ranks) {
    std::vector<Device> devices;
    for (const std::string& name : names) devices.push_back(parse(name));
    const auto on_cuda = [](const Device& d) { return d.cuda >= 0; };
    const bool cuda = std::any_of(devices.begin(), devices.end(), on_cuda),
               cpu = !std::all_of(devices.begin(), devices.end(), on_cuda);
    if ((cuda && settings.backend == Backend::cpu) || (cpu && settings.backend == Backend::cuda))
        throw Error(ExitCode::usage, "--devices and --backend ask for different ones: leave --backend out");
    if (cuda && cpu && settings.deterministic)
        throw Error(ExitCode::usage,
                    "--devices: --deterministic means the same bits, which the CPU and CUDA devices do not make");
    if (devices.empty()) {
        const bool open = settings.backend == Backend::automatic && settings.accel != AccelKind::embree &&
                          settings.precision != Precision::in_double;
        if (settings.backend != Backend::cuda && !(open && cuda_available())) return {{}};
        return {{ranks.local_rank() % std::max(1, cuda_device_count())}};
    }
    const auto rank = size_t(ranks.local_rank()), others = size_t(ranks.local_size());
    std::vector<Device> own;
    for (size_t i = rank; i < devices.size(); i += others) own.push_back(devices[i]);
    if (own.empty()) own.push_back(devices[rank % devices.size()]);
    return own;
}

}  // namespace ambilux
