#include "hapticd/client.h"

#include <algorithm>

#include "base/printable.h"
#include "base/world.h"
#include "client/client_impl.h"

namespace hapticd {

using namespace std::chrono_literals;

namespace {

// With timeouts that fit in every unit in which they are counted.
ClientOptions limited(ClientOptions options) {
  options.connectTimeout =
      std::min<std::chrono::milliseconds>(options.connectTimeout, client::Link::kLongestWait);
  options.sendTimeout = std::min<std::chrono::milliseconds>(options.sendTimeout, client::Link::kLongestWait);
  return options;
}

client::LinkOptions linkOptions(const ClientOptions& options) {
  return {.reconnect = options.reconnect,
          .sendTimeout = options.sendTimeout,
          .queueLimit_bytes = std::max<std::size_t>(options.queueLimit_bytes, 1)};
}

// A server that hangs after its greeting has named nothing either.
std::string whatServerHas(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    if (name == "VRPN Control") continue;
    text += (text.empty() ? "it has " : ", ") + base::printable(name);
  }
  return text.empty() ? "it has named none: it has no device, or it hangs" : text;
}

}  // namespace

Client::Impl::Impl(const client::DeviceAddress& address, const ClientOptions& clientOptions)
    : device(address.device),
      server(address.server.text()),
      options(limited(clientOptions)),
      link(address.server, linkOptions(options)),
      sender(link.addDevice(address.device)),
      key(base::world().random.next() | 1) {
  link.onUp = [this] { greet(); };
  link.onArrival = [this](auto kind, auto from, auto payload) { onArrival(kind, from, payload); };
}

void Client::Impl::waitConnected(Duration timeout) {
  constexpr Duration kShortestAnswer = 1s;  // also when the connection took nearly all of the timeout
  const base::Nanos start = base::now();
  timeout = std::max(timeout, Duration::zero());
  if (!link.waitConnected(timeout)) throw ConnectError(device + ": " + link.whyNotConnected());
  const Duration left = timeout - Duration(base::now() - start);
  if (!link.waitHeard(sender, std::max(left, kShortestAnswer))) {
    if (!link.connected()) throw ConnectError(device + ": " + link.whyNotConnected());
    throw ConnectError("no device '" + device + "' answers at " + server + "; " +
                       whatServerHas(link.serverDevices()));
  }
}

std::size_t Client::Impl::poll(Duration timeout) {
  const std::size_t count = link.poll(timeout, [this](const client::Arrival& arrival) { dispatch(arrival); });
  if (options.throwOnError && !firstError.empty()) {
    std::string text;
    text.swap(firstError);
    throw ServerError(device + '@' + server + ": " + text);
  }
  return count;
}

Client::Client(std::string_view device, const ClientOptions& options)
    : impl_(std::make_unique<Impl>(client::parseDevice(device), options)) {
  if (options.connectTimeout > 0ms) impl_->waitConnected(impl_->options.connectTimeout);
}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

std::size_t Client::poll(Duration timeout) {
  return impl_->poll(timeout);
}

void Client::runFor(Duration duration) {
  const base::Nanos start = base::now();
  for (Duration left = std::max(duration, 0ns); left > 0ns; left = duration - Duration(base::now() - start))
    impl_->poll(left);
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
  result.taken = std::chrono::steady_clock::time_point(Duration(base::now()));
  result.connections = link.connections;
  result.messagesOut = link.messagesOut;
  result.messagesIn = link.messagesIn;
  result.messagesDropped = link.messagesDropped;
  result.messagesDamaged = impl_->damaged;
  result.tcpBytesOut = link.tcpBytesOut;
  result.tcpBytesIn = link.tcpBytesIn;
  result.udpBytesOut = link.udpBytesOut;
  result.udpBytesIn = link.udpBytesIn;
  result.reports = impl_->reports;
  return result;
}

}  // namespace hapticd
