// Streams images to a running tev (github.com/Tom94/tev) through the TCP protocol of its remote control.
#pragma once

#include <string>

#include "film/image.h"

namespace ambilux {

class TevStream {
public:
    /// `address` is HOST:PORT, or HOST alone for tev's own port. Throws Error(usage) or, if nobody listens there,
    /// Error(device).
    TevStream(const std::string& address, std::string name, uint32_t width, uint32_t height);
    ~TevStream();
    TevStream(const TevStream&) = delete;
    TevStream& operator=(const TevStream&) = delete;

    /// A tev that has gone away is warned of once; images sent after that are dropped.
    void send(const Image& image);

private:
    bool send_all(const std::string& bytes) const;

    std::string address_, name_;
    int socket_ = -1;
};

}  // namespace ambilux
