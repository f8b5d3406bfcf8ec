// The subcommands of hapticd, one file each.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>

namespace hapticd::apps {

/// Exit status of the process, set by the subcommand's callback.
inline int exitCode = 0;

/// Exit status of a command that read a recording as far as it goes, with this remark of its reader.
inline int statusFor(const std::string& remark) {
  constexpr int kNotWhole = 3;  // 1: there is no result
  return remark.empty() ? 0 : kNotWhole;
}

/// Accepts a number from `least` to `most`. CLI11's own ranges accept NaN.
inline CLI::Validator within(double least, double most) {
  std::ostringstream range;
  range << least << " to " << most;
  return CLI::Validator(
      [least, most, range = range.str()](std::string& text) {
        double value = std::nan("");
        const bool hexadecimal = text.find_first_of("xX") != std::string::npos;
        if (!hexadecimal && CLI::detail::lexical_cast(text, value) && value >= least && value <= most)
          return std::string();
        return "must be a number from " + range + ", got '" + text + "'";
      },
      range.str());
}
/// Accepts an integer from `least`, at least 0, to `most` in decimal digits. CLI11 takes 0x10 for 16 and 010
/// for 8.
inline CLI::Validator withinIntegers(int least, int most) {
  const std::string range = std::to_string(least) + " to " + std::to_string(most);
  return CLI::Validator(
      [least, most, range](std::string& text) {
        int value = -1;
        const char* const end = text.data() + text.size();
        const auto [rest, error] = std::from_chars(text.data(), end, value);
        const bool zeros = text.size() > 1 && text[0] == '0';
        if (error == std::errc() && rest == end && !zeros && value >= least && value <= most)
          return std::string();
        return "must be an integer from " + range + " without leading zeros, got '" + text + "'";
      },
      range);
}
/// Refuses a text without characters, which would otherwise mean what a missing option means.
inline CLI::Validator notEmpty() {
  return CLI::Validator([](std::string& text) { return text.empty() ? "is empty" : ""; }, "");
}
/// Accepts a file to read, also a pipe or device. CLI11's own check calls one missing that lies in a folder
/// which may not be entered.
inline CLI::Validator existingFile() {
  return CLI::Validator(
      [](const std::string& file) -> std::string {
        std::error_code error;
        const auto status = std::filesystem::status(file, error);
        if (std::filesystem::is_directory(status)) return "'" + file + "' is a folder, not a file";
        if (std::filesystem::exists(status)) return {};
        if (status.type() == std::filesystem::file_type::not_found) return "there is no file '" + file + "'";
        return "cannot read '" + file + "': " + error.message();
      },
      "FILE");
}
/// Throws std::runtime_error when the file exists and `force` is not given, or is `input`, which is still to
/// be read. Pipes and devices may be written. Of "-" one would expect standard output, which has other text.
inline void keepFile(const std::string& file, bool force, const std::string& input = {}) {
  if (file == "-")
    throw std::runtime_error("'-' would be a file of that name: name another, or this one by ./-");
  std::error_code none;
  if (!file.empty() && !input.empty() && std::filesystem::equivalent(file, input, none))
    throw std::runtime_error("'" + file + "' is the file to read: choose another name for what is written");
  if (force || file.empty() || !std::filesystem::is_regular_file(file, none)) return;
  throw std::runtime_error("'" + file + "' exists: choose another name, or overwrite it by --force");
}
inline constexpr const char* kNotWritten =
    "cannot write to standard output: the disk is full, or its reader has gone";
inline constexpr const char* kForceText = "Overwrite an existing file";

/// Largest duration that an option accepts, in seconds: 30 years.
inline constexpr double kLongest_s = 1e9;

void addServe(CLI::App& app);
void addDemo(CLI::App& app);
void addTouch(CLI::App& app);
void addStop(CLI::App& app);
void addTunnel(CLI::App& app);
void addWatch(CLI::App& app);
void addDeviceHost(CLI::App& app);
void addExport(CLI::App& app);
void addInfo(CLI::App& app);
void addList(CLI::App& app);
void addMark(CLI::App& app);
void addPlot(CLI::App& app);
void addRecord(CLI::App& app);
void addRender(CLI::App& app);
void addReplay(CLI::App& app);
void addDoctor(CLI::App& app);
void addDevices(CLI::App& app);
void addBench(CLI::App& app);
void addSelfTest(CLI::App& app);
void addManual(CLI::App& app);

}  // namespace hapticd::apps
