// The bits of the extension's masks, as other languages name them.
#pragma once

#include <cstdint>

#include "wire/messages/extension.h"

namespace hapticd::wire {

struct NamedBit {
  const char* name;
  std::uint32_t bit;
};

inline constexpr NamedBit kReportBits[] = {
    {"REPORT_TRACKER", kReportTracker},
    {"REPORT_FORCE", kReportForce},
    {"REPORT_BUTTON", kReportButton},
    {"REPORT_ANALOG", kReportAnalog},
    {"REPORT_TICK", kReportTick},
    {"REPORT_CONTACTS", kReportContacts},
    {"REPORT_HAND", kReportHand},
    {"REPORT_CONTACT_POINT", kReportContactPoint},
    {"REPORT_TOUCH_BUTTON", kReportTouchButton},
    {"REPORT_CONTACT_ANALOG", kReportContactAnalog},
    {"REPORT_HIP", kReportHip},
    {"REPORT_POSES", kReportPoses},
};

inline constexpr NamedBit kFeatureBits[] = {
    {"FEATURE_BULK_MESH", kFeatureBulkMesh},
    {"FEATURE_BATCH", kFeatureBatch},
    {"FEATURE_SUBSCRIBE", kFeatureSubscribe},
    {"FEATURE_STOP", kFeatureStop},
    {"FEATURE_HEARTBEAT", kFeatureHeartbeat},
    {"FEATURE_HOLD_HAND", kFeatureHoldHand},
    {"FEATURE_REMOTE_CONTACTS", kFeatureRemoteContacts},
};

}  // namespace hapticd::wire
