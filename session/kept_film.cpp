#include "session/kept_film.h"

#include "core/error.h"

namespace ambilux {

void KeptFilm::look(const RenderStats& stats) {
    constexpr int kShare = 1000;
    const auto start = Clock::now();
    if (start - copied_ < kShare * cost_) return;
    kept_ = {renderer_.film(), stats};
    copied_ = Clock::now();
    cost_ = copied_ - start;
}

KeptFilm::Finished KeptFilm::last() {
    try {
        Finished now = {renderer_.film(), renderer_.stats()};
        if (now.film.samples >= kept_.film.samples) return now;
    } catch (const Error& e) {
        if (e.code != ExitCode::device) throw;
    }
    kept_.stats.samples = kept_.film.samples;
    return std::move(kept_);
}

}  // namespace ambilux
