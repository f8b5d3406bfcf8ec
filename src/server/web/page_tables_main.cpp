// Prints web/src/server_tables.ts.
#include <cstdio>

#include "server/web/page_tables.h"

int main() {
  return std::fputs(hapticd::server::pageTables().c_str(), stdout) < 0;
}
