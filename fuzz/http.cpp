// A client of the web port in a simulated network: however its bytes are cut, the same requests are seen, and
// the connection ends.
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "fuzz/targets.h"
#include "net/fake_network.h"
#include "net/http_server.h"

namespace hapticd::fuzz {
namespace {

using namespace std::chrono_literals;

struct HttpSeen {
  std::string requests;
  std::size_t answered = 0;
};

HttpSeen ask(Input input, std::size_t piece) {
  HttpSeen seen;
  base::SimulatedClock clock;
  net::FakeNetwork network(clock);
  const net::ScopedNetwork scope(network);
  net::Loop loop;
  std::vector<net::Connection> taken;
  net::HttpServer server(
      loop, {0x7f000001, 8080}, [&](const net::HttpRequest& request, const net::HttpReply& reply) {
        seen.requests += request.method + ' ' + request.target + ' ' + request.body + '\n';
        for (const auto& [name, value] : request.headers) seen.requests += name + ": " + value + '\n';
        require(request.body.size() <= 4096, "bodies are bounded");
        static_cast<void>(request.parameter("scene"));
        if (!request.wantsWebSocket) return reply(net::HttpResponse::of(200, request.path()));
        net::HttpResponse response;
        response.onWebSocket = [&](net::Connection connection) {
          connection.start({.onBytes = [&](std::span<const std::byte> bytes) {
            seen.requests.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
          }});
          taken.push_back(std::move(connection));
        };
        reply(std::move(response));
      });
  net::Connection client = net::Connection::connect(loop, server.local(), 1000ms);
  client.start({.onBytes = [&](std::span<const std::byte> bytes) { seen.answered += bytes.size(); }});
  for (Input rest = input; !rest.empty(); rest = rest.subspan(std::min(piece, rest.size()))) {
    client.send(rest.first(std::min(piece, rest.size())));
    client.flush();
    loop.runFor(1ms);
  }
  loop.runFor(1s);
  client.close("the input ends");
  loop.runFor(1s);
  require(server.connections() == 0, "the connection ends with its client");
  return seen;
}

}  // namespace

void http(Input input) {
  if (input.size() > 16384) return;
  const HttpSeen whole = ask(input, input.size());
  const HttpSeen cut = ask(input, 1 + input.size() / 3);
  require(whole.requests == cut.requests, "cuts do not change the requests");
}

}  // namespace hapticd::fuzz
