#include "live_table.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace hapticd::apps {
namespace {

struct TerminalSize {
  std::size_t columns = 80;
  std::size_t rows = 24;
};

TerminalSize terminalSize() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {size.ws_col, size.ws_row};
}

// The first `columns` characters of UTF-8 text.
std::string cutTo(const std::string& text, std::size_t columns) {
  std::size_t characters = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins = (static_cast<unsigned char>(text[i]) & 0xc0U) != 0x80U;
    if (begins && characters++ == columns) return text.substr(0, i);
  }
  return text;
}

}  // namespace

bool onTerminal() {
  const char* term = std::getenv("TERM");
  return isatty(STDOUT_FILENO) == 1 && term && std::string_view(term) != "dumb";
}

std::string bytesText(double bytes) {
  constexpr std::array kUnits{"B", "kB", "MB", "GB", "TB"};
  std::size_t unit = 0;
  for (; bytes >= 1000 && unit + 1 < kUnits.size(); ++unit) bytes /= 1000;
  char text[32];
  std::snprintf(text, sizeof text, unit == 0 ? "%.0f %s" : "%.1f %s", bytes, kUnits[unit]);
  return text;
}

void ProgressBar::show(std::uint64_t done, std::uint64_t total) {
  const int percent = total == 0 ? 100 : static_cast<int>(done * 100 / total);
  if (percent == shownPercent_) return;
  const std::string amount =
      bytesText(static_cast<double>(done)) + " of " + bytesText(static_cast<double>(total));
  if (onTerminal()) {
    // On a narrow terminal the bar is shorter: a line that wraps stays above the next one.
    constexpr std::size_t kWidth = 40;
    char numbers[64];
    std::snprintf(numbers, sizeof numbers, "%3d %% %s", percent, amount.c_str());
    const std::size_t columns = terminalSize().columns - 1;
    const std::size_t others = title_.size() + std::strlen(" [] ") + std::strlen(numbers);
    const std::size_t width = std::min(kWidth, std::max(columns, others) - others);
    std::string bar(static_cast<std::size_t>(percent) * width / 100, '#');
    bar.resize(width, ' ');
    std::printf("\r%s\x1b[K", cutTo(title_ + " [" + bar + "] " + numbers, columns).c_str());
  } else if (shownPercent_ < 0 || percent / 10 > shownPercent_ / 10) {
    std::printf("%s %d %% %s\n", title_.c_str(), percent, amount.c_str());
  }
  std::fflush(stdout);
  shownPercent_ = percent;
}

void ProgressBar::finish() {
  if (onTerminal()) std::printf("\n");
}

void LiveTable::show(const std::vector<std::string>& lines) {
  if (height_ > 0) std::printf("\x1b[%zuA", height_);
  // A wrapped line, or one that scrolls, would count as two in the next redraw.
  const TerminalSize size = terminalSize();
  const std::size_t shown = std::min(lines.size(), size.rows - 1);
  for (std::size_t i = 0; i < shown; ++i)
    std::printf("%s\x1b[K\n", cutTo(lines[i], size.columns - 1).c_str());
  std::printf("\x1b[J");
  std::fflush(stdout);
  height_ = shown;
}

void LiveTable::say(const std::string& line) {
  if (height_ > 0) std::printf("\x1b[%zuA", height_);
  std::printf("\x1b[J%s\n", line.c_str());
  std::fflush(stdout);
  height_ = 0;
}

}  // namespace hapticd::apps
