// Images on their way into a scene.
#include <fmt/format.h>

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
    return builder.add_table("decode " + std::to_string(gamma), 256, [&](float* table) {
        for (int i = 0; i < 256; ++i) table[i] = float(decoded(float(i) / 255.0f, gamma));
    });
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
    constexpr uint8_t kPadding[16] = {};
    const uint64_t end = scene.texels.size(), offset = (end + 15) / 16 * 16;
    scene.texels.append(kPadding, offset - end);
    scene.texels.append(static_cast<const uint8_t*>(data), size);
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

namespace {

/// Puts the texels of an image into the scene, unless those that stand for `pool` are there.
void place_bytes(Builder& builder, const std::string& pool, const uint8_t* bytes, LoadedImage& out) {
    out.decode_table = decode_table(builder, out.gamma);
    const auto [it, added] = builder.texel_pool.try_emplace(pool, 0);
    if (added) it->second = append_texels(builder.scene, bytes, out.bytes());
    out.offset = it->second;
}

void place_image(Builder& builder, const std::string& path, const std::string& pool, const Texels& image, bool as_float,
                 bool colors, LoadedImage& out) {
    Rgb& largest = out.facts.largest;
    float smallest = 0;
    double mean[3] = {0, 0, 0};
    const size_t count = size_t(image.width) * image.height;
    if (image.is_8bit && !as_float) {
        out.format = TexelFormat::rgba8;
        place_bytes(builder, pool, image.bytes.data(), out);
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
            texels[i] = i % 4 == 3 ? stored : float(decoded(stored, out.gamma));
            if (!std::isfinite(texels[i]))
                throw input_error(path, 0,
                                  "texel (" + std::to_string(i / 4 % image.width) + ", " +
                                      std::to_string(i / 4 / image.width) + ") is not finite");
            const int c = int(i % 4);
            if (c == 3) continue;
            smallest = std::min(smallest, texels[i]);
            if (colors) texels[i] = std::max(texels[i], 0.0f);
            mean[c] += texels[i], largest[c] = std::max(largest[c], texels[i]);
        }
        if (colors && smallest < 0)
            out.notes.push_back(fmt::format("colours below 0, down to {:.3g}, count as 0", smallest));
        out.offset = append_floats(builder.scene, texels, as_float, out.format);
    }
    out.facts.mean = {float(mean[0] / double(count)), float(mean[1] / double(count)), float(mean[2] / double(count))};
}

/// Places the image as the scene before has it.
void place_again(Builder& builder, const std::string& pool, LoadedImage& image) {
    const uint8_t* bytes = builder.before->scene.texels.data() + image.offset;
    if (image.format == TexelFormat::rgba8)
        place_bytes(builder, pool, bytes, image);
    else
        image.offset = append_texels(builder.scene, bytes, image.bytes());
}

LoadedImage read_and_place(Builder& builder, const std::string& path, const std::string& pool, double gamma,
                           bool as_float, bool colors, int channel, const Texels* given) {
    LoadedImage out;
    Texels own;
    if (!given) {
        const std::string bytes = read_input(path, builder.options.limits);
        out.digest = sha256(bytes);
        own = read_image(path, bytes, builder.options.limits);
        out.notes = own.notes;
    } else if (channel >= 0) {
        own = *given;
    }
    const Texels& image = given && channel < 0 ? *given : own;
    if (channel >= 0) spread_channel(own, size_t(channel));
    if (channel == 3) gamma = 1;
    out.gamma = gamma != 0 ? gamma : (image.is_linear ? 1 : -1);
    out.width = image.width;
    out.height = image.height;
    out.facts.file = path;
    out.memory = uint64_t(image.width) * image.height * (image.is_8bit && !as_float ? 4 : 16);
    builder.take_memory(out.memory, path);
    place_image(builder, path, pool, image, as_float, colors, out);
    return out;
}

}  // namespace

LoadedImage load_image(Builder& builder, const std::string& path, double gamma, bool as_float, bool colors, int channel,
                       const Texels* given) {
    const std::string name = (given ? "given|" : "") + path + "|";
    const auto key_of = [&](bool c) {
        return name + std::to_string(gamma) + (as_float ? "|float" : "") + (c ? "|colors" : "") +
               std::to_string(channel);
    };
    const std::string key = key_of(colors);
    for (const bool c : {colors, !colors})
        if (const auto known = builder.images.find(key_of(c)); known != builder.images.end())
            if (c == colors || known->second.format == TexelFormat::rgba8)
                return known->second;  // bytes are not below 0

    const ScopedSeconds clock(&builder.options.times->read);
    const std::string pool = name + std::to_string(channel);
    LoadedImage out;
    const auto* before = builder.before ? &builder.before->images : nullptr;
    if (before && before->contains(key)) {
        out = before->at(key);
        builder.take_memory(out.memory, path);
        place_again(builder, pool, out);
    } else {
        out = read_and_place(builder, path, pool, gamma, as_float, colors, channel, given);
    }
    if (!given) builder.file_digests.push_back({path, out.digest});
    note_image(builder.scene.notes, path, out.notes);
    builder.images[key] = out;
    return out;
}

}  // namespace ambilux::document
