// Polygons of a file, and the words of its lines: what our readers of PLY and OBJ share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/types.h"

namespace hapticd::mesh_io {

struct PolygonMesh {
  std::vector<geometry::Vec3f> vertices;
  std::vector<std::uint32_t> corners;  ///< of all faces, one after the other
  std::vector<std::uint32_t> sizes;    ///< corners of each face
};

/// Throws std::runtime_error.
[[noreturn]] void refuse(const std::string& what);

/// The beginning of a text, in quotes.
std::string inQuotes(std::string_view text);

/// The next word of a line, and an empty one at its end.
std::string_view word(std::string_view& line);

/// The number that a whole word is, also with a sign + and without digits on one side of its point; infinite
/// or zero where no double holds it.
std::optional<double> numberFrom(std::string_view word);

/// Throws std::runtime_error for more vertices or faces than a mesh may have.
void requireRoom(std::size_t count);

}  // namespace hapticd::mesh_io
