// Runs untrusted parsers in a child process: no network, no writing to files, limited memory, time and
// output.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace hapticd::mesh_io {

struct ConfinedLimits {
  /// Address space that the child may add to what the caller has mapped. Not applied in sanitizer builds,
  /// whose shadow memory exceeds any limit.
  std::uint64_t memory_bytes = 4ULL << 30U;
  /// Wall-clock time, and processor time.
  double time_s = 60;
  std::uint64_t output_bytes = 2ULL << 30U;
  /// What keeps the network away; a child that gets neither does not run. Both, except in tests.
  bool networkNamespace = true;
  bool systemCallFilter = true;
};

/// What went wrong in the child, or why there is none: one line of printable ASCII.
class ConfinedError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Sends bytes to the calling process.
using ConfinedOutput = std::function<void(std::span<const std::byte>)>;

/// Runs `work` in a forked child and returns the bytes that it sent, which are as untrusted as its input. The
/// child has no descriptor except its output, cannot open sockets, write to files or start processes, and is
/// killed at the first limit that it exceeds, or when the calling thread ends. `work` computes its whole
/// result before it sends any of it; an exception becomes the text of the error. Throws ConfinedError. From
/// any thread; blocks until the child has ended.
std::vector<std::byte> runConfined(const ConfinedLimits& limits,
                                   const std::function<void(const ConfinedOutput&)>& work);

}  // namespace hapticd::mesh_io
