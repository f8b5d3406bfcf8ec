// What the sockets of this room share behind Loop; the only way Asio is seen, and by src/net alone.
#pragma once

#include <utility>  // before Asio: Boost 1.74 uses std::exchange without including it
//
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address_v4.hpp>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "net/endpoint.h"
#include "net/loop.h"

namespace hapticd::net {

/// Runs the function; the text of the exception that left it, if one did.
template <class Function>
std::optional<std::string> errorOf(Function&& function) {
  try {
    function();
    return std::nullopt;
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "an exception of unknown type";
  }
}

struct Loop::Impl {
  static constexpr std::size_t kReadBufferBytes = std::size_t{64} * 1024;

  // One buffer for all sockets: each read is consumed before the next, so memory does not grow with clients.
  std::unique_ptr<std::byte[]> readBuffer = std::make_unique_for_overwrite<std::byte[]>(kReadBufferBytes);
  std::function<void(std::string_view)> onError;
  bool running = false;
  boost::asio::io_context context{1};  // one thread runs it; posting from others stays safe
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work{context.get_executor()};

  void report(std::string_view text) noexcept;

  /// Runs a callback that belongs to no connection.
  template <class Function>
  void guard(Function&& function) {
    if (const auto error = errorOf(std::forward<Function>(function))) {
      report(*error);
    }
  }
};

/// Why a socket of the given kind ("TCP", "UDP") could not be bound, with the remedy: another choice for
/// `option`.
std::string bindErrorText(const char* kind, const Endpoint& local, const boost::system::error_code& error,
                          const std::string& option = "--listen");

template <class AsioEndpoint>
AsioEndpoint toAsio(const Endpoint& endpoint) {
  return AsioEndpoint(boost::asio::ip::address_v4(endpoint.address), endpoint.port);
}

template <class AsioEndpoint>
Endpoint fromAsio(const AsioEndpoint& endpoint) {
  return {endpoint.address().is_v4() ? endpoint.address().to_v4().to_uint() : 0, endpoint.port()};
}

}  // namespace hapticd::net
