#include "device/haply/service_connection.h"

#include <utility>
//
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>

namespace hapticd::device::haply {

namespace asio = boost::asio;
namespace beast = boost::beast;
using ErrorCode = boost::system::error_code;

struct ServiceConnection::Impl {
  asio::io_context context{1};
  // A client that offers no compression: without the code for it.
  beast::websocket::stream<asio::ip::tcp::socket, false> stream{context};
  beast::flat_buffer buffer;

  // Runs one operation; `begin` receives the completion handler.
  template <class Begin>
  void await(const char* what, std::chrono::milliseconds most, Begin&& begin) {
    bool done = false;
    ErrorCode result;
    begin([&](ErrorCode error, auto&&...) {
      done = true;
      result = error;
    });
    context.restart();
    context.run_for(most);
    if (!done) {
      // The operation holds references to this stack frame, so it must end first.
      ErrorCode ignored;
      stream.next_layer().close(ignored);
      context.restart();
      context.run();
      throw ConnectionError(std::string(what) + ": no answer within " + std::to_string(most.count()) + " ms");
    }
    if (result) throw ConnectionError(std::string(what) + ": " + result.message());
  }
};

ServiceConnection::ServiceConnection(const std::string& host, const std::string& port,
                                     std::chrono::milliseconds most)
    : impl_(std::make_unique<Impl>()) {
  const std::string place = host + ":" + port;
  ErrorCode error;
  asio::ip::tcp::resolver resolver(impl_->context);
  const auto addresses = resolver.resolve(host, port, error);
  if (error) throw ConnectionError(place + ": " + error.message());
  auto& socket = impl_->stream.next_layer();
  const std::string connecting = "connecting to " + place;
  impl_->await(connecting.c_str(), most,
               [&](auto handler) { asio::async_connect(socket, addresses, std::move(handler)); });
  socket.set_option(asio::ip::tcp::no_delay(true), error);
  impl_->await("handshake", most,
               [&](auto handler) { impl_->stream.async_handshake(place, "/", std::move(handler)); });
  impl_->stream.text(true);
  impl_->stream.read_message_max(1U << 20);
}

ServiceConnection::~ServiceConnection() = default;

void ServiceConnection::send(std::string_view text, std::chrono::milliseconds most) {
  impl_->await("sending", most, [&](auto handler) {
    impl_->stream.async_write(asio::buffer(text.data(), text.size()), std::move(handler));
  });
}

std::string_view ServiceConnection::receive(std::chrono::milliseconds most) {
  impl_->buffer.clear();
  impl_->await("receiving", most,
               [&](auto handler) { impl_->stream.async_read(impl_->buffer, std::move(handler)); });
  const auto data = impl_->buffer.cdata();
  return {static_cast<const char*>(data.data()), data.size()};
}

}  // namespace hapticd::device::haply
