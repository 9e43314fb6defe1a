#include "experiments/peers/pass_peer.h"

#include <fmt/format.h>

#include "film/exr_io.h"

namespace ambilux {

PassPeer::PassPeer(const PeerJob& job) : film_(job.scene->sensor.crop_width, job.scene->sensor.crop_height) {}

RenderStats PassPeer::stats() {
    RenderStats s;
    s.backend = description_.backend;
    s.device = description_.device;
    s.build_seconds = description_.compile_seconds;
    film_.state(s);
    return s;
}

Image PassPeer::read_image(const std::string& path, bool missing) const {
    Image image;
    try {
        image = read_exr(path);
    } catch (const Error& e) {
        throw PeerRefusal(missing, e.what());
    }
    const FilmMoments& m = film_.moments();
    if (image.width != m.width || image.height != m.height)
        throw PeerRefusal(false, fmt::format("{}: an image of {}x{} pixels, asked for were {}x{}", path, image.width,
                                             image.height, m.width, m.height));
    return image;
}

std::string fill_placeholders(const std::string& text, const Settings& values) {
    std::string out;
    for (size_t i = 0; i < text.size();) {
        bool found = false;
        for (const auto& [key, value] : values) {
            const std::string placeholder = "{" + key + "}";
            if (text.compare(i, placeholder.size(), placeholder) != 0) continue;
            out += value;
            i += placeholder.size();
            found = true;
            break;
        }
        if (!found) out += text[i++];
    }
    return out;
}

}  // namespace ambilux
