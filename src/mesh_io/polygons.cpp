#include "mesh_io/polygons.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <stdexcept>

#include "mesh_io/mesh_reader.h"

namespace hapticd::mesh_io {

void refuse(const std::string& what) {
  throw std::runtime_error(what);
}

std::string inQuotes(std::string_view text) {
  return '\'' + std::string(text.substr(0, 64)) + '\'';
}

std::string_view word(std::string_view& line) {
  constexpr std::string_view kBlank = " \t\r";
  line.remove_prefix(std::min(line.size(), line.find_first_not_of(kBlank)));
  const std::string_view found = line.substr(0, line.find_first_of(kBlank));
  line.remove_prefix(found.size());
  return found;
}

std::optional<double> numberFrom(std::string_view word) {
  if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::invalid_argument || end != word.data() + word.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range) return std::strtod(std::string(word).c_str(), nullptr);
  return value;
}

void requireRoom(std::size_t count) {
  if (count > kLargestMesh)
    refuse("it has more than " + std::to_string(kLargestMesh) + " triangles or vertices: reduce it");
}

}  // namespace hapticd::mesh_io
