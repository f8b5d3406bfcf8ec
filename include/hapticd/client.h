// The client of a haptics server: hapticd's own, or any other that speaks VRPN.
//
//   hapticd::Client client("Phantom@localhost");               // connects, or throws and says why
//   client.setSurface(0, {.stiffness = 0.8F});
//   client.uploadMesh(0, {vertices, triangles});
//   client.onForce([](const hapticd::ForceReport& r) { std::cout << r.force_N[1] << " N\n"; });
//   while (true) client.poll(100ms);                           // sleeps, sends, receives, calls back
//
// A client belongs to one thread and starts none. Callbacks come only from poll() and runFor(), in the order
// of arrival; an exception they throw leaves poll(). They may call the client, but not destroy it.
//
// Commands are collected and leave with the next poll(), flush() or when there are 64 KiB of them; a command
// waits (asleep) while a slow server has more than ClientOptions::queue_limit bytes ahead of it. What is
// commanded before the first connection is kept for it. What is commanded while a connection is lost is
// dropped and counted: a server that restarted has an empty scene, so rebuild it when onConnection() says
// connected.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "hapticd/error.h"
#include "hapticd/extensions.h"
#include "hapticd/reports.h"
#include "hapticd/scene.h"
#include "hapticd/statistics.h"

namespace hapticd {

struct ClientOptions {
  /// How long the constructor tries to connect before it throws; 0: it does not wait.
  std::chrono::milliseconds connect_timeout{3000};
  /// Whether to connect again, for ever, when a connection ends.
  bool reconnect = true;
  /// How long the server may take nothing of what is sent.
  std::chrono::milliseconds send_timeout{10000};
  /// Bytes that may wait to be sent before commands wait themselves.
  std::size_t queue_limit = 4 * 1024 * 1024;
  /// Throw ServerError from poll() for each text of severity error, after the callbacks.
  bool throw_on_error = false;
};

/// Bytes of an upload that were handed to the system, of all it has.
struct UploadProgress {
  std::uint64_t bytes_sent = 0;
  std::uint64_t bytes_total = 0;
};

class Client {
 public:
  using Duration = std::chrono::nanoseconds;
  template <class Report>
  using Callback = std::function<void(const Report&)>;

  /// Opens NAME@host, NAME@host:port (VRPN's default: requests by UDP, called back by TCP, fast reports by
  /// UDP) or NAME@tcp://host:port (one TCP connection, passes most firewalls). The port is 3883 if not given.
  /// Throws std::invalid_argument for another form and ConnectError when there is no such server or device.
  explicit Client(std::string_view device, const ClientOptions& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// Sends what waits, sleeps up to the timeout until something arrives, makes the callbacks for it and
  /// returns how many messages there were. 0 does not sleep. From inside a callback it calls nobody back.
  std::size_t poll(Duration timeout);
  /// Polls for the whole duration.
  void runFor(Duration duration);
  /// Sends what waits as far as the system takes it now.
  void flush();
  /// Sends what waits until the system has all of it. Throws ConnectionLost.
  void flushAll();

  /// Whether commands reach a server now.
  bool connected() const noexcept;
  /// Waits for a connection and for an answer of the device; throws ConnectError after the timeout.
  void waitConnected(Duration timeout);
  /// NAME of the device and HOST:PORT of the server.
  const std::string& device() const noexcept;
  const std::string& server() const noexcept;
  /// The newest report of each kind.
  const LatestReports& latest() const noexcept;
  /// Counts so far.
  Statistics statistics() const;

  // --- Callbacks: each call adds one, for the life of the client.
  void onPose(Callback<PoseReport> callback);
  void onVelocity(Callback<VelocityReport> callback);
  void onAcceleration(Callback<AccelerationReport> callback);
  /// On change; also once for each button that is already down when a server connects.
  void onButton(Callback<ButtonReport> callback);
  void onAnalog(Callback<AnalogReport> callback);
  void onForce(Callback<ForceReport> callback);
  void onDepth(Callback<DepthReport> callback);
  void onContactPoint(Callback<ContactPointReport> callback);
  void onTouching(Callback<TouchingReport> callback);
  void onTouchedObject(Callback<TouchedObjectReport> callback);
  void onAngle(Callback<AngleReport> callback);
  void onForceError(Callback<ForceErrorReport> callback);
  void onText(Callback<TextReport> callback);
  void onToRoom(Callback<ToRoomReport> callback);
  void onUnitToSensor(Callback<UnitToSensorReport> callback);
  void onWorkspace(Callback<WorkspaceReport> callback);
  void onTick(Callback<TickReport> callback);
  void onContacts(Callback<ContactsReport> callback);
  void onGuard(Callback<GuardReport> callback);
  /// The first connection is reported too if it came after this call.
  void onConnection(Callback<ConnectionReport> callback);

  // --- Scene, in world units. Objects are numbered from 0; object 0 always exists.

  /// Makes the scene have at least this many objects.
  void setObjectCount(int count);
  /// Sends a mesh and returns when the system has all of it; reports progress as it goes, the last time with
  /// all bytes. A server that can gets it as bulk messages in a batch, so that the hand never feels half of
  /// it; others get three setVertex() a triangle. What an earlier mesh had more stays: resetScene() or
  /// clearMesh() first. Inside batch() it only collects, and reports no progress. Throws
  /// std::invalid_argument for a triangle outside the vertices, ConnectError and ConnectionLost.
  void uploadMesh(int object, const MeshView& mesh, const Callback<UploadProgress>& progress = {});
  /// The same for corners: three consecutive ones are a triangle.
  void uploadCorners(int object, std::span<const std::array<float, 3>> corners,
                     const Callback<UploadProgress>& progress = {});
  /// Sets one vertex of a mesh, object units; without setTriangle(), consecutive triples are triangles.
  void setVertex(int object, int vertex, float x, float y, float z);
  /// Sets vertices from number `first` on: for meshes that deform.
  void setVertices(int object, int first, std::span<const std::array<float, 3>> positions);
  /// Sets all properties of an object's surface.
  void setSurface(int object, const Surface& surface);
  /// Sets one property: "stiffness", "damping", "static friction", "dynamic friction", "popthrough", "mass".
  void setSurfaceProperty(int object, std::string_view property, float value);
  /// Places an object; at any time and as often as wanted, the hand feels it move.
  void setTransform(int object, const Matrix4& T_world_object);
  /// Starts or stops rendering an object.
  void setTouchable(int object, bool touchable);
  /// Chooses for all objects which sides are felt; both at first.
  void setTouchableFaces(Faces faces);
  /// Fits the device's workspace to a box of the world, seen through a model matrix.
  void setWorkspaceBox(const Box& box, const Matrix4& model = kIdentity);
  /// Fits the device's workspace to what a camera sees.
  void setWorkspaceProjection(const Matrix4& model, const Matrix4& projection);
  /// Defines or redefines an effect; a running one changes in place.
  void setEffect(int index, const Effect& effect);
  void startEffect(int index);
  void stopEffect(int index);
  /// Puts workspace, objects and effects back to the beginning.
  void resetScene();

  // --- What servers of this project can do beyond VRPN. Where a call says nothing else: it throws
  // Unsupported when the connected server or its device cannot, and may wait for the server's answer to that
  // question.

  /// What the server and its device can do: asked on every connection. Nothing while there is no connection,
  /// no answer yet, or for a server of another make. Does not wait.
  std::optional<Capabilities> capabilities() const;
  /// The same, when the server has answered. Throws ConnectError. Never Unsupported.
  std::optional<Capabilities> waitCapabilities();
  /// Calls the function and makes all that it commanded visible in one tick. It is collected here and sent
  /// when the function returns: nothing is sent when it throws (the exception goes on to the caller) or when
  /// the connection ends meanwhile (ConnectionLost). A batch holds at most 256 MiB (std::length_error).
  /// Batches do not nest (std::logic_error).
  void batch(const std::function<void()>& commands);
  /// Chooses the reports of this client and how many a second at most; 0 keeps the rate. It replaces what was
  /// chosen before, and is sent again on every new connection. std::invalid_argument for a rate that is none.
  void subscribe(Reports kinds, double rate_Hz = 0);
  /// Brings the force of the device to zero within one tick, until rearmForces(). Leaves at once, ahead of
  /// whatever is collected, even inside batch(). ConnectionLost when there is no connection.
  void stopForces();
  /// Ends a stop and clears what the guard has latched; forces come back over half a second.
  void rearmForces();
  /// From now on the server takes this client for lost, ends its effects and its connection, when it hears no
  /// heartbeat for 500 ms. Heartbeats leave ten times a second while the client polls or waits: a program
  /// that hangs, or does not poll for 500 ms, is lost, which is the point. Holds for every new connection.
  void enableHeartbeat(bool enable = true);
  /// Takes the simulated hand, and moves it to the pose. It follows as a hand would, and surfaces push back;
  /// call it as often as the hand should move. One client holds the hand at a time: others get a text.
  void holdHand(const HandPose& pose);
  /// Lets go of the simulated hand, as does leaving.
  void releaseHand();

  // --- Stock VRPN scene, in metres; the first of these calls that names an object makes it one in metres.
  void addObject(int object, int parent = -1);
  void addObjectOutsideScene(int object);
  void moveToParent(int object, int parent);
  void removeObject(int object);
  void setObjectPosition(int object, const std::array<float, 3>& position_m);
  void setObjectOrientation(int object, const std::array<float, 3>& axis, float angle_rad);
  void setObjectScale(int object, const std::array<float, 3>& scale);
  void setNormal(int object, int normal, float x, float y, float z);
  /// Vertex numbers, and normal numbers or -1.
  void setTriangle(int object, int triangle, const std::array<std::int32_t, 3>& vertices,
                   const std::array<std::int32_t, 3>& normals = {-1, -1, -1});
  void removeTriangle(int object, int triangle);
  /// Makes edits felt, with a stock surface: stiffness 1 is 1000 N/m, damping 0.005 is 5 N s/m.
  void updateMesh(int object, const Surface& surface);
  /// Moves the vertices by a row-major matrix (translation in 3, 7 and 11).
  void transformMesh(int object, const std::array<float, 16>& row_major);
  /// Chooses a rendering library of old servers: 0 Ghost, 1 Hcollide.
  void setMeshType(int object, int type);
  void clearMesh(int object);
  void setHapticOrigin(const std::array<float, 3>& position_m, const std::array<float, 3>& axis,
                       float angle_rad);
  void setHapticScale(float scale);
  void setSceneOrigin(const std::array<float, 3>& position_m, const std::array<float, 3>& axis,
                      float angle_rad);

  // --- Stock VRPN forces, in metres.

  /// Starts or changes the plane.
  void setPlane(const Plane& plane);
  void setPlaneTexture(const PlaneTexture& texture);
  void stopPlane(std::int32_t index = 0);
  void setForceField(const ForceField& field);
  void stopForceField();
  /// Holds the device to a point, a line or a plane by a spring, until released.
  void constrainToPoint(const std::array<float, 3>& point_m, float stiffness_N_per_m);
  void constrainToLine(const std::array<float, 3>& point_m, const std::array<float, 3>& direction,
                       float stiffness_N_per_m);
  void constrainToPlane(const std::array<float, 3>& point_m, const std::array<float, 3>& normal,
                        float stiffness_N_per_m);
  void releaseConstraint();
  /// Starts an effect the device driver knows by number.
  void startCustomEffect(std::uint32_t effect, std::span<const float> parameters);
  void stopCustomEffect();

  // --- Tracker and buttons.
  void requestToRoom();
  void requestUnitToSensor();
  void requestWorkspace();
  void setUpdateRate(double rate_Hz);
  void resetOrigin();
  /// Makes a button momentary or a toggle; -99 means all.
  void setButtonMode(int button, ButtonMode mode);
  static constexpr int kAllButtons = -99;
  /// Says something to the server's log.
  void sendText(std::string_view text, Severity severity = Severity::normal);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd
