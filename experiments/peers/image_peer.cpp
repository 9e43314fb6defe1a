#include "experiments/peers/image_peer.h"

#include <fmt/format.h>

#include <cmath>
#include <sstream>

#include "core/error.h"
#include "experiments/peers/pass_film.h"
#include "film/exr_io.h"

namespace ambilux {
namespace {

std::string value_of(const Settings& settings, const std::string& key) {
    for (const auto& [name, value] : settings)
        if (name == key) return value;
    return "";
}

std::vector<double> numbers(const std::string& text) {
    std::istringstream in(text);
    std::vector<double> found;
    for (double value = 0; in >> value;) found.push_back(value);
    return found;
}

bool rises(const std::vector<double>& values) {
    double last = 0;
    for (const double value : values) {
        if (!(value > last)) return false;
        last = value;
    }
    return true;
}

std::string filled(std::string text, const std::string& placeholder, const std::string& value) {
    for (size_t at = 0; (at = text.find(placeholder, at)) != std::string::npos; at += value.size())
        text.replace(at, placeholder.size(), value);
    return text;
}

class ImagePeer : public PeerRenderer {
public:
    explicit ImagePeer(const PeerJob& job)
        : files_(filled(value_of(job.run->settings, "files"), "{name}", job.scene_name)),
          samples_(numbers(value_of(job.run->settings, "samples"))),
          seconds_(numbers(value_of(job.run->settings, "seconds"))),
          film_(job.scene->sensor.crop_width, job.scene->sensor.crop_height) {
        description_.version = "images";
        description_.device = "not stated";
        description_.backend = "images";
        description_.differences = {
            "images made elsewhere: that they agree with the reference was not tested, times are "
            "as stated"};
    }

    const PeerDescription& description() const override { return description_; }
    void set_seed(uint64_t seed) override { seed_ = seed; }

    /// Up to the next image, however many samples that is.
    uint32_t render(uint32_t first, uint32_t, const volatile bool*) override {
        size_t next = 0;
        while (next < samples_.size() && samples_[next] <= first) ++next;
        if (next == samples_.size())
            throw PeerRefusal(false, fmt::format("it has no image behind that of {} samples", samples_.back()));
        const double before = next ? samples_[next - 1] : 0, all = samples_[next], own = all - before;
        Image pass = read(next);
        if (next) {
            const Image earlier = read(next - 1);
            for (size_t i = 0; i < pass.rgb.size(); ++i)
                pass.rgb[i] = float((all * pass.rgb[i] - before * earlier.rgb[i]) / own);
        }
        // Differences of rounded means can be slightly below 0: they are no radiance, but their sum is.
        film_.add_signed(pass, uint32_t(own), seconds_[next] - (next ? seconds_[next - 1] : 0));
        return uint32_t(own);
    }

    FilmMoments film() override { return film_.moments(); }
    void clear_film() override { film_.clear(); }
    double last_seconds() const override { return film_.last_seconds(); }
    uint32_t preferred_batch() const override { return 1; }
    RenderStats stats() override {
        RenderStats s;
        s.backend = description_.backend;
        s.device = description_.device;
        film_.state(s);
        return s;
    }

private:
    Image read(size_t i) const {
        const std::string path =
            filled(filled(files_, "{seed}", std::to_string(seed_)), "{number}", std::to_string(i + 1));
        Image image;
        try {
            image = read_exr(path);
        } catch (const Error& e) {
            throw PeerRefusal(true, e.what());
        }
        const FilmMoments& m = film_.moments();
        if (image.width != m.width || image.height != m.height)
            throw PeerRefusal(false, fmt::format("{}: {}x{} pixels, the scene has {}x{}", path, image.width,
                                                 image.height, m.width, m.height));
        return image;
    }

    const std::string files_;
    const std::vector<double> samples_, seconds_;
    PassFilm film_;
    PeerDescription description_;
    uint64_t seed_ = 0;
};

}  // namespace

std::string check_images(const Settings& settings) {
    const std::string files = value_of(settings, "files");
    for (const char* name : {"{number}", "{seed}"})
        if (files.find(name) == std::string::npos) return fmt::format("'files' lacks the placeholder {}", name);
    const std::vector<double> samples = numbers(value_of(settings, "samples")),
                              seconds = numbers(value_of(settings, "seconds"));
    if (samples.empty() || samples.size() != seconds.size())
        return "'samples' and 'seconds' must be lists of equal length, a number for each image";
    if (!rises(samples) || !rises(seconds)) return "'samples' and 'seconds' must rise";
    for (const double value : samples)
        if (value != std::floor(value) || value > 4294967295.0) return "'samples' must be integers below 2^32";
    return "";
}

std::unique_ptr<PeerRenderer> start_image_peer(const PeerJob& job) { return std::make_unique<ImagePeer>(job); }

}  // namespace ambilux
