#include "server/web/web_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <map>

#include "server/web/web_assets.h"

namespace hapticd::server {
namespace {

constexpr int kForgetAfter_s = 10;

constexpr std::string_view kNoMemory = "the server is out of memory; retry later";

net::HttpResponse errorResponse(int status, std::string_view text) {
  return net::HttpResponse::of(status, errorJson(text), "application/json");
}

// A whole number from the query string. Sets `error` when it is missing, malformed or out of range.
template <class Number>
Number numberIn(const net::HttpRequest& request, std::string_view name, std::string& error) {
  const auto text = request.parameter(name);
  Number number = 0;
  if (text) {
    const auto [end, code] = std::from_chars(text->data(), text->data() + text->size(), number);
    if (code == std::errc{} && end == text->data() + text->size()) return number;
  }
  constexpr std::size_t kShown = 80;
  error = std::string(name) +
          (text ? " must be a whole number, got '" + std::string(text->substr(0, kShown)) + "'"
                : std::string(" is missing")) +
          ": expected /api/mesh?scene=0&object=0&geometry=1";
  return 0;
}

net::HttpOptions httpOptions(const net::ConnectionOptions& connection, WebOwner& owner) {
  net::HttpOptions options;
  options.secured = [&owner](net::Connection accepted) { return owner.secured(std::move(accepted)); };
  options.connection = connection;
  return options;
}

// On every response: our page loads nothing from other sites, and other sites cannot embed it.
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

// Empty where there is none. The scheme has no case.
std::string bearerToken(std::string_view field) {
  constexpr std::string_view kScheme = "bearer ";
  const auto same = [](char a, unsigned char b) { return a == static_cast<char>(std::tolower(b)); };
  const bool has =
      field.size() > kScheme.size() && std::equal(kScheme.begin(), kScheme.end(), field.begin(), same);
  return std::string(has ? field.substr(kScheme.size()) : "");
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
      servers_([&loop](std::function<void()> function) { loop.post(std::move(function)); }),
      http_(
          loop, local, [this](const auto& request, const auto& reply) { onRequest(request, reply); },
          httpOptions(connection, owner)),
      access_(http_.local(), allowed) {
  prepareAssets();
}

WebServer::~WebServer() = default;

void WebServer::everySecond() {
  if (++idleSeconds_ == kForgetAfter_s) watch_.forget();
}

void WebServer::respond(const net::HttpReply& reply, net::HttpResponse response) const {
  addHeaders(response);
  reply(std::move(response));
}

namespace {

// Scripts of pages from an allowed origin may read the responses. Access refused all other origins before.
net::HttpReply withOrigin(const net::HttpRequest& request, const net::HttpReply& reply) {
  const std::string origin(request.header("origin"));
  if (origin.empty()) return reply;
  return reply.with({{"Access-Control-Allow-Origin", origin}, {"Vary", "Origin"}});
}

}  // namespace

void WebServer::onRequest(const net::HttpRequest& request, const net::HttpReply& reply) {
  idleSeconds_ = 0;
  const std::string refusal = access_.refusal(request);
  if (!refusal.empty()) {
    respond(reply, net::HttpResponse::of(request.count("host") == 1 ? 403 : 400, refusal + '\n'));
  } else if (request.method != "GET" && request.method != "HEAD") {
    net::HttpResponse response = net::HttpResponse::of(405, "only GET and HEAD are allowed\n");
    response.headers = {{"Allow", "GET, HEAD"}};
    respond(reply, std::move(response));
  } else if (!request.target.starts_with('/')) {
    respond(reply, net::HttpResponse::of(400, "the request target must begin with '/'\n"));
  } else {
    route(request, withOrigin(request, reply));
  }
}

void WebServer::route(const net::HttpRequest& request, const net::HttpReply& reply) {
  const std::string_view path = request.path();
  if (path == "/vrpn") {
    net::HttpResponse response =
        net::HttpResponse::of(426, "/vrpn is a WebSocket that carries a VRPN stream\n");
    response.headers = {{"Upgrade", "websocket"}, {"Connection", "Upgrade"}};
    response.onWebSocket = [this, ofPage = !request.header("origin").empty(),
                            token =
                                bearerToken(request.header("authorization"))](net::Connection connection) {
      owner_.onWebClient(std::move(connection), token, ofPage);
    };
    respond(reply, std::move(response));
  } else if (path == "/api/state") {
    sendState(reply, &stateJson, "application/json");
  } else if (path == "/metrics") {
    sendState(reply, &metricsText, "text/plain; version=0.0.4; charset=utf-8");
  } else if (path == "/healthz") {
    const std::string faults = faultsOf(owner_.status());
    respond(reply, faults.empty() ? net::HttpResponse::of(200, "ok\n") : net::HttpResponse::of(503, faults));
  } else if (path == "/api/mesh") {
    sendMesh(request, reply);
  } else if (path == "/api/servers") {
    sendServers(reply);
  } else if (path == "/api/messages") {
    respond(reply, net::HttpResponse::of(200, messagesJson(), "application/json"));
  } else {
    respond(reply, assetResponse(path));
  }
}

void WebServer::addScenes() {
  for (std::size_t i = 0; i < watch_.latest().size(); ++i) {
    const auto& observed = watch_.latest()[i];
    if (observed) meshes_.prune(i, *observed);
    report_.scenes.push_back(
        {observed, observed ? meshes_.displayTriangles(i, *observed) : std::vector<std::size_t>()});
  }
}

void WebServer::sendState(const net::HttpReply& reply, Format format, const char* contentType) {
  askers_.push_back({reply, format, contentType});
  nextReport();
}

// One report answers all who asked before it was made, and reports take a tenth of this thread at most: they
// cost more with more clients.
void WebServer::nextReport() {
  if (reporting_ || askers_.empty()) return;
  reporting_ = true;
  const base::Nanos wait = nextReport_ - base::now();
  const auto make = [this] {
    watch_.refresh([this] {
      report_ = {.version = HAPTICD_VERSION, .server = owner_.status(), .scenes = {}};
      answering_ = std::exchange(askers_, {});
      cost_ = 0;
      gather();
    });
  };
  if (wait <= 0) return make();
  reportTimer_ = loop_.after(std::chrono::nanoseconds(wait), make);
}

// A stop does not wait until all of very many clients are listed.
void WebServer::gather() {
  const base::Nanos start = base::now();
  const bool more = owner_.addClients(report_.server);
  if (!more) addScenes();
  cost_ += base::now() - start;
  if (more) return loop_.post([this] { gather(); });
  nextReport_ = base::now() + 9 * cost_;
  answer();
}

void WebServer::answer() {
  const auto askers = std::make_shared<const std::vector<Asker>>(std::exchange(answering_, {}));
  const auto send = [this](const Asker& asker, net::HttpResponse response) {
    loop_.post([this, reply = asker.reply, response = std::move(response)]() mutable {
      respond(reply, std::move(response));
    });
  };
  const auto next = [this] {
    loop_.post([this] {
      reporting_ = false;
      nextReport();
    });
  };
  textWorker_.post(
      [askers, send, next, report = std::exchange(report_, {})] {
        std::map<Format, net::HttpResponse> responses;
        for (const Asker& asker : *askers) {
          if (!responses.contains(asker.format))
            responses[asker.format] = net::HttpResponse::of(200, asker.format(report), asker.contentType);
        }
        for (const Asker& asker : *askers) send(asker, responses.at(asker.format));
        next();
      },
      [askers, send, next](const std::exception& error) {
        spdlog::error("web: {}", error.what());
        for (const Asker& asker : *askers) send(asker, errorResponse(503, kNoMemory));
        next();
      });
}

void WebServer::sendServers(const net::HttpReply& reply) {
  servers_.get([this, reply](const std::string& json) {
    respond(reply, net::HttpResponse::of(200, json, "application/json"));
  });
}

void WebServer::sendMesh(const net::HttpRequest& request, const net::HttpReply& reply) {
  std::string error;
  const auto scene = numberIn<std::size_t>(request, "scene", error);
  const auto object = numberIn<std::int64_t>(request, "object", error);
  const auto geometry = numberIn<std::uint64_t>(request, "geometry", error);
  if (!error.empty()) return respond(reply, errorResponse(400, error));
  if (findMesh(scene, object, geometry, reply, error)) return;
  // The latest description may be old: look again in a new one.
  watch_.refresh([=, this] {
    std::string reason;
    if (!findMesh(scene, object, geometry, reply, reason)) respond(reply, errorResponse(404, reason));
  });
}

bool WebServer::findMesh(std::size_t scene, std::int64_t object, std::uint64_t geometry,
                         const net::HttpReply& reply, std::string& error) {
  const std::string which = "object " + std::to_string(object) + " of scene " + std::to_string(scene);
  if (scene >= watch_.latest().size() || !watch_.latest()[scene]) {
    error = "there is no scene " + std::to_string(scene);
    return false;
  }
  const ObservedScene& observed = *watch_.latest()[scene];
  const auto& objects = observed.description->objects;
  const auto found = std::lower_bound(objects.begin(), objects.end(), object,
                                      [](const auto& known, std::int64_t id) { return known.id < id; });
  if (found == objects.end() || found->id != object) {
    error = "there is no " + which;
    return false;
  }
  if (!found->triangles) {
    error = which + " has no triangles";
    return false;
  }
  const auto position = static_cast<std::size_t>(found - objects.begin());
  if (observed.geometry[position] != geometry) {
    error = which + " has geometry " + std::to_string(observed.geometry[position]) + " now, not " +
            std::to_string(geometry);
    return false;
  }
  meshes_.get(scene, observed, position,
              [this, reply](net::HttpResponse response) { respond(reply, std::move(response)); });
  return true;
}

}  // namespace hapticd::server
