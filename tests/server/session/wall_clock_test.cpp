#include "server/session/wall_clock.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

using base::Nanos;

// Its reader loses the processor before some readings.
class BusyClock final : public base::Clock {
 public:
  Nanos now() noexcept override { return time_ += step(); }
  void sleepUntil(Nanos deadline) noexcept override { time_ = deadline; }
  Nanos wallNow() noexcept override { return (time_ += step()) + offset; }

  Nanos offset = 1'600'000'000'000'000'000;
  int readings = 0;      // so far
  int interrupted = -1;  // the reading before which 5 ms pass

 private:
  Nanos step() { return readings++ == interrupted ? 5'000'000 : 0; }

  Nanos time_ = 1'000'000'000;
};

class WallClockTest : public testing::Test {
 protected:
  BusyClock clock_;
  base::SystemThreads threads_;
  base::SystemFiles files_;
  base::SystemRandom random_;
  base::ScopedWorld scope_{base::World{clock_, threads_, files_, random_}};
};

TEST_F(WallClockTest, FollowsAClockThatIsSet) {
  WallClock wall;
  EXPECT_EQ(wall.offset(), clock_.offset);
  for (const Nanos step : {3600LL, -7200LL, -1'500'000'000LL, 2'600'000'000LL}) {
    clock_.offset += step * 1'000'000'000;
    wall.refresh();
    EXPECT_EQ(wall.offset(), clock_.offset);
  }
}

// A machine that is busy between two readings does not set its clock.
TEST_F(WallClockTest, AnInterruptionIsNoStep) {
  for (int at = 0; at < 6; ++at) {
    clock_.readings = 0;
    clock_.interrupted = at;
    const WallClock wall;
    EXPECT_EQ(wall.offset(), clock_.offset) << "reading " << at;
  }
  clock_.interrupted = -1;
  WallClock wall;
  for (int at = 0; at < 3; ++at) {
    clock_.readings = 0;
    clock_.interrupted = at;
    wall.refresh();
    EXPECT_EQ(wall.offset(), clock_.offset) << "reading " << at;
  }
}

}  // namespace
}  // namespace hapticd::server
