// The guard's trips, under the names of this room; the table is public.
#pragma once

#include "hapticd/trips.h"

namespace hapticd::realtime {

using hapticd::bit;
using hapticd::ForceError;
using hapticd::kTripCount;
using hapticd::kTrips;
using hapticd::Trip;
using hapticd::TripAction;
using hapticd::TripInfo;

/// The bit field of the trips that act in one way.
constexpr std::uint32_t tripsOf(TripAction action) noexcept {
  return Trips::thatAct(action).bits();
}

}  // namespace hapticd::realtime
