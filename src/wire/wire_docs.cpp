// Prints what is derived from the table of messages:
//   wire_docs markdown    docs/wire-messages.md
//   wire_docs typescript  web/src/wire/messages.ts
//   wire_docs python      python/hapticd/_messages.py
//   wire_docs vectors     testdata/wire/vectors.json
//   wire_docs dictionary  for libFuzzer
#include <cstdio>
#include <string>
#include <string_view>

#include "wire/describe.h"
#include "wire/vectors.h"

int main(int argc, char** argv) {
  using namespace hapticd::wire;
  const std::string_view what = argc == 2 ? argv[1] : "";
  std::string text;
  if (what == "markdown") text = messagesAsMarkdown();
  if (what == "typescript") text = messagesAsTypeScript();
  if (what == "python") text = messagesAsPython();
  if (what == "vectors") text = vectorsAsJson();
  if (what == "dictionary") text = messagesAsFuzzDictionary();
  if (!text.empty()) return std::fputs(text.c_str(), stdout) < 0 || std::fflush(stdout) != 0;
  std::fputs("usage: wire_docs markdown|typescript|python|vectors|dictionary\n", stderr);
  return 2;
}
