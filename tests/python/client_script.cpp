// Calls every command of the client once, in the order of python/tests/test_transcript.py:
//   client_script NAME@HOST:PORT
// Prints median and 99th percentile of so many round trips, in microseconds (bench/python_package.py):
//   client_script NAME@HOST:PORT COUNT
#include <algorithm>
#include <chrono>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "hapticd/client.h"

namespace {

using namespace hapticd;

void scene(Client& client, const Matrix4& m) {
  client.setObjectCount(3);
  client.setVertex(1, 2, 0.5F, -1.5F, 2.5F);
  client.setVertices(1, 4, std::array<std::array<float, 3>, 2>{{{1, 2, 3}, {4, 5, 6}}});
  client.setSurface(1, {0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F});
  client.setSurfaceProperty(2, "stiffness", 0.7F);
  client.setTransform(2, m);
  client.setTouchable(2, false);
  client.setTouchableFaces(Faces::back);
  client.setWorkspaceBox({{1, 2, 3}, {4, 5, 6}}, m);
  client.setWorkspaceProjection(kIdentity, m);
  client.setEffect(0, Effect::constant({0, 1, 0}, 2, 100));
  client.setEffect(1, Effect::spring({1, 2, 3}, 0.5, 2, 100));
  client.setEffect(2, Effect::viscous(0.01, 1, 5));
  client.setEffect(3, Effect::friction(0.5, 1));
  client.setEffect(4, Effect::motorVibration(80, 0.5));
  client.setEffect(5, Effect::contactVibration(400, 0.25));
  client.startEffect(4);
  client.stopEffect(4);
  client.resetScene();
}

void stockScene(Client& client) {
  const std::array<float, 3> v{0.5F, 1.5F, -2.5F};
  std::array<float, 16> rows{};
  for (std::size_t i = 0; i < 16; ++i) rows[i] = static_cast<float>(i) + 0.25F;
  client.addObject(3, 1);
  client.addObjectOutsideScene(4);
  client.moveToParent(3, -1);
  client.setObjectPosition(3, v);
  client.setObjectOrientation(3, v, 0.75F);
  client.setObjectScale(3, v);
  client.setNormal(3, 1, 0, 1, 0);
  client.setTriangle(3, 5, {0, 1, 2});
  client.setTriangle(3, 6, {2, 1, 0}, {3, 4, 5});
  client.removeTriangle(3, 6);
  client.updateMesh(3, {0.1F, 0.002F, 0.3F, 0.4F, 0.5F, 0.6F});
  client.transformMesh(3, rows);
  client.setMeshType(3, 1);
  client.setObjectName(3, "part.stl");
  client.clearMesh(3);
  client.removeObject(3);
  client.setHapticOrigin(v, {0, 1, 0}, 0.25F);
  client.setHapticScale(2);
  client.setSceneOrigin(v, {1, 0, 0}, 0.5F);
}

void forces(Client& client) {
  client.setPlane({{0, 2, 0, 0.5F}, 0.25F, 0.002F, 0.3F, 0.2F, 3, 25});
  client.setPlaneTexture({0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F});
  client.stopPlane(3);
  client.setForceField({{1, 2, 3}, {4, 5, 6}, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 0.5F});
  client.stopForceField();
  client.constrainToPoint({1, 2, 3}, 100);
  client.constrainToLine({1, 2, 3}, {0, 0, 1}, 200);
  client.constrainToPlane({1, 2, 3}, {0, 1, 0}, 300);
  client.releaseConstraint();
  const std::array<float, 3> parameters{1, 2, 3};
  client.startCustomEffect(7, parameters);
  client.stopCustomEffect();
}

void extensions(Client& client) {
  const std::array<std::array<float, 3>, 4> vertices{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const std::array<std::array<std::uint32_t, 3>, 2> triangles{{{0, 1, 2}, {0, 2, 3}}};
  client.uploadMesh(1, {vertices, triangles});
  client.uploadCorners(2, std::span(vertices).first(3));
  client.batch([&] {
    client.setTouchable(1, true);
    client.setTouchable(2, false);
  });
  client.subscribe(Reports::tick | Reports::button, 250);
  client.stopForces();
  client.rearmForces();
  client.mark("trial 3 begins");
  client.enableHeartbeat();
  client.enableHeartbeat(false);
  client.holdHand({{1, 2, 3}, {0, 0, 1, 0}, 2});
  client.releaseHand();
  RemoteContact contact;
  contact.id = 7;
  contact.shape = RemoteShape::cylinder;
  contact.point_m = {1, 2, 3};
  contact.radius_m = 0.25;
  contact.axis = {1, 0, 0};
  contact.velocity_m_per_s = {4, 5, 6};
  contact.angularVelocity_rad_per_s = {7, 8, 9};
  contact.stiffness_N_per_m = 600;
  contact.damping_Ns_per_m = 0.5;
  contact.staticFriction = 0.4;
  contact.dynamicFriction = 0.3;
  contact.lifetime = std::chrono::milliseconds(50);
  contact.yields = true;
  RemoteContact plain;
  plain.id = 8;
  plain.point_m = {1, 2, 3};
  client.setRemoteContacts(std::array{contact, plain});
  client.setForce({1, 2, 3}, {4, 5, 6}, std::chrono::milliseconds(50));
}

void rest(Client& client) {
  client.requestToRoom();
  client.requestUnitToSensor();
  client.requestWorkspace();
  client.setUpdateRate(125);
  client.resetOrigin();
  client.setButtonMode(Client::kAllButtons, ButtonMode::toggleStartsOn);
  client.sendText("end of the script", Severity::warning);
}

// From a question to its answer, as the program sees it, with nothing else on the connection.
void roundTrips(Client& client, int count) {
  using Clock = std::chrono::steady_clock;
  int answers = 0;
  client.onWorkspace([&](const WorkspaceReport&) { ++answers; });
  client.subscribe(Reports::none);
  client.runFor(std::chrono::seconds(1));
  std::vector<double> times_us;
  for (int i = 0; i < count; ++i) {
    const int before = answers;
    const Clock::time_point start = Clock::now();
    client.requestWorkspace();
    while (answers == before) client.poll(std::chrono::seconds(1));
    times_us.push_back(std::chrono::duration<double, std::micro>(Clock::now() - start).count());
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  std::sort(times_us.begin(), times_us.end());
  const auto quantile = [&](double q) {
    return times_us[static_cast<std::size_t>(q * static_cast<double>(times_us.size() - 1))];
  };
  std::cout << quantile(0.5) << ' ' << quantile(0.99) << '\n';
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2 && argc != 3) return 2;
  Client client(argv[1]);
  if (argc == 3) {
    roundTrips(client, std::stoi(argv[2]));
    return 0;
  }
  Matrix4 m{};
  for (std::size_t i = 0; i < 16; ++i) m[i] = 0.5 + static_cast<double>(i);
  client.waitCapabilities();
  scene(client, m);
  stockScene(client);
  forces(client);
  extensions(client);
  rest(client);
  client.flushAll();
  return 0;
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
