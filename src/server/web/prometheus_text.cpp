#include "server/web/prometheus_text.h"

#include <array>
#include <charconv>
#include <cmath>

#include "base/printable.h"
#include "base/time.h"

namespace hapticd::server {
namespace {

using base::Histogram;

std::string textOf(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "+Inf" : "-Inf";
  std::array<char, 32> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  return {digits.data(), end};
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\n') {
      out += "\\n";
    } else if (c == '\\' || c == '"') {
      (out += '\\') += c;
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace

void PrometheusText::family(std::string_view name, std::string_view type, std::string_view help) {
  name_ = name;
  ((text_ += "# HELP ") += name_) += ' ';
  (text_ += help) += '\n';
  ((text_ += "# TYPE ") += name_) += ' ';
  (text_ += type) += '\n';
}

void PrometheusText::line(std::string_view ending, double value, Labels labels) {
  (text_ += name_) += ending;
  char before = '{';
  for (const auto& [name, label] : labels) {
    ((((text_ += before) += name) += "=\"") += escaped(base::utf8(label))) += '"';
    before = ',';
  }
  if (before == ',') text_ += '}';
  ((text_ += ' ') += textOf(value)) += '\n';
}

void PrometheusText::sample(double value, Labels labels) {
  line("", value, labels);
}

void PrometheusText::histogram(const Histogram::Copy& histogram, std::string_view device) {
  constexpr base::Nanos kFirst = 1 << 10;
  constexpr base::Nanos kLast = 1 << 29;
  const int last = Histogram::bucketOf(kLast);
  std::uint64_t count = 0;
  int bucket = 0;
  for (base::Nanos bound = kFirst; bound <= kLast; bound *= 2) {
    for (; bucket < Histogram::bucketOf(bound) && bucket <= last; ++bucket) {
      count += histogram.counts[static_cast<std::size_t>(bucket)];
    }
    // Whole nanoseconds below the bound: no value lies between this and the bound.
    const double upTo_s = static_cast<double>(bound - 1) / 1e9;
    line("_bucket", static_cast<double>(count), {{"device", device}, {"le", textOf(upTo_s)}});
  }
  line("_bucket", static_cast<double>(histogram.total), {{"device", device}, {"le", "+Inf"}});
  line("_sum", static_cast<double>(histogram.sum_ns) * 1e-9, {{"device", device}});
  line("_count", static_cast<double>(histogram.total), {{"device", device}});
}

}  // namespace hapticd::server
