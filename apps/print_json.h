// One line of JSON for programs that read the output of a command.
#pragma once

#include <cstdio>
#include <nlohmann/json.hpp>

namespace hapticd::apps {

inline constexpr const char* kJsonText = "Print one line of JSON instead of text";

inline void printJson(const nlohmann::json& value) {
  std::printf("%s\n", value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

}  // namespace hapticd::apps
