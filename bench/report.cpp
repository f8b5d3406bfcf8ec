#include "bench/report.h"

#include <sys/utsname.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "realtime/servo/thread_setup.h"

namespace hapticd::bench {
namespace {

// Three figures that matter, whatever the size.
std::string number(double value) {
  std::array<char, 64> text{};
  const double size = value < 0 ? -value : value;
  const char* pattern = size >= 100 ? "%.0f" : size >= 10 ? "%.1f" : size >= 1 ? "%.2f" : "%.3g";
  std::snprintf(text.data(), text.size(), pattern, value);
  return text.data();
}

std::string figures(const Summary& s) {
  if (s.count == 0) return "-";
  if (s.count == 1) return number(s.p50);
  return number(s.p50) + " / " + number(s.p99) + " / " + number(s.p999) + " / " + number(s.max);
}

std::string verdict(const Check& check) {
  const std::string figure = check.what + " " + number(check.value) +
                             (check.atLeast ? " (at least " : " (at most ") + number(check.limit) + ")";
  if (!check.notMeasurable.empty()) return figure + ": not measurable here, " + check.notMeasurable;
  return figure + (check.met() ? ": met" : ": MISSED");
}

std::string ratioOf(const Row& row) {
  return row.yardstick && row.yardstick->count > 0 && row.yardstick->p50 > 0 ? number(row.ratio()) : "-";
}

std::vector<std::array<std::string, 5>> cells(const Outcome& outcome) {
  std::vector<std::array<std::string, 5>> lines;
  for (const Row& row : outcome.rows) {
    lines.push_back(
        {row.what, row.unit, figures(row.ours), row.yardstick ? figures(*row.yardstick) : "-", ratioOf(row)});
  }
  return lines;
}

nlohmann::json jsonOf(const Summary& s) {
  return {{"count", s.count}, {"mean", s.mean}, {"deviation", s.deviation}, {"p50", s.p50}, {"p99", s.p99},
          {"p99.9", s.p999},  {"max", s.max}};
}

nlohmann::json jsonOf(const Row& row) {
  nlohmann::json json{{"what", row.what}, {"unit", row.unit}, {"ours", jsonOf(row.ours)}};
  if (row.yardstick) {
    json["yardstick"] = jsonOf(*row.yardstick);
    if (row.yardstick->p50 > 0) json["ratio"] = row.ratio();
  }
  for (const Check& check : row.checks) {
    nlohmann::json one{
        {"what", check.what}, {"value", check.value}, {"limit", check.limit}, {"at_least", check.atLeast}};
    if (check.notMeasurable.empty()) {
      one["met"] = check.met();
    } else {
      one["not_measurable"] = check.notMeasurable;
    }
    json["checks"].push_back(one);
  }
  if (!row.note.empty()) json["note"] = row.note;
  return json;
}

std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "unknown processor";
}

}  // namespace

double Row::ratio(bool byMean) const noexcept {
  if (!yardstick) return 0;
  const double theirs = byMean ? yardstick->mean : yardstick->p50;
  return theirs > 0 ? (byMean ? ours.mean : ours.p50) / theirs : 0;
}

std::vector<std::string> describeMachine(Length length) {
  std::vector<std::string> lines;
  utsname system{};
  uname(&system);
  lines.push_back(processor() + ", " + std::to_string(std::thread::hardware_concurrency()) + " cores; " +
                  system.sysname + " " + system.release);
  realtime::ThreadSetup setup;
  std::thread([&] {
    setup = realtime::setUpThread({.realtime = true, .priority = 80, .cpu = -1, .lockMemory = false});
  }).join();
  lines.push_back("realtime scheduling: " + setup.scheduling.text);
  const char* lengths[] = {"windows of 5 s", "--full", "--long"};
  lines.push_back(std::string("length: ") + lengths[static_cast<int>(length)]);
  return lines;
}

std::string asText(const Measured& measured) {
  std::array<std::string, 5> head{"", "unit", "ours p50 / p99 / p99.9 / max", "yardstick", "ratio"};
  auto lines = cells(measured.outcome);
  std::array<std::size_t, 5> width{};
  lines.insert(lines.begin(), head);
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < 5; ++i) width[i] = std::max(width[i], line[i].size());
  }
  std::string text = measured.benchmark->name + ": " + measured.benchmark->what +
                     "\n  yardstick: " + measured.benchmark->yardstick + "\n";
  for (std::size_t k = 0; k < lines.size(); ++k) {
    text += "  ";
    for (std::size_t i = 0; i < 5; ++i)
      text += lines[k][i] + std::string(width[i] - lines[k][i].size() + 2, ' ');
    text += "\n";
    if (k == 0) continue;
    const Row& row = measured.outcome.rows[k - 1];
    for (const Check& check : row.checks) text += "      " + verdict(check) + "\n";
    if (!row.note.empty()) text += "      " + row.note + "\n";
  }
  for (const std::string& remark : measured.outcome.remarks) text += "  " + remark + "\n";
  return text;
}

std::string asMarkdown(const std::vector<Measured>& all, const std::vector<std::string>& machine) {
  std::string text;
  for (const std::string& line : machine) text += "- " + line + "\n";
  text +=
      "\nFigures are p50 / p99 / p99.9 / max, or one number where there is only one. Ratios are of the "
      "medians.\n";
  for (const Measured& measured : all) {
    text += "\n### " + measured.benchmark->name + "\n\n" + measured.benchmark->what +
            ". Yardstick: " + measured.benchmark->yardstick +
            ".\n\n| | unit | ours | yardstick | ratio | goal |\n|---|---|---|---|---|---|\n";
    const auto lines = cells(measured.outcome);
    for (std::size_t k = 0; k < lines.size(); ++k) {
      text += "|";
      for (const std::string& cell : lines[k]) text += " " + cell + " |";
      std::string goals;
      for (const Check& check : measured.outcome.rows[k].checks)
        goals += (goals.empty() ? " " : "; ") + verdict(check);
      const std::string& note = measured.outcome.rows[k].note;
      if (!note.empty()) goals += (goals.empty() ? " " : "; ") + note;
      text += goals + " |\n";
    }
    for (const std::string& remark : measured.outcome.remarks) text += "\n" + remark + "\n";
    for (const Figure& figure : measured.outcome.figures) {
      text += "\n![" + figure.title + "](figures/" + figure.file + ".svg)\n";
    }
  }
  return text;
}

void writeFile(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw std::runtime_error("cannot write '" + file.string() + "'; is there room, and may you?");
}

void writeJson(const std::filesystem::path& file, const std::vector<Measured>& all,
               const std::vector<std::string>& machine) {
  nlohmann::json json{{"machine", machine}, {"benchmarks", nlohmann::json::array()}};
  for (const Measured& measured : all) {
    nlohmann::json one{{"name", measured.benchmark->name},
                       {"took_s", measured.took_s},
                       {"remarks", measured.outcome.remarks},
                       {"rows", nlohmann::json::array()}};
    for (const Row& row : measured.outcome.rows) one["rows"].push_back(jsonOf(row));
    json["benchmarks"].push_back(one);
  }
  writeFile(file, json.dump(2) + "\n");
}

void writeCsv(const std::filesystem::path& file, const std::vector<Measured>& all) {
  std::string text = "benchmark,row,unit,who,count,mean,deviation,p50,p99,p99.9,max\n";
  for (const Measured& measured : all) {
    for (const Row& row : measured.outcome.rows) {
      const auto line = [&](const char* who, const Summary& s) {
        std::array<char, 256> numbers{};
        std::snprintf(numbers.data(), numbers.size(), "%llu,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g",
                      static_cast<unsigned long long>(s.count), s.mean, s.deviation, s.p50, s.p99, s.p999,
                      s.max);
        text += measured.benchmark->name + ",\"" + row.what + "\"," + row.unit + "," + who + "," +
                numbers.data() + "\n";
      };
      line("ours", row.ours);
      if (row.yardstick) line("yardstick", *row.yardstick);
    }
  }
  writeFile(file, text);
}

void writeFigures(const std::filesystem::path& directory, const std::vector<Measured>& all) {
  for (const Measured& measured : all) {
    for (const Figure& figure : measured.outcome.figures) {
      writeFile(directory / "figures" / (figure.file + ".svg"), asSvg(figure));
    }
  }
}

}  // namespace hapticd::bench
