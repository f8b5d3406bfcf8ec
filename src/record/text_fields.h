// Values as text by their lists of fields: columns of CSV, and objects of JSON with their schema. JSON that
// is not written per tick uses nlohmann::json instead.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

#include "base/printable.h"
#include "hapticd/trips.h"
#include "record/archive.h"

namespace hapticd::record {

/// The shortest text that reads back as the same number.
template <Scalar T>
void appendNumber(std::string& out, T value) {
  char text[40];
  out.append(text, std::to_chars(text, text + sizeof text, value).ptr);
}

/// A time that JSON has as a text: its readers hold whole numbers up to 2^53, and nanoseconds since 1970 are
/// more.
struct ExactNanos {
  std::int64_t value = 0;
};

/// Appends text of UTF-8 in quotes, for JSON.
inline void appendQuoted(std::string& out, std::string_view text) {
  out += '"';
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += {'\\', c};
    } else if (byte < 0x20) {
      constexpr char kDigits[] = "0123456789abcdef";
      out += "\\u00";
      out += {kDigits[byte >> 4U], kDigits[byte & 15U]};
    } else {
      out += c;
    }
  }
  out += '"';
}

/// One row of CSV: vectors take a column per coordinate, trips are names joined by "+", and absent values
/// leave their columns empty. Text is made UTF-8. The one writer of CSV.
class CsvRow {
 public:
  explicit CsvRow(std::string& out) : out_(out) {}

  template <class T>
  void operator()(const char*, const T& value) {
    put(value);
  }

 private:
  template <Scalar T>
  void put(T value) {
    separate();
    appendNumber(out_, value);
  }
  void put(bool value) { put(std::uint8_t{value}); }
  void put(Trips trips) { put(namesOf(trips)); }
  void put(ExactNanos time) { put(time.value); }
  void put(const std::string& bytes) {
    separate();
    const std::string text = base::utf8(bytes);
    if (text.find_first_of(",\"\r\n") == std::string::npos) {
      out_ += text;
      return;
    }
    out_ += '"';
    for (const char c : text) out_.append(c == '"' ? 2 : 1, c);
    out_ += '"';
  }
  template <class S, int R>
  void put(const Eigen::Matrix<S, R, 1>& v) {
    for (int i = 0; i < R; ++i) put(v[i]);
  }
  void put(const geometry::Quat& q) { put(q.coeffs()); }
  template <class T>
  void put(const std::optional<T>& value) {
    if (value) return put(*value);
    for (int i = 0; i < columns(static_cast<const T*>(nullptr)); ++i) separate();
  }
  static constexpr int columns(const void*) { return 1; }
  static constexpr int columns(const geometry::Quat*) { return 4; }
  template <class S, int R>
  static constexpr int columns(const Eigen::Matrix<S, R, 1>*) {
    return R;
  }
  void separate() {
    if (!std::exchange(first_, false)) out_ += ',';
  }

  std::string& out_;
  bool first_ = true;
};

/// The names of those columns: the x coordinate of position_m is position_x_m.
class CsvHeader {
 public:
  explicit CsvHeader(std::string& out) : out_(out) {}

  template <class T>
  void operator()(const char* name, const T& value) {
    put(name, value);
  }

 private:
  template <class T>
  void put(const std::string& name, const T&) {
    add(name);
  }
  template <class S>
  void put(const std::string& name, const std::optional<Eigen::Matrix<S, 3, 1>>&) {
    put(name, Eigen::Matrix<S, 3, 1>::Zero().eval());
  }
  template <class S>
  void put(const std::string& name, const Eigen::Matrix<S, 3, 1>&) {
    const std::size_t unit = name.find("_m");  // _m, _m_per_s
    const std::size_t at = unit != std::string::npos ? unit : std::min(name.find("_N"), name.size());
    for (const char* axis : {"_x", "_y", "_z"}) add(name.substr(0, at) + axis + name.substr(at));
  }
  void put(const std::string&, const geometry::Quat&) {
    for (const char* part : {"qx", "qy", "qz", "qw"}) add(part);
  }
  void add(const std::string& name) { out_ += (out_.empty() ? "" : ",") + name; }

  std::string& out_;
};

/// An object of JSON. Numbers that are not finite are null, trips are their bit field, a list of more than 64
/// items is its length, and absent values are left out.
class JsonObject {
 public:
  explicit JsonObject(std::string& out) : out_(out) { out_ += '{'; }
  ~JsonObject() { out_ += '}'; }
  JsonObject(const JsonObject&) = delete;
  JsonObject& operator=(const JsonObject&) = delete;

  template <class T>
  void operator()(const char* name, const T& value) {
    key(name);
    put(value);
  }
  template <class T>
  void operator()(const char* name, const std::optional<T>& value) {
    if (value) (*this)(name, *value);
  }
  /// The value must follow.
  void key(const char* name) {
    if (!std::exchange(first_, false)) out_ += ',';
    appendQuoted(out_, name);
    out_ += ':';
  }

 private:
  static constexpr std::size_t kLongestList = 64;

  template <Scalar T>
  void put(T value) {
    if (std::isfinite(static_cast<double>(value))) {
      appendNumber(out_, value);
    } else {
      out_ += "null";
    }
  }
  void put(bool value) { out_ += value ? "true" : "false"; }
  void put(Trips trips) { put(trips.bits()); }
  void put(ExactNanos time) {
    out_ += '"';
    appendNumber(out_, time.value);
    out_ += '"';
  }
  void put(const std::string& text) { appendQuoted(out_, base::utf8(text)); }
  template <IsEnum T>
  void put(T value) {
    appendNumber(out_, static_cast<int>(value));
  }
  template <class List>
  void putList(const List& list, std::size_t size) {
    out_ += '[';
    for (std::size_t i = 0; i < size; ++i) {
      if (i > 0) out_ += ',';
      put(list[static_cast<typename List::size_type>(i)]);
    }
    out_ += ']';
  }
  template <class T>
  void put(const std::vector<T>& list) {
    if (list.size() <= kLongestList) return putList(list, list.size());
    appendNumber(out_, list.size());
  }
  template <class T, std::size_t N>
  void put(const std::array<T, N>& list) {
    putList(list, N);
  }
  template <class S, int R>
  void put(const Eigen::Matrix<S, R, 1>& v) {
    std::array<S, R> list;
    std::copy_n(v.data(), R, list.begin());
    putList(list, R);
  }
  void put(const geometry::Quat& q) { put(q.coeffs()); }

  std::string& out_;
  bool first_ = true;
};

/// The properties of the JSON schema of such an object.
class JsonSchema {
 public:
  explicit JsonSchema(std::string& out) : out_(out) {}

  template <class T>
  void operator()(const char* name, const T&) {
    if (!out_.empty()) out_ += ',';
    appendQuoted(out_, name);
    out_ += R"(:{"type":")";
    out_ += typeOf<T>();
    out_ += typeOf<T>() == std::string_view("array") ? R"(","items":{"type":"number"}})" : R"("})";
  }

 private:
  template <class T>
  struct Plain {
    using Type = T;
  };
  template <class T>
  struct Plain<std::optional<T>> {
    using Type = T;
  };

  template <class Field>
  static constexpr const char* typeOf() {
    using T = typename Plain<Field>::Type;
    if constexpr (std::same_as<T, bool>)
      return "boolean";
    else if constexpr (std::same_as<T, std::string> || std::same_as<T, ExactNanos>)
      return "string";
    else if constexpr (std::integral<T> || std::same_as<T, Trips>)
      return "integer";
    else if constexpr (std::floating_point<T>)
      return "number";
    else
      return "array";
  }

  std::string& out_;
};

/// The header of the CSV of a type, with the end of the line.
template <class T>
std::string csvHeader() {
  std::string text;
  const T any{};
  fields(any, CsvHeader(text));
  return text + '\n';
}

/// Appends one row with the end of the line.
template <class T>
void appendCsvRow(std::string& out, const T& value) {
  fields(value, CsvRow(out));
  out += '\n';
}

}  // namespace hapticd::record
