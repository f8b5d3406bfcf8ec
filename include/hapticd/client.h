// The client of a haptics server: hapticd's own, or any other that speaks VRPN.
//
//   hapticd::Client client("Phantom@localhost");               // connects, or throws and says why
//   client.setSurface(0, {.stiffness = 0.8F});
//   client.uploadMesh(0, {vertices, triangles});
//   client.onForce([](const hapticd::ForceReport& r) { std::cout << r.force_N[1] << " N\n"; });
//   while (true) client.poll(100ms);                           // sleeps, sends, receives, calls back
#pragma once

#include <array>
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
#include "hapticd/export.h"
#include "hapticd/extensions.h"
#include "hapticd/remote.h"
#include "hapticd/reports.h"
#include "hapticd/scene.h"
#include "hapticd/statistics.h"
#include "hapticd/subscription.h"

namespace hapticd {

struct ClientOptions {
  /// How long the constructor waits for a connection before it throws; 0: it does not wait for one.
  std::chrono::milliseconds connectTimeout{3000};
  /// Whether to reconnect, without limit, when a connection ends.
  bool reconnect = true;
  /// How long the server may accept no data while data waits; then the connection ends with ConnectionLost.
  std::chrono::milliseconds sendTimeout{10000};
  /// Bytes that may wait to be sent; a command that would exceed them sleeps.
  std::size_t queueLimit_bytes = 4 * 1024 * 1024;
  /// poll() throws ServerError for a text of severity error, after the callbacks.
  bool throwOnError = false;
};

/// Progress of an upload: bytes that the system has accepted, of all bytes of the mesh.
struct UploadProgress {
  std::uint64_t bytesSent = 0;
  std::uint64_t bytesTotal = 0;
};

/// One device of one server.
///
/// Thread: a client belongs to one thread, and starts none but to look the name of its host up anew while it
/// has no connection. Several clients may live in several threads.
///
/// Callbacks run in poll() and runFor(), in the order of arrival. An exception that a callback throws leaves
/// poll(); the remaining reports follow in the next poll(). A callback may call the client, but not destroy
/// it.
///
/// Commands (everything below "Scene") are collected and sent by the next poll(), flush(), or when 64 KiB
/// have accumulated. Every command may therefore
/// - sleep, while more than ClientOptions::queueLimit_bytes wait for a slow server,
/// - throw ConnectionLost, when the server accepts no data for ClientOptions::sendTimeout,
///   or the connection ends during that sleep,
/// - throw ConnectError, when more than queueLimit_bytes wait for the first connection.
/// Commands before the first connection are kept for it. Commands while a later connection is lost are
/// dropped and counted (Statistics::messagesDropped): a restarted server has an empty scene, so rebuild it
/// when onConnection() reports a connection. The server checks the arguments of a command; a refusal arrives
/// as a text of severity error, see onText().
class HAPTICD_EXPORT Client {
 public:
  using Duration = std::chrono::nanoseconds;
  template <class Report>
  using Callback = std::function<void(const Report&)>;

  /// Opens NAME@host or NAME@host:port (VRPN's default: a request by UDP, a TCP connection from the server,
  /// fast reports by UDP), or NAME@tcp://host:port (one TCP connection, which passes most firewalls). The
  /// port is 3883 unless given. Throws std::invalid_argument for another form, and ConnectError when there is
  /// no such server or device within ClientOptions::connectTimeout. Before that, the system looks the host
  /// up, once; without an answer of a name server this takes as long as the system waits, 10 s by default.
  explicit Client(std::string_view device, const ClientOptions& options = {});
  /// Sends what is collected, and waits until the server has received it and ended the connection; reports
  /// that arrive meanwhile are discarded. The wait ends, too, when a server that has received everything does
  /// not answer for 1 s, or when none receives anything for ClientOptions::sendTimeout: the rest is then
  /// lost.
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// Sends what is collected, sleeps up to the timeout until something arrives, runs the callbacks for it,
  /// and returns the number of messages that arrived. A timeout of 0 does not sleep. Called from a callback,
  /// it runs no callbacks. Throws what callbacks throw, and ServerError (ClientOptions::throwOnError).
  std::size_t poll(Duration timeout);
  /// Polls for the whole duration. Throws as poll().
  void runFor(Duration duration);
  /// Sends what is collected as far as the system accepts it without waiting.
  void flush();
  /// Sends what is collected and waits until the system has accepted all of it. Throws ConnectionLost.
  void flushAll();

  /// Whether commands reach a server now.
  bool connected() const noexcept;
  /// Waits for a connection and for an answer of the device. Throws ConnectError after the timeout.
  void waitConnected(Duration timeout);
  /// NAME of the device.
  const std::string& device() const noexcept;
  /// HOST:PORT of the server.
  const std::string& server() const noexcept;
  /// The newest report of each kind; changes during poll() and runFor() only.
  const LatestReports& latest() const noexcept;
  /// Counts since the client was constructed.
  Statistics statistics() const;

  // --- Callbacks. Each call adds one callback. It stays for the life of the client unless the returned
  // Subscription is ended; discarding the Subscription does not end it, a ScopedSubscription does.

  Subscription onPose(Callback<PoseReport> callback);
  Subscription onVelocity(Callback<VelocityReport> callback);
  Subscription onAcceleration(Callback<AccelerationReport> callback);
  /// On change, and once for each button that is down when a server connects, or was released while there was
  /// no connection.
  Subscription onButton(Callback<ButtonReport> callback);
  Subscription onAnalog(Callback<AnalogReport> callback);
  Subscription onForce(Callback<ForceReport> callback);
  Subscription onDepth(Callback<DepthReport> callback);
  Subscription onContactPoint(Callback<ContactPointReport> callback);
  Subscription onTouching(Callback<TouchingReport> callback);
  Subscription onTouchedObject(Callback<TouchedObjectReport> callback);
  Subscription onAngle(Callback<AngleReport> callback);
  Subscription onForceError(Callback<ForceErrorReport> callback);
  Subscription onText(Callback<TextReport> callback);
  Subscription onToRoom(Callback<ToRoomReport> callback);
  Subscription onUnitToSensor(Callback<UnitToSensorReport> callback);
  Subscription onWorkspace(Callback<WorkspaceReport> callback);
  /// Only after subscribe(Reports::tick).
  Subscription onTick(Callback<TickReport> callback);
  /// Only after subscribe(Reports::contacts).
  Subscription onContacts(Callback<ContactsReport> callback);
  /// Only after subscribe(Reports::hand).
  Subscription onHand(Callback<HandReport> callback);
  Subscription onGuard(Callback<GuardReport> callback);
  /// Connections and losses from now on. The constructor's connection is reported by the first poll().
  Subscription onConnection(Callback<ConnectionReport> callback);

  // --- Scene, in world units. Objects are numbered from 0; object 0 always exists.

  /// Makes the scene have at least this many objects, at most 10 000. It never removes objects.
  void setObjectCount(int count);
  /// Sends a mesh and returns when the system has accepted all of it; calls `progress` meanwhile, the last
  /// time with all bytes. A server of this project receives bulk messages in a batch, so that no tick renders
  /// part of the mesh; other servers receive three setVertex() per triangle. Replaces the mesh that the
  /// object has; setVertices() changes parts of it. Inside batch() it only collects and reports no progress.
  /// Throws std::invalid_argument for a triangle with an index outside the vertices, ConnectError without a
  /// connection, and ConnectionLost.
  void uploadMesh(int object, const MeshView& mesh, const Callback<UploadProgress>& progress = {});
  /// The same for a list of corners: three consecutive ones are a triangle. Object units. Throws
  /// std::invalid_argument when their number is no multiple of three, and what uploadMesh() throws.
  void uploadCorners(int object, std::span<const std::array<float, 3>> corners,
                     const Callback<UploadProgress>& progress = {});
  /// Sets one vertex of a mesh. Object units, object frame. Without setTriangle(), consecutive triples are
  /// triangles.
  void setVertex(int object, int vertex, float x, float y, float z);
  /// Sets vertices from number `first` on, for meshes that deform. Object units, object frame.
  void setVertices(int object, int first, std::span<const std::array<float, 3>> positions);
  /// Sets all properties of an object's surface.
  void setSurface(int object, const Surface& surface);
  /// Sets one property: "stiffness", "damping", "static friction", "dynamic friction", "popthrough" (0 to 1)
  /// or "mass" (kg).
  void setSurfaceProperty(int object, std::string_view property, float value);
  /// Places an object in the world. It may be called at any rate: the hand feels the object move.
  void setTransform(int object, const Matrix4& T_world_object);
  /// Names an object for people, in the viewer and in recordings: at most 64 bytes (std::invalid_argument).
  /// Servers without extensions ignore it.
  void setObjectName(int object, std::string_view name);
  /// Starts or stops rendering an object.
  void setTouchable(int object, bool touchable);
  /// Chooses which sides of all objects are rendered; both initially.
  void setTouchableFaces(Faces faces);
  /// Fits the device's workspace to a box of the world, seen through a model matrix (world to eye).
  void setWorkspaceBox(const Box& box, const Matrix4& model = kIdentity);
  /// Fits the device's workspace to the view volume of an OpenGL camera.
  void setWorkspaceProjection(const Matrix4& model, const Matrix4& projection);
  /// Defines or redefines an effect by its number, 0 or more; a running one changes in place. At most 64
  /// effects. An effect ends when the client that set it leaves, over 250 ms.
  void setEffect(int index, const Effect& effect);
  /// Starts an effect, or restarts it.
  void startEffect(int index);
  /// Stops an effect.
  void stopEffect(int index);
  /// Resets workspace, objects and effects to the initial state.
  void resetScene();

  // --- Extensions of this project. Every call but presentToken() throws Unsupported when the connected
  // server or its device does not support it, and may wait for the server's answer to that question (at most
  // ClientOptions::connectTimeout, at least 1 s): then ConnectError without an answer, ConnectionLost when
  // the connection ends meanwhile.

  /// What the server and its device support; the client asks on every connection. Empty without a connection,
  /// before the answer, and for servers of other makes. Does not wait and does not throw.
  std::optional<Capabilities> capabilities() const;
  /// The same, after waiting for the answer. Throws ConnectError without a connection, never Unsupported.
  std::optional<Capabilities> waitCapabilities();
  /// Calls the function and makes everything that it commands take effect in one tick. The commands are
  /// collected here and sent when the function returns. Nothing is sent when it throws (the exception is
  /// passed on) or when the connection ends meanwhile (ConnectionLost). A batch holds at most 256 MiB
  /// (std::length_error). Batches do not nest (std::logic_error).
  void batch(const std::function<void()>& commands);
  /// Chooses the kinds of reports that this client receives, and the highest rate; 0 keeps the rate. It
  /// replaces the previous choice and is repeated on every new connection. Throws std::invalid_argument for a
  /// negative or infinite rate.
  void subscribe(Reports kinds, double rate_Hz = 0);
  /// Brings the force of the device to zero within one tick of its arrival, until rearmForces(). Sent at
  /// once, ahead of everything collected, even inside batch().
  ///
  /// The server executes a stop ahead of the scene commands that precede it on the same connection, as far as
  /// it reads ahead: 4 MiB. While more than 64 KiB of this connection are unsent or unacknowledged, the stop
  /// may wait behind them, so the client also opens a second TCP connection to the server, sends the stop
  /// there, waits for the server's confirmation, and closes it. Heartbeats of the first connection continue
  /// meanwhile.
  ///
  /// Throws ConnectionLost without a connection, also when the server has ended it and nothing has been
  /// polled since. Throws ConnectError when the second connection is not confirmed within
  /// ClientOptions::connectTimeout (at least 1 s), and up to 1 s later when the server does not answer its
  /// end either; the stop on the first connection then still takes effect when the server reads it.
  void stopForces();
  /// Marks a moment, such as "trial 3 begins": the server records it and reports it to all clients. At most
  /// 255 bytes (std::invalid_argument). Sends at once, before it asks whether the server knows markers.
  /// Throws ConnectionLost as stopForces().
  void mark(std::string_view text);
  /// Ends a stop and clears latched trips; the force ramps in over half a second. It keeps its place behind
  /// the commands sent before it, and never undoes a stop that is sent after it. The server refuses it, by a
  /// text that names who stopped, while a stop of another client stands, unless this one is an operator by a
  /// token or a user id. Throws ConnectionLost as stopForces().
  void rearmForces();
  /// Presents a token for a role, on every connection from now on; 16 to 128 characters
  /// (std::invalid_argument). An empty one presents none on later connections; the present one keeps its
  /// role. Without TLS, everybody on the way can read it. A refusal arrives as a text.
  void presentToken(std::string_view token);
  /// From now on the server disconnects this client and ends its effects when it receives no heartbeat for
  /// 500 ms. The client sends ten heartbeats per second while it polls or waits: a program that hangs, or
  /// does not poll for 500 ms, is disconnected. Repeated on every new connection.
  void enableHeartbeat(bool enable = true);
  /// Takes hold of the simulated hand and moves it to the pose. The hand follows with a person's dynamics,
  /// and surfaces push it back. One client holds the hand at a time; the server refuses others with a text.
  void holdHand(const HandPose& pose);
  /// Releases the simulated hand. Disconnecting releases it, too.
  void releaseHand();

  // --- Streamed state, for simulations that run in the client. Each call is sent at once, even inside
  // batch() and ahead of everything collected, by TCP: datagrams can be forged. The newest value wins; call
  // at a steady rate of 30 to 1000 Hz. Dropped without a connection. One client streams each kind to a device
  // at a time; the server refuses others with a text.

  /// Replaces this client's contacts, at most 16. The server renders them at its servo rate, moves them by
  /// their velocities, and takes over changes within 0.3 N/ms. Contacts that are not repeated end at the end
  /// of their lifetime, contacts that are absent from a later call fade out at once, all of them when the
  /// client leaves. HandReport has the force of each. Throws std::invalid_argument for more than 16.
  void setRemoteContacts(std::span<const RemoteContact> contacts);
  /// Has a force (N, world frame) held until the next call, at most for `lifetime` (10 to 100 ms). The server
  /// changes it by at most 0.3 N/ms, and cuts the part that adds power to the hand when its budget of energy
  /// is spent (HandReport::energySpent). A torque (N m) is felt only on devices that render it; a text says
  /// when it is not. Prefer setRemoteContacts() for everything that is stiff: a force is always late by the
  /// round trip.
  void setForce(const std::array<double, 3>& force_N, const std::array<double, 3>& torque_Nm = {},
                Duration lifetime = std::chrono::milliseconds(100));

  // --- Stock VRPN scene, in metres. The first of these calls that names an object makes it an object in
  // metres.

  /// Adds an object below a parent, -1: below the scene.
  void addObject(int object, int parent = -1);
  /// Adds an object that setSceneOrigin() does not move.
  void addObjectOutsideScene(int object);
  /// Attaches an object to another parent, -1: to the scene.
  void moveToParent(int object, int parent);
  /// Removes an object and everything below it; object 0 becomes empty instead.
  void removeObject(int object);
  /// Position in the frame of the parent.
  void setObjectPosition(int object, const std::array<float, 3>& position_m);
  /// Rotation about an axis of any length, in the frame of the parent.
  void setObjectOrientation(int object, const std::array<float, 3>& axis, float angle_rad);
  /// Scale along the object's own axes.
  void setObjectScale(int object, const std::array<float, 3>& scale);
  /// Ignored by servers of this project, which answer with a text: normals follow from the triangles.
  void setNormal(int object, int normal, float x, float y, float z);
  /// Defines a triangle by its vertex numbers. Servers of this project ignore the normal numbers (-1: none).
  void setTriangle(int object, int triangle, const std::array<int, 3>& vertices,
                   const std::array<int, 3>& normals = {-1, -1, -1});
  void removeTriangle(int object, int triangle);
  /// Makes preceding edits of the mesh take effect. The surface is in stock units: a stiffness of 1 is 1000
  /// N/m, a damping of 0.005, which is the maximum, is 5 N s/m. Popthrough and mass are not sent.
  void updateMesh(int object, const Surface& surface);
  /// Transforms the vertices within their object by a row-major matrix: the translation is in elements 3, 7
  /// and 11.
  void transformMesh(int object, const std::array<float, 16>& rowMajor);
  /// Chooses the collision library of old servers: 0 Ghost, 1 Hcollide. Ignored by servers of this project,
  /// which answer with a text.
  void setMeshType(int object, int type);
  /// Removes all vertices and triangles of an object.
  void clearMesh(int object);
  /// Places the device in the world: position, and rotation about an axis.
  void setHapticOrigin(const std::array<float, 3>& position_m, const std::array<float, 3>& axis,
                       float angle_rad);
  /// Scales the motion of the device in the world.
  void setHapticScale(float scale);
  /// Places the scene in the world: position, and rotation about an axis.
  void setSceneOrigin(const std::array<float, 3>& position_m, const std::array<float, 3>& axis,
                      float angle_rad);

  // --- Stock VRPN forces, in metres. They end when the client that set them leaves, over 250 ms.

  /// Starts or changes the plane of this index.
  void setPlane(const Plane& plane);
  /// Sets adhesion, texture and buzz of plane 0.
  void setPlaneTexture(const PlaneTexture& texture);
  /// Removes the plane of this index.
  void stopPlane(int index = 0);
  /// Sets the force field of the device. Sent by datagram where the connection has them: a lost or late one
  /// is not repeated, so send it again and again.
  void setForceField(const ForceField& field);
  void stopForceField();
  /// Pulls the device to a point by a spring, until releaseConstraint().
  void constrainToPoint(const std::array<float, 3>& point_m, float stiffness_N_per_m);
  /// Pulls the device to a line, given by a point and a direction of any length, until releaseConstraint().
  void constrainToLine(const std::array<float, 3>& point_m, const std::array<float, 3>& direction,
                       float stiffness_N_per_m);
  /// Pulls the device to a plane, given by a point and a normal of any length, until releaseConstraint().
  void constrainToPlane(const std::array<float, 3>& point_m, const std::array<float, 3>& normal,
                        float stiffness_N_per_m);
  void releaseConstraint();
  /// Starts an effect that the server knows by number. Servers of this project know 0, a buzz: amplitude (N),
  /// frequency (Hz), duration (s), direction x y z; missing parameters are 1, 40, 2, (0, 0, 1).
  void startCustomEffect(std::uint32_t effect, std::span<const float> parameters);
  void stopCustomEffect();

  // --- Tracker and buttons.

  /// Asks for a ToRoomReport.
  void requestToRoom();
  /// Asks for a UnitToSensorReport of each sensor.
  void requestUnitToSensor();
  /// Asks for a WorkspaceReport.
  void requestWorkspace();
  /// Sets the report rate of this client, also for every new connection.
  void setUpdateRate(double rate_Hz);
  /// Makes the present position of the proxy the origin of poses.
  void resetOrigin();
  /// Makes a button, or all (kAllButtons), momentary or a toggle. With all, what is a toggle keeps its state.
  void setButtonMode(int button, ButtonMode mode);
  static constexpr int kAllButtons = -99;
  /// Sends a text, which servers of this project write to their log: at most 1023 bytes
  /// (std::invalid_argument).
  void sendText(std::string_view text, Severity severity = Severity::normal);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hapticd
