// What a backend runs together: a value that stages and schedules are made for.
#pragma once

namespace ambilux {

/// What a backend runs as part of the stage before it, without a queue in between.
struct Fusion {
    bool weigh = false;    ///< mis_weight, and accumulate
    bool connect = false;  ///< connect_emitter and connect_camera, in the stage that makes the vertex
    bool occlude =
        false;  ///< for bdpt connect_vertices, in the stage that makes the eye vertex, and shadow rays
                ///< whenever there are many: on a host, which goes through queues while they are in its cache
    bool generate = false;  ///< camera rays, in extend
};

/// `a` or `b`, of different types.
template <bool kFirst, class A, class B>
constexpr auto choose(const A& a, const B& b) {
    if constexpr (kFirst)
        return a;
    else
        return b;
}

}  // namespace ambilux
