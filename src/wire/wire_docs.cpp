// Prints the table of messages: `wire_docs markdown` is docs/wire-messages.md, `wire_docs dictionary` is for
// libFuzzer.
#include <cstdio>
#include <string_view>

#include "wire/describe.h"

int main(int argc, char** argv) {
  const std::string_view what = argc == 2 ? argv[1] : "";
  if (what == "markdown") return std::fputs(hapticd::wire::messagesAsMarkdown().c_str(), stdout) < 0;
  if (what == "dictionary") return std::fputs(hapticd::wire::messagesAsFuzzDictionary().c_str(), stdout) < 0;
  std::fputs("usage: wire_docs markdown|dictionary\n", stderr);
  return 2;
}
