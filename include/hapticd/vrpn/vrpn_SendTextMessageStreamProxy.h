// Text messages of a device by operator<<: send_text_message(vrpn_TEXT_ERROR) << "motor " << 3;
#ifndef VRPN_SEND_TEXT_MESSAGE_STREAM_PROXY_H
#define VRPN_SEND_TEXT_MESSAGE_STREAM_PROXY_H

#include <sstream>

#include "vrpn_BaseClass.h"

/// Collects a text and sends it at the end of the statement.
class vrpn_SendTextMessageStreamProxy {
 public:
  typedef vrpn_BaseClassUnique::SendTextMessageBoundCall Call;

  explicit vrpn_SendTextMessageStreamProxy(const Call& call) : call_(call) {}
  vrpn_SendTextMessageStreamProxy(vrpn_SendTextMessageStreamProxy&& other)
      : call_(other.call_), text_(other.text_.str(), std::ios::ate), sends_(other.sends_) {
    other.sends_ = false;
  }
  ~vrpn_SendTextMessageStreamProxy() {
    if (sends_) call_(text_.str().c_str());
  }

  template <class T>
  std::ostream& operator<<(const T& value) {
    return text_ << value;
  }

 private:
  Call call_;
  std::ostringstream text_;
  bool sends_ = true;
};

template <class T>
vrpn_SendTextMessageStreamProxy operator<<(const vrpn_BaseClassUnique::SendTextMessageBoundCall& call,
                                           const T& first) {
  vrpn_SendTextMessageStreamProxy proxy(call);
  proxy << first;
  return proxy;
}

#endif
