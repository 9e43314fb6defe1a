#include "view/server.h"

#include <fmt/format.h>
#include <httplib.h>

#include <algorithm>
#include <cstdlib>

#include "core/error.h"
#include "core/flag.h"
#include "core/seconds.h"
#include "formats/images/jpeg_write.h"
#include "view/page.h"

namespace ambilux {
namespace {

constexpr std::chrono::seconds kPatience(5);
constexpr std::chrono::milliseconds kLookPeriod(100);
constexpr size_t kLargestRequest = 1 << 16, kRequestsPerConnection = 1 << 30;
constexpr int kQuality = 90;

std::string text_of(const nlohmann::json& json) {
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Vec3f vector_of(const nlohmann::json& json) {
    const auto v = json.get<std::array<float, 3>>();
    return {v[0], v[1], v[2]};
}

/// What is sent of a picture: length of the facts in bytes, facts as JSON, and pixels.
struct Sent {
    SharedPicture picture;
    std::string head, jpeg;  ///< of the two kinds of pixels, those of the picture if there is no JPEG

    std::string_view pixels() const {
        if (!jpeg.empty()) return jpeg;
        return {reinterpret_cast<const char*>(picture->image.rgb.get()), picture->image.bytes()};
    }
};

std::shared_ptr<const Sent> sent_of(const SharedPicture& picture, const httplib::Request& q) {
    auto sent = std::make_shared<Sent>(Sent{picture, {}, {}});
    const ByteImage& image = picture->image;
    nlohmann::json facts = picture->facts;
    facts["frame"] = picture->number;
    facts["width"] = image.width;
    facts["height"] = image.height;
    facts["format"] = "rgb";
    if (q.get_param_value("as") == "jpeg" && image.bytes() && std::max(image.width, image.height) <= kLargestJpeg) {
        const int quality = q.has_param("quality") ? std::atoi(q.get_param_value("quality").c_str()) : kQuality;
        const auto start = Clock::now();
        sent->jpeg = jpeg_bytes(image.width, image.height, image.rgb.get(), quality);
        facts["format"] = "jpeg";
        facts["picture_seconds"]["jpeg"] = seconds_since(start);
    }
    const std::string text = text_of(facts);
    const auto size = uint32_t(text.size());
    sent->head.assign(reinterpret_cast<const char*>(&size), sizeof(size));
    sent->head += text;
    return sent;
}

/// Head and pixels lie where they are until the socket has them.
void answer_with(std::shared_ptr<const Sent> sent, httplib::Response& r) {
    const size_t size = sent->head.size() + sent->pixels().size();
    r.set_header("Cache-Control", "no-store");
    r.set_content_provider(size, "application/octet-stream",
                           [sent = std::move(sent)](size_t offset, size_t, httplib::DataSink& sink) {
                               const std::string_view head = sent->head, pixels = sent->pixels();
                               const std::string_view part =
                                   offset < head.size() ? head.substr(offset) : pixels.substr(offset - head.size());
                               return sink.write(part.data(), part.size());
                           });
}

/// A page of somebody else that a browser shows must not drive this one, whatever its name resolves to.
bool is_own(const httplib::Request& request, const std::string& host, int port) {
    const std::string end = fmt::format(":{}", port), given = request.get_header_value("Host");
    const std::string origin = request.get_header_value("Origin");
    // One that others may look at has names that are not known here.
    const bool local = host == "127.0.0.1" || host == "localhost";
    const bool named = !local || given == "localhost" + end || given == "127.0.0.1" + end;
    return named && (origin.empty() || origin == "http://" + given);
}

void answer(ViewedRender& render, httplib::Server& server) {
    server.Get("/", [](const httplib::Request&, httplib::Response& r) { r.set_content(kPage, "text/html"); });
    server.Get("/scene", [&](const httplib::Request&, httplib::Response& r) {
        r.set_content(text_of(render.description()), "application/json");
    });
    server.Get("/frame", [&](const httplib::Request& q, httplib::Response& r) {
        const SharedPicture picture =
            render.wait(std::strtoull(q.get_param_value("after").c_str(), nullptr, 10), kPatience);
        if (!picture) {
            r.status = 204;
            return;
        }
        answer_with(sent_of(picture, q), r);
    });
    const auto asked = [](uint64_t number, httplib::Response& r) {
        r.set_content(text_of({{"asked", number}}), "application/json");
    };
    server.Post("/camera", [&render, asked](const httplib::Request& q, httplib::Response& r) {
        const auto json = nlohmann::json::parse(q.body);
        if (json.value("reset", false)) return asked(render.reset_camera(), r);
        const LookAt look = {vector_of(json.at("origin")), vector_of(json.at("target")), vector_of(json.at("up"))};
        asked(render.look(look, json.value("moving", false)), r);
    });
    server.Post("/method", [&render, asked](const httplib::Request& q, httplib::Response& r) {
        std::vector<std::pair<std::string, std::string>> assignments;
        for (const auto& pair : nlohmann::json::parse(q.body))
            assignments.emplace_back(pair.at(0).get<std::string>(), pair.at(1).get<std::string>());
        asked(render.choose(assignments), r);
    });
    server.Post("/exposure", [&render, asked](const httplib::Request& q, httplib::Response& r) {
        const float stops = nlohmann::json::parse(q.body).at("stops").get<float>();
        asked(render.expose(std::clamp(stops, -100.0f, 100.0f)), r);
    });
    server.set_exception_handler([](const httplib::Request&, httplib::Response& r, std::exception_ptr thrown) {
        try {
            std::rethrow_exception(thrown);
        } catch (const std::exception& e) {
            r.status = 400;
            r.set_content(text_of({{"error", e.what()}}), "application/json");
        }
    });
}

}  // namespace

void serve(ViewedRender& render, const Address& address, const volatile bool* interrupt,
           const std::function<void(const std::string& url)>& started) {
    httplib::Server server;
    server.set_payload_max_length(kLargestRequest);
    // Headers and body are written apart: without this the second waits for the other side to acknowledge the first.
    server.set_tcp_nodelay(true);
    server.set_keep_alive_max_count(kRequestsPerConnection);
    // The library's own options let a second program listen at the same port.
    server.set_socket_options([](socket_t s) {
        const int yes = 1;
        setsockopt(s, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    const int port = address.port ? address.port : server.bind_to_any_port(address.host.c_str());
    if (port < 0 || (address.port && !server.bind_to_port(address.host.c_str(), port)))
        throw Error(
            ExitCode::device,
            fmt::format("{}:{} cannot be listened at: the port is taken, or the host is none of this machine's; "
                        "--port 0 takes a free one",
                        address.host, address.port));
    server.set_pre_routing_handler([&, port](const httplib::Request& q, httplib::Response& r) {
        if (is_own(q, address.host, port)) return httplib::Server::HandlerResponse::Unhandled;
        r.status = 403;
        return httplib::Server::HandlerResponse::Handled;
    });
    answer(render, server);
    std::atomic<bool> over = false;
    std::thread watch([&] {
        while (!over && !is_set(interrupt)) std::this_thread::sleep_for(kLookPeriod);
        server.stop();
    });
    started(fmt::format("http://{}:{}/", address.host, port));
    server.listen_after_bind();
    over = true;
    watch.join();
}

}  // namespace ambilux
