// Replays the corpora in testdata/fuzz. A violated property aborts the program, so each target is a test.
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "fuzz/targets.h"

namespace hapticd::fuzz {
namespace {

struct Target {
  const char* name;
  void (*run)(Input);
};

const Target kTargets[] = {{"wire_message", wire_message},
                           {"wire_frames", wire_frames},
                           {"wire_peer", wire_peer},
                           {"udp_request", udp_request},
                           {"http", http},
                           {"web_socket", web_socket},
                           {"vrpn_cfg", vrpn_cfg},
                           {"toml_config", toml_config},
                           {"recording", recording},
                           {"hand_csv", hand_csv},
                           {"hand_traj", hand_traj},
                           {"haply_json", haply_json},
                           {"isolation_block", isolation_block},
                           {"mesh_bytes", mesh_bytes},
                           {"mesh_file", mesh_file},
                           {"remote_input", remote_input},
                           {"whole_server", whole_server}};

// Each input with its length before it, four bytes, as scripts/fuzz.sh packs them.
std::vector<std::vector<std::byte>> corpusOf(const std::string& target) {
  std::ifstream in(HAPTICD_TESTDATA "/fuzz/" + target + ".corpus", std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(in)), {});
  std::vector<std::vector<std::byte>> inputs;
  for (std::size_t at = 0; at + 4 <= all.size();) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = length << 8U | static_cast<unsigned char>(all[at + i]);
    at += 4;
    EXPECT_LE(length, all.size() - at) << "a damaged corpus";
    const auto bytes = std::as_bytes(std::span(all)).subspan(at, std::min(length, all.size() - at));
    inputs.emplace_back(bytes.begin(), bytes.end());
    at += bytes.size();
  }
  return inputs;
}

class Corpus : public testing::TestWithParam<Target> {};

TEST_P(Corpus, HoldsTheProperties) {
  const Target& target = GetParam();
  std::vector<std::vector<std::byte>> inputs = corpusOf(target.name);
  ASSERT_GE(inputs.size(), 3U) << "testdata/fuzz/" << target.name << ".corpus is missing or empty";
  inputs.emplace_back();
  for (const std::vector<std::byte>& input : inputs) target.run(input);
}

// Without the guidance of a fuzzer, but in each build: two of its inputs, spliced, and one changed byte.
TEST_P(Corpus, HoldsTheUnguidedProperties) {
  const Target& target = GetParam();
  const std::vector<std::vector<std::byte>> inputs = corpusOf(target.name);
  ASSERT_FALSE(inputs.empty());
  std::uint32_t state = 1;
  const auto below = [&](std::size_t n) {
    state = state * 1664525U + 1013904223U;
    return n == 0 ? 0 : (state >> 8U) % n;
  };
  const std::string_view name = target.name;
  const bool slow = name == "mesh_file" || name == "whole_server";  // a process or a server each
  for (std::size_t i = 0; i < (slow ? 20U : 300U); ++i) {
    const std::vector<std::byte>& first = inputs[below(inputs.size())];
    const std::vector<std::byte>& second = inputs[below(inputs.size())];
    std::vector<std::byte> input(first.begin(),
                                 first.begin() + static_cast<std::ptrdiff_t>(below(first.size() + 1)));
    input.insert(input.end(), second.begin() + static_cast<std::ptrdiff_t>(below(second.size() + 1)),
                 second.end());
    if (!input.empty()) input[below(input.size())] = static_cast<std::byte>(below(256));
    target.run(input);
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Corpus, testing::ValuesIn(kTargets),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace hapticd::fuzz
