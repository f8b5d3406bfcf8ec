#include "net/send_queue.h"

#include <algorithm>
#include <utility>

namespace hapticd::net {

void SendQueue::push(std::shared_ptr<const Buffer> buffer, Delivery delivery, bool replace) {
  if (!buffer || buffer->empty()) {
    return;
  }
  const std::size_t size = buffer->size();
  if (delivery == Delivery::lowLatency) {
    if (replace || bytes_ > lowMarkBytes_) {
      dropWaitingLowLatency();
    }
    if (bytes_ > lowMarkBytes_) {
      countDrop(size);
      return;
    }
    lowLatencyBytes_ += size;
  }
  bytes_ += size;
  items_.push_back({std::move(buffer), delivery});
}

// Amortised: after a scan that freed n bytes, the next one runs only when n more have been queued.
void SendQueue::dropWaitingLowLatency() {
  const bool headStarted = headSent_ > 0;
  const std::size_t unsentOfHead = headStarted && items_[head_].delivery == Delivery::lowLatency
                                       ? items_[head_].buffer->size() - headSent_
                                       : 0;
  if (lowLatencyBytes_ == unsentOfHead) {
    return;
  }
  const auto first = items_.begin() + static_cast<std::ptrdiff_t>(head_ + (headStarted ? 1 : 0));
  const auto kept = std::remove_if(first, items_.end(), [this](const Item& item) {
    if (item.delivery == Delivery::reliable) {
      return false;
    }
    bytes_ -= item.buffer->size();
    lowLatencyBytes_ -= item.buffer->size();
    countDrop(item.buffer->size());
    return true;
  });
  items_.erase(kept, items_.end());
}

void SendQueue::countDrop(std::size_t bytes) {
  ++droppedBuffers_;
  droppedBytes_ += bytes;
}

std::size_t SendQueue::gather(std::span<std::span<const std::byte>> parts) const {
  const std::size_t count = std::min(parts.size(), items_.size() - head_);
  for (std::size_t i = 0; i < count; ++i) {
    parts[i] = *items_[head_ + i].buffer;
  }
  if (count > 0) {
    parts[0] = parts[0].subspan(headSent_);
  }
  return count;
}

void SendQueue::consume(std::size_t bytes) {
  bytes_ -= bytes;
  while (bytes > 0) {
    Item& item = items_[head_];
    const std::size_t part = std::min(bytes, item.buffer->size() - headSent_);
    if (item.delivery == Delivery::lowLatency) {
      lowLatencyBytes_ -= part;
    }
    bytes -= part;
    headSent_ += part;
    if (headSent_ == item.buffer->size()) {
      item.buffer.reset();
      headSent_ = 0;
      ++head_;
    }
  }
  if (head_ > items_.size() / 2) {
    items_.erase(items_.begin(), items_.begin() + static_cast<std::ptrdiff_t>(head_));
    head_ = 0;
  }
}

void SendQueue::clear() {
  items_.clear();
  head_ = headSent_ = bytes_ = lowLatencyBytes_ = 0;
}

}  // namespace hapticd::net
