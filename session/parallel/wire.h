// What ranks tell each other during a render.
#pragma once

#include <nlohmann/json.hpp>

#include "core/ranks.h"
#include "film/moments.h"
#include "session/parallel/crew.h"

namespace ambilux {

enum class Say : int {
    setup = 1,  ///< first rank to all: what is rendered
    ready,      ///< back: host and devices
    wanted,     ///< back: how many ranges it could begin
    states,     ///< to one: what its devices kept from an earlier part, before its first order
    order,      ///< to one: which ranges
    finished,   ///< back: they are rendered; with their film, if no other rank collects it
    part,       ///< to the rank that collects: that film
    collected,  ///< from there to the first one: films of a block, added up
    hand_over,  ///< first rank to all: it wants what they have collected
    stop,       ///< to all: nothing is left to do
};

void tell(Ranks& ranks, int to, Say kind, const nlohmann::json& text, const FilmMoments* film = nullptr,
          const std::vector<RangeState>& states = {});

/// The film of a node, to the rank that collects it.
void tell_part(Ranks& ranks, const Finished& finished);

struct Told {
    int from = 0;
    Say kind = Say::stop;
    nlohmann::json text;
    FilmMoments film;
    std::vector<RangeState> states;
};
/// A film lies in `memory`, if that is large enough.
std::optional<Told> hear(Ranks& ranks, Arrays* memory = nullptr);
/// Of a film that is not used any more.
Arrays memory_of(FilmMoments film);

/// An order as its rank hears it; `last`: no other one answers the same wish.
nlohmann::json order_text(const Order& order, bool last);
Order read_order(const nlohmann::json& text);

nlohmann::json node_text(const RangeNode& node);
RangeNode read_node(const nlohmann::json& text);

nlohmann::json work_text(const std::vector<DeviceWork>& devices);
std::vector<DeviceWork> restore_work(const nlohmann::json& text);

}  // namespace ambilux
