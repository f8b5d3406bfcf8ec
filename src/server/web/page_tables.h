// Tables that the page shares with the server, as TypeScript.
#pragma once

#include <string>

namespace hapticd::server {

/// The content of web/src/server_tables.ts: trips of the guard and refusal codes.
std::string pageTables();

}  // namespace hapticd::server
