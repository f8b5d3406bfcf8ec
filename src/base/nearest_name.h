#pragma once

#include <optional>
#include <span>
#include <string>

namespace hapticd::base {

/// The name that a person who typed `typed` most probably meant: the one with the fewest letters to change,
/// add or leave out. Nothing where even that one differs in more than three.
std::optional<std::string> nearestName(const std::string& typed, std::span<const std::string> names);

}  // namespace hapticd::base
