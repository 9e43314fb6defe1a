#include "formats/gzip.h"

#include <zlib.h>

#include <algorithm>

#include "formats/file_budget.h"

namespace ambilux {

std::string gunzip_if_packed(const std::string& path, std::string bytes, const Limits& limits) {
    if (!bytes.starts_with("\x1f\x8b")) return bytes;
    FileBudget budget(path, limits);
    z_stream stream{};
    constexpr int kGzip = 16;
    if (inflateInit2(&stream, kGzip + MAX_WBITS) != Z_OK) budget.fail("zlib cannot be started");
    const struct End {
        z_stream& stream;
        ~End() { inflateEnd(&stream); }
    } end{stream};
    std::string out;
    size_t read = 0, written = 0;
    for (int state = Z_OK; state != Z_STREAM_END;) {
        if (stream.avail_in == 0) {
            stream.next_in = reinterpret_cast<Bytef*>(bytes.data()) + read;
            stream.avail_in = uInt(std::min<size_t>(bytes.size() - read, 1u << 30));
            read += stream.avail_in;
        }
        if (out.size() == written) out.resize(std::max<size_t>(1 << 16, 2 * written));
        const size_t room = std::min<size_t>(out.size() - written, 1u << 30);
        stream.next_out = reinterpret_cast<Bytef*>(out.data()) + written;
        stream.avail_out = uInt(room);
        state = inflate(&stream, Z_NO_FLUSH);
        written += room - stream.avail_out;
        budget.bytes(written);
        budget.tick();
        if (state == Z_STREAM_END && (stream.avail_in > 0 || read < bytes.size())) {
            // Another member follows.
            if (inflateReset(&stream) != Z_OK) budget.fail("it is no gzip file");
            state = Z_OK;
        } else if (state == Z_BUF_ERROR ||
                   (state == Z_OK && stream.avail_in == 0 && stream.avail_out == room && read == bytes.size())) {
            budget.fail("the gzip file is cut off");
        } else if (state != Z_OK && state != Z_STREAM_END) {
            budget.fail("it is no gzip file");
        }
    }
    out.resize(written);
    return out;
}

}  // namespace ambilux
