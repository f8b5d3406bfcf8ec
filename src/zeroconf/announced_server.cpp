#include "zeroconf/announced_server.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <string_view>

#include "base/printable.h"

namespace hapticd::zeroconf {
namespace {

constexpr std::size_t kLongestEntry = 255;  // RFC 6763, 6.1

std::string replaced(std::string text, std::string_view what, std::string_view with) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size())
    text.replace(at, what.size(), with);
  return text;
}

// A device's name may contain what separates the names.
std::string escaped(const std::string& name) {
  return replaced(replaced(name, "%", "%25"), ",", "%2C");
}
std::string unescaped(std::string_view part) {
  return replaced(replaced(std::string(part), "%2C", ","), "%25", "%");
}

std::vector<std::string> splitAtCommas(std::string_view list) {
  std::vector<std::string> parts;
  while (!list.empty()) {
    const std::size_t comma = std::min(list.find(','), list.size());
    if (comma > 0) parts.push_back(unescaped(list.substr(0, comma)));
    list.remove_prefix(std::min(comma + 1, list.size()));
  }
  return parts;
}

}  // namespace

std::vector<std::string> AnnouncedServer::text() const {
  std::string names = "devices=";
  for (const std::string& device : devices) {
    const std::string next = (names.back() == '=' ? "" : ",") + escaped(device);
    if (names.size() + next.size() <= kLongestEntry) names += next;
  }
  std::vector<std::string> entries{"txtvers=1", names, "version=" + version};
  if (pagePort != 0) entries.push_back("page=" + std::to_string(pagePort));
  if (tls) entries.emplace_back("tls=1");
  return entries;
}

void AnnouncedServer::read(const std::vector<std::string>& text) {
  for (const std::string& entry : text) {
    const std::size_t equals = entry.find('=');
    if (equals == std::string::npos) continue;
    const std::string_view key = std::string_view(entry).substr(0, equals);
    const std::string value = base::printable(entry.substr(equals + 1));
    if (key == "devices") devices = splitAtCommas(value);
    if (key == "version") version = value;
    if (key == "tls") tls = value == "1";
    if (key == "page") std::from_chars(value.data(), value.data() + value.size(), pagePort);
  }
}

std::string AnnouncedServer::client(const std::string& device) const {
  return device + '@' + address + ':' + std::to_string(port);
}

std::string AnnouncedServer::page() const {
  if (pagePort == 0) return "";
  return (tls ? "https://" : "http://") + address + ':' + std::to_string(pagePort) + '/';
}

}  // namespace hapticd::zeroconf
