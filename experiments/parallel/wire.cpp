#include "experiments/parallel/wire.h"

#include <cstring>

#include "core/error.h"
#include "experiments/stats_sum.h"

namespace ambilux {
namespace {

struct Head {
    uint64_t text, width, height, samples, values;
};

}  // namespace

void tell(Ranks& ranks, int to, Say kind, const nlohmann::json& text, const FilmMoments* film) {
    const std::string words = text.dump();
    Head head = {words.size(), 0, 0, 0, 0};
    if (film) head = {words.size(), film->width, film->height, film->samples, film->sum.size()};
    const size_t bytes = head.values * sizeof(double);
    std::string message(sizeof head + words.size() + 2 * bytes, '\0');
    char* at = message.data();
    const auto put = [&](const void* from, size_t count) {
        if (count) std::memcpy(at, from, count);
        at += count;
    };
    put(&head, sizeof head);
    put(words.data(), words.size());
    if (film) {
        put(film->sum.data(), bytes);
        put(film->sum_squares.data(), bytes);
    }
    ranks.send(to, int(kind), message);
}

std::optional<Told> hear(Ranks& ranks) {
    const std::optional<RankMessage> message = ranks.poll();
    if (!message) return std::nullopt;
    Head head;
    const std::string& bytes = message->bytes;
    if (bytes.size() < sizeof head) throw Error(ExitCode::device, "a message of another rank is cut off");
    std::memcpy(&head, bytes.data(), sizeof head);
    if (bytes.size() != sizeof head + head.text + 2 * head.values * sizeof(double))
        throw Error(ExitCode::device, "a message of another rank is cut off");
    const char* at = bytes.data() + sizeof head;
    Told told = {message->from, Say(message->kind), nlohmann::json::parse(at, at + head.text), {}};
    at += head.text;
    told.film = {uint32_t(head.width), uint32_t(head.height), head.samples, std::vector<double>(head.values),
                 std::vector<double>(head.values)};
    for (std::vector<double>* values : {&told.film.sum, &told.film.sum_squares}) {
        if (head.values) std::memcpy(values->data(), at, head.values * sizeof(double));
        at += head.values * sizeof(double);
    }
    return told;
}

nlohmann::json order_text(const Order& order, bool last) {
    return {{"size", order.ranges.size}, {"samples", order.ranges.samples},    {"level", order.node.level},
            {"index", order.node.index}, {"seconds_left", order.seconds_left}, {"last", last}};
}

Order read_order(const nlohmann::json& t) {
    return {{t.at("size"), t.at("samples")}, {t.at("level"), t.at("index")}, t.at("seconds_left")};
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
