#include "server/reports/moving_objects.h"

#include <algorithm>

namespace hapticd::server {
namespace {

constexpr base::Nanos kRest = 1'000'000'000;
constexpr std::size_t kMost =
    4096;  // that may move at once; more stay where the scene's description has them

template <class List>
auto placeOf(List& list, std::int32_t id) {
  return std::lower_bound(list.begin(), list.end(), id,
                          [](const auto& known, std::int32_t wanted) { return known.id < wanted; });
}

}  // namespace

// By value, not by pointer: a pointer kept here would keep the old geometry from being used again.
void MovingObjects::published(const scene::SceneSnapshot& snapshot, base::Nanos now) {
  std::vector<Placed> placed;
  placed.reserve(snapshot.objects.size());
  std::vector<Moving> found;
  auto old = before_.begin();
  for (const auto& object : snapshot.objects) {
    const scene::Motion& motion = object->motion;
    placed.push_back({object->id, motion.destination()});
    while (old != before_.end() && old->id < object->id) ++old;
    const bool known = old != before_.end() && old->id == object->id;
    const bool moved = known && old->to.matrix() != motion.destination().matrix();
    if ((moved || motion.movingAfter(now)) && found.size() < kMost) found.push_back({object->id, motion, 0});
  }
  before_ = std::move(placed);
  if (found.empty()) return;
  const std::lock_guard lock(mutex_);
  for (Moving& each : found) {
    const auto at = placeOf(published_, each.id);
    if (at != published_.end() && at->id == each.id) {
      *at = each;
    } else if (published_.size() < kMost) {
      published_.insert(at, each);
    }
  }
}

void MovingObjects::refresh() {
  std::vector<Moving> news;
  {
    const std::lock_guard lock(mutex_);
    news.swap(published_);
  }
  for (Moving& each : news) {
    const auto at = placeOf(moving_, each.id);
    if (at != moving_.end() && at->id == each.id) {
      *at = each;
    } else if (moving_.size() < kMost) {
      moving_.insert(at, each);
    }
  }
}

void MovingObjects::append(base::Nanos time, std::size_t most, std::size_t& next,
                           std::vector<double>& numbers) {
  refresh();
  std::erase_if(moving_, [time](Moving& each) {
    if (each.motion.movingAfter(time)) return false;
    if (each.restedAt == 0) each.restedAt = time;
    return time - each.restedAt > kRest;
  });
  const std::size_t count = std::min(most, moving_.size());
  if (next >= moving_.size()) next = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Moving& each = moving_[next];
    next = (next + 1) % moving_.size();
    const scene::Affine T_world_mesh = each.motion.at(time);
    numbers.push_back(each.id);
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) numbers.push_back(T_world_mesh.matrix()(row, column));
    }
  }
}

}  // namespace hapticd::server
