// The state of a method (integrators/kept_state.h) in the memory of a backend: allocated, grown, saved.
#pragma once

#include <cstring>
#include <span>

#include "core/error.h"
#include "render/wave_maker.h"

namespace ambilux {

/// `Memory`: HostMemory or DeviceMemory.
template <class Memory, class Maker>
class StateMemory {
    using State = typename Maker::State;

public:
    explicit StateMemory(Maker& maker) : maker_(maker) {}

    uint64_t bytes() const { return memory_.bytes(); }
    const Layout& layout() const { return layout_; }
    std::vector<QueueCounter> counters() const {
        std::vector<QueueCounter> all(layout_.queue_names().size());
        Memory::get(all.data(), layout_.counters(), all.size() * sizeof(QueueCounter));
        return all;
    }

    void allocate() {
        place();
        maker_.state.init(maker_.policy, [](auto* to, const auto& values) {
            Memory::put(to, values.data(), values.size() * sizeof(values[0]));
        });
    }

    /// Bytes of the next grow().
    uint64_t grown_bytes() {
        const uint32_t before = std::exchange(maker_.appended, needed());
        const uint64_t bytes = maker_.state_bytes();
        maker_.appended = before;
        return bytes;
    }
    /// More room for what waves append. The state's places change; what is there stays as far as take_items copies it:
    /// init is not called again.
    void grow() {
        if constexpr (AppendedState<State>) {
            const std::vector<QueueCounter> old_counters = counters();
            maker_.appended = needed();
            const State old_state = maker_.state;
            const Memory old = std::move(memory_);
            place();
            const size_t queue = layout_.growing().front();
            std::vector<QueueCounter> all = layout_.first_counters();
            for (size_t q = 0; q < all.size(); ++q) {
                all[q].count = old_counters[q].count;
                all[q].peak = std::min<uint64_t>(old_counters[q].peak, old_counters[q].capacity);
                all[q].overflow = old_counters[q].overflow;
            }
            Memory::put(layout_.counters(), all.data(), all.size() * sizeof(QueueCounter));
            maker_.state.take_items(old_state, all[queue].count, [](auto* to, const auto* from, uint64_t count) {
                Memory::copy(to, from, count * sizeof(*to));
            });
        }
    }

    /// What a resumed render needs of it: of each array its name, its size, its bytes.
    std::vector<std::byte> save() const {
        std::vector<std::byte> saved;
        const auto grown = [&](size_t bytes) {
            saved.resize(saved.size() + bytes);
            return saved.data() + saved.size() - bytes;
        };
        maker_.state.for_each_saved([&](const char* name, auto* place, uint64_t count) {
            const uint64_t bytes = count * sizeof(*place), letters = std::strlen(name);
            std::memcpy(grown(sizeof(letters)), &letters, sizeof(letters));
            std::memcpy(grown(letters), name, letters);
            std::memcpy(grown(sizeof(bytes)), &bytes, sizeof(bytes));
            Memory::get(grown(bytes), place, bytes);
        });
        return saved;
    }
    /// Throws Error(bad_input) that names what does not fit.
    void load(std::span<const std::byte> saved) {
        const auto next = [&](uint64_t bytes, const char* name) {
            if (saved.size() < bytes)
                throw Error(ExitCode::bad_input, std::string("saved state: it ends within ") + name);
            const std::span<const std::byte> part = saved.first(bytes);
            saved = saved.subspan(bytes);
            return part;
        };
        const auto number = [&](const char* name) {
            uint64_t value;
            std::memcpy(&value, next(sizeof(value), name).data(), sizeof(value));
            return value;
        };
        maker_.state.for_each_saved([&](const char* name, auto* place, uint64_t count) {
            const auto letters = next(number(name), name);
            const std::string found(reinterpret_cast<const char*>(letters.data()), letters.size());
            const uint64_t bytes = number(name);
            if (found != name || bytes != count * sizeof(*place))
                throw Error(ExitCode::bad_input, "saved state: '" + found + "' of " + std::to_string(bytes) +
                                                     " bytes, where this render has '" + name + "' of " +
                                                     std::to_string(count * sizeof(*place)));
            Memory::put(place, next(bytes, name).data(), bytes);
        });
        if (!saved.empty()) throw Error(ExitCode::bad_input, "saved state: there is more than this render has");
    }

private:
    void place() {
        Layout dry;
        maker_.lay_out_state(dry);
        memory_ = Memory(dry.bytes(), "state");
        layout_ = Layout(dry, memory_.data());
        maker_.state = maker_.lay_out_state(layout_);
        const std::vector<QueueCounter> first = layout_.first_counters();
        Memory::put(layout_.counters(), first.data(), first.size() * sizeof(QueueCounter));
    }
    /// Half as much again as was asked for.
    uint32_t needed() const {
        const uint64_t most = layout_.most_grown(counters().data());
        return uint32_t(std::min<uint64_t>(std::max<uint64_t>(most, maker_.appended) * 3 / 2 + 64, 0xfffffff0u));
    }

    Maker& maker_;
    Layout layout_;
    Memory memory_;
};

}  // namespace ambilux
