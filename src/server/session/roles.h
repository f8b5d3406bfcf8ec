// Decides which owners may command a scene. The role of a client itself: identity.h.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "server/config/config.h"

namespace hapticd::server {

/// The configured `control` of one scene, for all of its devices. Net thread.
class Roles {
 public:
  Roles(Control control, std::vector<std::string> list) : control_(control), list_(std::move(list)) {}

  /// Whether this client, at this IPv4 address, may command. With Control::first, the first client to ask
  /// gets control.
  bool mayCommand(std::uint64_t client, const std::string& address) {
    if (control_ == Control::any) return true;
    if (control_ == Control::list) return std::find(list_.begin(), list_.end(), address) != list_.end();
    if (!first_) first_ = client;
    return *first_ == client;
  }
  /// The same without assigning control.
  bool couldCommand(std::uint64_t client, const std::string& address) const {
    if (control_ != Control::first) return Roles(*this).mayCommand(client, address);
    return !first_ || *first_ == client;
  }
  /// The client disconnects or gives up control: the next one to command gets it.
  void release(std::uint64_t client) {
    if (first_ == client) first_.reset();
  }
  /// The reason in the text of a refusal.
  std::string reason() const {
    return control_ == Control::list ? "your address is not in control_list of the server"
                                     : "client " + std::to_string(first_.value_or(0)) + " is in control";
  }

 private:
  Control control_;
  std::vector<std::string> list_;
  std::optional<std::uint64_t> first_;
};

}  // namespace hapticd::server
