// The reason of a refusal as a stable number in addition to the text.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace hapticd::server {

/// Sent in the `level` field of a text_message, so that clients need not parse the text. All other texts of
/// this server have level 0; a stock VRPN server may send any level. Numbers never change their meaning; new
/// ones are appended. docs/wire-extensions.md lists them.
enum class RefusalCode : std::uint32_t {
  none = 0,              ///< not a refusal, or one without a code
  notPermitted = 1,      ///< the client's role, or a replayed recording, permits no commands
  handNotSimulated = 2,  ///< Hold_Hand: the device is real, or follows a recorded hand
  handHeldByOther = 3,   ///< Hold_Hand: another client holds the simulated hand
  handPoseInvalid = 4,   ///< Hold_Hand: position or orientation is not finite, or the quaternion is zero
  streamedByOther = 5,   ///< Remote_Contacts, Held_Force: another client streams them
  streamInvalid = 6,     ///< Remote_Contacts, Held_Force: a number is not usable
  stoppedByOther = 7,    ///< Rearm_Forces: a stop of another client stands, and only certain ones may undo it
  tokenRefused = 8,      ///< Identify: no such token, or too many wrong ones from this address
  batchRefused = 9,      ///< a command of a batch whose Batch_Begin was refused
};

/// The refusal of one command.
struct Refusal {
  RefusalCode code = RefusalCode::none;
  std::string text;
};

struct RefusalInfo {
  RefusalCode code;
  std::string_view name;
};

/// All codes, in order.
inline constexpr std::array<RefusalInfo, 10> kRefusals{{
    {RefusalCode::none, "none"},
    {RefusalCode::notPermitted, "notPermitted"},
    {RefusalCode::handNotSimulated, "handNotSimulated"},
    {RefusalCode::handHeldByOther, "handHeldByOther"},
    {RefusalCode::handPoseInvalid, "handPoseInvalid"},
    {RefusalCode::streamedByOther, "streamedByOther"},
    {RefusalCode::streamInvalid, "streamInvalid"},
    {RefusalCode::stoppedByOther, "stoppedByOther"},
    {RefusalCode::tokenRefused, "tokenRefused"},
    {RefusalCode::batchRefused, "batchRefused"},
}};

}  // namespace hapticd::server
