// Which channels of an OpenEXR file are its colours, and what colours they are.
#include <ImfChannelList.h>
#include <ImfRgba.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <map>

#include "formats/images/exr_file.h"
#include "formats/images/readers.h"

namespace ambilux {

namespace {

enum class Colors { rgb, xyz, chroma, grey };

/// The channels of a layer that say its colours, and its alpha, as the file spells them.
struct Layer {
    std::string name;
    Colors colors;
    std::vector<std::string> channels;
    std::string alpha;
};

/// Channels by layer and, in small letters, their own name.
using Layers = std::map<std::string, std::map<std::string, std::string>>;

std::string all_names(const Imf::ChannelList& channels) {
    std::string out;
    size_t count = 0;
    for (auto it = channels.begin(); it != channels.end(); ++it)
        if (++count <= 20) out += std::string(count > 1 ? ", " : "") + it.name();
    return count > 20 ? out + ", ... (" + std::to_string(count) + " in all)" : out;
}

Layers layers_of(const Imf::ChannelList& channels) {
    Layers out;
    for (auto it = channels.begin(); it != channels.end(); ++it) {
        const std::string whole = it.name();
        const size_t dot = whole.rfind('.');
        std::string name = dot == std::string::npos ? whole : whole.substr(dot + 1);
        for (char& c : name) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
        const bool is_full = it.channel().xSampling == 1 && it.channel().ySampling == 1;
        if (is_full || whole.ends_with("RY") || whole.ends_with("BY"))
            out[dot == std::string::npos ? "" : whole.substr(0, dot)].try_emplace(name, whole);
    }
    return out;
}

std::vector<Layer> colored_layers(const Layers& layers) {
    static const std::pair<Colors, std::vector<std::string>> kKinds[] = {{Colors::rgb, {"r", "g", "b"}},
                                                                         {Colors::rgb, {"red", "green", "blue"}},
                                                                         {Colors::xyz, {"x", "y", "z"}},
                                                                         {Colors::chroma, {"y", "ry", "by"}},
                                                                         {Colors::grey, {"y"}}};
    std::vector<Layer> out;
    for (const auto& [name, channels] : layers)
        for (const auto& [colors, names] : kKinds) {
            const auto is_there = [&all = channels](const std::string& n) { return all.contains(n); };
            if (!std::all_of(names.begin(), names.end(), is_there)) continue;
            if (colors == Colors::chroma && !channels.at("ry").ends_with("RY")) continue;  // OpenEXR knows no others
            Layer layer{name, colors, {}, {}};
            for (const std::string& n : names) layer.channels.push_back(channels.at(n));
            for (const char* n : {"a", "alpha"})
                if (channels.contains(n)) layer.alpha = channels.at(n);
            out.push_back(layer);
            break;
        }
    return out;
}

/// The layer without a name, or the only one with colours, or the only channel.
Layer choose_layer(const Imf::ChannelList& channels, std::vector<std::string>& notes, const FileBudget& budget) {
    const Layers layers = layers_of(channels);
    const std::vector<Layer> colored = colored_layers(layers);
    if (!colored.empty() && (colored.size() == 1 || colored[0].name.empty())) {
        if (!colored[0].name.empty()) notes.push_back("its colours are those of its layer '" + colored[0].name + "'");
        return colored[0];
    }
    if (colored.empty() && layers.size() == 1 && layers.begin()->second.size() == 1) {
        const std::string& only = layers.begin()->second.begin()->second;
        notes.push_back("its only channel '" + only + "' is taken as grey");
        return {"", Colors::grey, {only}, ""};
    }
    budget.fail(
        "cannot read EXR image: it has neither channels R, G, B nor Y at full resolution, or has them in "
        "several layers; its channels are " +
        all_names(channels));
}

void note_unused(const Imf::ChannelList& channels, const Layer& layer, std::vector<std::string>& notes) {
    Imf::ChannelList unused;
    for (auto it = channels.begin(); it != channels.end(); ++it)
        if (it.name() != layer.alpha &&
            std::find(layer.channels.begin(), layer.channels.end(), it.name()) == layer.channels.end())
            unused.insert(it.name(), it.channel());
    if (unused.begin() != unused.end()) notes.push_back("unused channels: " + all_names(unused));
}

void note_header(const Imf::Header& header, std::vector<std::string>& notes) {
    const auto text = [](const Imath::Box2i& b) {
        return std::to_string(int64_t(b.max.x) - b.min.x + 1) + "x" + std::to_string(int64_t(b.max.y) - b.min.y + 1) +
               " at (" + std::to_string(b.min.x) + ", " + std::to_string(b.min.y) + ")";
    };
    if (header.dataWindow() != header.displayWindow())
        notes.push_back("the texels are those of its data window, " + text(header.dataWindow()) +
                        "; its display window is another: " + text(header.displayWindow()));
    if (Imf::hasEnvmap(header) && Imf::envmap(header) == Imf::ENVMAP_CUBE)
        notes.emplace_back("it says that it is an environment on the faces of a cube, and is taken as it lies");
    for (const char* name : {"colorInteropID", "oiio:ColorSpace"}) {
        const auto* space = header.findTypedAttribute<Imf::StringAttribute>(name);
        const std::string value = space && !Imf::hasChromaticities(header) ? space->value() : "";
        if (!value.empty() && !value.starts_with("lin_rec709") && value != "Linear" && value != "scene_linear")
            notes.push_back("colours are read as linear Rec.709; its " + std::string(name) + " is ignored: " + value);
    }
}

/// Of colours with these primaries to linear Rec.709, without adaptation of the white.
Imath::M44f to_rec709(const Imf::Chromaticities& from, const FileBudget& budget) {
    const std::string problem = "cannot read EXR image: its chromaticities are no primaries of colours";
    Imath::M44f m;
    try {
        m = Imf::RGBtoXYZ(from, 1) * Imf::XYZtoRGB(Imf::Chromaticities(), 1);
    } catch (const std::exception&) {
        budget.fail(problem);
    }
    if (!m.equalWithAbsError(m, 0)) budget.fail(problem);  // not finite
    return m;
}

void convert(Texels& texels, const Imath::M44f& m) {
    size_t outside = 0;
    for (size_t i = 0; i + 3 < texels.floats.size(); i += 4) {
        float* c = &texels.floats[i];
        const Imath::V3f rgb = Imath::V3f(c[0], c[1], c[2]) * m;
        outside += std::min({rgb.x, rgb.y, rgb.z}) < -1e-5f * std::max({rgb.x, rgb.y, rgb.z});
        for (int k = 0; k < 3; ++k) c[k] = rgb[k] < 0 ? 0 : rgb[k];
    }
    if (outside)
        texels.notes.push_back("colours of " + std::to_string(outside) +
                               " texels lie outside of Rec.709 and are clipped at 0");
}

void read_channels(ExrFile& file, const Layer& layer, Texels& texels) {
    Imf::FrameBuffer buffer;
    const auto insert = [&](const std::string& name, size_t c) {
        buffer.insert(
            name, Imf::Slice::Make(Imf::FLOAT, texels.floats.data() + c, file.window(), 16, size_t(texels.width) * 16));
    };
    for (size_t c = 0; c < layer.channels.size(); ++c) insert(layer.channels[c], c);
    if (!layer.alpha.empty()) insert(layer.alpha, 3);
    file.read(buffer);
    for (size_t i = 0; i < texels.floats.size(); i += 4) {
        if (layer.colors == Colors::grey) texels.floats[i + 1] = texels.floats[i + 2] = texels.floats[i];
        if (layer.alpha.empty()) texels.floats[i + 3] = 1;
    }
}

}  // namespace

Texels read_exr_texels(std::string_view bytes, FileBudget& budget) {
    ExrFile file(bytes, budget);
    const Imf::Header& header = file.header();
    Texels texels = make_texels(file.width(), file.height(), false, budget);
    texels.is_linear = true;
    const Layer layer = choose_layer(header.channels(), texels.notes, budget);
    note_unused(header.channels(), layer, texels.notes);
    note_header(header, texels.notes);
    if (layer.colors == Colors::chroma) {
        float* out = texels.floats.data();
        for (const Imf::Rgba& p : file.read_chroma(layer.name))
            for (const float v : {float(p.r), float(p.g), float(p.b), float(p.a)}) *out++ = v;
    } else {
        read_channels(file, layer, texels);
    }
    Imath::M44f m;
    if (layer.colors == Colors::xyz)
        m = Imf::XYZtoRGB(Imf::Chromaticities(), 1);
    else if (layer.colors != Colors::grey && Imf::hasChromaticities(header))
        m = to_rec709(Imf::chromaticities(header), budget);
    if (!m.equalWithAbsError(Imath::M44f(), 1e-3f)) convert(texels, m);
    return texels;
}

}  // namespace ambilux
