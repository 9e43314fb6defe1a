#include "film/exr_io.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>

#include <array>
#include <cstring>
#include <limits>

#include "core/atomic_file.h"
#include "core/error.h"

namespace ambilux {
namespace {

/// Collects the file in memory, so that it reaches the disk in one atomic step.
class StringStream : public Imf::OStream {
public:
    StringStream() : Imf::OStream("memory") {}
    void write(const char c[], int n) override {
        if (position_ + size_t(n) > bytes.size()) bytes.resize(position_ + size_t(n));
        std::memcpy(bytes.data() + position_, c, size_t(n));
        position_ += size_t(n);
    }
    uint64_t tellp() override { return position_; }
    void seekp(uint64_t position) override { position_ = size_t(position); }
    std::string bytes;

private:
    size_t position_ = 0;
};

void insert_attributes(Imf::Header& header, const Attributes& attributes) {
    for (const auto& [name, value] : attributes.items()) {
        if (value.is_string())
            header.insert(name, Imf::StringAttribute(value.get<std::string>()));
        else if (value.is_number_float())
            header.insert(name, Imf::DoubleAttribute(value.get<double>()));
        else if (value.is_number_unsigned()
                     ? value.get<uint64_t>() <= uint64_t(std::numeric_limits<int>::max())
                     : value.is_number_integer() && value.get<int64_t>() >= std::numeric_limits<int>::min())
            header.insert(name, Imf::IntAttribute(value.get<int>()));
        else
            header.insert(name, Imf::StringAttribute(value.dump()));
    }
}

Attributes header_attributes(const Imf::Header& header) {
    Attributes attributes = Attributes::object();
    for (auto it = header.begin(); it != header.end(); ++it) {
        const Imf::Attribute& a = it.attribute();
        if (const auto* s = dynamic_cast<const Imf::StringAttribute*>(&a))
            attributes[it.name()] = s->value();
        else if (const auto* i = dynamic_cast<const Imf::IntAttribute*>(&a))
            attributes[it.name()] = i->value();
        else if (const auto* d = dynamic_cast<const Imf::DoubleAttribute*>(&a))
            attributes[it.name()] = d->value();
        else if (const auto* f = dynamic_cast<const Imf::FloatAttribute*>(&a))
            attributes[it.name()] = f->value();
    }
    return attributes;
}

constexpr std::array<const char*, 3> kMeanChannels = {"R", "G", "B"};
constexpr std::array<const char*, 3> kErrorChannels = {"se.R", "se.G", "se.B"};

void check_image(const std::string& path, const Image& image) {
    if (image.width == 0 || image.height == 0 || image.rgb.size() != size_t(image.width) * image.height * 3)
        throw Error(ExitCode::device,
                    "cannot write " + path + ": the image is empty or its buffer does not fit its size");
}

/// Writes planes of interleaved RGB floats under the given channel names.
void write_planes(const std::string& path, uint32_t width, uint32_t height,
                  const std::vector<std::pair<const float*, std::array<const char*, 3>>>& planes,
                  const Attributes& attributes) {
    StringStream stream;
    try {
        Imf::Header header{int(width), int(height)};
        header.compression() = Imf::ZIP_COMPRESSION;
        insert_attributes(header, attributes);
        Imf::FrameBuffer frame;
        for (const auto& [data, names] : planes)
            for (size_t c = 0; c < 3; ++c) {
                header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
                frame.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(data + c)),
                                                  3 * sizeof(float), 3 * sizeof(float) * width));
            }
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(frame);
        file.writePixels(int(height));
    } catch (const std::exception& e) {
        throw Error(ExitCode::device, "cannot write " + path + ": " + e.what());
    }
    write_file_atomic(path, stream.bytes);
}

/// Reads three channels (a missing name repeats the first one) into interleaved floats.
Image read_planes(Imf::InputFile& file, const std::array<const char*, 3>& names) {
    const Imath::Box2i window = file.header().dataWindow();
    const uint64_t width = uint64_t(int64_t(window.max.x) - window.min.x + 1),
                   height = uint64_t(int64_t(window.max.y) - window.min.y + 1);
    Image image{uint32_t(width), uint32_t(height), std::vector<float>(width * height * 3)};
    Imf::FrameBuffer frame;
    for (size_t c = 0; c < 3; ++c) {
        if (c > 0 && std::strcmp(names[c], names[0]) == 0) continue;
        // OpenEXR addresses pixels by data-window coordinates: Slice::Make takes the window's origin out of the
        // pointer.
        frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.rgb.data() + c, window, 3 * sizeof(float),
                                                3 * sizeof(float) * width));
    }
    file.setFrameBuffer(frame);
    file.readPixels(window.min.y, window.max.y);
    if (std::strcmp(names[0], names[1]) == 0)
        for (size_t i = 0; i < image.rgb.size(); i += 3) image.rgb[i + 1] = image.rgb[i + 2] = image.rgb[i];
    return image;
}

bool has_channels(const Imf::InputFile& file, const std::array<const char*, 3>& names) {
    for (const char* name : names) {
        const Imf::Channel* channel = file.header().channels().findChannel(name);
        if (!channel || channel->xSampling != 1 || channel->ySampling != 1) return false;
    }
    return true;
}

}  // namespace

void write_exr(const std::string& path, const Image& image, const Attributes& attributes) {
    check_image(path, image);
    write_planes(path, image.width, image.height, {{image.rgb.data(), kMeanChannels}}, attributes);
}

void write_reference_exr(const std::string& path, const Reference& reference, Attributes attributes) {
    check_image(path, reference.mean);
    check_image(path, reference.standard_error);
    if (reference.mean.rgb.size() != reference.standard_error.rgb.size())
        throw Error(ExitCode::device, "cannot write " + path + ": means and standard errors differ in size");
    attributes["spp"] = reference.samples;
    write_planes(path, reference.mean.width, reference.mean.height,
                 {{reference.mean.rgb.data(), kMeanChannels}, {reference.standard_error.rgb.data(), kErrorChannels}},
                 attributes);
}

Reference read_reference_exr(const std::string& path, Attributes* attributes) {
    read_file(path);  // for the system's own words if it is missing or unreadable; references are small
    try {
        Imf::InputFile file(path.c_str(), 1);
        Reference reference;
        if (has_channels(file, kMeanChannels)) {
            reference.mean = read_planes(file, kMeanChannels);
        } else if (has_channels(file, {"Y", "Y", "Y"})) {
            reference.mean = read_planes(file, {"Y", "Y", "Y"});
        } else {
            std::string found;
            for (auto it = file.header().channels().begin(); it != file.header().channels().end(); ++it)
                found += std::string(" ") + it.name();
            throw input_error(path, 0, "no channels R, G, B or Y at full resolution; it has:" + found);
        }
        if (has_channels(file, kErrorChannels)) reference.standard_error = read_planes(file, kErrorChannels);
        const Attributes all = header_attributes(file.header());
        if (const auto spp = all.find("spp"); spp != all.end()) {
            if (spp->is_number_integer() && spp->get<int64_t>() > 0) reference.samples = spp->get<uint64_t>();
            if (spp->is_string()) reference.samples = std::strtoull(spp->get<std::string>().c_str(), nullptr, 10);
        }
        if (attributes) *attributes = all;
        return reference;
    } catch (const Error&) {
        throw;
    } catch (const std::exception& e) {
        throw input_error(path, 0, std::string("not a readable OpenEXR file: ") + e.what());
    }
}

Image read_exr(const std::string& path, Attributes* attributes) { return read_reference_exr(path, attributes).mean; }

}  // namespace ambilux
