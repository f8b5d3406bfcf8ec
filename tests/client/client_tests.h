// Helpers of the client's tests.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "client/scripted_server.h"
#include "hapticd/client.h"
#include "wire/codec.h"

namespace hapticd::test {

constexpr auto kPatience = std::chrono::seconds(60);

/// Polls until the condition holds; false after kPatience.
template <class Condition>
bool pollUntil(Client& client, Condition&& condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    client.poll(std::chrono::milliseconds(10));
  }
  return true;
}

/// Whether this is the message, field by field.
template <class M>
::testing::AssertionResult is(const Received& received, const M& expected) {
  const M* message = received.message.as<M>();
  if (message && *message == expected) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << wire::info(received.message.kind()).name << ", expected "
                                       << M::kInfo.name << (message ? " with other fields" : "");
}

/// The text of the exception that the function throws.
template <class Failure, class Function>
std::string textOf(Function&& function) {
  try {
    function();
  } catch (const Failure& failure) {
    return failure.what();
  }
  return "nothing was thrown";
}

/// Tests that run for each of VRPN's two ways to connect.
class BothWays : public ::testing::TestWithParam<bool> {
 protected:
  bool tcpOnly() const { return GetParam(); }
  std::string name(const ScriptedServer& server) const {
    return tcpOnly() ? server.tcpName() : server.name();
  }
};

}  // namespace hapticd::test
