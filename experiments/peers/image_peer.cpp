#include "experiments/peers/image_peer.h"

#include <fmt/format.h>

#include <cmath>
#include <sstream>

#include "experiments/peers/pass_peer.h"

namespace ambilux {
namespace {

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

class ImagePeer : public PassPeer {
public:
    explicit ImagePeer(const PeerJob& job)
        : PassPeer(job), files_(setting_value(job.run->settings, "files")), name_(job.scene_name),
          samples_(numbers(setting_value(job.run->settings, "samples"))),
          seconds_(numbers(setting_value(job.run->settings, "seconds"))) {
        description_.version = "images";
        description_.device = "not stated";
        description_.backend = "images";
        description_.differences = {
            "images made elsewhere: that they agree with the reference was not tested, times are "
            "as stated"};
    }

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

    uint32_t preferred_batch() const override { return 1; }

private:
    Image read(size_t i) const {
        const Settings values = {{"name", name_}, {"seed", std::to_string(seed_)}, {"number", std::to_string(i + 1)}};
        return read_image(fill_placeholders(files_, values), true);
    }

    const std::string files_, name_;
    const std::vector<double> samples_, seconds_;
};

}  // namespace

std::string check_images(const Settings& settings) {
    const std::string files = setting_value(settings, "files");
    for (const char* name : {"{number}", "{seed}"})
        if (files.find(name) == std::string::npos) return fmt::format("'files' lacks the placeholder {}", name);
    const std::vector<double> samples = numbers(setting_value(settings, "samples")),
                              seconds = numbers(setting_value(settings, "seconds"));
    if (samples.empty() || samples.size() != seconds.size())
        return "'samples' and 'seconds' must be lists of equal length, a number for each image";
    if (!rises(samples) || !rises(seconds)) return "'samples' and 'seconds' must rise";
    for (const double value : samples)
        if (value != std::floor(value) || value > 4294967295.0) return "'samples' must be integers below 2^32";
    return "";
}

std::unique_ptr<PeerRenderer> start_image_peer(const PeerJob& job) { return std::make_unique<ImagePeer>(job); }

}  // namespace ambilux
