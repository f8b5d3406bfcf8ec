#include "server/web/page_tables.h"

#include <nlohmann/json.hpp>

#include "hapticd/trips.h"
#include "server/session/refusal_codes.h"

namespace hapticd::server {
namespace {

// A JSON string is a TypeScript string.
std::string typeScriptString(std::string_view text) {
  return nlohmann::json(text).dump();
}

std::string_view nameOf(TripAction action) {
  switch (action) {
    case TripAction::clamp:
      return "clamp";
    case TripAction::hold:
      return "hold";
    case TripAction::latch:
      return "latch";
  }
  return "";
}

}  // namespace

std::string pageTables() {
  std::string out =
      R"(// Generated from include/hapticd/trips.h and src/server/session/refusal_codes.h. Do not edit; to update it, run
//   build/release/bin/page_tables > web/src/server_tables.ts

export interface Trip {
  /** Bit number in Tick.guardActive and in GuardState. */
  bit: number;
  /** clamp: shapes the force; hold: zero force while the cause lasts; latch: zero force until re-armed. */
  action: "clamp" | "hold" | "latch";
  what: string;
  remedy: string;
}

export const TRIPS = {
)";
  for (const TripInfo& trip : kTrips) {
    out += "  " + std::string(trip.name) + ": {\n    bit: " + std::to_string(static_cast<int>(trip.trip)) +
           ",\n    action: " + typeScriptString(nameOf(trip.action)) +
           ",\n    what: " + typeScriptString(trip.what) + ",\n    remedy: " + typeScriptString(trip.remedy) +
           ",\n  },\n";
  }
  out += R"(} as const satisfies Record<string, Trip>;

/** Why the server refused a command: the level of its text. */
export const REFUSAL = {
)";
  for (const RefusalInfo& refusal : kRefusals) {
    out += "  " + std::string(refusal.name) + ": " +
           std::to_string(static_cast<std::uint32_t>(refusal.code)) + ",\n";
  }
  return out + "} as const;\n";
}

}  // namespace hapticd::server
