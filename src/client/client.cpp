#include "hapticd/client.h"

#include <algorithm>

#include "client/client_impl.h"

namespace hapticd {

using namespace std::chrono_literals;

namespace {

client::LinkOptions linkOptions(const ClientOptions& options) {
  return {.reconnect = options.reconnect,
          .send_timeout = options.send_timeout,
          .queue_limit = std::max<std::size_t>(options.queue_limit, 1)};
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    if (name == "VRPN Control") continue;
    text += (text.empty() ? "" : ", ") + name;
  }
  return text.empty() ? "no other device" : text;
}

}  // namespace

Client::Impl::Impl(const client::DeviceAddress& address, const ClientOptions& client_options)
    : device(address.device),
      server(address.server.text()),
      options(client_options),
      link(address.server, linkOptions(client_options)),
      sender(link.addDevice(address.device)) {
  link.onUp = [this] { greet(); };
  link.onArriving = [this](auto kind, auto from, auto payload) { arriving(kind, from, payload); };
}

void Client::Impl::waitConnected(Duration timeout) {
  constexpr Duration kShortestAnswer = 1s;  // for a server that was reached in the last moment
  const auto start = std::chrono::steady_clock::now();
  if (!link.waitConnected(timeout)) throw ConnectError(device + ": " + link.whyNotConnected());
  const Duration left = timeout - (std::chrono::steady_clock::now() - start);
  if (!link.waitHeard(sender, std::max(left, kShortestAnswer))) {
    throw ConnectError("no device '" + device + "' answers at " + server + "; it has " +
                       joined(link.serverDevices()));
  }
}

std::size_t Client::Impl::poll(Duration timeout) {
  const std::size_t count = link.poll(timeout, [this](const client::Arrival& arrival) { dispatch(arrival); });
  if (options.throw_on_error && !first_error.empty()) {
    std::string text;
    text.swap(first_error);
    throw ServerError(device + '@' + server + ": " + text);
  }
  return count;
}

Client::Client(std::string_view device, const ClientOptions& options)
    : impl_(std::make_unique<Impl>(client::parseDevice(device), options)) {
  if (options.connect_timeout > 0ms) impl_->waitConnected(options.connect_timeout);
}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

std::size_t Client::poll(Duration timeout) {
  return impl_->poll(timeout);
}

void Client::runFor(Duration duration) {
  const auto end = std::chrono::steady_clock::now() + duration;
  for (Duration left = duration; left > 0ns; left = end - std::chrono::steady_clock::now()) impl_->poll(left);
}

void Client::flush() {
  impl_->link.flush();
}
void Client::flushAll() {
  impl_->link.drainTo(0);
}
bool Client::connected() const noexcept {
  return impl_->link.connected();
}
void Client::waitConnected(Duration timeout) {
  impl_->waitConnected(timeout);
}
const std::string& Client::device() const noexcept {
  return impl_->device;
}
const std::string& Client::server() const noexcept {
  return impl_->server;
}
const LatestReports& Client::latest() const noexcept {
  return impl_->latest;
}

Statistics Client::statistics() const {
  const client::LinkStatistics link = impl_->link.statistics();
  Statistics result;
  result.taken = std::chrono::steady_clock::now();
  result.connections = link.connections;
  result.messages_out = link.messages_out;
  result.messages_in = link.messages_in;
  result.messages_dropped = link.messages_dropped;
  result.messages_damaged = impl_->damaged;
  result.tcp_bytes_out = link.tcp_bytes_out;
  result.tcp_bytes_in = link.tcp_bytes_in;
  result.udp_bytes_out = link.udp_bytes_out;
  result.udp_bytes_in = link.udp_bytes_in;
  result.reports = impl_->reports;
  return result;
}

}  // namespace hapticd
