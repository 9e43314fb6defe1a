// Other renderers that take part in an experiment. The list of their kinds is in peer.cpp.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "experiments/config.h"
#include "scene/scene.h"
#include "session/drive.h"

namespace ambilux {

/// What a peer is asked to render.
struct PeerJob {
    const RunEntry* run = nullptr;
    const Scene* scene = nullptr;
    std::string scene_name, scene_path;
    Settings parameters;
    int max_depth = -1, rr_depth = 5;
    std::string folder;  ///< for its files; it is there
    const volatile bool* interrupt = nullptr;
};

/// What a peer says of itself once it has loaded the scene.
struct PeerDescription {
    std::string version;                   ///< "mitsuba 3.9.1"
    std::string device, backend;           ///< as in RenderStats
    double load_seconds = 0;               ///< program, conversion and scene
    double compile_seconds = 0;            ///< of kernels; no part of any render's time
    std::vector<std::string> changes;      ///< what the conversion of the scene changed
    std::vector<std::string> differences;  ///< in what the render differs from ours though the image should not
};

/// Why a peer does not render.
struct PeerRefusal : Error {
    bool missing;  ///< it is not installed
    PeerRefusal(bool is_missing, const std::string& reason) : Error(ExitCode::device, reason), missing(is_missing) {}
};

/// A peer at work. Its film holds squares of means of passes, not of samples: there is no variance of a sample in it.
class PeerRenderer : public Renderer, public SelfTimed {
public:
    virtual const PeerDescription& description() const = 0;
    /// Where its passes begin; other than those of any other seed.
    virtual void set_seed(uint64_t seed) = 0;
};

/// One kind of renderer.
struct PeerKind {
    std::string name;                                ///< value of the key `renderer`
    std::vector<std::string> integrators, variants;  ///< that a run can name; the first is the default. Empty: none
    std::vector<std::string> texts, lists;           ///< further keys, all needed: strings, and lists of numbers
    std::string (*check)(const Settings&);           ///< what is wrong with them; empty if nothing. May be null
    bool own_settings;  ///< takes integrator, variant, estimator and any `set`, and checks them itself
    bool tested;        ///< that its agreement is measured: it can render as many samples as that needs
    std::unique_ptr<PeerRenderer> (*start)(const PeerJob&);  ///< throws PeerRefusal, Error(interrupted)
    bool independent_passes = true;  ///< of each other: false of one low-discrepancy sequence, which has no batches
};

/// Empty if there is none of that key.
std::string setting_value(const Settings& settings, const std::string& key);

const std::vector<PeerKind>& peer_kinds();
/// Null if there is none of that name.
const PeerKind* find_peer_kind(const std::string& name);

}  // namespace ambilux
