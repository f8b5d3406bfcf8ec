// What the server knows of itself at one moment, as plain values: for the page, and for metrics.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "realtime/servo/histogram.h"
#include "realtime/servo/report.h"

namespace hapticd::server {

struct DeviceStatus {
  std::vector<std::string> names;
  std::string driver;
  bool simulated = false;
  std::size_t scene = 0;  ///< which of the server's
  geometry::Box workspace_m;
  double peakForce_N = 0;
  double rate_Hz = 0;
  bool realtime = false;  ///< the loop has its scheduling class
  std::string hand;       ///< who moves it: scripted, file, held, user
  std::optional<std::uint32_t> heldBy;
  std::string fault;
  std::uint64_t droppedReports = 0;
  realtime::TickReport last;
  realtime::Histogram::Copy period, wakeup, compute;
};

struct ClientStatus {
  std::uint32_t id = 0;
  std::string address;
  std::string mode;                  ///< tcp, udp, web
  std::vector<std::string> devices;  ///< names it listens to
  double connected_s = 0;
  double rate_Hz = 0;  ///< of the reports it chose
  std::uint64_t bytesIn = 0;
  std::uint64_t bytesOut = 0;
  std::uint64_t dropped = 0;  ///< low-latency buffers and datagrams it never got
  std::size_t queuedBytes = 0;
  std::size_t unacknowledgedBytes = 0;
  bool commands = false;  ///< may change a scene
};

struct ServerStatus {
  double uptime_s = 0;
  std::string recording;  ///< file name; empty when nothing is being recorded
  std::vector<DeviceStatus> devices;
  std::vector<ClientStatus> clients;
  std::vector<std::vector<std::string>> scenes;  ///< first names of the devices that touch each
};

}  // namespace hapticd::server
