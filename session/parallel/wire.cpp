#include "session/parallel/wire.h"

#include <cstring>
#include <span>

#include "core/error.h"
#include "session/stats_sum.h"

namespace ambilux {
namespace {

struct Head {
    uint64_t width, height, samples;
    uint64_t text;  ///< bytes; states follow
};

/// Before the bytes of each state.
struct StateHead {
    uint64_t device, range, bytes;
};

constexpr const char* kCutOff = "a message of another rank is cut off";

template <class T>
void put(std::string& message, const T& value) {
    message.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::vector<RangeState> read_states(std::string_view bytes) {
    std::vector<RangeState> states;
    while (!bytes.empty()) {
        StateHead head;
        if (bytes.size() < sizeof head) throw Error(ExitCode::device, kCutOff);
        std::memcpy(&head, bytes.data(), sizeof head);
        bytes.remove_prefix(sizeof head);
        if (bytes.size() < head.bytes) throw Error(ExitCode::device, kCutOff);
        const auto* const state = reinterpret_cast<const std::byte*>(bytes.data());
        states.push_back({size_t(head.device), head.range, {state, state + head.bytes}});
        bytes.remove_prefix(head.bytes);
    }
    return states;
}

}  // namespace

void tell(Ranks& ranks, int to, Say kind, const nlohmann::json& text, const FilmMoments* film,
          const std::vector<RangeState>& states) {
    const std::string words = text.dump();
    Head head = {0, 0, 0, words.size()};
    std::vector<std::span<const double>> arrays;
    if (film) {
        head = {film->width, film->height, film->samples, words.size()};
        arrays = {film->sum, film->sum_squares};
    }
    std::string message;
    put(message, head);
    message += words;
    for (const RangeState& s : states) {
        put(message, StateHead{s.device, s.range, s.state.size()});
        message.append(reinterpret_cast<const char*>(s.state.data()), s.state.size());
    }
    ranks.send(to, int(kind), message, arrays);
}

void tell_part(Ranks& ranks, const Finished& f) {
    tell(ranks, f.order.collector, Say::part, {{"block", node_text(f.order.block)}, {"node", node_text(f.order.node)}},
         &f.film);
}

std::optional<Told> hear(Ranks& ranks, Arrays* memory) {
    std::optional<RankMessage> message = ranks.poll(memory);
    if (!message) return std::nullopt;
    Head head;
    std::string_view bytes = message->bytes;
    if (bytes.size() < sizeof head) throw Error(ExitCode::device, kCutOff);
    std::memcpy(&head, bytes.data(), sizeof head);
    bytes.remove_prefix(sizeof head);
    if (bytes.size() < head.text) throw Error(ExitCode::device, kCutOff);
    Told told = {message->from,
                 Say(message->kind),
                 nlohmann::json::parse(bytes.substr(0, head.text)),
                 {},
                 read_states(bytes.substr(head.text))};
    told.film = {uint32_t(head.width), uint32_t(head.height), head.samples, {}, {}};
    if (message->arrays.size() == 2) {
        told.film.sum = std::move(message->arrays[0]);
        told.film.sum_squares = std::move(message->arrays[1]);
    }
    if (told.film.sum.size() != 3 * head.width * head.height || told.film.sum_squares.size() != told.film.sum.size())
        throw Error(ExitCode::device, kCutOff);
    return told;
}

Arrays memory_of(FilmMoments film) {
    Arrays memory;
    for (std::vector<double>* values : {&film.sum, &film.sum_squares})
        if (!values->empty()) memory.push_back(std::move(*values));
    return memory;
}

nlohmann::json node_text(const RangeNode& node) { return {node.level, node.index}; }
RangeNode read_node(const nlohmann::json& text) { return {text.at(0), text.at(1)}; }

nlohmann::json order_text(const Order& order, bool last) {
    return {{"size", order.ranges.size},
            {"samples", order.ranges.samples},
            {"node", node_text(order.node)},
            {"seconds_left", order.seconds_left},
            {"block", node_text(order.block)},
            {"collector", order.collector},
            {"last", last}};
}

Order read_order(const nlohmann::json& t) {
    return {{t.at("size"), t.at("samples")}, read_node(t.at("node")), t.at("seconds_left"), 0,
            read_node(t.at("block")),        t.at("collector")};
}

nlohmann::json work_text(const std::vector<DeviceWork>& devices) {
    nlohmann::json text = nlohmann::json::array();
    for (const DeviceWork& d : devices)
        text.push_back(
            {{"samples", d.samples}, {"ranges", d.ranges}, {"seconds", d.seconds}, {"stats", save_stats(d.stats)}});
    return text;
}

std::vector<DeviceWork> restore_work(const nlohmann::json& text) {
    std::vector<DeviceWork> devices;
    for (const auto& d : text)
        devices.push_back({d.at("samples"), d.at("ranges"), d.at("seconds"), restore_stats(d.at("stats"))});
    return devices;
}

}  // namespace ambilux
