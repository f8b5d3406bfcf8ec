// A small HTTP client: one blocking request per connection.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "net/endpoint.h"
#include "net/loopback.h"
#include "running_server.h"

namespace hapticd::test {

struct Answer {
  int status = 0;
  std::string head;
  std::string body;

  nlohmann::json json() const { return nlohmann::json::parse(body); }
  /// The value of a header; empty when there is none.
  std::string header(const std::string& name) const {
    const std::size_t at = head.find("\r\n" + name + ": ");
    if (at == std::string::npos) return "";
    const std::size_t from = at + name.size() + 4;
    return head.substr(from, head.find("\r\n", from) - from);
  }
};

/// Sends the request unchanged and reads until the server closes the connection.
inline Answer ask(const net::Endpoint& server, const std::string& request) {
  net::RawSocket socket = net::RawSocket::connected(server);
  socket.send(request);
  std::string all;
  for (;;) {
    std::string part(65536, '\0');
    const ssize_t got = ::recv(socket.fd(), part.data(), part.size(), 0);
    if (got <= 0) break;
    all.append(part, 0, static_cast<std::size_t>(got));
  }
  Answer answer;
  const std::size_t end = all.find("\r\n\r\n");
  if (all.size() < 12 || end == std::string::npos) return answer;
  answer.status = std::stoi(all.substr(9, 3));
  answer.head = all.substr(0, end + 2);
  answer.body = all.substr(end + 4);
  return answer;
}

/// A GET without browser headers, or with additional ones ("Origin: http://evil\r\n").
inline Answer get(const net::Endpoint& server, const std::string& target, const std::string& headers = "") {
  const std::string host =
      headers.find("Host: ") == std::string::npos ? "Host: " + server.text() + "\r\n" : "";
  return ask(server, "GET " + target + " HTTP/1.1\r\n" + host + headers + "Connection: close\r\n\r\n");
}

/// Polls the state until the condition holds; null after 60 s.
template <class Condition>
nlohmann::json stateWhen(const net::Endpoint& server, const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (std::chrono::steady_clock::now() < end) {
    nlohmann::json state = get(server, "/api/state").json();
    if (condition(state)) return state;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return {};
}

/// The configuration with an HTTP port chosen by the system.
inline server::ServerConfig withWeb(server::ServerConfig config = RunningServer::anyPort()) {
  config.http = "127.0.0.1:0";
  return config;
}

}  // namespace hapticd::test
