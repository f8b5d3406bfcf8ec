// The commands that make a part of a scene what it is.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "base/time.h"
#include "scene/commands.h"
#include "scene/notice.h"

namespace hapticd::scene {

using base::Nanos;

/// A command and the client on whose behalf it is executed.
struct ClientCommand {
  ClientId client = 0;
  SceneCommand command;
  Nanos at = 0;  ///< when it is executed
};

/// Of each type and index the last command that was accepted. Each command replaces what an earlier one of
/// the same type and index set, so that these in their order give the same state as all.
class LastCommands {
 public:
  template <class C>
  void keep(const C& command, ClientId client = 0, std::int64_t index = 0) {
    entries_[{typeOf<C>(), index}] = {++number_, {client, command}};
  }
  template <class C>
  void drop(std::int64_t index = 0) {
    entries_.erase({typeOf<C>(), index});
  }
  void clear() { entries_.clear(); }

  /// Null: there is none.
  template <class C>
  const C* find(std::int64_t index = 0) const {
    const auto entry = entries_.find({typeOf<C>(), index});
    return entry != entries_.end() ? std::get_if<C>(&entry->second.second.command) : nullptr;
  }
  /// Appends all, in the order in which they were kept.
  void appendTo(std::vector<ClientCommand>& out) const {
    std::vector<const Numbered*> ordered;
    for (const auto& entry : entries_) ordered.push_back(&entry.second);
    std::sort(ordered.begin(), ordered.end(),
              [](const Numbered* a, const Numbered* b) { return a->first < b->first; });
    for (const Numbered* entry : ordered) out.push_back(entry->second);
  }

 private:
  using Numbered = std::pair<std::uint64_t, ClientCommand>;

  template <class C>
  static std::size_t typeOf() {
    static const std::size_t index = SceneCommand(C{}).index();
    return index;
  }

  std::map<std::pair<std::size_t, std::int64_t>, Numbered> entries_;
  std::uint64_t number_ = 0;
};

}  // namespace hapticd::scene
