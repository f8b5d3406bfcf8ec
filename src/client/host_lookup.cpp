#include "client/host_lookup.h"

#include <exception>
#include <utility>

#include "base/thread.h"
#include "net/endpoint.h"

namespace hapticd::client {
namespace {

bool isNumber(const std::string& host) {
  try {
    (void)net::Endpoint::parse(host);
    return true;
  } catch (const net::Error&) {
    return false;
  }
}

}  // namespace

HostLookup::HostLookup(std::string host)
    : host_(std::move(host)), isNumber_(isNumber(host_)), address_(net::resolve(host_)) {}

std::uint32_t HostLookup::address() {
  if (question_ && question_->answered.load(std::memory_order_acquire)) {
    if (question_->address != 0) address_ = question_->address;
    question_.reset();
  }
  return address_;
}

void HostLookup::askAgain() {
  if (isNumber_ || question_) return;
  const auto question = std::make_shared<Question>();
  try {
    base::BlockingThread({.name = "find-host"}, [question, host = host_] {
      try {
        question->address = net::resolve(host);
      } catch (const std::exception&) {
        // Unknown at this time.
      }
      question->answered.store(true, std::memory_order_release);
    }).detach();
    question_ = question;
  } catch (const std::exception&) {
    // No thread at this time: the next attempt asks.
  }
}

}  // namespace hapticd::client
