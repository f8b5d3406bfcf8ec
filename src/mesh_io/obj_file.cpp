#include "mesh_io/obj_file.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace hapticd::mesh_io {
namespace {

// Lines that end in a line feed, a carriage return, or both. A line of numbers goes on in the next one behind
// a backslash; of names, which may end in one, none does.
class Lines {
 public:
  explicit Lines(std::string_view bytes) : rest_(bytes) {}

  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    line = one();
    std::string_view begin = line;
    const std::string_view keyword = word(begin);
    if (!line.ends_with('\\') || (keyword != "v" && keyword != "f")) return true;
    joined_.clear();
    for (; line.ends_with('\\'); line = one()) joined_.append(line.substr(0, line.size() - 1)).append(1, ' ');
    line = joined_.append(line);
    return true;
  }
  /// For error texts: the last line that was read.
  std::string where() const { return "line " + std::to_string(number_) + ": "; }
  std::size_t number() const { return number_; }

 private:
  // Without its comment, which begins at a word and has no end but that of the line.
  std::string_view one() {
    const auto end = std::find_if(rest_.begin(), rest_.end(), [](char c) { return c == '\n' || c == '\r'; });
    std::string_view line = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(line.size());
    rest_.remove_prefix(rest_.starts_with("\r\n") ? 2 : std::min<std::size_t>(rest_.size(), 1));
    ++number_;
    for (std::size_t at = line.find('#'); at != std::string_view::npos; at = line.find('#', at + 1)) {
      if (at == 0 || line[at - 1] == ' ' || line[at - 1] == '\t') return line.substr(0, at);
    }
    return line;
  }

  std::string_view rest_;
  std::string joined_;
  std::size_t number_ = 0;
};

class ObjReader {
 public:
  explicit ObjReader(std::string_view bytes) : lines_(bytes) {}

  PolygonMesh read() {
    for (std::string_view line; lines_.next(line);) {
      const std::string_view keyword = word(line);
      if (keyword == "v") readVertex(line);
      if (keyword == "f") readFace(line);
    }
    if (last_ >= mesh_.vertices.size() && !mesh_.corners.empty())
      refuseCorner("line " + std::to_string(lineOfLast_) + ": ", last_ + 1);
    return std::move(mesh_);
  }

 private:
  void readVertex(std::string_view line) {
    geometry::Vec3f position;
    for (int axis = 0; axis < 3; ++axis) {
      std::string text(word(line));
      if (text.empty())
        refuse(lines_.where() + "a vertex has " + std::to_string(axis) + " coordinates, expected 3");
      std::replace(text.begin(), text.end(), ',', '.');  // as some languages write numbers
      const std::optional<double> number = numberFrom(text);
      if (!number) refuse(lines_.where() + inQuotes(text) + " is no number");
      position[axis] = static_cast<float>(*number);
    }
    mesh_.vertices.push_back(position);
    requireRoom(mesh_.vertices.size());
  }

  // A face of fewer than three corners has no area.
  void readFace(std::string_view line) {
    const std::size_t begin = mesh_.corners.size();
    for (std::string_view text = word(line); !text.empty(); text = word(line))
      mesh_.corners.push_back(cornerOf(text.substr(0, text.find('/'))));
    const std::size_t size = mesh_.corners.size() - begin;
    if (size < 3) return mesh_.corners.resize(begin);
    mesh_.sizes.push_back(static_cast<std::uint32_t>(size));
    requireRoom(mesh_.sizes.size());
  }

  // From 1 on, also of vertices that follow; or from the last one back.
  std::uint32_t cornerOf(std::string_view text) {
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size())
      refuse(lines_.where() + inQuotes(text) + " is no number of a vertex");
    const auto present = static_cast<std::int64_t>(mesh_.vertices.size());
    const std::int64_t index = number < 0 ? present + number : number - 1;
    if (index < 0 || index > 0xFFFFFFFE) refuseCorner(lines_.where(), number);
    if (mesh_.corners.empty() || index > last_) {
      last_ = static_cast<std::uint32_t>(index);
      lineOfLast_ = lines_.number();
    }
    return static_cast<std::uint32_t>(index);
  }

  [[noreturn]] void refuseCorner(const std::string& where, std::int64_t number) const {
    refuse(where + "a face has the corner " + std::to_string(number) + ", but there are " +
           std::to_string(mesh_.vertices.size()) + " vertices");
  }

  Lines lines_;
  PolygonMesh mesh_;
  std::uint32_t last_ = 0;  // of the vertices that faces name
  std::size_t lineOfLast_ = 0;
};

}  // namespace

PolygonMesh parseObj(std::string_view bytes) {
  return ObjReader(bytes).read();
}

}  // namespace hapticd::mesh_io
