// Whether a peer's image has the expectation of our reference: without it there is no time to compare.
#pragma once

#include <nlohmann/json.hpp>

#include "experiments/peers/peer.h"
#include "film/equivalence.h"
#include "film/ztest.h"

namespace ambilux {

/// Independent parts of a peer's image, whose scatter tells its variance.
constexpr int kAgreementParts = 16;

/// No run has it or the one below: seeds of a configuration are below 2^63.
constexpr uint64_t kAgreementSeed = ~uint64_t(0);

struct Agreement {
    bool interrupted = false;
    ZTestResult test;
    Equivalence near;            ///< to the reference
    FilmMoments parts;           ///< each part counts as one sample
    bool with_own_path = false;  ///< `test` is against our path tracer, not the reference
    uint64_t samples = 0;
    double seconds = 0;

    /// No difference was found, or one that nobody could see.
    bool agrees() const { return test.pass || near.shown; }
};

/// Renders `samples` per pixel (a multiple of the parts is used) and compares block means (z_test and equivalence, with
/// the variances of both images).
Agreement measure_agreement(PeerRenderer& peer, uint64_t samples, const Reference& reference,
                            const volatile bool* interrupt);

/// The same samples by `own`, the estimator of the peer, decide where the reference, by another one, does not agree:
/// neither estimator may have met bright samples that are rare in it, which leaves both equally dark and their
/// variances too small. Variances are pooled.
void compare_with_own(Agreement& agreement, Renderer& own, const volatile bool* interrupt);

/// pass, equivalent, mean_bound, block_bound, level, samples, seconds, with_own_path, relative_difference, detectable,
/// worst {z, p, x, y, width, height, channel}.
nlohmann::json to_json(const Agreement& agreement);

}  // namespace ambilux
