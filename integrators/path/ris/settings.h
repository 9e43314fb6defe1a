// What variant ris of integrator path can be told.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

struct RisSettings {
    static constexpr uint32_t kMostCandidates = 64;

    uint32_t candidates = 8;  ///< emitter samples that an eye vertex chooses from

    static RisSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
