// Who may command a device.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "server/config/config.h"

namespace hapticd::server {

/// `control` of one device. Net thread.
class Roles {
 public:
  Roles(Control control, std::vector<std::string> list) : control_(control), list_(std::move(list)) {}

  /// Whether this client, at this address, may command. With `first`, asking makes the first one.
  bool mayCommand(std::uint64_t client, const std::string& address) {
    if (control_ == Control::any) return true;
    if (control_ == Control::list) return std::find(list_.begin(), list_.end(), address) != list_.end();
    if (!first_) first_ = client;
    return *first_ == client;
  }
  /// The same without making anybody the first one.
  bool couldCommand(std::uint64_t client, const std::string& address) const {
    if (control_ != Control::first) return Roles(*this).mayCommand(client, address);
    return !first_ || *first_ == client;
  }
  /// When the one in control leaves, the next to command is.
  void clientGone(std::uint64_t client) {
    if (first_ == client) first_.reset();
  }
  /// For the text of a refusal.
  std::string reason() const {
    return control_ == Control::list ? "control_list of the server does not name your address"
                                     : "client " + std::to_string(first_.value_or(0)) + " is in control";
  }

 private:
  Control control_;
  std::vector<std::string> list_;
  std::optional<std::uint64_t> first_;
};

}  // namespace hapticd::server
