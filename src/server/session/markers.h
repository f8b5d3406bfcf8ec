// The markers of clients, on their way to all clients.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/time.h"
#include "net/connection.h"
#include "scene/notice.h"
#include "wire/frame_encoder.h"

namespace hapticd::server {

/// How many markers the server takes in a second, and the frames of those that wait. They are encoded once
/// for all clients that know the device by the same name, and sent in passes over the clients: a marker alone
/// wakes nobody. Net thread.
class Markers {
 public:
  static constexpr int kMostOfOne = 100;
  static constexpr int kMost = 500;

  enum class Answer { taken, tooManyOfClient, tooManyOfAll };

  /// Counts a marker of this client in the present second.
  Answer count(scene::ClientId client) {
    int& ofClient = counts_[client];
    if (ofClient >= kMostOfOne) return Answer::tooManyOfClient;
    if (counted_ >= kMost) return Answer::tooManyOfAll;
    ++ofClient;
    ++counted_;
    return Answer::taken;
  }
  void nextSecond() {
    counts_.clear();
    counted_ = 0;
  }

  /// Keeps a marker for the next pass; false when too many wait already, as in a crafted recording.
  bool add(base::Nanos time, const std::string& text) {
    if (waiting_.size() >= std::size_t{kMost}) return false;
    waiting_.push_back({.time = time, .text = text});
    return true;
  }
  /// The markers that wait are those of the pass that begins.
  void beginPass() {
    passing_ = std::exchange(waiting_, {});
    frames_.clear();
  }
  /// The markers of the pass at hand, under this name; null when there are none.
  std::shared_ptr<const net::Buffer> frames(wire::LocalSender name, wire::Time now) {
    if (passing_.empty()) return nullptr;
    auto& frames = frames_[name];
    if (!frames) {
      wire::FrameEncoder encoder;
      for (const wire::Marker& marker : passing_) encoder.add(now, name, marker);
      net::Buffer bytes;
      encoder.swapOut(bytes);
      frames = std::make_shared<const net::Buffer>(std::move(bytes));
    }
    return frames;
  }
  bool passing() const noexcept { return !passing_.empty(); }

 private:
  std::map<scene::ClientId, int> counts_;
  int counted_ = 0;
  std::vector<wire::Marker> waiting_;
  std::vector<wire::Marker> passing_;
  std::map<wire::LocalSender, std::shared_ptr<const net::Buffer>> frames_;
};

}  // namespace hapticd::server
