// Images on their way into a scene.
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/half.h"
#include "core/scoped_seconds.h"
#include "formats/document/builder.h"
#include "formats/file_budget.h"
#include "formats/images/image_io.h"

namespace ambilux::document {

namespace {

uint32_t decode_table(Builder& builder, double gamma) {
    const std::string key = "decode " + std::to_string(gamma);
    const auto it = builder.table_pool.find(key);
    if (it != builder.table_pool.end()) return it->second;
    const uint32_t offset = uint32_t(builder.scene.tables.size());
    for (int i = 0; i < 256; ++i) builder.scene.tables.push_back(float(decoded(float(i) / 255.0f, gamma)));
    builder.table_pool[key] = offset;
    return offset;
}

/// True if all colours keep a precision of 2^-11 as halves: none is too large, and none that is not zero too small.
bool fits_half(const std::vector<float>& texels) {
    for (size_t i = 0; i < texels.size(); ++i) {
        if (i % 4 == 3) continue;
        const float f = texels[i];
        if (!(std::fabs(f) <= kMaxHalf) || !(std::fabs(half_to_float(float_to_half(f)) - f) <= 0x1p-11f * std::fabs(f)))
            return false;
    }
    return true;
}

/// Makes all colours equal to one channel.
void spread_channel(Texels& image, size_t channel) {
    const auto spread = [&](auto& texels) {
        for (size_t i = 0; i + 3 < texels.size(); i += 4)
            for (size_t c = 0; c < 3; ++c) texels[i + c] = texels[i + channel];
    };
    spread(image.bytes), spread(image.floats);
}

}  // namespace

uint64_t append_texels(Scene& scene, const void* data, size_t size) {
    const uint64_t offset = (scene.texels.size() + 15) / 16 * 16;
    scene.texels.resize(offset + size);
    memcpy(scene.texels.data() + offset, data, size);
    return offset;
}

uint64_t append_floats(Scene& scene, const std::vector<float>& texels, bool allow_half, TexelFormat& format) {
    if (!allow_half || !fits_half(texels)) {
        format = TexelFormat::rgba32f;
        return append_texels(scene, texels.data(), texels.size() * sizeof(float));
    }
    format = TexelFormat::rgba16f;
    std::vector<uint16_t> halves(texels.size());
    for (size_t i = 0; i < texels.size(); ++i) halves[i] = uint16_t(float_to_half(i % 4 == 3 ? 1.0f : texels[i]));
    return append_texels(scene, halves.data(), halves.size() * sizeof halves[0]);
}

LoadedImage load_image(Builder& builder, const std::string& path, double gamma, bool as_float, int channel,
                       const Texels* given) {
    const std::string key = (given ? "given|" : "") + path + "|" + std::to_string(gamma) + (as_float ? "|float" : "") +
                            std::to_string(channel);
    const auto known = builder.images.find(key);
    if (known != builder.images.end()) return known->second;

    const ScopedSeconds clock(&builder.options.times->read);
    Texels own;
    if (!given) {
        const std::string bytes = read_input(path, builder.options.limits);
        builder.file_digests.push_back({path, sha256(bytes)});
        own = read_image(path, bytes, builder.options.limits);
        note_image(builder.scene.notes, path, own);
    } else if (channel >= 0) {
        own = *given;
    }
    const Texels& image = given && channel < 0 ? *given : own;
    if (channel >= 0) spread_channel(own, size_t(channel));
    if (channel == 3) gamma = 1;
    const double used_gamma = gamma != 0 ? gamma : (image.is_linear ? 1 : -1);
    LoadedImage out;
    out.width = image.width;
    out.height = image.height;
    out.facts.file = path;
    Rgb& largest = out.facts.largest;
    double mean[3] = {0, 0, 0};
    const size_t count = size_t(image.width) * image.height;
    builder.take_memory(count * (image.is_8bit && !as_float ? 4 : 16), path);
    if (image.is_8bit && !as_float) {
        out.format = TexelFormat::rgba8;
        out.decode_table = decode_table(builder, used_gamma);
        const auto [it, added] =
            builder.texel_pool.try_emplace((given ? "given|" : "") + path + "|" + std::to_string(channel), 0);
        if (added) it->second = append_texels(builder.scene, image.bytes.data(), image.bytes.size());
        out.offset = it->second;
        const float* table = builder.scene.tables.data() + out.decode_table;
        for (size_t i = 0; i < count; ++i)
            for (int c = 0; c < 3; ++c) {
                const float v = table[image.bytes[4 * i + c]];
                mean[c] += v, largest[c] = std::max(largest[c], v);
            }
    } else {
        std::vector<float> texels(count * 4);
        for (size_t i = 0; i < texels.size(); ++i) {
            const float stored = image.is_8bit ? float(image.bytes[i]) / 255.0f : image.floats[i];
            texels[i] = i % 4 == 3 ? stored : float(decoded(stored, used_gamma));
            if (!std::isfinite(texels[i]))
                throw input_error(path, 0,
                                  "texel (" + std::to_string(i / 4 % image.width) + ", " +
                                      std::to_string(i / 4 / image.width) + ") is not finite");
            if (const int c = int(i % 4); c < 3) mean[c] += texels[i], largest[c] = std::max(largest[c], texels[i]);
        }
        out.offset = append_floats(builder.scene, texels, as_float, out.format);
    }
    out.facts.mean = {float(mean[0] / double(count)), float(mean[1] / double(count)), float(mean[2] / double(count))};
    builder.images[key] = out;
    return out;
}

}  // namespace ambilux::document
