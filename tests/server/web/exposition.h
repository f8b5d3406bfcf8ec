// A strict reader of the Prometheus text format.
#pragma once

#include <cstdlib>
#include <limits>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace hapticd::test {

class Exposition {
 public:
  explicit Exposition(const std::string& text) {
    if (text.empty() || text.back() != '\n') problem("the last line does not end");
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) read(line);
    for (const auto& [name, type] : types_) {
      if (helps_.count(name) == 0) problem("no HELP for " + name);
      if (type == "counter" && name.find("_total") == std::string::npos)
        problem("a counter whose name does not end in _total: " + name);
    }
  }

  /// Value of one sample, by its name and labels as in the text; NaN when it is missing.
  double value(const std::string& sample) const {
    const auto found = values_.find(sample);
    return found == values_.end() ? std::numeric_limits<double>::quiet_NaN() : found->second;
  }
  const std::vector<std::string>& problems() const { return problems_; }
  /// Names of all samples, with _bucket, _sum and _count.
  const std::set<std::string>& names() const { return names_; }
  const std::map<std::string, std::string>& types() const { return types_; }

 private:
  void problem(const std::string& text) { problems_.push_back(text); }

  void read(const std::string& line) {
    static const std::regex kHelp("# HELP ([a-z_:][a-z0-9_:]*) (.+)");
    static const std::regex kType("# TYPE ([a-z_:][a-z0-9_:]*) (counter|gauge|histogram)");
    static const std::regex kSample(
        R"re((([a-z_:][a-z0-9_:]*)(?:\{[a-z_]+="(?:[^"\\\n]|\\[n"\\])*"(?:,[a-z_]+="(?:[^"\\\n]|\\[n"\\])*")*\})?) (\S+))re");
    std::smatch match;
    if (std::regex_match(line, match, kHelp)) {
      if (!helps_.insert(match[1]).second) problem("two HELP lines: " + line);
    } else if (std::regex_match(line, match, kType)) {
      if (!types_.emplace(match[1], match[2]).second) problem("two TYPE lines: " + line);
      family_ = match[1];
    } else if (std::regex_match(line, match, kSample)) {
      sample(match[1], match[2], match[3]);
    } else {
      problem("malformed line: " + line);
    }
  }

  void sample(const std::string& whole, const std::string& name, const std::string& number) {
    const std::string type = types_.count(family_) ? types_[family_] : "";
    const bool fits = type == "histogram" ? name == family_ + "_bucket" || name == family_ + "_sum" ||
                                                name == family_ + "_count"
                                          : name == family_;
    if (!fits) problem("a sample outside its family: " + whole);
    char* end = nullptr;
    const double value = std::strtod(number.c_str(), &end);
    if (*end != '\0') problem("malformed number: " + whole + ' ' + number);
    if (!values_.emplace(whole, value).second) problem("duplicate sample: " + whole);
    names_.insert(name);
    if (name.ends_with("_bucket")) {
      if (whole.find("le=\"") == std::string::npos) problem("a bucket without bound: " + whole);
      if (number < "0") problem("a negative count: " + whole);
    }
  }

  std::string family_;
  std::set<std::string> helps_;
  std::map<std::string, std::string> types_;
  std::map<std::string, double> values_;
  std::set<std::string> names_;
  std::vector<std::string> problems_;
};

}  // namespace hapticd::test
