#include "session/stats_sum.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "integrators/setting.h"

namespace ambilux {
namespace {

constexpr double RenderStats::* kBuildTimes[] = {&RenderStats::device_seconds, &RenderStats::build_seconds,
                                                 &RenderStats::structure_seconds, &RenderStats::kernel_seconds};

template <class Item>
const Item* named(const std::vector<Item>& items, const std::string& name) {
    const auto found = std::find_if(items.begin(), items.end(), [&](const Item& item) { return item.name == name; });
    return found == items.end() ? nullptr : &*found;
}

template <class Item>
Item& named_or_new(std::vector<Item>& items, const std::string& name) {
    if (const Item* found = named(items, name)) return const_cast<Item&>(*found);
    items.push_back({});
    items.back().name = name;
    return items.back();
}

void add(InvalidCounts& total, const InvalidCounts& before, const InvalidCounts& now) {
    total.nan += now.nan - before.nan;
    total.inf += now.inf - before.inf;
    total.negative += now.negative - before.negative;
    total.underflow += now.underflow - before.underflow;
}

nlohmann::json save(const InvalidCounts& c) { return {c.nan, c.inf, c.negative, c.underflow}; }
InvalidCounts restore(const nlohmann::json& j) {
    return {j.at(0).get<uint64_t>(), j.at(1).get<uint64_t>(), j.at(2).get<uint64_t>(), j.at(3).get<uint64_t>()};
}

nlohmann::json save(const RenderSettings& settings) {
    nlohmann::json pairs = nlohmann::json::array();
    for (const Setting& s : general_settings()) pairs.push_back({s.what.key, s.text(settings)});
    for (const auto& [key, value] : settings.own) pairs.push_back({key, value});
    return pairs;
}

nlohmann::json save(const SelectionStats& c) {
    nlohmann::json candidates = nlohmann::json::array();
    // Infinite variances become null.
    for (const SelectionStats::Candidate& x : c.candidates)
        candidates.push_back({x.name, x.settings, x.variance, x.work, x.seconds, x.efficiency, x.excluded});
    return {c.name, c.settings, c.seconds, c.pilot_samples, c.expected_samples, candidates};
}

SelectionStats restore_selection(const nlohmann::json& j) {
    SelectionStats c;
    c.name = j.at(0);
    c.settings = j.at(1).get<std::vector<std::pair<std::string, std::string>>>();
    c.seconds = j.at(2);
    c.pilot_samples = j.at(3);
    c.expected_samples = j.at(4);
    for (const auto& x : j.at(5))
        c.candidates.push_back({x.at(0), x.at(1),
                                x.at(2).is_null() ? std::numeric_limits<double>::infinity() : x.at(2).get<double>(),
                                x.at(3), x.at(4), x.at(5), x.size() > 6 ? x.at(6) : nlohmann::json("")});
    return c;
}

}  // namespace

void add_part(RenderStats& total, const RenderStats& before, const RenderStats& now) {
    RenderStats sum = now;
    // A resumed render goes on with what its first part chose.
    if (sum.selection.name.empty()) sum.selection = total.selection;
    sum.stages = total.stages;
    sum.queues = total.queues;
    sum.invalid = total.invalid;
    sum.invalid_by_stage = total.invalid_by_stage;
    sum.memory_bytes_peak = std::max(total.memory_bytes_peak, now.memory_bytes_peak);
    sum.render_seconds = total.render_seconds + now.render_seconds - before.render_seconds;
    sum.rays_extend = total.rays_extend + now.rays_extend - before.rays_extend;
    sum.rays_occlude = total.rays_occlude + now.rays_occlude - before.rays_occlude;
    for (const StageStats& s : now.stages) {
        const StageStats* first = named(before.stages, s.name);
        const StageStats none, &b = first ? *first : none;
        StageStats& t = named_or_new(sum.stages, s.name);
        t.launches += s.launches - b.launches;
        t.items += s.items - b.items;
        t.seconds += s.seconds - b.seconds;
        t.items_by_depth.resize(std::max(t.items_by_depth.size(), s.items_by_depth.size()));
        for (size_t i = 0; i < s.items_by_depth.size(); ++i)
            t.items_by_depth[i] += s.items_by_depth[i] - (i < b.items_by_depth.size() ? b.items_by_depth[i] : 0);
    }
    for (const QueueStats& q : now.queues) {
        const QueueStats* first = named(before.queues, q.name);
        QueueStats& t = named_or_new(sum.queues, q.name);
        t.capacity = q.capacity;
        t.peak = std::max(t.peak, q.peak);
        t.overflow += q.overflow - (first ? first->overflow : 0);
    }
    add(sum.invalid, before.invalid, now.invalid);
    for (const auto& [stage, counts] : now.invalid_by_stage) {
        const auto first = before.invalid_by_stage.find(stage);
        add(sum.invalid_by_stage[stage], first == before.invalid_by_stage.end() ? InvalidCounts{} : first->second,
            counts);
    }
    total = std::move(sum);
}

RenderStats sum_of_devices(RenderStats sum, const std::vector<std::pair<std::string, RenderStats>>& devices,
                           bool hosts) {
    RenderStats together;
    std::map<std::string, int> names;
    for (const auto& [host, stats] : devices) {
        add_part(sum, {}, stats);
        together.memory_bytes += stats.memory_bytes;
        together.memory_bytes_predicted += stats.memory_bytes_predicted;
        together.memory_bytes_peak += stats.memory_bytes_peak;
        for (double RenderStats::* part : kBuildTimes) together.*part = std::max(together.*part, stats.*part);
        ++names[host + ": " + stats.device];
    }
    sum.device.clear();
    for (const auto& [name, count] : names)
        sum.device +=
            fmt::format("{}{}{}", sum.device.empty() ? "" : "; ", count > 1 ? fmt::format("{} x ", count) : "",
                        names.size() > 1 || hosts ? name : devices[0].second.device);
    sum.memory_bytes = together.memory_bytes;
    sum.memory_bytes_predicted = together.memory_bytes_predicted;
    sum.memory_bytes_peak = together.memory_bytes_peak;
    for (double RenderStats::* part : kBuildTimes) sum.*part = together.*part;
    return sum;
}

nlohmann::json save_stats(const RenderStats& s) {
    nlohmann::json stages = nlohmann::json::array(), queues = nlohmann::json::array(),
                   invalid = nlohmann::json::object();
    for (const StageStats& stage : s.stages)
        stages.push_back({stage.name, stage.launches, stage.items, stage.seconds, stage.items_by_depth});
    for (const QueueStats& q : s.queues) queues.push_back({q.name, q.capacity, q.peak, q.overflow});
    for (const auto& [stage, counts] : s.invalid_by_stage) invalid[stage] = save(counts);
    return {{"backend", s.backend},
            {"device", s.device},
            {"accel", s.accel},
            {"settings", save(s.settings)},
            {"build_seconds", s.build_seconds},
            {"build_parts", {s.device_seconds, s.structure_seconds, s.kernel_seconds}},
            {"render_seconds", s.render_seconds},
            {"samples", s.samples},
            {"wave_paths", s.wave_paths},
            {"rays", {s.rays_extend, s.rays_occlude}},
            {"stages", stages},
            {"queues", queues},
            {"invalid", save(s.invalid)},
            {"invalid_by_stage", invalid},
            {"memory", {s.memory_bytes, s.memory_bytes_predicted, s.memory_bytes_peak}},
            {"features", s.features},
            {"skipped", s.skipped},
            {"selection", save(s.selection)}};
}

RenderStats restore_stats(const nlohmann::json& j) {
    RenderStats s;
    s.backend = j.at("backend");
    s.device = j.at("device");
    s.accel = j.at("accel");
    for (const auto& setting : j.at("settings")) apply_setting(s.settings, setting.at(0), setting.at(1));
    s.build_seconds = j.at("build_seconds");
    if (j.contains("build_parts")) {  // states of older versions lack them
        s.device_seconds = j["build_parts"].at(0);
        s.structure_seconds = j["build_parts"].at(1);
        s.kernel_seconds = j["build_parts"].at(2);
    }
    s.render_seconds = j.at("render_seconds");
    s.samples = j.at("samples");
    s.wave_paths = j.value("wave_paths", 0u);  // states of older versions lack it
    s.rays_extend = j.at("rays").at(0);
    s.rays_occlude = j.at("rays").at(1);
    for (const auto& stage : j.at("stages"))
        s.stages.push_back({stage.at(0), stage.at(1).get<uint64_t>(), stage.at(2).get<uint64_t>(),
                            stage.at(3).get<double>(), stage.at(4).get<std::vector<uint64_t>>()});
    for (const auto& q : j.at("queues"))
        s.queues.push_back({q.at(0), q.at(1).get<uint64_t>(), q.at(2).get<uint64_t>(), q.at(3).get<uint64_t>()});
    s.invalid = restore(j.at("invalid"));
    for (const auto& [stage, counts] : j.at("invalid_by_stage").items()) s.invalid_by_stage[stage] = restore(counts);
    s.memory_bytes = j.at("memory").at(0);
    s.memory_bytes_predicted = j.at("memory").at(1);
    s.memory_bytes_peak = j.at("memory").at(2);
    s.features = j.at("features").get<std::vector<std::string>>();
    s.skipped = j.at("skipped").get<std::vector<std::string>>();
    s.selection = restore_selection(j.at("selection"));
    return s;
}

}  // namespace ambilux
