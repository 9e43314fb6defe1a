// What ranks tell each other during a render.
#pragma once

#include <nlohmann/json.hpp>

#include "core/ranks.h"
#include "experiments/parallel/crew.h"
#include "film/moments.h"

namespace ambilux {

enum class Say : int {
    setup = 1,  ///< first rank to all: what is rendered
    ready,      ///< back: host and devices
    wanted,     ///< back: how many ranges it could begin
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

/// An order as its rank hears it; `last`: no other one answers the same wish.
nlohmann::json order_text(const Order& order, bool last);
Order read_order(const nlohmann::json& text);

nlohmann::json work_text(const std::vector<DeviceWork>& devices);
std::vector<DeviceWork> restore_work(const nlohmann::json& text);

}  // namespace ambilux
