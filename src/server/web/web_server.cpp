#include "server/web/web_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "server/web/web_assets.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

constexpr int kForgetAfter_s = 10;

net::HttpResponse errorJson(int status, const std::string& text) {
  return net::HttpResponse::of(status, R"({"error": ")" + text + "\"}\n", "application/json");
}

template <class Number>
std::optional<Number> numberIn(const net::HttpRequest& request, std::string_view name) {
  const auto text = request.parameter(name);
  if (!text) return std::nullopt;
  Number number = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), number);
  if (error != std::errc{} || end != text->data() + text->size()) return std::nullopt;
  return number;
}

net::HttpOptions httpOptions(const net::ConnectionOptions& connection) {
  net::HttpOptions options;
  options.connection = connection;
  return options;
}

// For every answer: nothing of others in our page, our page in no other.
void addHeaders(net::HttpResponse& response) {
  for (const auto& [name, value] : {
           std::pair{"Cache-Control", "no-cache"},
           {"Content-Security-Policy",
            "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; "
            "form-action 'none'; frame-ancestors 'none'"},
           {"Cross-Origin-Resource-Policy", "same-origin"},
           {"Cross-Origin-Opener-Policy", "same-origin"},
           {"Referrer-Policy", "no-referrer"},
           {"X-Content-Type-Options", "nosniff"},
       }) {
    response.headers.emplace_back(name, value);
  }
}

}  // namespace

WebServer::WebServer(net::Loop& loop, const net::Endpoint& local, const std::vector<std::string>& allowed,
                     const net::ConnectionOptions& connection, WebOwner& owner,
                     std::vector<SceneHost*> scenes)
    : loop_(loop),
      owner_(owner),
      watch_(loop, std::move(scenes),
             [this](std::shared_ptr<const void> old) {
               if (old) textWorker_.post([old = std::move(old)] {});
             }),
      meshes_(loop, meshWorker_),
      http_(
          loop, local, [this](const auto& request, const auto& reply) { onRequest(request, reply); },
          httpOptions(connection)),
      access_(http_.local(), allowed) {}

WebServer::~WebServer() = default;

void WebServer::everySecond() {
  if (++idleSeconds_ == kForgetAfter_s) watch_.forget();
}

void WebServer::respond(const net::HttpReply& reply, net::HttpResponse response) const {
  addHeaders(response);
  reply(std::move(response));
}

void WebServer::onRequest(const net::HttpRequest& request, const net::HttpReply& reply) {
  idleSeconds_ = 0;
  const std::string refusal = access_.refusal(request);
  if (!refusal.empty()) {
    respond(reply, net::HttpResponse::of(403, refusal + '\n'));
  } else if (request.method != "GET" && request.method != "HEAD") {
    net::HttpResponse response = net::HttpResponse::of(405, "this address can only be read\n");
    response.headers = {{"Allow", "GET, HEAD"}};
    respond(reply, std::move(response));
  } else if (!request.target.starts_with('/')) {
    respond(reply, net::HttpResponse::of(400, "the target of a request begins with '/'\n"));
  } else {
    route(request, reply);
  }
}

void WebServer::route(const net::HttpRequest& request, const net::HttpReply& reply) {
  const std::string_view path = request.path();
  if (path == "/vrpn") {
    net::HttpResponse response = net::HttpResponse::of(426, "this is a WebSocket with a VRPN stream in it\n");
    response.headers = {{"Upgrade", "websocket"}, {"Connection", "Upgrade"}};
    response.onWebSocket = [this](net::Connection connection) { owner_.onWebClient(std::move(connection)); };
    respond(reply, std::move(response));
  } else if (path == "/api/state") {
    sendPicture(reply, &stateJson, "application/json");
  } else if (path == "/metrics") {
    sendPicture(reply, &metricsText, "text/plain; version=0.0.4; charset=utf-8");
  } else if (path == "/api/mesh") {
    sendMesh(request, reply);
  } else if (path == "/api/messages") {
    respond(reply, net::HttpResponse::of(200, messagesJson(), "application/json"));
  } else {
    respond(reply, assetResponse(path));
  }
}

Picture WebServer::picture() {
  Picture picture;
  picture.version = HAPTICD_VERSION;
  picture.server = owner_.status();
  for (std::size_t i = 0; i < watch_.views().size(); ++i) {
    const auto& view = watch_.views()[i];
    if (view) meshes_.prune(i, *view);
    picture.scenes.push_back({view, view ? meshes_.displayTriangles(i, *view) : std::vector<std::size_t>()});
  }
  return picture;
}

void WebServer::sendPicture(const net::HttpReply& reply, TextOf text, const char* contentType) {
  watch_.refresh([this, reply, text, contentType] {
    textWorker_.post([this, reply, text, contentType, picture = picture()] {
      auto response = net::HttpResponse::of(200, text(picture), contentType);
      loop_.post(
          [this, reply, response = std::move(response)]() mutable { respond(reply, std::move(response)); });
    });
  });
}

void WebServer::sendMesh(const net::HttpRequest& request, const net::HttpReply& reply) {
  const auto scene = numberIn<std::size_t>(request, "scene");
  const auto object = numberIn<std::int64_t>(request, "object");
  const auto geometry = numberIn<std::uint64_t>(request, "geometry");
  if (!scene || !object || !geometry) {
    return respond(reply, errorJson(400, "say which: /api/mesh?scene=0&object=0&geometry=1"));
  }
  std::string why;
  if (findMesh(*scene, *object, *geometry, reply, why)) return;
  // It may have changed since anybody looked.
  watch_.refresh([=, this] {
    std::string reason;
    if (!findMesh(*scene, *object, *geometry, reply, reason)) respond(reply, errorJson(404, reason));
  });
}

bool WebServer::findMesh(std::size_t scene, std::int64_t object, std::uint64_t geometry,
                         const net::HttpReply& reply, std::string& why) {
  const std::string which = "object " + std::to_string(object) + " of scene " + std::to_string(scene);
  if (scene >= watch_.views().size() || !watch_.views()[scene]) {
    why = "there is no scene " + std::to_string(scene);
    return false;
  }
  const SceneView& view = *watch_.views()[scene];
  const auto& objects = view.description->objects;
  const auto found = std::lower_bound(objects.begin(), objects.end(), object,
                                      [](const auto& known, std::int64_t id) { return known.id < id; });
  if (found == objects.end() || found->id != object || !found->triangles) {
    why = "there is no " + which + (found == objects.end() || found->id != object ? "" : " with triangles");
    return false;
  }
  const auto position = static_cast<std::size_t>(found - objects.begin());
  if (view.geometry[position] != geometry) {
    why = which + " has geometry " + std::to_string(view.geometry[position]) + " now, not " +
          std::to_string(geometry);
    return false;
  }
  meshes_.get(scene, view, position,
              [this, reply](net::HttpResponse response) { respond(reply, std::move(response)); });
  return true;
}

}  // namespace hapticd::server
