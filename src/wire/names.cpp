#include "wire/names.h"

#include <algorithm>
#include <stdexcept>

#include "wire/text.h"

namespace hapticd::wire {

namespace {

std::optional<std::int32_t> find(const std::vector<std::string>& names, std::string_view name) noexcept {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<std::int32_t>(found - names.begin());
}

std::int32_t add(std::vector<std::string>& names, std::string_view name) {
  if (const auto known = find(names, name)) return *known;
  if (name.empty() || name.size() > kMaxNameBytes || name.find('\0') != std::string_view::npos) {
    throw std::invalid_argument("name " + inQuotes(name) + " is not 1 to " + std::to_string(kMaxNameBytes) +
                                " characters without NUL");
  }
  if (names.size() >= static_cast<std::size_t>(kMaxNames)) {
    throw std::length_error("name " + inQuotes(name) + " is one more than " + std::to_string(kMaxNames));
  }
  names.emplace_back(name);
  return static_cast<std::int32_t>(names.size() - 1);
}

}  // namespace

LocalNames::LocalNames() {
  for (const MessageInfo& message : kMessageInfos) types_.emplace_back(message.name);
}

LocalSender LocalNames::addSender(std::string_view name) {
  return {add(senders_, name)};
}

LocalType LocalNames::addType(std::string_view name) {
  return {add(types_, name)};
}

std::optional<LocalSender> LocalNames::findSender(std::string_view name) const noexcept {
  const auto found = find(senders_, name);
  return found ? std::optional(LocalSender{*found}) : std::nullopt;
}

std::optional<LocalType> LocalNames::findType(std::string_view name) const noexcept {
  const auto found = find(types_, name);
  return found ? std::optional(LocalType{*found}) : std::nullopt;
}

}  // namespace hapticd::wire
