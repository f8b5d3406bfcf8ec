#include "mesh_io/ply_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string>

namespace hapticd::mesh_io {
namespace {

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

constexpr std::size_t sizeOf(Type type) {
  constexpr std::array<std::size_t, 8> kSizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

struct Property {
  std::string_view name;
  Type type = Type::float32;
  std::optional<Type> count;  // of a list
};

struct Element {
  std::string_view name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

Type typeOf(std::string_view name) {
  constexpr std::array<std::array<std::string_view, 2>, 8> kNames = {{{"char", "int8"},
                                                                      {"uchar", "uint8"},
                                                                      {"short", "int16"},
                                                                      {"ushort", "uint16"},
                                                                      {"int", "int32"},
                                                                      {"uint", "uint32"},
                                                                      {"float", "float32"},
                                                                      {"double", "float64"}}};
  for (std::size_t i = 0; i < kNames.size(); ++i)
    if (name == kNames[i][0] || name == kNames[i][1]) return static_cast<Type>(i);
  refuse("a property has the unknown type " + inQuotes(name));
}

// The rest of the file from some place on.
class Content {
 public:
  explicit Content(std::string_view bytes) : rest_(bytes) {}

  std::string_view line() {
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    std::string_view found = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    if (found.ends_with('\r')) found.remove_suffix(1);
    ++number_;
    return found;
  }
  std::string_view bytes(std::size_t count) {
    if (count > rest_.size()) refuse("it ends early, within the data");
    const std::string_view found = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return found;
  }
  bool empty() const { return rest_.empty(); }
  std::size_t left() const { return rest_.size(); }
  std::size_t lineNumber() const { return number_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

enum class Encoding { text, littleEndian, bigEndian };

struct Header {
  Encoding encoding = Encoding::text;
  std::vector<Element> elements;
};

Property propertyFrom(std::string_view line) {
  Property property;
  std::string_view type = word(line);
  if (type == "list") {
    property.count = typeOf(word(line));
    type = word(line);
  }
  property.type = typeOf(type);
  property.name = word(line);
  return property;
}

Header readHeader(Content& content) {
  if (content.line() != "ply") refuse("it does not begin with 'ply'");
  Header header;
  bool formatted = false;
  for (;;) {
    if (content.empty()) refuse("its header has no end");
    std::string_view line = content.line();
    const std::string_view keyword = word(line);
    if (keyword == "end_header") break;
    if (keyword == "format") {
      const std::string_view name = word(line);
      formatted = true;
      if (name == "binary_little_endian") {
        header.encoding = Encoding::littleEndian;
      } else if (name == "binary_big_endian") {
        header.encoding = Encoding::bigEndian;
      } else if (name != "ascii") {
        refuse("its format " + inQuotes(name) + " is unknown");
      }
    } else if (keyword == "element") {
      Element element{.name = word(line), .count = 0, .properties = {}};
      const std::string_view count = word(line);
      const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (error != std::errc{} || end != count.data() + count.size())
        refuse("the number of elements " + inQuotes(count) + " in line " +
               std::to_string(content.lineNumber()) + " is none");
      header.elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (header.elements.empty()) refuse("a property precedes all elements");
      header.elements.back().properties.push_back(propertyFrom(line));
    } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
      refuse("line " + std::to_string(content.lineNumber()) + " of its header begins with " +
             inQuotes(keyword));
    }
  }
  if (!formatted) refuse("its header names no format");
  return header;
}

// The numbers of one element after the other.
class Rows {
 public:
  Rows(Content content, Encoding encoding) : content_(content), encoding_(encoding) {}

  // In text, a row is a line. Values that no property declares are left out.
  void begin() {
    if (encoding_ != Encoding::text) return;
    for (row_ = {}; row_.find_first_not_of(" \t\r") == std::string_view::npos; row_ = content_.line())
      if (content_.empty()) refuse("it ends early, within the data");
  }

  double number(Type type) {
    if (encoding_ == Encoding::text) return numberOfText();
    std::array<char, 8> raw{};
    const std::string_view bytes = content_.bytes(sizeOf(type));
    std::copy(bytes.begin(), bytes.end(), raw.begin());
    constexpr bool kLittle = std::endian::native == std::endian::little;
    if ((encoding_ == Encoding::littleEndian) != kLittle)
      std::reverse(raw.begin(), raw.begin() + static_cast<std::ptrdiff_t>(bytes.size()));
    switch (type) {
      case Type::int8:
        return as<std::int8_t>(raw);
      case Type::uint8:
        return as<std::uint8_t>(raw);
      case Type::int16:
        return as<std::int16_t>(raw);
      case Type::uint16:
        return as<std::uint16_t>(raw);
      case Type::int32:
        return as<std::int32_t>(raw);
      case Type::uint32:
        return as<std::uint32_t>(raw);
      case Type::float32:
        return as<float>(raw);
      case Type::float64:
        return as<double>(raw);
    }
    return 0;
  }

  // The length of a list, which the file has room for.
  std::size_t length(const Property& list) {
    const double value = number(*list.count);
    const std::size_t least = encoding_ == Encoding::text ? 1 : sizeOf(list.type);
    const std::size_t left = encoding_ == Encoding::text ? row_.size() : content_.left();
    if (!(value >= 0 && value == std::floor(value)))
      refuse(where() + "a list has a length of " + std::to_string(value));
    if (value > static_cast<double>(left / least)) refuse(where() + "a list is longer than the data");
    return static_cast<std::size_t>(value);
  }

  void skip(const Property& property) {
    const std::size_t count = property.count ? length(property) : 1;
    for (std::size_t i = 0; i < count; ++i) number(property.type);
  }

  std::string where() const {
    return encoding_ == Encoding::text ? "line " + std::to_string(content_.lineNumber()) + ": " : "";
  }
  std::size_t left() const { return content_.left(); }

 private:
  template <class T>
  static double as(const std::array<char, 8>& raw) {
    T value;
    std::memcpy(&value, raw.data(), sizeof value);
    return static_cast<double>(value);
  }

  double numberOfText() {
    const std::string_view text = word(row_);
    if (text.empty()) refuse(where() + "values are missing");
    const std::optional<double> value = numberFrom(text);
    if (!value) refuse(where() + inQuotes(text) + " is no number");
    return *value;
  }

  Content content_;
  Encoding encoding_;
  std::string_view row_;
};

void readVertices(const Element& element, Rows& rows, PolygonMesh& mesh) {
  std::array<std::size_t, 3> at{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    constexpr std::array<std::string_view, 3> kNames = {"x", "y", "z"};
    const auto found =
        std::find_if(element.properties.begin(), element.properties.end(),
                     [&](const Property& p) { return p.name == kNames[axis] && !p.count.has_value(); });
    if (found == element.properties.end()) refuse("its vertices have no " + std::string(kNames[axis]));
    at[axis] = static_cast<std::size_t>(found - element.properties.begin());
  }
  requireRoom(element.count);
  mesh.vertices.reserve(std::min(element.count, rows.left()));
  for (std::size_t i = 0; i < element.count; ++i) {
    rows.begin();
    std::array<double, 3> position{};
    for (std::size_t k = 0; k < element.properties.size(); ++k) {
      const auto axis = std::find(at.begin(), at.end(), k);
      if (axis == at.end()) {
        rows.skip(element.properties[k]);
      } else {
        position[static_cast<std::size_t>(axis - at.begin())] = rows.number(element.properties[k].type);
      }
    }
    mesh.vertices.emplace_back(static_cast<float>(position[0]), static_cast<float>(position[1]),
                               static_cast<float>(position[2]));
  }
}

std::uint32_t cornerOf(double value, std::size_t vertices, const Rows& rows) {
  if (!(value >= 0 && value < static_cast<double>(vertices) && value == std::floor(value))) {
    std::ostringstream text;
    text << rows.where() << "a face has the corner " << std::setprecision(15) << value << ", but there are "
         << vertices << " vertices";
    refuse(text.str());
  }
  return static_cast<std::uint32_t>(value);
}

// Each corner makes a triangle with the two before it, of alternating order; -1 begins anew.
void addStrip(const std::vector<double>& strip, std::size_t vertices, const Rows& rows, PolygonMesh& mesh) {
  std::size_t begin = 0;
  std::array<std::uint32_t, 3> last{};
  for (std::size_t i = 0; i < strip.size(); ++i) {
    if (strip[i] == -1) {
      begin = i + 1;
      continue;
    }
    last = {last[1], last[2], cornerOf(strip[i], vertices, rows)};
    if (i < begin + 2 || last[0] == last[1] || last[1] == last[2] || last[0] == last[2]) continue;
    const bool swapped = (i - begin) % 2 == 1;
    mesh.corners.insert(mesh.corners.end(), {last[swapped ? 1 : 0], last[swapped ? 0 : 1], last[2]});
    mesh.sizes.push_back(3);
  }
}

// `strips`: of triangles, instead of the corners of one face each.
void readFaces(const Element& element, bool strips, std::size_t vertices, Rows& rows, PolygonMesh& mesh) {
  const auto list = std::find_if(element.properties.begin(), element.properties.end(), [](const Property& p) {
    return p.count.has_value() && (p.name == "vertex_indices" || p.name == "vertex_index");
  });
  if (list == element.properties.end() && element.count > 0)
    refuse("its element " + inQuotes(element.name) + " has no list vertex_indices");
  std::vector<double> corners;
  for (std::size_t i = 0; i < element.count; ++i) {
    rows.begin();
    for (auto property = element.properties.begin(); property != element.properties.end(); ++property) {
      if (property != list) {
        rows.skip(*property);
        continue;
      }
      corners.resize(rows.length(*property));
      for (double& corner : corners) corner = rows.number(property->type);
      if (strips) {
        addStrip(corners, vertices, rows, mesh);
      } else if (corners.size() >= 3) {
        for (const double corner : corners) mesh.corners.push_back(cornerOf(corner, vertices, rows));
        mesh.sizes.push_back(static_cast<std::uint32_t>(corners.size()));
      }
      requireRoom(mesh.sizes.size());
    }
  }
}

}  // namespace

PolygonMesh parsePly(std::string_view bytes) {
  Content content(bytes);
  const Header header = readHeader(content);
  const auto vertices = std::find_if(header.elements.begin(), header.elements.end(),
                                     [](const Element& element) { return element.name == "vertex"; });
  if (vertices == header.elements.end()) refuse("it has no vertices");
  PolygonMesh mesh;
  Rows rows(content, header.encoding);
  for (const Element& element : header.elements) {
    if (&element == &*vertices) {
      readVertices(element, rows, mesh);
    } else if (element.name == "face" || element.name == "tristrips") {
      readFaces(element, element.name == "tristrips", vertices->count, rows, mesh);
    } else if (!element.properties.empty()) {
      for (std::size_t i = 0; i < element.count; ++i) {
        rows.begin();
        for (const Property& property : element.properties) rows.skip(property);
      }
    }
  }
  return mesh;
}

}  // namespace hapticd::mesh_io
