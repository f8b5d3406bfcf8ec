// Commands of an open batch.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "base/page_allocator.h"
#include "scene/commands.h"

namespace hapticd::scene {

/// A list that grows without a copy and gives its memory back to the system. One thread.
class HeldCommands {
 public:
  void push(SceneCommand&& command) {
    if (chunks_.empty() || chunks_.back().size() == kChunk) {
      Chunk chunk;
      chunk.reserve(kChunk);
      chunks_.push_back(std::move(chunk));
    }
    chunks_.back().push_back(std::move(command));
  }
  void clear() { chunks_ = {}; }
  /// Calls `visit` with each command, in their order.
  template <class Visit>
  void forEach(const Visit& visit) {
    for (Chunk& chunk : chunks_) {
      for (SceneCommand& command : chunk) visit(command);
    }
  }
  template <class Visit>
  void forEach(const Visit& visit) const {
    for (const Chunk& chunk : chunks_) {
      for (const SceneCommand& command : chunk) visit(command);
    }
  }

 private:
  static constexpr std::size_t kChunk = (std::size_t{256} << 10) / sizeof(SceneCommand);

  using Chunk = std::vector<SceneCommand, base::PageAllocator<SceneCommand>>;
  std::vector<Chunk> chunks_;
};

}  // namespace hapticd::scene
