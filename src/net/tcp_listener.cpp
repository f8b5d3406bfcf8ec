#include "net/tcp_listener.h"

#include "net/loop_impl.h"

namespace hapticd::net {

TcpListener::TcpListener(Loop& loop, const Endpoint& local, std::function<void(Connection)> onAccept,
                         const ConnectionOptions& options, const char* option)
    : impl_(loop.impl().listen(local, std::move(onAccept), options, option)) {}

TcpListener::~TcpListener() {
  impl_->close();
}

const Endpoint& TcpListener::local() const noexcept {
  return impl_->local();
}

}  // namespace hapticd::net
