#include "server/scene/scene_queue.h"

namespace hapticd::server {

void SceneQueue::push(SceneParcel&& parcel) {
  const std::lock_guard lock(mutex_);
  charge(parcel);
  parcels_.push_back(std::move(parcel));
}

void SceneQueue::pushFront(SceneParcel&& parcel) {
  const std::lock_guard lock(mutex_);
  charge(parcel);
  parcels_.push_front(std::move(parcel));
}

void SceneQueue::charge(const SceneParcel& parcel) {
  Account& account = accounts_[parcel.client];
  account.bytes += parcel.bytes;
  ++account.parcels;
  account.full = account.full || account.bytes > kClientLimit_bytes;
}

bool SceneQueue::full(scene::ClientId client) const {
  const std::lock_guard lock(mutex_);
  const auto account = accounts_.find(client);
  return account != accounts_.end() && account->second.full;
}

bool SceneQueue::pending(scene::ClientId client) const {
  const std::lock_guard lock(mutex_);
  return accounts_.count(client) != 0;
}

std::optional<SceneParcel> SceneQueue::take() {
  const std::lock_guard lock(mutex_);
  if (parcels_.empty()) return std::nullopt;
  std::optional<SceneParcel> oldest(std::move(parcels_.front()));
  parcels_.pop_front();
  return oldest;
}

bool SceneQueue::done(scene::ClientId client, std::size_t bytes, base::Nanos now) {
  const std::lock_guard lock(mutex_);
  Account& account = accounts_.at(client);
  account.bytes -= bytes;
  --account.parcels;
  account.appliedAt = now;
  const bool relieved = account.full && account.bytes <= kRelief_bytes;
  if (relieved) account.full = false;
  return relieved;
}

void SceneQueue::published(std::optional<base::Nanos> oldestEdit) {
  const std::lock_guard lock(mutex_);
  std::erase_if(accounts_, [&](const auto& entry) {
    const Account& account = entry.second;
    return account.parcels == 0 && (!oldestEdit || account.appliedAt < *oldestEdit);
  });
}

bool SceneQueue::empty() const {
  const std::lock_guard lock(mutex_);
  return parcels_.empty();
}

}  // namespace hapticd::server
