#include "film/exr_io.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfThreading.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <mutex>
#include <thread>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/sha256.h"
#include "formats/images/exr_file.h"
#include "formats/images/exr_stream.h"

namespace ambilux {
namespace {

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

/// Interleaved floats, as many a pixel as there are names.
struct Plane {
    const float* data;
    std::vector<std::string> names;

    Plane(const float* values, const std::array<const char*, 3>& channels)
        : data(values), names(channels.begin(), channels.end()) {}
    explicit Plane(const Layer& layer) : data(layer.values.data()) {
        for (const std::string& channel : layer.channels) names.push_back(layer.name + "." + channel);
    }
};

/// Threads that compress blocks of rows of a large image side by side: one takes a second for 1920x1080 pixels of
/// noise. They end with this object, since a process that forks later would wait for them in its child.
class CompressingThreads {
public:
    explicit CompressingThreads(uint64_t pixels) {
        if (pixels < 1u << 18) return;
        lock_ = std::unique_lock(mutex_);
        count_ = std::clamp(int(std::thread::hardware_concurrency()), 1, 16);
        Imf::setGlobalThreadCount(count_);
    }
    ~CompressingThreads() {
        if (lock_) Imf::setGlobalThreadCount(0);
    }
    int count() const { return count_; }

private:
    static inline std::mutex mutex_;
    std::unique_lock<std::mutex> lock_;
    int count_ = 0;
};

std::string encode_planes(const std::string& path, uint32_t width, uint32_t height, const std::vector<Plane>& planes,
                          const Attributes& attributes) {
    ExrStream stream;
    const CompressingThreads threads(uint64_t(width) * height);
    try {
        Imf::Header header{int(width), int(height)};
        header.compression() = Imf::ZIP_COMPRESSION;
        insert_attributes(header, attributes);
        Imf::FrameBuffer frame;
        for (const auto& [data, names] : planes)
            for (size_t c = 0; c < names.size(); ++c) {
                const size_t stride = names.size() * sizeof(float);
                header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
                frame.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(data + c)),
                                                  stride, stride * width));
            }
        Imf::OutputFile file(stream, header, threads.count());
        file.setFrameBuffer(frame);
        file.writePixels(int(height));
    } catch (const std::exception& e) {
        throw Error(ExitCode::device, "cannot write " + path + ": " + e.what());
    }
    return std::move(stream.bytes);
}

// A reference ends with the digest of all before it. Readers of EXR files do not look behind the last chunk.
constexpr std::string_view kChecksumMark = "ambilux sha256 ";

std::string checksum_of(std::string_view bytes) { return std::string(kChecksumMark) + to_hex(sha256(bytes)) + "\n"; }

/// The file without its checksum. A file without one is taken as it is: other programs write none.
std::string_view without_checksum(std::string_view bytes, const std::string& path) {
    const size_t size = kChecksumMark.size() + 2 * sizeof(Sha256Digest) + 1;
    if (bytes.size() < size || !bytes.substr(bytes.size() - size).starts_with(kChecksumMark)) return bytes;
    const std::string_view content = bytes.substr(0, bytes.size() - size);
    if (bytes.substr(content.size()) != checksum_of(content))
        throw input_error(path, 0, "is damaged: its content is not that of its checksum. Remove it, or take a copy");
    return content;
}

/// Reads three channels (a missing name repeats the first one) into interleaved floats.
Image read_planes(ExrFile& file, const std::array<const char*, 3>& names) {
    const size_t row = 3 * sizeof(float) * file.width();
    Image image{file.width(), file.height(), std::vector<float>(size_t(file.width()) * file.height() * 3)};
    Imf::FrameBuffer frame;
    for (size_t c = 0; c < 3; ++c) {
        if (c > 0 && std::strcmp(names[c], names[0]) == 0) continue;
        // OpenEXR addresses pixels by data-window coordinates: Slice::Make takes the window's origin out of the
        // pointer.
        frame.insert(names[c],
                     Imf::Slice::Make(Imf::FLOAT, image.rgb.data() + c, file.window(), 3 * sizeof(float), row));
    }
    file.read(frame);
    if (std::strcmp(names[0], names[1]) == 0)
        for (size_t i = 0; i < image.rgb.size(); i += 3) image.rgb[i + 1] = image.rgb[i + 2] = image.rgb[i];
    return image;
}

bool has(const ExrFile& file, const std::array<const char*, 3>& names) {
    return file.has({names[0], names[1], names[2]});
}

}  // namespace

void write_exr(const std::string& path, const Image& image, const Attributes& attributes,
               const std::vector<Layer>& layers) {
    check_image(path, image);
    std::vector<Plane> planes = {{image.rgb.data(), kMeanChannels}};
    for (const Layer& layer : layers) {
        if (layer.values.size() != size_t(image.width) * image.height * layer.channels.size())
            throw Error(ExitCode::device, "cannot write " + path + ": layer " + layer.name + " has another size");
        planes.emplace_back(layer);
    }
    write_file_atomic(path, encode_planes(path, image.width, image.height, planes, attributes));
}

void write_reference_exr(const std::string& path, const Reference& reference, Attributes attributes) {
    check_image(path, reference.mean);
    check_image(path, reference.standard_error);
    if (reference.mean.rgb.size() != reference.standard_error.rgb.size())
        throw Error(ExitCode::device, "cannot write " + path + ": means and standard errors differ in size");
    attributes["spp"] = reference.samples;
    std::string bytes = encode_planes(
        path, reference.mean.width, reference.mean.height,
        {{reference.mean.rgb.data(), kMeanChannels}, {reference.standard_error.rgb.data(), kErrorChannels}},
        attributes);
    bytes += checksum_of(bytes);
    write_file_atomic(path, bytes);
}

Reference read_reference_exr(const std::string& path, Attributes* attributes) {
    FileBudget budget(path);
    const std::string bytes = read_input(path);
    ExrFile file(without_checksum(bytes, path), budget);
    Reference reference;
    if (has(file, kMeanChannels)) {
        reference.mean = read_planes(file, kMeanChannels);
    } else if (has(file, {"Y", "Y", "Y"})) {
        reference.mean = read_planes(file, {"Y", "Y", "Y"});
    } else {
        std::string found;
        for (auto it = file.header().channels().begin(); it != file.header().channels().end(); ++it)
            found += std::string(" ") + it.name();
        throw input_error(path, 0, "no channels R, G, B or Y at full resolution; it has:" + found);
    }
    if (has(file, kErrorChannels)) reference.standard_error = read_planes(file, kErrorChannels);
    const Attributes all = header_attributes(file.header());
    if (const auto spp = all.find("spp"); spp != all.end()) {
        if (spp->is_number_integer() && spp->get<int64_t>() > 0) reference.samples = spp->get<uint64_t>();
        if (spp->is_string()) reference.samples = std::strtoull(spp->get<std::string>().c_str(), nullptr, 10);
    }
    if (attributes) *attributes = all;
    return reference;
}

Image read_exr(const std::string& path, Attributes* attributes) { return read_reference_exr(path, attributes).mean; }

}  // namespace ambilux
