// Hand files for tests, so that no test waits for the scripted hand.
#pragma once

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "geometry/types.h"
#include "running_server.h"

namespace hapticd::test {

using geometry::Vec3;

/// A temporary hand file. Positions in metres, device frame; with the initial workspace the reported metres
/// are the same numbers.
class Hand {
 public:
  /// Rests at a position until rows are added.
  static Hand at(const Vec3& position_m) {
    Hand hand;
    hand.row(0, position_m);
    return hand;
  }

  /// Strokes for two minutes: down the y axis from 40 to 15 mm, a pause with button 0 pressed, and up again;
  /// rotated about the z axis.
  static Hand stroking(double turn_rad = 0) {
    constexpr double kHigh_m = 0.040;
    constexpr double kLow_m = 0.015;
    Hand hand;
    for (double t_s = 0; t_s < 120; t_s += 0.28) {
      hand.row(t_s, {0, kHigh_m, 0}, turn_rad);
      hand.row(t_s + 0.03, {0, kHigh_m, 0}, turn_rad);
      hand.row(t_s + 0.09, {0, kLow_m, 0}, turn_rad, 1);
      hand.row(t_s + 0.22, {0, kLow_m, 0}, turn_rad);
    }
    return hand;
  }

  Hand(Hand&& other) noexcept : file_(std::exchange(other.file_, {})) {}
  ~Hand() {
    if (!file_.empty()) std::remove(file_.c_str());
  }

  /// Appends a row to the path.
  void row(double t_s, const Vec3& p_m, double turn_rad = 0, int buttons = 0) {
    std::ofstream out(file_, std::ios::app);
    out << t_s << ',' << p_m.x() << ',' << p_m.y() << ',' << p_m.z() << ",0,0," << std::sin(turn_rad / 2)
        << ',' << std::cos(turn_rad / 2) << ',' << buttons << '\n';
  }

  /// Configuration of a server with this hand on its own port.
  server::ServerConfig config() const {
    server::ServerConfig config = RunningServer::anyPort();
    config.devices[0].hand = file_;
    return config;
  }

 private:
  Hand() {
    static int count = 0;
    file_ = std::filesystem::temp_directory_path() /
            ("hapticd_hand_" + std::to_string(::getpid()) + '_' + std::to_string(++count) + ".csv");
    std::remove(file_.c_str());  // of a program that had this number and was killed
  }

  std::string file_;
};

}  // namespace hapticd::test
