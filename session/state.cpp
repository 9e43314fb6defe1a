#include "session/state.h"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/log.h"
#include "render/renderer.h"

namespace ambilux {
namespace {

constexpr char kMagic[] = "ambilux state 4\n";

/// FNV-1a, 64 bits: against truncation and bit rot, not against people.
uint64_t checksum(std::string_view bytes) {
    uint64_t hash = 0xcbf29ce484222325ull;
    for (const char c : bytes) hash = (hash ^ uint8_t(c)) * 0x100000001b3ull;
    return hash;
}

template <class T>
void put(std::string& out, const T* values, size_t count) {
    out.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

template <class T>
bool take(std::string_view& in, T* values, size_t count) {
    if (count > in.size() / sizeof(T)) return false;
    if (count == 0) return true;                        // values may be null then, which memcpy must not be given
    std::memcpy(values, in.data(), count * sizeof(T));  // NOLINT(bugprone-suspicious-stringview-data-usage): sized
    in.remove_prefix(count * sizeof(T));
    return true;
}

}  // namespace

DeviceStates save_devices(Renderer& renderer) {
    if (renderer.state_kind() != StateKind::per_device) return {};
    return {renderer.save_state()};
}

void load_devices(Renderer& renderer, const DeviceStates& saved, const std::string& path) {
    if (renderer.state_kind() != StateKind::per_device) return;
    check_devices(saved, 1, path);
    if (!saved[0].empty()) renderer.load_state(saved[0]);
}

void check_devices(const DeviceStates& saved, size_t count, const std::string& path) {
    if (saved.size() == count) return;
    const auto devices = [](size_t n) { return fmt::format("{} device{}", n, n == 1 ? "" : "s"); };
    throw input_error(path, 0,
                      fmt::format("{} saved what this method has learned, and {} would go on: take as many devices, or "
                                  "remove the file",
                                  devices(saved.size()), devices(count)));
}

void write_state(const std::string& path, const RenderState& state) {
    const FilmMoments& m = state.moments;
    const std::string notes = state.notes.dump();
    std::string out = kMagic;
    const uint64_t numbers[] = {notes.size(), m.width, m.height, m.samples, m.sum.size(), state.devices.size()};
    put(out, numbers, 6);
    out += notes;
    put(out, m.sum.data(), m.sum.size());
    put(out, m.sum_squares.data(), m.sum_squares.size());
    for (const std::vector<std::byte>& device : state.devices) {
        const uint64_t bytes = device.size();
        put(out, &bytes, 1);
        put(out, device.data(), device.size());
    }
    const uint64_t hash = checksum(out);
    put(out, &hash, 1);
    write_file_atomic(path, out);
}

std::optional<RenderState> read_state(const std::string& path) {
    if (!std::filesystem::exists(path)) return std::nullopt;
    const std::string content = read_file(path);
    std::string_view in = content;
    const auto damaged = [&] {
        log_warning(path + " is damaged, or of another version: this render begins anew");
        return std::nullopt;
    };
    uint64_t hash = 0, numbers[6];
    if (content.size() < sizeof hash) return damaged();
    std::memcpy(&hash, content.data() + content.size() - sizeof hash, sizeof hash);
    in.remove_suffix(sizeof hash);
    if (!in.starts_with(kMagic) || checksum(in) != hash) return damaged();
    in.remove_prefix(sizeof kMagic - 1);
    if (!take(in, numbers, 6) || numbers[0] > in.size()) return damaged();
    RenderState state;
    state.notes = nlohmann::json::parse(in.substr(0, numbers[0]), nullptr, false);
    in.remove_prefix(numbers[0]);
    if (state.notes.is_discarded() || numbers[4] > in.size() || numbers[4] != numbers[1] * numbers[2] * 3)
        return damaged();
    state.moments = {uint32_t(numbers[1]), uint32_t(numbers[2]), numbers[3], std::vector<double>(numbers[4]),
                     std::vector<double>(numbers[4])};
    if (!take(in, state.moments.sum.data(), numbers[4]) || !take(in, state.moments.sum_squares.data(), numbers[4]))
        return damaged();
    for (uint64_t device = 0; device < numbers[5]; ++device) {
        uint64_t bytes = 0;
        if (!take(in, &bytes, 1) || bytes > in.size()) return damaged();
        state.devices.emplace_back(bytes);
        take(in, state.devices.back().data(), bytes);
    }
    if (!in.empty()) return damaged();
    return state;
}

}  // namespace ambilux
