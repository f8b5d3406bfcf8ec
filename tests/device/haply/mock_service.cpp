#include "device/haply/mock_service.h"

#include <sys/socket.h>

#include <atomic>
#include <mutex>
#include <thread>
#include <utility>
//
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>

namespace hapticd::device {

namespace asio = boost::asio;
namespace beast = boost::beast;
using Json = nlohmann::json;
using ErrorCode = boost::system::error_code;

struct MockService::Impl {
  asio::io_context context;
  asio::ip::tcp::acceptor acceptor{context, {asio::ip::make_address("127.0.0.1"), 0}};
  std::atomic<bool> stopping{false};
  std::atomic<int> messages{0};
  std::atomic<int> connections{0};
  std::atomic<bool> muted{false};
  std::atomic<bool> babbling{false};
  std::atomic<bool> refusing{false};
  std::atomic<bool> another{false};
  std::atomic<int> toAnother{0};
  mutable std::mutex mutex;
  int open = -1;  // descriptor of the present connection
  Vec3 position = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();
  Vec3 force = Vec3::Zero();
  bool pressed = false;
  bool noDevice = false;
  std::string permutation = "XYZ";
  Json status{{"calibrated", true}, {"ready", true}, {"power_supply", true}};
  mock::Arm shared;
  std::thread thread;

  static Json vector(const Vec3& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }

  std::string stateMessage(bool first) const {
    const std::lock_guard lock(mutex);
    if (babbling) return "{\"inverse3\": oops";
    Json device{{"device_id", "MOCK1"},
                {"state", {{"cursor_position", vector(position)}, {"cursor_velocity", vector(velocity)}}},
                {"status", status}};
    if (first) device["config"] = {{"basis", {{"permutation", permutation}}}};
    const Json grip{{"device_id", "GRIP1"},
                    {"state",
                     {{"orientation", {{"x", 0}, {"y", 0}, {"z", std::sqrt(0.5)}, {"w", std::sqrt(0.5)}}},
                      {"buttons", {{"a", false}, {"b", pressed}, {"c", false}}}}}};
    Json devices = Json::array();
    if (another) {
      devices.push_back(device);
      devices.back()["device_id"] = "MOCK2";
    }
    if (!noDevice) devices.push_back(device);
    return Json{{"session_id", 1}, {"inverse3", devices}, {"verse_grip", Json::array({grip})}}.dump();
  }

  // Right, away from the user, up.
  void obeyShared() {
    const std::lock_guard lock(mutex);
    if (!shared) return;
    const double* place = shared.begin();
    position = Vec3(place[0], -place[2], place[1]);
    velocity.setZero();
    status["calibrated"] = shared.fault() != mock::kNotCalibrated;
    status["ready"] = shared.fault() != mock::kForceExceeded;
  }

  void obey(const std::string& text) {
    const Json command = Json::parse(text).at("inverse3").at(0);
    if (command.at("device_id") == "MOCK2") {
      ++toAnother;
      return;
    }
    const Json values = command.at("commands").at("set_cursor_force").at("values");
    const std::lock_guard lock(mutex);
    force = Vec3(values.at("x").get<double>(), values.at("y").get<double>(), values.at("z").get<double>());
    ++messages;
    if (!shared) return;
    const double ours[3] = {force.x(), force.z(), -force.y()};
    shared.end(ours, shared.place(), shared.fault());
  }

  void serve(asio::ip::tcp::socket socket) {
    {
      const std::lock_guard lock(mutex);
      open = socket.native_handle();
    }
    ++connections;
    try {
      beast::websocket::stream<asio::ip::tcp::socket> stream(std::move(socket));
      stream.next_layer().set_option(asio::ip::tcp::no_delay(true));
      stream.accept();
      stream.text(true);
      obeyShared();
      stream.write(asio::buffer(stateMessage(true)));
      for (;;) {
        beast::flat_buffer buffer;
        stream.read(buffer);
        obey(beast::buffers_to_string(buffer.cdata()));
        obeyShared();
        if (!muted) stream.write(asio::buffer(stateMessage(false)));
      }
    } catch (const std::exception&) {
      // The client is gone, or was sent away.
    }
    const std::lock_guard lock(mutex);
    open = -1;
    force.setZero();
    shared.switchOff();
  }

  void run() {
    while (!stopping) {
      ErrorCode error;
      asio::ip::tcp::socket socket(context);
      acceptor.accept(socket, error);
      if (!error && !stopping && !refusing) serve(std::move(socket));
    }
  }

  void hangUp() {
    const std::lock_guard lock(mutex);
    if (open >= 0) shutdown(open, SHUT_RDWR);
  }
};

MockService::MockService() : impl_(std::make_unique<Impl>()) {
  impl_->thread = std::thread([this] { impl_->run(); });
}

MockService::~MockService() {
  impl_->stopping = true;
  impl_->hangUp();
  shutdown(impl_->acceptor.native_handle(), SHUT_RDWR);
  impl_->thread.join();
}

std::string MockService::port() const {
  return std::to_string(impl_->acceptor.local_endpoint().port());
}

void MockService::hand(const Vec3& position_m, const Vec3& velocity_m_per_s) {
  const std::lock_guard lock(impl_->mutex);
  impl_->position = position_m;
  impl_->velocity = velocity_m_per_s;
}

Vec3 MockService::force() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->force;
}

int MockService::messages() const {
  return impl_->messages;
}
int MockService::connections() const {
  return impl_->connections;
}
void MockService::button(bool pressed) {
  const std::lock_guard lock(impl_->mutex);
  impl_->pressed = pressed;
}
void MockService::status(const std::string& json) {
  const std::lock_guard lock(impl_->mutex);
  impl_->status = Json::parse(json);
}
void MockService::basis(const std::string& permutation) {
  const std::lock_guard lock(impl_->mutex);
  impl_->permutation = permutation;
}
void MockService::withoutDevice(bool yes) {
  const std::lock_guard lock(impl_->mutex);
  impl_->noDevice = yes;
}
void MockService::another(bool yes) {
  impl_->another = yes;
}
int MockService::toAnother() const {
  return impl_->toAnother;
}
void MockService::mute(bool yes) {
  impl_->muted = yes;
}
void MockService::babble(bool yes) {
  impl_->babbling = yes;
}
void MockService::hangUp() {
  impl_->hangUp();
}
void MockService::refuse(bool yes) {
  impl_->refusing = yes;
}
void MockService::follow(mock::ArmBlock& block) {
  const std::lock_guard lock(impl_->mutex);
  impl_->shared = mock::Arm(&block);
}

}  // namespace hapticd::device
