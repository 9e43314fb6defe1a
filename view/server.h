// The page and what it asks for, over HTTP.
#pragma once

#include <functional>
#include <string>

#include "view/viewed_render.h"

namespace ambilux {

struct Address {
    std::string host = "127.0.0.1";
    int port = 8765;  ///< 0: a free one
};

/// Serves `render` until *interrupt becomes true. `started` gets the address of the page once it can be opened.
/// Throws Error(device) if the port is taken or the host is none of this machine's.
void serve(ViewedRender& render, const Address& address, const volatile bool* interrupt,
           const std::function<void(const std::string& url)>& started);

}  // namespace ambilux
