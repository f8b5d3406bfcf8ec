// One run: the server, its clients, and what is judged.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/server.h"
#include "sim/clients.h"
#include "sim/hash.h"
#include "sim/listener_judge.h"
#include "sim/scoped_log.h"
#include "sim/simulation.h"
#include "sim/visit.h"

namespace hapticd::sim {

inline constexpr char kRecording[] = "/recording.haptics";
inline constexpr char kSocket[] = "/run/hapticd.sock";
inline constexpr std::int32_t kUploaded = 5;
inline constexpr std::size_t kServerLoop = 0;  // of the network: the first that is made
inline constexpr double kPlace = 777;          // where the object of the uploads is at the end

class Simulation {
 public:
  Simulation(const Script& script, bool verbose);
  Outcome run();
  std::vector<std::byte> recording() { return files_.read(kRecording); }

 private:
  void finding(const std::string& text);
  void line(const std::string& text);
  void logged(const std::string& text);
  void after(Nanos delay, std::function<void()> function);
  server::ServerConfig configuration() const;
  void joinClients();
  void scheduleEnd();
  void sumUp();
  void perform(const Action& action);
  void move(Dice& dice);
  void pose(double y);
  void upload(Dice& dice);
  void appear(Dice& dice);
  void vanish(Dice& dice);
  void stream(Dice& dice);
  void endStream(Streamer& streamer, Dice& dice);
  void endForcesWithin(Nanos lasts);
  void failDisk(Dice& dice);
  void healDisk();
  void runOutOfMemory(Dice& dice);
  void pauseReader(Dice& dice);
  void resumeReader();
  void runOutOfDescriptors(Dice& dice);
  void visitWithoutDescriptors(Dice& dice);
  void returnDescriptors();
  bool shortOfDescriptors();
  void checkGreeted(Nanos back, Nanos stalled);
  void nonsense(Dice& dice);
  void visit(Dice& dice);
  void ask(const std::string& target, Visit::Manner manner, Dice& dice);
  void onAnswer(const std::string& target, Nanos asked, const Visit::Answer& answer, std::uint64_t seed);
  void checkVisits();
  void beat();
  void describe(bool last);
  void compare(const scene::SceneDescription& description, bool last);
  void checkEnd();
  void checkRecording();
  void checkReplay();
  std::optional<Nanos> freeFrom();
  Nanos serverStalled();
  Nanos sceneTime();
  std::optional<Judge::Top> top();
  SimClient* clientAt(const net::Endpoint& endpoint);

  const Script& script_;
  const bool verbose_;
  Outcome outcome_;
  Hash hash_;
  SimClock clock_{base::FakeWorld::kWallAtZero};
  base::SeededRandom random_;
  base::FakeFiles files_;
  Scheduler scheduler_;
  base::ScopedWorld world_;
  net::ScopedNetwork network_;
  ScopedLog log_;
  Judge judge_;
  Bench bench_;
  ScopedBench scopedBench_;
  Dice networkDice_;
  std::optional<server::Server> server_;
  std::optional<net::Loop> loop_;
  std::optional<Clients> clients_;
  std::deque<net::Subscription> timers_;

  std::unique_ptr<CubeOwner> cubeOwner_;
  std::vector<std::unique_ptr<Listener>> operators_;
  std::vector<std::unique_ptr<Batcher>> batchers_;
  std::unique_ptr<Listener> uploader_;
  std::unique_ptr<Listener> reader_;  // that sometimes does not read
  std::unique_ptr<Listener> page_;    // as a browser
  std::unique_ptr<Listener> stock_;   // with datagrams
  std::vector<std::unique_ptr<Pusher>> pushers_;
  std::vector<std::unique_ptr<Streamer>> streamers_;
  std::vector<std::unique_ptr<SimClient>> strangers_;
  std::vector<std::unique_ptr<Listener>> newcomers_;  // while descriptors are short
  std::vector<std::unique_ptr<Visit>> visits_;
  Nanos stateKnownAt_ = 0;                                 // when the newest state of the web port came
  std::uint64_t stateTick_ = 0;                            // its tick
  Nanos logSecond_ = 0;                                    // when the present second of the log began
  std::size_t logBytes_ = 0;                               // in it
  std::deque<std::pair<Nanos, std::uint64_t>> revisions_;  // of the scene in the servo: when known
  std::map<std::uint16_t, SimClient*> byPort_;

  struct Moved {
    Nanos sent;  // of the time in which the server does not stand still
    double y;    // world units
  };
  std::deque<Moved> poses_;  // of the cube
  double y_ = 0;
  std::uint64_t moving_ = 0;  // number of the newest stream of poses
  Nanos endOfForces_ = 0;     // of clients that are gone
  Nanos stalledThen_ = 0;
  std::deque<std::pair<Nanos, std::uint32_t>> buttons_{{0, 0}};  // of the device: since when
  bool over_ = false;
  bool writesFailed_ = false;
  bool memoryFailed_ = false;
  Nanos memoryShortUntil_ = 0;                 // and what that delayed is made up for
  std::map<std::int32_t, std::int64_t> seen_;  // newest batch of each batcher that a description showed
  ListenerJudge listeners_;
  bool noDescriptors_ = false;
  std::optional<Nanos> descriptorsBack_;  // when they were back last
  bool wakesReader_ = false;              // with the next object that is touched
  int unanswered_ = 0;                    // requests for a description of the scene
  bool compared_ = false;
  bool uploaded_ = false;
  bool wallSteps_ = false;
};

}  // namespace hapticd::sim
