#include "formats/images/exr_file.h"

#include <ImfChannelList.h>
#include <ImfIO.h>
#include <ImfTileDescription.h>

#include <cstring>

#include "core/error.h"
#include "formats/images/readers.h"

namespace ambilux {

/// Bytes in memory as OpenEXR's stream.
class ExrFile::Stream : public Imf::IStream {
public:
    Stream(const std::string& name, std::string_view bytes) : IStream(name.c_str()), bytes_(bytes) {}
    bool read(char c[], int n) override {
        if (n < 0 || position_ > bytes_.size() || uint64_t(n) > bytes_.size() - position_)
            throw std::runtime_error("the file ends too early");
        memcpy(c, bytes_.data() + position_, size_t(n));
        position_ += uint64_t(n);
        return position_ < bytes_.size();
    }
    uint64_t tellg() override { return position_; }
    void seekg(uint64_t position) override { position_ = position; }

private:
    std::string_view bytes_;
    uint64_t position_ = 0;
};

namespace {

constexpr uint32_t kLongNames = 0x400, kTiled = 0x200, kKnownFlags = kTiled | kLongNames;
/// Offset of the first attribute: behind magic number and version.
constexpr size_t kHeaderAt = 8;

std::string_view take_name(ByteReader& in) {
    const size_t end = in.bytes.find('\0', in.at);
    if (end == std::string_view::npos || end - in.at > 255) in.budget.fail("cannot read EXR image: damaged header");
    const std::string_view name = in.take(end - in.at);
    in.u8();
    return name;
}

/// Bytes of a value of a type that always has the same number; 0: of another type.
uint32_t fixed_size(std::string_view type) {
    static constexpr std::pair<uint32_t, std::string_view> kTypes[] = {
        {1, " compression deepImageState envmap lineOrder "},
        {4, " float int "},
        {8, " double rational timecode v2f v2i "},
        {9, " tiledesc "},
        {12, " v3f v3i "},
        {16, " box2f box2i v2d "},
        {24, " v3d "},
        {28, " keycode "},
        {32, " chromaticities "},
        {36, " m33f "},
        {64, " m44f "},
        {72, " m33d "},
        {128, " m44d "}};
    for (const auto& [size, types] : kTypes)
        if (types.find(" " + std::string(type) + " ") != std::string_view::npos) return size;
    return 0;
}

/// True if the value ends where its size says. OpenEXR goes by the value, and allocates what lengths inside of it say.
bool has_its_size(std::string_view type, ByteReader value) {
    if (const uint32_t size = fixed_size(type)) return value.left() == size;
    if (type == "chlist") {
        while (!take_name(value).empty()) value.take(16);
        return value.left() == 0;
    }
    if (type == "stringvector") {
        while (value.left()) value.take(value.u32());
        return true;
    }
    if (type == "preview") {
        const uint64_t width = value.u32(), height = value.u32();
        return value.left() % 4 == 0 && width * height == value.left() / 4;
    }
    return true;
}

void check_attributes(std::string_view bytes, const FileBudget& budget) {
    ByteReader in{bytes, budget, kHeaderAt};
    for (std::string_view name; !(name = take_name(in)).empty();) {
        const std::string_view type = take_name(in);
        const uint32_t size = in.u32();
        if (!has_its_size(type, ByteReader{in.take(size), budget}))
            budget.fail("cannot read EXR image: damaged header");
    }
}

/// Most bytes that one byte of the file may become. 0: no bound that would matter.
uint64_t most_packed(Imf::Compression compression) {
    switch (compression) {
        case Imf::NO_COMPRESSION: return 1;
        case Imf::RLE_COMPRESSION: return 64;
        case Imf::ZIPS_COMPRESSION:
        case Imf::ZIP_COMPRESSION: return 1032;        // of deflate
        case Imf::PXR24_COMPRESSION: return 2 * 1032;  // which sees 24 of 32 bits
        default: return 0;
    }
}

uint64_t pixel_bytes(const Imf::ChannelList& channels) {
    uint64_t size = 0;
    for (auto it = channels.begin(); it != channels.end(); ++it)
        if (it.channel().xSampling == 1 && it.channel().ySampling == 1) size += it.channel().type == Imf::HALF ? 2 : 4;
    return size;
}

/// Lines that are compressed together, at most.
constexpr uint64_t kMostLines = 256;

void check_header(const Imf::Header& header, bool tiled, uint64_t file_size, const FileBudget& budget) {
    const Imath::Box2i& w = header.dataWindow();
    if (w.max.x < w.min.x || w.max.y < w.min.y) budget.fail("cannot read EXR image: its data window is empty");
    const uint64_t width = uint64_t(int64_t(w.max.x) - w.min.x + 1), height = uint64_t(int64_t(w.max.y) - w.min.y + 1);
    budget.pixels(width, height);
    const uint64_t stored = pixel_bytes(header.channels());
    budget.bytes(width * height, std::max<uint64_t>(stored, 16));
    const uint64_t packed = most_packed(header.compression());
    if (packed && width * height * stored / packed > file_size)
        budget.fail("cannot read EXR image: it claims more pixels than the file holds");
    // The table of chunks, 8 bytes each, is allocated before it is read.
    uint64_t chunks = (height + kMostLines - 1) / kMostLines;
    if (tiled) {
        const Imf::TileDescription& t = header.tileDescription();
        if (t.xSize == 0 || t.ySize == 0) budget.fail("cannot read EXR image: its tiles are empty");
        budget.pixels(t.xSize, t.ySize);
        budget.bytes(uint64_t(t.xSize) * t.ySize, std::max<uint64_t>(stored, 16));
        chunks = ((width + t.xSize - 1) / t.xSize) * ((height + t.ySize - 1) / t.ySize);
    } else if (header.compression() == Imf::NO_COMPRESSION || header.compression() == Imf::RLE_COMPRESSION) {
        chunks = height;
    }
    if (chunks > file_size / 8) budget.fail("cannot read EXR image: it claims more pixels than the file holds");
}

/// Calls of OpenEXR; what it says of the file becomes our error.
template <class F>
void guarded(const FileBudget& budget, F f) {
    try {
        f();
    } catch (const Error&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& e) {
        budget.fail(std::string("cannot read EXR image: ") + e.what());
    }
}

}  // namespace

bool is_exr(std::string_view bytes) { return bytes.starts_with("\x76\x2f\x31\x01"); }

ExrFile::ExrFile(std::string_view bytes, FileBudget& budget) : budget_(budget) {
    if (!is_exr(bytes)) budget.fail("not an OpenEXR file");
    const uint32_t version = ByteReader{bytes, budget, 4}.u32();
    if ((version & 0xff) != 2 || (version & ~0xffu & ~kKnownFlags))
        budget.fail("cannot read EXR image: files of several parts or of deep pixels are not supported");
    check_attributes(bytes, budget);
    guarded(budget, [&] {
        Stream again(budget.path(), bytes);
        again.seekg(kHeaderAt);
        Imf::Header header;
        int flags = int(version);
        header.readFrom(again, flags);
        check_header(header, version & kTiled, bytes.size(), budget);
        stream_ = std::make_unique<Stream>(budget.path(), bytes);
        file_ = std::make_unique<Imf::InputFile>(*stream_, 0);
    });
}

ExrFile::~ExrFile() = default;

bool ExrFile::has(std::initializer_list<const char*> channels) const {
    for (const char* name : channels) {
        const Imf::Channel* channel = header().channels().findChannel(name);
        if (!channel || channel->xSampling != 1 || channel->ySampling != 1) return false;
    }
    return true;
}

template <class File>
void ExrFile::read_lines(File& file) {
    for (int64_t y = window().min.y; y <= window().max.y; y += int64_t(kMostLines)) {
        file.readPixels(int(y), int(std::min<int64_t>(y + int64_t(kMostLines) - 1, window().max.y)));
        budget_.check_time();
    }
}

void ExrFile::read(const Imf::FrameBuffer& buffer) {
    guarded(budget_, [&] {
        file_->setFrameBuffer(buffer);
        read_lines(*file_);
    });
}

std::vector<Imf::Rgba> ExrFile::read_chroma(const std::string& layer) {
    std::vector<Imf::Rgba> pixels(size_t(width()) * height());
    guarded(budget_, [&] {
        stream_->seekg(0);
        Imf::RgbaInputFile file(*stream_, 0);
        file.setLayerName(layer);
        const Imath::V2i first = window().min;
        file.setFrameBuffer(pixels.data() - (first.x + int64_t(first.y) * width()), 1, width());
        read_lines(file);
    });
    return pixels;
}

}  // namespace ambilux
