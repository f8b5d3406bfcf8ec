// Forwards TCP connections to a server's WebSocket, with an independent WebSocket implementation: any test
// peer that speaks VRPN over TCP can then connect as a page does.
#pragma once

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <memory>
#include <string>
#include <thread>

#include "net/endpoint.h"

namespace hapticd::test {

class WebTunnel {
 public:
  /// `authorization` is a header of each request.
  explicit WebTunnel(const net::Endpoint& server, std::string authorization = "")
      : server_(server), authorization_(std::move(authorization)) {
    accept();
    thread_ = std::thread([this] { context_.run(); });
  }
  ~WebTunnel() {
    context_.stop();
    thread_.join();
  }
  /// The address to connect to instead of the server's.
  net::Endpoint address() const { return {net::kLoopbackAddress, acceptor_.local_endpoint().port()}; }

 private:
  using Tcp = boost::asio::ip::tcp;
  using Error = boost::system::error_code;

  struct Link : std::enable_shared_from_this<Link> {
    explicit Link(Tcp::socket socket) : near(std::move(socket)), far(near.get_executor()) {}

    void start(const net::Endpoint& server, const std::string& authorization) {
      far.set_option(boost::beast::websocket::stream_base::decorator([&](auto& request) {
        if (!authorization.empty()) request.set(boost::beast::http::field::authorization, authorization);
      }));
      far.next_layer().connect({boost::asio::ip::address_v4(server.address), server.port});
      far.handshake(server.text(), "/vrpn");
      far.binary(true);
      there();
      back();
    }
    void there() {
      near.async_read_some(boost::asio::buffer(bytes), [self = shared_from_this()](Error error,
                                                                                   std::size_t size) {
        if (error) return self->close();
        self->far.async_write(boost::asio::buffer(self->bytes.data(), size),
                              [self](Error failed, std::size_t) { failed ? self->close() : self->there(); });
      });
    }
    void back() {
      far.async_read(message, [self = shared_from_this()](Error error, std::size_t) {
        if (error) return self->close();
        boost::asio::async_write(self->near, self->message.data(), [self](Error failed, std::size_t size) {
          self->message.consume(size);
          failed ? self->close() : self->back();
        });
      });
    }
    void close() {
      Error ignored;
      near.close(ignored);
      far.next_layer().close(ignored);
    }

    Tcp::socket near;
    boost::beast::websocket::stream<Tcp::socket> far;
    std::array<char, 65536> bytes{};
    boost::beast::flat_buffer message;
  };

  void accept() {
    acceptor_.async_accept([this](Error error, Tcp::socket socket) {
      if (error) return;
      try {
        std::make_shared<Link>(std::move(socket))->start(server_, authorization_);
      } catch (const std::exception&) {
        // The peer sees its connection close.
      }
      accept();
    });
  }

  const net::Endpoint server_;
  const std::string authorization_;
  boost::asio::io_context context_{1};
  Tcp::acceptor acceptor_{context_, {boost::asio::ip::address_v4::loopback(), 0}};
  std::thread thread_;
};

}  // namespace hapticd::test
