// The outcome of a run for people (tables), for programs (JSON, CSV) and for the documentation (Markdown,
// SVG).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/benchmark.h"

namespace hapticd::bench {

struct Measured {
  const Benchmark* benchmark = nullptr;
  Outcome outcome;
  double took_s = 0;
};

/// What the figures depend on, one line each: processor, system, scheduling, length.
std::vector<std::string> describeMachine(Length length);

/// A table for a terminal.
std::string asText(const Measured& measured);
std::string asMarkdown(const std::vector<Measured>& all, const std::vector<std::string>& machine);
/// Throw std::runtime_error when a file cannot be written.
void writeJson(const std::filesystem::path& file, const std::vector<Measured>& all,
               const std::vector<std::string>& machine);
void writeCsv(const std::filesystem::path& file, const std::vector<Measured>& all);
/// Into `directory`/figures, which is there, as asMarkdown() links them.
void writeFigures(const std::filesystem::path& directory, const std::vector<Measured>& all);
void writeFile(const std::filesystem::path& file, const std::string& text);

/// A histogram as a drawing, the share of samples (logarithmic) over the value.
std::string asSvg(const Figure& figure);

}  // namespace hapticd::bench
