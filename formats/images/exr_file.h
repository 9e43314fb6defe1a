// OpenEXR files in memory, opened once their header is known to be sound.
#pragma once

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfRgbaFile.h>

#include <memory>
#include <string_view>
#include <vector>

#include "formats/file_budget.h"

namespace ambilux {

class ExrFile {
public:
    /// Checks sizes against the budget and against the length of the file before OpenEXR sees it. Throws
    /// Error(bad_input).
    ExrFile(std::string_view bytes, FileBudget& budget);
    ~ExrFile();

    const Imf::Header& header() const { return file_->header(); }
    const Imath::Box2i& window() const { return header().dataWindow(); }
    uint32_t width() const { return uint32_t(int64_t(window().max.x) - window().min.x + 1); }
    uint32_t height() const { return uint32_t(int64_t(window().max.y) - window().min.y + 1); }
    /// True if all of these are there at full resolution.
    bool has(std::initializer_list<const char*> channels) const;
    /// Reads all rows into `buffer`, which addresses pixels by their place in the window.
    void read(const Imf::FrameBuffer& buffer);
    /// Pixels of a layer's channels Y, RY and BY, the last two at half of the resolution, in the file's primaries. The
    /// file cannot be read otherwise after it.
    std::vector<Imf::Rgba> read_chroma(const std::string& layer);

private:
    class Stream;
    template <class File>
    void read_lines(File& file);

    FileBudget& budget_;
    std::unique_ptr<Stream> stream_;
    std::unique_ptr<Imf::InputFile> file_;
};

}  // namespace ambilux
