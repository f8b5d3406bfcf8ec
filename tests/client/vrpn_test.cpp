// VRPN's classes over this client, as a program written for VRPN uses them.
#include <gtest/gtest.h>
#include <vrpn_Analog.h>
#include <vrpn_Analog_Output.h>
#include <vrpn_Button.h>
#include <vrpn_Connection.h>
#include <vrpn_Dial.h>
#include <vrpn_ForceDevice.h>
#include <vrpn_Mutex.h>
#include <vrpn_Poser.h>
#include <vrpn_Text.h>
#include <vrpn_Tracker.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "client/client_tests.h"

namespace hapticd {
namespace {

using test::is;
using test::kPatience;
using test::ScriptedServer;

template <class Device, class Condition>
bool runUntil(Device& device, Condition&& condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    device.mainloop();
    vrpn_SleepMsecs(1);
  }
  return true;
}

class Vrpn : public ::testing::TestWithParam<bool> {
 protected:
  /// Waits for a message by TCP, which follows the server's descriptions of its names. Datagrams may overtake
  /// those, and without them have no meaning.
  static bool ready(vrpn_BaseClass& device) {
    const vrpn_int32 sender = device.connectionPtr()->register_sender("Phantom");
    return runUntil(device, [&] { return device.connectionPtr()->heard(sender); });
  }
  std::string name() const { return GetParam() ? server_.tcpName() : server_.name(); }
  ScriptedServer server_;
};
INSTANTIATE_TEST_SUITE_P(Connection, Vrpn, ::testing::Bool(),
                         [](const auto& way) { return way.param ? "tcp" : "callback"; });

template <class Report>
void VRPN_CALLBACK keep(void* reports, const Report report) {
  static_cast<std::vector<Report>*>(reports)->push_back(report);
}

TEST_P(Vrpn, ForceDeviceReportsReachTheirHandlers) {
  vrpn_ForceDevice_Remote device(name().c_str());
  std::vector<vrpn_FORCECB> forces;
  std::vector<vrpn_FORCESCPCB> scps;
  std::vector<vrpn_FORCEERRORCB> errors;
  std::vector<vrpn_DOPCB> dops;
  std::vector<vrpn_ISTOUCHINGCB> touchings;
  std::vector<vrpn_TOUCHEDOBJECTCB> objects;
  std::vector<vrpn_ANGLECB> angles;
  device.register_force_change_handler(&forces, keep<vrpn_FORCECB>);
  device.register_scp_change_handler(&scps, keep<vrpn_FORCESCPCB>);
  device.register_error_handler(&errors, keep<vrpn_FORCEERRORCB>);
  device.register_dop_change_handler(&dops, keep<vrpn_DOPCB>);
  device.register_isTouching_handler(&touchings, keep<vrpn_ISTOUCHINGCB>);
  device.register_touchedObject_handler(&objects, keep<vrpn_TOUCHEDOBJECTCB>);
  device.register_angle_handler(&angles, keep<vrpn_ANGLECB>);
  ASSERT_TRUE(ready(device));
  server_.send(wire::Force{{1, 2, 3}});
  server_.send(wire::Scp{{4, 5, 6}, {0.1, 0.2, 0.3, 0.9}});
  server_.send(wire::ForceError{FD_DUTY_CYCLE_ERROR});
  server_.send(wire::Dop{0.001});
  server_.send(wire::IsTouching{1});
  server_.send(wire::TouchedObject{3});
  server_.send(wire::Angle{30, 1});
  ASSERT_TRUE(runUntil(device, [&] {
    return !forces.empty() && !scps.empty() && !errors.empty() && !dops.empty() && !touchings.empty() &&
           !objects.empty() && !angles.empty();
  }));
  EXPECT_EQ(forces[0].msg_time.tv_sec, 1700000000);
  EXPECT_EQ(forces[0].msg_time.tv_usec, 250000);
  EXPECT_EQ(forces[0].force[2], 3);
  EXPECT_EQ(scps[0].pos[1], 5);
  EXPECT_EQ(scps[0].quat[3], 0.9);
  EXPECT_EQ(errors[0].error_code, FD_DUTY_CYCLE_ERROR);
  EXPECT_EQ(dops[0].dop, 0.001);
  EXPECT_EQ(touchings[0].isTouching, 1);
  EXPECT_EQ(objects[0].ObjectNum, 3);
  EXPECT_EQ(angles[0].angle, 30);
  EXPECT_EQ(device.unregister_force_change_handler(&forces, keep<vrpn_FORCECB>), 0);
  EXPECT_EQ(device.unregister_force_change_handler(&forces, keep<vrpn_FORCECB>), -1);
}

TEST_P(Vrpn, MalagaCallsArriveWithTheirFields) {
  vrpn_ForceDevice_Remote device(name().c_str());
  wire::F64x16 m{};
  for (std::size_t i = 0; i < 16; ++i) m[i] = static_cast<double>(i);
  const vrpn_float64 box[6] = {1, 2, 3, 4, 5, 6};
  const vrpn_float64 position[3] = {1, 2, 3};
  const vrpn_float64 direction[3] = {4, 5, 6};
  char spring[20] = "spring";
  device.setObjectNumber(2);
  device.setTransformMatrix(1, m.data());
  device.setHapticProperty(1, "static friction", 0.5F);
  device.setTouchableFace();
  device.setWorkspaceBoundingBox(m.data(), box);
  device.setWorkspaceProjectionMatrix(m.data(), m.data());
  device.setEffect(spring, 2, 1, 2, 3, 4, position, direction);
  device.startEffect(2);
  device.stopEffect(2);
  device.setObjectTouchable(1, false);
  device.resetScene();
  device.mainloop();
  const auto received = server_.waitReceived(11);
  ASSERT_EQ(received.size(), 11U);
  EXPECT_TRUE(is(received[0], wire::SetObjectNumber{2}));
  EXPECT_TRUE(is(received[1], wire::SetTransformMatrix{1, m}));
  EXPECT_TRUE(is(received[2], wire::SetHapticProperty{1, "static friction", 0.5F}));
  EXPECT_TRUE(is(received[3], wire::SetTouchableFace{3}));
  EXPECT_TRUE(is(received[4], wire::SetWorkspaceBoundingBox{m, {1, 2, 3, 4, 5, 6}}));
  EXPECT_TRUE(is(received[5], wire::SetWorkspaceProjectionMatrix{m, m}));
  EXPECT_TRUE(is(received[6], wire::Effect{"spring", 2, 1, 2, 3, 4, {1, 2, 3}, {4, 5, 6}}));
  EXPECT_TRUE(is(received[7], wire::StartEffect{2}));
  EXPECT_TRUE(is(received[8], wire::StopEffect{2}));
  EXPECT_TRUE(is(received[9], wire::SetObjectIsTouchable{1, 0}));
  EXPECT_TRUE(is(received[10], wire::ResetScene{}));
  EXPECT_EQ(received[0].sender, "Phantom");
}

TEST_P(Vrpn, StockCallsArriveWithTheirFields) {
  vrpn_ForceDevice_Remote device((name()).c_str());
  vrpn_float32 three[3] = {1, 2, 3};
  vrpn_float32 axis[3] = {0, 1, 0};
  std::array<vrpn_float32, 16> m{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  vrpn_float32 parameters[2] = {7, 8};
  device.addObject(1);
  device.addObjectExScene(2);
  device.moveToParent(2, 1);
  device.setObjectPosition(1, three);
  device.setObjectOrientation(1, axis, 0.5F);
  device.setObjectScale(1, three);
  device.setNormal(4, 0, 0, 1);
  device.setTriangle(5, 0, 1, 2);
  device.removeTriangle(5);
  device.setSurfaceKspring(0.9F);
  device.setSurfaceFstatic(0.4F);
  device.setSurfaceFdynamic(0.2F);
  device.setSurfaceKdamping(0.003F);
  device.updateTrimeshChanges();
  device.setTrimeshTransform(m.data());
  device.clearTrimesh();
  device.removeObject(2);
  device.setHapticOrigin(three, axis, 1);
  device.setHapticScale(2);
  device.setSceneOrigin(three, axis, 2);
  device.useHcollide();
  device.set_plane(0, 1, 0, -0.5F);
  device.startSurface();
  device.stopSurface();
  device.setCustomEffect(3, parameters, 2);
  device.startEffect();
  device.stopEffect();
  device.mainloop();
  const auto received = server_.waitReceived(21);
  ASSERT_EQ(received.size(), 21U);
  EXPECT_TRUE(is(received[0], wire::AddObject{1, -1}));
  EXPECT_TRUE(is(received[1], wire::AddObjectExScene{2}));
  EXPECT_TRUE(is(received[2], wire::MoveToParent{2, 1}));
  EXPECT_TRUE(is(received[3], wire::SetObjectPosition{1, {1, 2, 3}}));
  EXPECT_TRUE(is(received[4], wire::SetObjectOrientation{1, {0, 1, 0}, 0.5F}));
  EXPECT_TRUE(is(received[5], wire::SetObjectScale{1, {1, 2, 3}}));
  EXPECT_TRUE(is(received[6], wire::SetNormal{0, 4, {0, 0, 1}}));
  EXPECT_TRUE(is(received[7], wire::SetTriangle{0, 5, {0, 1, 2}, {-1, -1, -1}}));
  EXPECT_TRUE(is(received[8], wire::RemoveTriangle{0, 5}));
  EXPECT_TRUE(is(received[9], wire::UpdateTrimeshChanges{0, 0.9F, 0.003F, 0.4F, 0.2F}));
  EXPECT_TRUE(is(received[10], wire::TransformTrimesh{0, m}));
  EXPECT_TRUE(is(received[11], wire::ClearTrimesh{0}));
  EXPECT_TRUE(is(received[12], wire::RemoveObject{2}));
  EXPECT_TRUE(is(received[13], wire::SetHapticOrigin{{1, 2, 3}, {0, 1, 0}, 1}));
  EXPECT_TRUE(is(received[14], wire::SetHapticScale{2}));
  EXPECT_TRUE(is(received[15], wire::SetSceneOrigin{{1, 2, 3}, {0, 1, 0}, 2}));
  EXPECT_TRUE(is(received[16], wire::SetTrimeshType{-1, 1}));
  EXPECT_TRUE(is(received[17], wire::Plane{{0, 1, 0, -0.5F}, 0.9F, 0.003F, 0.2F, 0.4F, 0, 1}));
  EXPECT_TRUE(is(received[18], wire::Plane{{0, 0, 0, 0}, 0.9F, 0.003F, 0.2F, 0.4F, 0, 1}));
  EXPECT_TRUE(is(received[19], wire::CustomEffect{3, {{7, 8}}}));
  EXPECT_TRUE(is(received[20], wire::CustomEffect{wire::kStopCustomEffect, {}}));
}

TEST_P(Vrpn, ConstraintsAreForceFields) {
  vrpn_ForceDevice_Remote device(name().c_str());
  vrpn_float32 point[3] = {1, 2, 3};
  vrpn_float32 up[3] = {0, 2, 0};
  device.setConstraintKSpring(100);
  device.setConstraintLinePoint(point);
  device.setConstraintLineDirection(up);
  device.setConstraintPlanePoint(point);
  device.setConstraintPlaneNormal(up);
  device.setConstraintMode(vrpn_ForceDevice::LINE_CONSTRAINT);
  device.enableConstraint(1);
  device.setConstraintMode(vrpn_ForceDevice::PLANE_CONSTRAINT);
  device.enableConstraint(0);
  device.enableConstraint(1);
  device.setConstraintMode(vrpn_ForceDevice::NO_CONSTRAINT);
  device.mainloop();
  const auto received = server_.waitReceived(5);
  ASSERT_EQ(received.size(), 5U);
  EXPECT_TRUE(is(received[4], wire::ForceField{})) << "no constraint";
  EXPECT_TRUE(
      is(received[0], wire::ForceField{{1, 2, 3}, {0, 0, 0}, {-100, 0, 0, 0, 0, 0, 0, 0, -100}, 100}));
  EXPECT_TRUE(is(received[1], wire::ForceField{{1, 2, 3}, {0, 0, 0}, {0, 0, 0, 0, -100, 0, 0, 0, 0}, 100}));
  EXPECT_TRUE(is(received[2], wire::ForceField{}));
}

TEST_P(Vrpn, DevicesOfOneServerShareItsConnection) {
  {
    vrpn_Tracker_Remote tracker(name().c_str());
    vrpn_Button_Remote button(name().c_str());
    vrpn_Analog_Remote analog(name().c_str());
    vrpn_Text_Receiver text(name().c_str());
    EXPECT_EQ(tracker.connectionPtr(), button.connectionPtr());
    std::vector<vrpn_TRACKERCB> all;
    std::vector<vrpn_TRACKERCB> second;
    std::vector<vrpn_TRACKERVELCB> velocities;
    std::vector<vrpn_TRACKERWORKSPACECB> workspaces;
    std::vector<vrpn_BUTTONCB> buttons;
    std::vector<vrpn_BUTTONSTATESCB> states;
    std::vector<vrpn_ANALOGCB> analogs;
    std::vector<vrpn_TEXTCB> texts;
    tracker.register_change_handler(&all, keep<vrpn_TRACKERCB>);
    tracker.register_change_handler(&second, keep<vrpn_TRACKERCB>, 1);
    tracker.register_change_handler(&velocities, keep<vrpn_TRACKERVELCB>);
    tracker.register_change_handler(&workspaces, keep<vrpn_TRACKERWORKSPACECB>);
    button.register_change_handler(&buttons, keep<vrpn_BUTTONCB>);
    button.register_states_handler(&states, keep<vrpn_BUTTONSTATESCB>);
    analog.register_change_handler(&analogs, keep<vrpn_ANALOGCB>);
    text.register_message_handler(&texts, keep<vrpn_TEXTCB>);
    ASSERT_TRUE(ready(tracker));
    tracker.request_t2r_xform();
    tracker.request_u2s_xform();
    tracker.request_workspace();
    tracker.set_update_rate(250);
    tracker.reset_origin();
    button.set_toggle(2, VRPN_BUTTON_ON);
    button.set_all_momentary();
    tracker.mainloop();
    const auto received = server_.waitReceived(7);
    ASSERT_EQ(received.size(), 7U);
    EXPECT_TRUE(is(received[0], wire::TrackerRequestToRoom{}));
    EXPECT_TRUE(is(received[2], wire::TrackerRequestWorkspace{}));
    EXPECT_TRUE(is(received[3], wire::TrackerSetUpdateRate{250}));
    EXPECT_TRUE(is(received[5], wire::ButtonAdmin{2, 21}));
    EXPECT_TRUE(is(received[6], wire::ButtonAdmin{-99, 10}));

    server_.send(wire::TrackerPosQuat{0, 0, {1, 2, 3}, {0, 0, 0, 1}});
    server_.send(wire::TrackerPosQuat{1, 1, {4, 5, 6}, {0, 0, 0, 1}});
    server_.send(wire::TrackerVelocity{0, 0, {1, 0, 0}, {0, 0, 0, 1}, 0.5});
    server_.send(wire::TrackerWorkspace{{-1, -1, -1}, {1, 1, 1}});
    server_.send(wire::ButtonChange{1, 1});
    server_.send(wire::ButtonStates{{{0, 1}}});
    server_.send(wire::AnalogChannels{{{0.5, 1.5}}});
    server_.send(wire::Text{1, 2, "careful"});
    ASSERT_TRUE(runUntil(tracker, [&] {
      return all.size() == 2 && !velocities.empty() && !workspaces.empty() && !buttons.empty() &&
             !states.empty() && !analogs.empty() && !texts.empty();
    }));
    ASSERT_EQ(second.size(), 1U);
    EXPECT_EQ(second[0].pos[0], 4);
    EXPECT_EQ(velocities[0].vel_quat_dt, 0.5);
    EXPECT_EQ(workspaces[0].workspace_max[2], 1);
    EXPECT_EQ(buttons[0].button, 1);
    EXPECT_EQ(states[0].num_buttons, 2);
    EXPECT_EQ(analogs[0].num_channel, 2);
    EXPECT_EQ(analog.getNumChannels(), 2);
    EXPECT_STREQ(texts[0].message, "careful");
    EXPECT_EQ(texts[0].type, vrpn_TEXT_WARNING);
    EXPECT_EQ(server_.connections(), 1U);
  }
  // The connection was deleted with its last device: the next device opens another.
  vrpn_Tracker_Remote again(name().c_str());
  EXPECT_TRUE(runUntil(again, [&] { return server_.connections() == 2; }));
}

int VRPN_CALLBACK deleteTracker(void* tracker, vrpn_HANDLERPARAM) {
  delete std::exchange(*static_cast<vrpn_Tracker_Remote**>(tracker), nullptr);
  return 0;
}

TEST_P(Vrpn, TheConnectionOfADeviceThatAHandlerDeletesIsClosed) {
  auto* tracker = new vrpn_Tracker_Remote(name().c_str());
  vrpn_Connection* connection = tracker->connectionPtr();
  ASSERT_TRUE(ready(*tracker));
  connection->register_handler(connection->register_message_type("vrpn_Base text_message"), deleteTracker,
                               &tracker);
  server_.send(wire::Text{1, 2, "the end"});
  ASSERT_TRUE(runUntil(*connection, [&] { return tracker == nullptr; }));
  EXPECT_FALSE(connection->doing_okay());
  vrpn_Tracker_Remote again(name().c_str());
  EXPECT_TRUE(runUntil(again, [&] { return server_.connections() == 2; }));
}

int VRPN_CALLBACK throwTheirName(void*, vrpn_HANDLERPARAM) {
  throw std::runtime_error("a handler");
}

TEST_P(Vrpn, TheConnectionOfADeletedDeviceIsClosedAlsoWhenAHandlerThrew) {
  auto tracker = std::make_unique<vrpn_Tracker_Remote>(name().c_str());
  ASSERT_TRUE(ready(*tracker));
  vrpn_Connection* connection = tracker->connectionPtr();
  connection->register_handler(connection->register_message_type("vrpn_Base text_message"), throwTheirName,
                               nullptr);
  server_.send(wire::Text{1, 2, "throw"});
  EXPECT_THROW(runUntil(*tracker, [] { return false; }), std::runtime_error);
  tracker.reset();
  vrpn_Tracker_Remote again(name().c_str());
  EXPECT_TRUE(runUntil(again, [&] { return server_.connections() == 2; }));
}

TEST_P(Vrpn, TheConnectionOfADeviceThatAHandlerDeletesIsClosedAlsoWhenAnotherThrows) {
  auto* tracker = new vrpn_Tracker_Remote(name().c_str());
  vrpn_Connection* connection = tracker->connectionPtr();
  ASSERT_TRUE(ready(*tracker));
  const vrpn_int32 text = connection->register_message_type("vrpn_Base text_message");
  connection->register_handler(text, deleteTracker, &tracker);
  connection->register_handler(text, throwTheirName, nullptr);
  server_.send(wire::Text{1, 2, "the end"});
  EXPECT_THROW(runUntil(*connection, [] { return false; }), std::runtime_error);
  EXPECT_FALSE(connection->doing_okay());
}

// After all others have answered, the pings have ended.
TEST_P(Vrpn, ADeviceThatIsOpenedLaterIsPingedUntilItAnswers) {
  vrpn_Tracker_Remote tracker(name().c_str());
  ASSERT_TRUE(ready(tracker));
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(1500);
  ASSERT_TRUE(runUntil(tracker, [&] { return std::chrono::steady_clock::now() > end; }));
  const std::size_t before = server_.pings();
  vrpn_Button_Remote button(("Other" + name().substr(name().find('@'))).c_str());
  EXPECT_EQ(button.connectionPtr(), tracker.connectionPtr());
  EXPECT_TRUE(runUntil(button, [&] { return server_.pings() >= before + 2; }));
}

constexpr int kManyVertices = 90000;  // 4 MiB: more than the system takes

TEST_P(Vrpn, WhatADeviceSentArrivesAlthoughItEnds) {
  {
    vrpn_ForceDevice_Remote device(name().c_str());
    ASSERT_TRUE(ready(device));
    server_.stopReading();
    for (int i = 0; i < kManyVertices; ++i) device.setVertex(i, 1, 2, 3);
    server_.startReading();
  }
  EXPECT_EQ(server_.waitVertices(kManyVertices).size(), static_cast<std::size_t>(kManyVertices));
}

// Other clients wait longer for a server that receives nothing, see WhatWasSentArrivesAlthoughTheClientEnds.
TEST_P(Vrpn, ADeviceDoesNotWaitLongForAServerThatIsStopped) {
  auto device = std::make_unique<vrpn_ForceDevice_Remote>(name().c_str());
  ASSERT_TRUE(ready(*device));
  server_.stopReading();
  for (int i = 0; i < kManyVertices; ++i) device->setVertex(i, 1, 2, 3);
  const auto start = std::chrono::steady_clock::now();
  device.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(8));
}

TEST(VrpnNames, ADeviceWhoseNameIsRefusedHearsNobody) {
  vrpn_Connection* loopback = vrpn_create_server_connection("loopback:");
  const std::string tooLong(200, 'x');
  vrpn_Tracker_Remote nobody(tooLong.c_str(), loopback);
  EXPECT_EQ(nobody.connectionPtr(), nullptr);
  int poses = 0;
  nobody.register_change_handler(&poses,
                                 [](void* count, const vrpn_TRACKERCB) { ++*static_cast<int*>(count); });
  vrpn_Tracker_Server tracker("Tracker", loopback);
  const vrpn_float64 at[3] = {1, 2, 3};
  const vrpn_float64 turned[4] = {0, 0, 0, 1};
  tracker.report_pose(0, loopback->get_time(), at, turned);
  nobody.mainloop();
  EXPECT_EQ(poses, 0);
  loopback->removeReference();
}

TEST(VrpnNames, ACustomEffectThatIsTooLongIsNotSent) {
  vrpn_Connection* loopback = vrpn_create_server_connection("loopback:");
  {
    vrpn_ForceDevice_Remote device("Phantom", loopback);
    std::vector<vrpn_float32> parameters(20000);
    device.setCustomEffect(0, parameters.data(), static_cast<vrpn_uint32>(parameters.size()));
    EXPECT_NO_THROW(device.startEffect());
  }
  loopback->removeReference();
}

TEST_P(Vrpn, ALockOpensTheServerOfItsNameAndClosesIt) {
  const std::string server = name().substr(name().find('@') + 1);
  {
    vrpn_Mutex_Remote lock(("Lock@" + server).c_str());
    EXPECT_NE(vrpn_ConnectionManager::instance().getByName(server.c_str()), nullptr);
    EXPECT_TRUE(runUntil(lock, [&] { return server_.openConnections() == 1; }));
  }
  EXPECT_EQ(vrpn_ConnectionManager::instance().getByName(server.c_str()), nullptr);
}

TEST_P(Vrpn, DialsOfOtherServersAreReported) {
  vrpn_Dial_Remote dial(name().c_str());
  std::vector<vrpn_DIALCB> turns;
  EXPECT_EQ(dial.register_change_handler(nullptr, keep<vrpn_DIALCB>), 0);
  EXPECT_EQ(dial.unregister_change_handler(nullptr, keep<vrpn_DIALCB>), 0);
  dial.register_change_handler(&turns, keep<vrpn_DIALCB>);
  ASSERT_TRUE(ready(dial));
  char buffer[12];
  char* insert = buffer;
  vrpn_int32 left = sizeof buffer;
  vrpn_buffer(&insert, &left, -0.25);
  vrpn_buffer(&insert, &left, vrpn_int32{3});
  server_.sendOther("vrpn_Dial update", std::string(buffer, 8));  // too short
  server_.sendOther("vrpn_Dial update", std::string(buffer, 12));
  ASSERT_TRUE(runUntil(dial, [&] { return !turns.empty(); }));
  EXPECT_EQ(turns[0].dial, 3);
  EXPECT_EQ(turns[0].change, -0.25);
}

int VRPN_CALLBACK countMessage(void* counter, vrpn_HANDLERPARAM) {
  ++*static_cast<int*>(counter);
  return 0;
}

int VRPN_CALLBACK keepNumber(void* number, vrpn_HANDLERPARAM p) {
  const char* buffer = p.buffer;
  return vrpn_unbuffer(&buffer, static_cast<vrpn_int32*>(number));
}

TEST_P(Vrpn, ProgramsMayHandleMessagesThemselves) {
  vrpn_Connection* connection = vrpn_get_connection_by_name(name().c_str());
  const vrpn_int32 sender = connection->register_sender("Phantom");
  const vrpn_int32 type = connection->register_message_type("vrpn_ForceDevice TouchedObject");
  EXPECT_STREQ(connection->sender_name(sender), "Phantom");
  EXPECT_STREQ(connection->message_type_name(type), "vrpn_ForceDevice TouchedObject");
  EXPECT_EQ(connection->sender_name(1999), nullptr);
  int connections = 0;
  vrpn_int32 object = 0;
  connection->register_handler(connection->register_message_type(vrpn_got_connection), countMessage,
                               &connections);
  connection->register_handler(type, keepNumber, &object, sender);
  ASSERT_TRUE(runUntil(*connection, [&] { return connections == 1; }));
  // Send repeatedly: the server may learn of the connection after the client.
  ASSERT_TRUE(runUntil(*connection, [&] {
    server_.send(wire::TouchedObject{11});
    return object == 11;
  }));

  char buffer[64];
  char* insert = buffer;
  vrpn_int32 left = sizeof buffer;
  vrpn_buffer(&insert, &left, vrpn_int32{4});
  timeval now;
  vrpn_gettimeofday(&now, nullptr);
  const vrpn_int32 start = connection->register_message_type("vrpn_ForceDevice startEffect");
  EXPECT_EQ(connection->pack_message(4, now, start, sender, buffer, vrpn_CONNECTION_RELIABLE), 0);
  EXPECT_EQ(connection->pack_message(4, now, 1900, sender, buffer, vrpn_CONNECTION_RELIABLE), -1);
  connection->send_pending_reports();
  const auto received = server_.waitReceived(1);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_TRUE(is(received[0], wire::StartEffect{4}));

  int dropped = 0;
  connection->register_handler(connection->register_message_type(vrpn_dropped_connection), countMessage,
                               &dropped);
  server_.dropClients();
  ASSERT_TRUE(runUntil(*connection, [&] { return dropped == 1 && connections == 2; }));
  connection->removeReference();
}

TEST_P(Vrpn, ProgramsHearTheirOwnMessages) {
  vrpn_Tracker_Remote device(name().c_str());
  vrpn_Connection* connection = device.connectionPtr();
  const vrpn_int32 type = connection->register_message_type("a type of the program");
  const vrpn_int32 sender = connection->register_sender("Phantom");
  int messages = 0;
  connection->register_handler(type, countMessage, &messages);
  EXPECT_EQ(connection->pack_message(0, {}, type, sender, nullptr, vrpn_CONNECTION_RELIABLE), 0);
  EXPECT_EQ(messages, 1);
  connection->register_handler(type, throwTheirName, nullptr);
  EXPECT_THROW(connection->pack_message(0, {}, type, sender, nullptr, vrpn_CONNECTION_RELIABLE),
               std::runtime_error);
}

struct Leaver {
  vrpn_ForceDevice_Remote* device;
  int calls = 0;
};
void VRPN_CALLBACK leave(void* self, const vrpn_FORCECB) {
  auto* leaver = static_cast<Leaver*>(self);
  ++leaver->calls;
  leaver->device->unregister_force_change_handler(self, leave);
}

TEST_P(Vrpn, HandlersMayUnregisterThemselves) {
  vrpn_ForceDevice_Remote device(name().c_str());
  Leaver leaver{&device};
  std::vector<vrpn_FORCECB> forces;
  device.register_force_change_handler(&leaver, leave);
  device.register_force_change_handler(&forces, keep<vrpn_FORCECB>);
  ASSERT_TRUE(ready(device));
  server_.send(wire::Force{});
  server_.send(wire::Force{});
  ASSERT_TRUE(runUntil(device, [&] { return forces.size() == 2; }));
  EXPECT_EQ(leaver.calls, 1);
}

// Servers of this project have no posers, so the requests are seen where the library would send them.
class Requests : public vrpn_Connection {
 public:
  Requests() : vrpn_Connection("tcp://127.0.0.1:1") {}
  int pack_message(vrpn_uint32 length, timeval, vrpn_int32 type, vrpn_int32, const char* payload,
                   vrpn_uint32 service) override {
    sent.push_back({message_type_name(type), std::string(payload, length)});
    reliable = (service & vrpn_CONNECTION_RELIABLE) != 0;
    return 0;
  }
  struct Sent {
    std::string type, payload;
    double number(std::size_t index) const {
      const char* at = payload.data() + 8 * index;
      return vrpn_unbuffer<vrpn_float64>(at);
    }
  };
  std::vector<Sent> sent;
  bool reliable = false;
};

TEST(VrpnRequests, PosersAskForPosesAndVelocities) {
  Requests requests;
  {
    vrpn_Poser_Remote poser("Arm", &requests);
    const vrpn_float64 position[3] = {1, 2, 3};
    const vrpn_float64 turn[4] = {0, 0, 0, 1};
    const timeval now{};
    EXPECT_EQ(poser.request_pose(now, position, turn), 1);
    EXPECT_EQ(poser.request_pose_velocity_relative(now, position, turn, 0.5), 1);
  }
  ASSERT_EQ(requests.sent.size(), 2U);
  EXPECT_EQ(requests.sent[0].type, "vrpn_Poser Request Pos_Quat");
  EXPECT_EQ(requests.sent[0].payload.size(), 56U);
  EXPECT_EQ(requests.sent[0].number(1), 2);
  EXPECT_EQ(requests.sent[0].number(6), 1);
  EXPECT_EQ(requests.sent[1].type, "vrpn_Poser Request Relative Velocity");
  EXPECT_EQ(requests.sent[1].payload.size(), 64U);
  EXPECT_EQ(requests.sent[1].number(7), 0.5);
  EXPECT_FALSE(requests.reliable) << "as VRPN sends them";
}

TEST(VrpnRequests, AnalogOutputsAskForValues) {
  Requests requests;
  {
    vrpn_Analog_Output_Remote output("Out", &requests);
    vrpn_float64 values[2] = {0.25, -4};
    EXPECT_EQ(output.getNumChannels(), 0);
    EXPECT_TRUE(output.request_change_channel_value(3, 1.5));
    EXPECT_TRUE(output.request_change_channels(2, values));
    EXPECT_FALSE(output.request_change_channels(vrpn_CHANNEL_MAX + 1, values));
  }
  ASSERT_EQ(requests.sent.size(), 2U);
  EXPECT_EQ(requests.sent[0].type, "vrpn_Analog_Output Change_request");
  const char* at = requests.sent[0].payload.data();
  EXPECT_EQ(vrpn_unbuffer<vrpn_int32>(at), 3);
  EXPECT_EQ(requests.sent[0].number(1), 1.5);
  EXPECT_EQ(requests.sent[1].payload.size(), 24U);
  EXPECT_EQ(requests.sent[1].number(2), -4);
}

TEST_P(Vrpn, AnalogOutputsLearnTheirNumberOfChannels) {
  vrpn_Analog_Output_Remote output(name().c_str());
  ASSERT_TRUE(ready(output));
  server_.sendOther("vrpn_Analog_Output Num_Channels_report", std::string("\0\0\0\x05", 4));
  EXPECT_TRUE(runUntil(output, [&] { return output.getNumChannels() == 5; }));
}

class Speaker : public vrpn_Tracker_Remote {
 public:
  using vrpn_Tracker_Remote::vrpn_Tracker_Remote;
  void say(const char* text) { send_text_message(vrpn_TEXT_WARNING)(text); }
  static std::string throughBuffer(const char* text) {
    char buffer[2 * sizeof(vrpn_uint32) + vrpn_MAX_TEXT_LEN];
    char out[vrpn_MAX_TEXT_LEN] = {};
    vrpn_TEXT_SEVERITY severity = vrpn_TEXT_NORMAL;
    vrpn_uint32 level = 0;
    EXPECT_EQ(encode_text_message_to_buffer(buffer, vrpn_TEXT_ERROR, 7, text), 0);
    EXPECT_EQ(decode_text_message_from_buffer(out, &severity, &level, buffer), 0);
    EXPECT_EQ(severity, vrpn_TEXT_ERROR);
    EXPECT_EQ(level, 7U);
    return out;
  }
};

TEST_P(Vrpn, DerivedDevicesSendTextsOfASeverity) {
  Speaker speaker(name().c_str());
  ASSERT_TRUE(ready(speaker));
  speaker.say("hot");
  speaker.mainloop();
  const auto received = server_.waitReceived(1);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_TRUE(is(received[0], wire::Text{wire::kTextWarning, 0, std::string("hot")}));
  EXPECT_EQ(Speaker::throughBuffer("cold"), "cold");
}

TEST(VrpnNames, AreTakenApart) {
  const auto text = [](char* owned) {
    const std::string copy(owned);
    delete[] owned;
    return copy;
  };
  EXPECT_EQ(text(vrpn_copy_machine_name("b:3")), "b");
  EXPECT_EQ(text(vrpn_copy_machine_name("Phantom@tcp://lab7:3884")), "lab7");
  EXPECT_EQ(text(vrpn_copy_machine_name("tcp:lab7")), "lab7");
  EXPECT_EQ(vrpn_get_port_number("Phantom@tcp://lab7:3884"), 3884);
  EXPECT_EQ(vrpn_get_port_number("Phantom@tcp://lab7"), vrpn_DEFAULT_LISTEN_PORT_NO);
  EXPECT_EQ(text(vrpn_copy_file_name("Phantom@file:///tmp/x.vrpn")), "/tmp/x.vrpn");
  EXPECT_EQ(text(vrpn_copy_file_name("file:x")), "x");
  EXPECT_EQ(vrpn_copy_file_name("Phantom@lab7"), nullptr);
  EXPECT_EQ(text(vrpn_set_service_name("Phantom@lab7:1", "Other")), "Other@lab7:1");
}

TEST(VrpnNames, CookiesAreCompared) {
  char cookie[32];
  ASSERT_EQ(write_vrpn_cookie(cookie, sizeof cookie, vrpn_LOG_OUTGOING), 0);
  EXPECT_STREQ(cookie, "vrpn: ver. 07.38  2");
  EXPECT_EQ(write_vrpn_cookie(cookie, vrpn_cookie_size(), 0), -1);
  EXPECT_EQ(check_vrpn_cookie(cookie), 0);
  EXPECT_EQ(check_vrpn_cookie("vrpn: ver. 07.34  0"), 1);
  EXPECT_EQ(check_vrpn_cookie("vrpn: ver. 08.00  0"), -1);
}

TEST(VrpnConnection, CommandsThatDoNotFitBeforeTheFirstConnectionArePrintedOnce) {
  vrpn_ForceDevice_Remote device("Phantom@tcp://127.0.0.1:1");
  vrpn_Connection* connection = device.connectionPtr();
  ::testing::internal::CaptureStderr();
  for (int i = 0; i < 100000; ++i) device.setVertex(i, 1, 2, 3);  // 4.8 MB, more than the link keeps
  EXPECT_EQ(connection->pack_message(0, {}, 0, connection->register_sender("Phantom"), nullptr,
                                     vrpn_CONNECTION_RELIABLE),
            -1);
  const std::string printed = ::testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(printed.begin(), printed.end(), '\n'), 1) << printed.substr(0, 1000);
  EXPECT_NE(printed.find("bytes wait to be sent"), std::string::npos);
}

TEST(VrpnConnection, AnUnknownHostIsNotOkay) {
  vrpn_Connection* connection = vrpn_get_connection_by_name("Phantom@nowhere.invalid");
  ASSERT_NE(connection, nullptr);
  EXPECT_FALSE(connection->doing_okay());
  EXPECT_FALSE(connection->connected());
  EXPECT_EQ(connection->mainloop(), -1);
  EXPECT_EQ(connection->register_sender("x"), -1);
  connection->removeReference();
}

}  // namespace
}  // namespace hapticd
