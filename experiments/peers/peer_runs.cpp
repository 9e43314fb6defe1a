#include "experiments/peers/peer_runs.h"

#include <fmt/format.h>

#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/log.h"
#include "core/version.h"
#include "film/png_io.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

nlohmann::json to_json(const PeerDescription& d) {
    return {{"version", d.version},
            {"device", d.device},
            {"backend", d.backend},
            {"load_seconds", d.load_seconds},
            {"compile_seconds", d.compile_seconds},
            {"changes", d.changes},
            {"differences", d.differences}};
}

/// Mitsuba's path, LuxCore's PATHCPU and PATHOCL.
bool is_path_tracer(const RunEntry& run) {
    const std::string name = setting_value(run.settings, "integrator");
    return run.renderer != "command" && (name.empty() || name.substr(0, 4) == "path" || name.substr(0, 4) == "PATH");
}

}  // namespace

PeerRuns::PeerRuns(const ExperimentRequest& request, const ExperimentConfig& config)
    : request_(request), config_(config) {
    const std::string path = request.output + "/peers.json";
    if (!std::filesystem::exists(path)) return;
    const nlohmann::json earlier = nlohmann::json::parse(read_file(path), nullptr, false);
    if (!earlier.is_array()) throw input_error(path, 0, "is damaged: remove it");
    for (const nlohmann::json& entry : earlier)
        if (entry.value("state", "") != "missing" && entry.value("state", "") != "refused") found_.push_back(entry);
}

const nlohmann::json* PeerRuns::find(const LoadedEntry& scene, const RunEntry& run) const {
    for (const nlohmann::json& entry : found_)
        if (entry.value("scene", "") == scene.entry->name && entry.value("run", "") == run.name) return &entry;
    return nullptr;
}

nlohmann::json* PeerRuns::entry_of(const LoadedEntry& scene, const RunEntry& run) {
    return const_cast<nlohmann::json*>(find(scene, run));
}

void PeerRuns::lose(const LoadedEntry& scene, const RunEntry& run, uint64_t seed, const std::string& reason) {
    log_warning(fmt::format("{} {} seed {} is left out: {}", scene.entry->name, run.name, seed, reason));
    nlohmann::json* const entry = entry_of(scene, run);
    if (!entry) return;
    found_again(scene, run, seed);
    (*entry)["lost"].push_back({{"seed", seed}, {"reason", reason}});
    write();
}

void PeerRuns::found_again(const LoadedEntry& scene, const RunEntry& run, uint64_t seed) {
    nlohmann::json* const entry = entry_of(scene, run);
    if (!entry || !entry->contains("lost")) return;
    nlohmann::json rest = nlohmann::json::array();
    for (const nlohmann::json& l : (*entry)["lost"])
        if (l.value("seed", uint64_t(0)) != seed) rest.push_back(l);
    (*entry)["lost"] = rest;
    write();
}

bool PeerRuns::agrees(const LoadedEntry& scene, const RunEntry& run) const {
    const nlohmann::json* entry = find(scene, run);
    return entry && (entry->value("state", "") == "agrees" || entry->value("state", "") == "untested");
}

bool PeerRuns::examine(const RenderOf& render, const Reference& reference) {
    if (find(render.scene, render.run)) return true;
    nlohmann::json entry = {{"scene", render.scene.entry->name},
                            {"run", render.run.name},
                            {"renderer", render.run.renderer},
                            {"reason", nullptr}};
    try {
        entry.update(find_state(render, reference));
    } catch (const PeerRefusal& e) {
        entry["state"] = e.missing ? "missing" : "refused";
        entry["reason"] = e.what();
    } catch (const Error& e) {
        if (e.code != ExitCode::interrupted) throw;
        return false;
    }
    const std::string state = entry["state"].get<std::string>();
    if (state == "differs" || state == "undecided")
        entry["reason"] = fmt::format(
            "its image of {} samples {}", entry["agreement"]["samples"].get<uint64_t>(),
            state == "differs" ? "differs from the reference"
                               : "has met too few events to be compared with the reference: raise agreement_spp");
    if (state != "agrees" && state != "untested")
        log_warning(fmt::format("{} {}: {} is not timed: {}", render.scene.entry->name, render.run.name,
                                render.run.renderer, entry["reason"].get<std::string>()));
    found_.push_back(entry);
    write();
    return true;
}

nlohmann::json PeerRuns::find_state(const RenderOf& render, const Reference& reference) const {
    const std::unique_ptr<PeerRenderer> peer = start(render);
    peer->set_seed(kAgreementSeed);
    nlohmann::json entry = to_json(peer->description());
    entry["state"] = "untested";
    if (!find_peer_kind(render.run.renderer)->tested) return entry;
    Agreement agreement = measure_agreement(*peer, config_.agreement_spp, reference, request_.interrupt);
    if (!agreement.interrupted && !agreement.agrees()) {
        // Few samples of a heavy tail look like another image, or like nothing. More of them, drawn anew, decide.
        peer->set_seed(kAgreementSeed - 1);
        agreement = measure_agreement(*peer, 4 * config_.agreement_spp, reference, request_.interrupt);
    }
    if (!agreement.interrupted && !agreement.agrees() && is_path_tracer(render.run)) {
        RenderSettings settings = render.settings;
        settings.integrator = RenderSettings().integrator;
        settings.variant = RenderSettings().variant;
        settings.sampler = Sampler::independent;
        settings.seed = kAgreementSeed;
        compare_with_own(agreement, *make_renderer(render.scene.scene, settings), request_.interrupt);
    }
    if (agreement.interrupted) throw Error(ExitCode::interrupted, "interrupted");
    const std::string image = fmt::format("images/{}/{}_agreement", render.scene.entry->name, render.run.name);
    write_exr(request_.output + "/" + image + ".exr", mean_image(agreement.parts));
    write_png(request_.output + "/" + image + ".png", mean_image(agreement.parts));
    entry["agreement"] = ambilux::to_json(agreement);
    entry["image"] = image + ".exr";
    entry["state"] = agreement.agrees() ? "agrees" : agreement.test.undecided ? "undecided" : "differs";
    return entry;
}

std::unique_ptr<PeerRenderer> PeerRuns::start(const RenderOf& render) const {
    if (render.scene.scene.sensor.filter != FilterType::box)
        throw PeerRefusal(false, "the filter of the scene is not box: write filter = \"box\" in the configuration");
    PeerJob job;
    job.run = &render.run;
    job.scene = &render.scene.scene;
    job.scene_name = render.scene.entry->name;
    job.scene_path = render.scene.entry->path;
    job.parameters = render.scene.entry->parameters;
    job.max_depth = render.settings.max_depth;
    job.rr_depth = render.settings.rr_depth;
    job.folder = fmt::format("{}/peers/{}/{}", std::filesystem::absolute(request_.output).string(),
                             render.scene.entry->name, render.run.name);
    job.interrupt = request_.interrupt;
    make_folders(job.folder);
    return find_peer_kind(render.run.renderer)->start(job);
}

std::unique_ptr<Renderer> PeerRuns::make(const RenderOf& render, const RenderStats&) {
    std::unique_ptr<PeerRenderer> peer = start(render);
    peer->set_seed(render.settings.seed);
    return peer;
}

MethodNames PeerRuns::names(const RenderOf& render, const RenderStats&) const {
    const nlohmann::json* entry = find(render.scene, render.run);
    MethodNames names{setting_value(render.run.settings, "integrator"), setting_value(render.run.settings, "variant"),
                      "", entry ? entry->value("version", "") : render.run.renderer, ""};
    if (names.integrator.empty())
        names.integrator = render.run.renderer;
    else
        names.method += " " + names.integrator;
    if (!names.variant.empty()) names.method += " " + names.variant;
    return names;
}

nlohmann::json PeerRuns::statistics(const RenderOf& render, const RenderStats& stats) const {
    const Scene& scene = render.scene.scene;
    const nlohmann::json* entry = find(render.scene, render.run);
    nlohmann::json stages = nlohmann::json::array();
    for (const StageStats& s : stats.stages)
        stages.push_back({{"name", s.name}, {"launches", s.launches}, {"items", s.items}, {"seconds", s.seconds}});
    return {{"method", names(render, stats).method},
            {"renderer", render.run.renderer},
            {"peer", entry ? *entry : nlohmann::json(nullptr)},
            {"scene", scene.path},
            {"scene_hash", scene_hash(scene)},
            {"backend", stats.backend},
            {"device", stats.device},
            {"size", {scene.sensor.crop_width, scene.sensor.crop_height}},
            {"spp", stats.samples},
            {"max_depth", render.settings.max_depth},
            {"rr_depth", render.settings.rr_depth},
            {"seed", render.settings.seed},
            {"seconds",
             {{"load", entry ? entry->value("load_seconds", 0.0) : 0.0},
              {"build", stats.build_seconds},
              {"render", stats.render_seconds}}},
            {"stages", stages},
            {"invalid", {{"nan", stats.invalid.nan}, {"inf", stats.invalid.inf}, {"negative", stats.invalid.negative}}},
            {"version", version()},
            {"git_revision", git_revision()}};
}

Attributes PeerRuns::attributes(const RenderOf& render, const RenderStats& stats) const {
    return {{"method", names(render, stats).method},
            {"renderer", render.run.renderer},
            {"scene", render.scene.scene.path},
            {"scene_hash", scene_hash(render.scene.scene)},
            {"spp", stats.samples},
            {"seed", render.settings.seed},
            {"max_depth", render.settings.max_depth},
            {"rr_depth", render.settings.rr_depth},
            {"backend", stats.backend},
            {"device", stats.device},
            {"seconds", stats.render_seconds}};
}

void PeerRuns::write() const { write_file_atomic(request_.output + "/peers.json", found_.dump(2) + "\n"); }

}  // namespace ambilux
