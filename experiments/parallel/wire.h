// What ranks tell each other during a render.
#pragma once

#include <nlohmann/json.hpp>

#include "core/ranks.h"
#include "film/moments.h"

namespace ambilux {

enum class Say : int {
    setup = 1,  ///< first rank to all: what is rendered
    ready,      ///< back: host and devices
    order,      ///< to one: which ranges
    finished,   ///< back: their film
    stop,       ///< to all: nothing is left to do
};

void tell(Ranks& ranks, int to, Say kind, const nlohmann::json& text, const FilmMoments* film = nullptr);

struct Told {
    int from = 0;
    Say kind = Say::stop;
    nlohmann::json text;
    FilmMoments film;
};
std::optional<Told> hear(Ranks& ranks);

}  // namespace ambilux
