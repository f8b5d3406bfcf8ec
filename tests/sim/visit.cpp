#include "sim/visit.h"

#include <charconv>
#include <chrono>

namespace hapticd::sim {

using namespace std::chrono_literals;

Visit::Visit(Clients& all, std::string target, Manner manner, std::uint64_t seed,
             std::function<void(const Answer&)> onAnswer)
    : all_(all),
      target_(std::move(target)),
      manner_(manner),
      dice_(seed),
      onAnswer_(std::move(onAnswer)),
      asked_(all.clock.now()),
      request_("GET " + target_ + " HTTP/1.1\r\nHost: " + all.web.text() + "\r\nConnection: close\r\n\r\n"),
      over_(manner == Manner::stalls || manner == Manner::leaves),
      connection_(net::Connection::connect(all.loop, all.web, 2s)) {
  connection_.start({.onConnected = {},
                     .onBytes = [this](auto bytes) { receive(bytes); },
                     .onDrained = {},
                     .onPeerGone = {},
                     .onClosed =
                         [this](const std::string& reason) {
                           timer_ = {};
                           // While the machine stands still nobody answers.
                           if (over_ || reason.starts_with("cannot connect")) {
                             over_ = true;
                             return;
                           }
                           over_ = true;
                           all_.finding("the web port ended a request of " + target_ +
                                        " without its answer: " + reason);
                         }});
  if (manner_ == Manner::stalls) {
    if (dice_.chance(0.5)) request_.resize(dice_.below(request_.size()));
    connection_.pauseReading();
  }
  if (manner_ == Manner::leaves)
    timer_ = all_.loop.after(std::chrono::nanoseconds(dice_.between(0, 300 * kMs)),
                             [this] { connection_.abort("left"); });
  send(0);
}

void Visit::send(std::size_t from) {
  const std::size_t size =
      manner_ == Manner::dribbles ? std::min(5 + dice_.below(20), request_.size() - from) : request_.size();
  connection_.send(std::as_bytes(std::span(request_).subspan(from, size)));
  connection_.flush();
  if (from + size >= request_.size()) return;
  timer_ = all_.loop.after(std::chrono::nanoseconds(dice_.between(0, 200 * kMs)),
                           [this, next = from + size] { send(next); });
}

// A whole answer has a head and as many bytes as that says.
void Visit::receive(std::span<const std::byte> bytes) {
  if (over_) return;
  for (const std::byte b : bytes) input_ += static_cast<char>(b);
  const std::size_t end = input_.find("\r\n\r\n");
  if (end == std::string::npos) return;
  constexpr std::string_view kLength = "\r\nContent-Length: ";
  const std::size_t length = input_.find(kLength);
  std::size_t size = 0;
  Answer answer;
  const auto number = [this](std::size_t from, auto& value) {
    std::from_chars(input_.data() + from, input_.data() + input_.size(), value);
  };
  if (!input_.starts_with("HTTP/1.1 ") || length > end) {
    over_ = true;
    all_.finding("the web port answers " + target_ + " with '" + input_.substr(0, input_.find('\r')) +
                 "' and no length");
    return;
  }
  number(9, answer.status);
  number(length + kLength.size(), size);
  if (input_.size() < end + 4 + size) return;
  over_ = true;
  answer.body = input_.substr(end + 4, size);
  input_.clear();
  onAnswer_(answer);
}

}  // namespace hapticd::sim
