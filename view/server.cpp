#include "view/server.h"

#include <fmt/format.h>
#include <httplib.h>

#include "core/error.h"
#include "core/flag.h"
#include "view/page.h"

namespace ambilux {
namespace {

constexpr std::chrono::seconds kPatience(5);
constexpr std::chrono::milliseconds kLookPeriod(100);
constexpr size_t kLargestRequest = 1 << 16;

std::string text_of(const nlohmann::json& json) {
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Vec3f vector_of(const nlohmann::json& json) {
    const auto v = json.get<std::array<float, 3>>();
    return {v[0], v[1], v[2]};
}

/// Length of the facts in bytes, facts as JSON, pixels.
std::string body_of(const Picture& picture) {
    nlohmann::json facts = picture.facts;
    facts["frame"] = picture.number;
    facts["width"] = picture.width;
    facts["height"] = picture.height;
    std::string text = text_of(facts);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const auto size = uint32_t(text.size());
    std::string body(reinterpret_cast<const char*>(&size), sizeof(size));
    body += text;
    body.append(reinterpret_cast<const char*>(picture.rgba.data()), picture.rgba.size());
    return body;
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
        r.set_header("Cache-Control", "no-store");
        r.set_content(body_of(*picture), "application/octet-stream");
    });
    server.Post("/camera", [&](const httplib::Request& q, httplib::Response&) {
        const auto json = nlohmann::json::parse(q.body);
        if (json.value("reset", false)) return render.reset_camera();
        render.look({vector_of(json.at("origin")), vector_of(json.at("target")), vector_of(json.at("up"))},
                    json.value("moving", false));
    });
    server.Post("/method", [&](const httplib::Request& q, httplib::Response&) {
        std::vector<std::pair<std::string, std::string>> assignments;
        for (const auto& pair : nlohmann::json::parse(q.body))
            assignments.emplace_back(pair.at(0).get<std::string>(), pair.at(1).get<std::string>());
        render.choose(assignments);
    });
    server.Post("/exposure", [&](const httplib::Request& q, httplib::Response&) {
        render.expose(std::clamp(nlohmann::json::parse(q.body).at("stops").get<float>(), -100.0f, 100.0f));
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
