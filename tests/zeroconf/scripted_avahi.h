// An Avahi daemon that does what a test tells it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "system_bus/scripted_service.h"

namespace hapticd::test {

struct AvahiEntry {
  int interface, protocol;
  std::string name, type;
  std::uint16_t port;
  std::vector<std::string> text;
};

class ScriptedAvahi : public ScriptedService {
 public:
  /// `taken`: names that it refuses at once, as those of another program of the same machine.
  explicit ScriptedAvahi(std::vector<std::string> taken = {});
  ~ScriptedAvahi() override;

  /// Waits until this number of entry groups has been committed; false after a time that only a hang can
  /// take.
  bool waitCommitted(std::size_t count);
  /// The entry of the last commit.
  AvahiEntry entry();
  /// Tells the announcer that another machine has the name.
  void collide();
  /// Tells that the daemon runs under another host name; it has dropped all entries.
  void renameHost();
  /// What browsers are told, from then on: each entry once, with an address; those of protocol -1 cannot be
  /// resolved.
  void setOthers(std::vector<std::pair<AvahiEntry, std::string>> others);
  /// Waits until somebody has browsed; false as waitCommitted().
  bool waitBrowsed();
  /// Browsers never learn that they have been told all.
  void neverFinish();

 private:
  int answer(sd_bus_message* call) override;
  int addService(sd_bus_message* call);
  int browse(sd_bus_message* call);
  int resolve(sd_bus_message* call);

  std::vector<std::string> taken_;
  // With the mutex.
  AvahiEntry added_{}, committed_{};
  std::size_t commits_ = 0;
  std::vector<std::pair<AvahiEntry, std::string>> others_;
  bool neverFinishes_ = false;
  bool browsed_ = false;
};

}  // namespace hapticd::test
