#include "cli/tev.h"

#include <fmt/format.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <memory>

#include "core/error.h"
#include "core/log.h"

namespace ambilux {
namespace {

static_assert(std::endian::native == std::endian::little, "packets are little endian");

constexpr const char* kDefaultPort = "14158";
constexpr time_t kPatience = 5;  // seconds that a tev that does not read may hold up a render
constexpr size_t kFloatsPerPacket = 1 << 18;

/// A packet is its length in bytes, itself included, a type and what that has.
class Packet {
public:
    enum Type : char { create_image = 4, update_image = 6 };

    Packet(Type type, const std::string& name) : bytes_(sizeof(uint32_t), '\0') {
        bytes_ += char(type);
        bytes_ += '\0';  // whether tev's window comes to the front
        text(name);
    }
    void text(const std::string& value) { bytes_.append(value.c_str(), value.size() + 1); }
    template <class T>
    void number(T value) {
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    }
    void channels() {
        number(int32_t(3));
        for (const char* name : {"R", "G", "B"}) text(name);
    }
    void floats(const float* values, size_t count) {
        bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(float));
    }
    const std::string& finished() {
        const auto size = uint32_t(bytes_.size());
        std::memcpy(bytes_.data(), &size, sizeof(size));
        return bytes_;
    }

private:
    std::string bytes_;
};

int connected(const std::string& address) {
    const size_t colon = address.rfind(':');
    const std::string host = address.substr(0, colon);
    const std::string port = colon == std::string::npos ? kDefaultPort : address.substr(colon + 1);
    if (host.empty() || port.empty() || port.find_first_not_of("0123456789") != std::string::npos)
        throw Error(ExitCode::usage,
                    fmt::format("--tev {}: write it as HOST:PORT, such as localhost:{}", address, kDefaultPort));
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    if (const int failed = getaddrinfo(host.c_str(), port.c_str(), &hints, &found); failed != 0)
        throw Error(ExitCode::device, fmt::format("--tev {}: {}", address, gai_strerror(failed)));
    const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, &freeaddrinfo);
    int error = 0;
    for (const addrinfo* a = found; a; a = a->ai_next) {
        const int s = socket(a->ai_family, a->ai_socktype, a->ai_protocol);
        const timeval patience{kPatience, 0};
        if (s >= 0 && setsockopt(s, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience)) == 0 &&
            connect(s, a->ai_addr, a->ai_addrlen) == 0)
            return s;
        error = errno;
        if (s >= 0) close(s);
    }
    throw Error(ExitCode::device, fmt::format("--tev {}: {}; is tev running there?", address, std::strerror(error)));
}

}  // namespace

TevStream::TevStream(const std::string& address, std::string name, uint32_t width, uint32_t height)
    : address_(address), name_(std::move(name)), socket_(connected(address)) {
    Packet packet(Packet::create_image, name_);
    packet.number(int32_t(width));
    packet.number(int32_t(height));
    packet.channels();
    send_all(packet.finished());
}

TevStream::~TevStream() {
    if (socket_ >= 0) close(socket_);
}

void TevStream::send(const Image& image) {
    const size_t row = size_t(image.width) * 3;
    const auto most = uint32_t(std::max<size_t>(1, kFloatsPerPacket / row));
    for (uint32_t y = 0; socket_ >= 0 && y < image.height; y += most) {
        const uint32_t rows = std::min(most, image.height - y);
        Packet packet(Packet::update_image, name_);
        packet.channels();
        for (const uint32_t n : {0u, y, image.width, rows}) packet.number(int32_t(n));
        for (const int64_t offset : {0, 1, 2}) packet.number(offset);
        for (int i = 0; i < 3; ++i) packet.number(int64_t(3));  // from a pixel to the next
        packet.floats(image.rgb.data() + y * row, rows * row);
        if (send_all(packet.finished())) continue;
        log_warning(fmt::format("--tev {}: {}; the render goes on without it", address_, std::strerror(errno)));
        close(socket_);
        socket_ = -1;
    }
}

bool TevStream::send_all(const std::string& bytes) const {
    for (size_t sent = 0; sent < bytes.size();) {
        const ssize_t n = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        sent += size_t(n);
    }
    return true;
}

}  // namespace ambilux
