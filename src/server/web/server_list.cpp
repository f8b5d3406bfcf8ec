#include "server/web/server_list.h"

#include <utility>

#include "base/world.h"

namespace hapticd::server {

void ServerList::get(Then then) {
  if (!finder_) return then(serversJson({.reason = "this server does not search the network"}));
  if (freshUntil_ != 0 && base::now() < freshUntil_) return then(json_);
  waiting_.push_back(std::move(then));
  if (waiting_.size() > 1) return;
  finder_->find([this](NetworkSearch found) {
    post_([this, json = serversJson(std::move(found))] { onFound(json); });
  });
}

void ServerList::onFound(const std::string& json) {
  json_ = json;
  freshUntil_ = base::now() + kFresh;
  for (const Then& then : std::exchange(waiting_, {})) then(json_);
}

}  // namespace hapticd::server
