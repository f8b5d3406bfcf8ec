#include "server/scene/scene_queue.h"

#include <algorithm>

namespace hapticd::server {

void SceneQueue::push(SceneParcel&& parcel) {
  const std::lock_guard lock(mutex_);
  Account& account = charge(parcel);
  if (account.queued.empty()) turns_.push_back(parcel.client);
  if (parcel.beforeOthers) before_.push_back(parcel.client);
  account.queued.push_back(std::move(parcel));
}

void SceneQueue::pushFront(SceneParcel&& parcel) {
  const std::lock_guard lock(mutex_);
  charge(parcel);
  urgent_.push_back(std::move(parcel));
}

SceneQueue::Account& SceneQueue::charge(const SceneParcel& parcel) {
  Account& account = accounts_[parcel.client];
  account.bytes += parcel.bytes;
  ++account.parcels;
  account.full = account.full || account.bytes > kClientLimit_bytes;
  return account;
}

bool SceneQueue::full(scene::ClientId client) const {
  const std::lock_guard lock(mutex_);
  const auto account = accounts_.find(client);
  return account != accounts_.end() && account->second.full;
}

std::map<scene::ClientId, std::size_t> SceneQueue::waiting() const {
  std::map<scene::ClientId, std::size_t> bytes;
  const std::lock_guard lock(mutex_);
  for (const auto& [client, account] : accounts_) {
    if (account.bytes > 0) bytes.emplace(client, account.bytes);
  }
  return bytes;
}

bool SceneQueue::pending(scene::ClientId client) const {
  const std::lock_guard lock(mutex_);
  return accounts_.count(client) != 0;
}

std::optional<SceneParcel> SceneQueue::take() {
  const std::lock_guard lock(mutex_);
  const auto first = [](std::deque<SceneParcel>& parcels) {
    std::optional<SceneParcel> oldest(std::move(parcels.front()));
    parcels.pop_front();
    return oldest;
  };
  if (!urgent_.empty()) return first(urgent_);
  const auto turn =
      std::find_if(turns_.begin(), turns_.end(), [this](scene::ClientId client) { return !waits(client); });
  if (turn == turns_.end()) return std::nullopt;
  const scene::ClientId client = *turn;
  turns_.erase(turn);
  std::deque<SceneParcel>& queued = accounts_.at(client).queued;
  std::optional<SceneParcel> oldest = first(queued);
  if (!queued.empty()) turns_.push_back(client);
  if (oldest->beforeOthers) before_.pop_front();
  return oldest;
}

bool SceneQueue::waits(scene::ClientId client) const {
  return client != 0 && !before_.empty() && before_.front() != client;
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
  return urgent_.empty() && turns_.empty();
}

}  // namespace hapticd::server
