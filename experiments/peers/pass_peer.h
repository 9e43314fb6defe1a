// What peers have in common that render in passes, each an image.
#pragma once

#include "experiments/peers/pass_film.h"
#include "experiments/peers/peer.h"

namespace ambilux {

class PassPeer : public PeerRenderer {
public:
    explicit PassPeer(const PeerJob& job);
    const PeerDescription& description() const override { return description_; }
    void set_seed(uint64_t seed) override { seed_ = seed; }
    FilmMoments film() override { return film_.moments(); }
    void clear_film() override { film_.clear(); }
    double last_seconds() const override { return film_.last_seconds(); }
    uint32_t preferred_batch() const override { return film_.preferred_batch(); }
    RenderStats stats() override;

protected:
    /// An EXR of the film's size. Throws PeerRefusal, of `missing` if it cannot be read.
    Image read_image(const std::string& path, bool missing) const;

    PassFilm film_;
    PeerDescription description_;
    uint64_t seed_ = 0;
};

/// `text` with the values in the place of "{KEY}"; what they bring is not looked at again.
std::string fill_placeholders(const std::string& text, const Settings& values);

}  // namespace ambilux
