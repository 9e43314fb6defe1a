// What integrator toy can be told.
#pragma once

namespace ambilux {

struct RenderSettings;

struct ToySettings {
    float radius = 0.0f;  ///< surfaces further away than this do not shade; 0: no limit

    static ToySettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
