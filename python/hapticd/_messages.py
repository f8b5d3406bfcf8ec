"""Every message of the wire as a named tuple, and its layout.

Written by `wire_docs python` from the table in src/wire/messages.h; do not edit. Fields are named as in
docs/wire-messages.md.
"""
# mypy: disable-error-code="assignment,misc"
# Fields named `count` and `index` hide methods of tuple.

from typing import Any, Final, NamedTuple, Tuple

from ._codec import Layout, Numbers, Vec3, Vec4, define


class Text(NamedTuple):
    """Carries a text for a person: severity 0 is normal, 1 a warning, 2 an error."""

    severity: int = 0
    level: int = 0
    text: str = ""


class Ping(NamedTuple):
    """Asks whether the device is alive."""


class Pong(NamedTuple):
    """Answers a ping: the device is alive."""


class Force(NamedTuple):
    """Reports the force at the device."""

    force: Vec3 = (0.0, 0.0, 0.0)  # N


class Scp(NamedTuple):
    """Reports the surface contact point: where the proxy rests, and the stylus orientation."""

    position: Vec3 = (0.0, 0.0, 0.0)  # m
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)


class ForceError(NamedTuple):
    """Reports a fault: 0 value out of range, 1 duty cycle, 2 force or motor, 3 other, 4 recovered."""

    code: int = 0


class ForceField(NamedTuple):
    """Sets a force that varies linearly with the distance from an origin inside a sphere; all zero (sent reliably) stops it."""

    origin: Vec3 = (0.0, 0.0, 0.0)  # m
    force: Vec3 = (0.0, 0.0, 0.0)  # N
    jacobian: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # N/m
    radius: float = 0.0  # m


class Plane(NamedTuple):
    """Sets a plane a x + b y + c z + d = 0 to touch; starting and stopping it is sent reliably."""

    plane: Vec4 = (0.0, 0.0, 0.0, 0.0)
    stiffness: float = 0.0
    damping: float = 0.0
    dynamic_friction: float = 0.0
    static_friction: float = 0.0
    index: int = 0
    recovery_cycles: int = 0


class Plane2(NamedTuple):
    """Sets the texture, the buzz and the adhesion of the plane."""

    normal_adhesion: float = 0.0
    lateral_adhesion: float = 0.0
    texture_amplitude: float = 0.0
    texture_wavelength: float = 0.0
    buzz_amplitude: float = 0.0
    buzz_frequency: float = 0.0  # Hz


class CustomEffect(NamedTuple):
    """Starts an effect that the device driver defines by number; 0xFFFFFFFF stops it."""

    effect: int = 0
    parameters: Numbers = ()


class ConstraintEnable(NamedTuple):
    """Switches the constraint on (1) or off (0)."""

    enable: int = 0


class ConstraintMode(NamedTuple):
    """Chooses the constraint: 0 none, 1 point, 2 line, 3 plane."""

    mode: int = 0


class ConstraintPoint(NamedTuple):
    """Sets the point of a point constraint."""

    point: Vec3 = (0.0, 0.0, 0.0)  # m


class ConstraintLinePoint(NamedTuple):
    """Sets a point of the line of a line constraint."""

    point: Vec3 = (0.0, 0.0, 0.0)  # m


class ConstraintLineDirection(NamedTuple):
    """Sets the direction of the line of a line constraint."""

    direction: Vec3 = (0.0, 0.0, 0.0)


class ConstraintPlanePoint(NamedTuple):
    """Sets a point of the plane of a plane constraint."""

    point: Vec3 = (0.0, 0.0, 0.0)  # m


class ConstraintPlaneNormal(NamedTuple):
    """Sets the normal of the plane of a plane constraint."""

    normal: Vec3 = (0.0, 0.0, 0.0)


class ConstraintStiffness(NamedTuple):
    """Sets the spring that holds the constraint."""

    stiffness: float = 0.0  # N/m


class AddObject(NamedTuple):
    """Adds an object below a parent (-1: the scene)."""

    object: int = 0
    parent: int = -1


class AddObjectExScene(NamedTuple):
    """Adds an object beside the scene, as another root."""

    object: int = 0


class MoveToParent(NamedTuple):
    """Moves an object below another parent."""

    object: int = 0
    parent: int = -1


class SetObjectPosition(NamedTuple):
    """Places an object relative to its parent."""

    object: int = 0
    position: Vec3 = (0.0, 0.0, 0.0)  # m


class SetObjectOrientation(NamedTuple):
    """Turns an object relative to its parent, about an axis."""

    object: int = 0
    axis: Vec3 = (0.0, 0.0, 0.0)
    angle: float = 0.0  # rad


class SetObjectScale(NamedTuple):
    """Scales an object along its own axes."""

    object: int = 0
    scale: Vec3 = (1.0, 1.0, 1.0)


class RemoveObject(NamedTuple):
    """Removes an object."""

    object: int = 0


class SetVertex(NamedTuple):
    """Sets a vertex of an object's mesh; without triangles, consecutive triples are faces."""

    object: int = 0
    vertex: int = 0
    position: Vec3 = (0.0, 0.0, 0.0)  # object units


class SetNormal(NamedTuple):
    """Sets a vertex normal of an object's mesh."""

    object: int = 0
    normal: int = 0
    direction: Vec3 = (0.0, 0.0, 0.0)


class SetTriangle(NamedTuple):
    """Sets a triangle of an object's mesh by vertex and normal numbers (normals -1: none)."""

    object: int = 0
    triangle: int = 0
    vertices: Numbers = (0, 0, 0)
    normals: Numbers = (-1, -1, -1)


class RemoveTriangle(NamedTuple):
    """Removes a triangle of an object's mesh."""

    object: int = 0
    triangle: int = 0


class UpdateTrimeshChanges(NamedTuple):
    """Makes mesh edits effective, with this surface."""

    object: int = 0
    stiffness: float = 0.0
    damping: float = 0.0
    static_friction: float = 0.0
    dynamic_friction: float = 0.0


class TransformTrimesh(NamedTuple):
    """Moves the vertices of an object's mesh by a row-major 4x4 matrix."""

    object: int = 0
    matrix: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SetTrimeshType(NamedTuple):
    """Chooses a rendering library: 0 Ghost, 1 Hcollide; object -1 means all."""

    object: int = 0
    type: int = 0


class ClearTrimesh(NamedTuple):
    """Removes an object's mesh."""

    object: int = 0


class SetHapticOrigin(NamedTuple):
    """Places the device in the scene."""

    position: Vec3 = (0.0, 0.0, 0.0)  # m
    axis: Vec3 = (0.0, 0.0, 0.0)
    angle: float = 0.0  # rad


class SetHapticScale(NamedTuple):
    """Scales the device's motion in the scene."""

    scale: float = 1.0


class SetSceneOrigin(NamedTuple):
    """Places the scene."""

    position: Vec3 = (0.0, 0.0, 0.0)  # m
    axis: Vec3 = (0.0, 0.0, 0.0)
    angle: float = 0.0  # rad


class GetNewObjectId(NamedTuple):
    """Is reserved: registered by stock libraries, never sent."""


class SetObjectIsTouchable(NamedTuple):
    """Starts (1) or stops (0) rendering an object."""

    object: int = 0
    touchable: int = 1


class SetWorkspaceBoundingBox(NamedTuple):
    """Fits the device workspace to a box (min x y z, max x y z) seen through a model matrix (column-major)."""

    model: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    box: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # world units


class SetWorkspaceProjectionMatrix(NamedTuple):
    """Fits the device workspace to a view volume, by a model and a projection matrix (column-major)."""

    model: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    projection: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SetObjectNumber(NamedTuple):
    """Makes the scene have at least this many objects, numbered from 0."""

    count: int = 0


class SetTransformMatrix(NamedTuple):
    """Sets the pose and scale of an object: a column-major matrix, translation in elements 12 to 14."""

    object: int = 0
    matrix: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SetHapticProperty(NamedTuple):
    """Sets one property of an object's surface: stiffness, damping, static friction, dynamic friction, popthrough or mass."""

    object: int = 0
    property: str = ""
    value: float = 0.0


class SetTouchableFace(NamedTuple):
    """Chooses the faces that are rendered: 0 front, 1 back, any other value both."""

    face: int = 2


class Effect(NamedTuple):
    """Defines an effect by index: constant, spring, viscous, friction, vibrationMotor or vibrationContact; duration 0 lasts until stopped."""

    type: str = ""
    index: int = 0
    gain: float = 0.0
    magnitude: float = 0.0  # N
    duration: float = 0.0  # ms
    frequency: float = 0.0
    position: Vec3 = (0.0, 0.0, 0.0)  # world units
    direction: Vec3 = (0.0, 0.0, 0.0)


class StartEffect(NamedTuple):
    """Starts an effect."""

    index: int = 0


class StopEffect(NamedTuple):
    """Stops an effect."""

    index: int = 0


class ResetScene(NamedTuple):
    """Resets workspace, objects and effects to their initial state; the byte has no meaning."""

    ignored: int = 0


class Dop(NamedTuple):
    """Reports the depth of penetration."""

    depth: float = 0.0  # m


class IsTouching(NamedTuple):
    """Reports whether anything is touched."""

    touching: int = 0


class TouchedObject(NamedTuple):
    """Reports which object is touched, -1 for none."""

    object: int = -1


class Angle(NamedTuple):
    """Reports the angle between stylus and surface normal, 0 without contact."""

    angle: float = 0.0  # deg
    touching: int = 0


class TrackerPosQuat(NamedTuple):
    """Reports the pose of a sensor; the filler is ignored."""

    sensor: int = 0
    filler: int = 0
    position: Vec3 = (0.0, 0.0, 0.0)  # m
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)


class TrackerVelocity(NamedTuple):
    """Reports how fast a sensor moves and by which rotation it turns within an interval."""

    sensor: int = 0
    filler: int = 0
    velocity: Vec3 = (0.0, 0.0, 0.0)  # m/s
    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    interval: float = 1.0  # s


class TrackerAcceleration(NamedTuple):
    """Reports how a sensor's velocity changes and by which rotation its turning changes within an interval."""

    sensor: int = 0
    filler: int = 0
    acceleration: Vec3 = (0.0, 0.0, 0.0)  # m/s^2
    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    interval: float = 1.0  # s


class TrackerToRoom(NamedTuple):
    """Reports the pose of the tracker's base in the room."""

    position: Vec3 = (0.0, 0.0, 0.0)  # m
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)


class TrackerUnitToSensor(NamedTuple):
    """Says how a tracked unit is mounted on its sensor, one message for each sensor; the filler is ignored."""

    sensor: int = 0
    filler: int = 0
    position: Vec3 = (0.0, 0.0, 0.0)  # m
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)


class TrackerWorkspace(NamedTuple):
    """Reports the box in which the tracker works."""

    min: Vec3 = (0.0, 0.0, 0.0)  # m
    max: Vec3 = (0.0, 0.0, 0.0)  # m


class TrackerRequestToRoom(NamedTuple):
    """Asks for To_Room."""


class TrackerRequestUnitToSensor(NamedTuple):
    """Asks for one Unit_To_Sensor per sensor."""


class TrackerRequestWorkspace(NamedTuple):
    """Asks for Workspace."""


class TrackerSetUpdateRate(NamedTuple):
    """Asks for a report rate."""

    rate: float = 0.0  # Hz


class TrackerResetOrigin(NamedTuple):
    """Makes the present pose the origin."""


class ButtonChange(NamedTuple):
    """Reports that a button went down (1) or up (0)."""

    button: int = 0
    state: int = 0


class ButtonStates(NamedTuple):
    """Reports the state of every button, on each new connection and for each ping."""

    states: Numbers = ()


class ButtonAdmin(NamedTuple):
    """Makes a button (-99: all) momentary (10), a toggle that starts off (20) or one that starts on (21); the time stamp is that of the client's start."""

    button: int = 0
    event: int = 10


class ButtonAlert(NamedTuple):
    """Reports that a button's toggle was switched off (20, also for momentary) or on (21)."""

    button: int = 0
    event: int = 20


class AnalogChannels(NamedTuple):
    """Reports the value of every channel; even their number travels as a float."""

    channels: Numbers = ()


class QueryCapabilities(NamedTuple):
    """Asks for the abilities of the server and its device; answered by Capabilities."""


class Capabilities(NamedTuple):
    """Answers Query_Capabilities: version of the extensions, feature bits, facts of the device."""

    version: int = 1
    features: int = 0
    servo_rate: float = 0.0  # Hz
    report_rate: float = 0.0  # Hz
    peak_force: float = 0.0  # N
    buttons: int = 0
    workspace: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # m


class MeshVertices(NamedTuple):
    """Sets a run of vertices of an object from number first on: x y z each."""

    object: int = 0
    first: int = 0
    positions: Numbers = ()  # world units


class MeshTriangles(NamedTuple):
    """Sets a run of triangles of an object from number first on: three vertex numbers each."""

    object: int = 0
    first: int = 0
    vertices: Numbers = ()


class BatchBegin(NamedTuple):
    """Starts a batch: the client's commands until Batch_Commit become visible in one tick, or not at all."""


class BatchCommit(NamedTuple):
    """Ends a batch and makes it visible."""


class Subscribe(NamedTuple):
    """Chooses which reports this client gets and how often; rate 0 keeps the rate as it is."""

    kinds: int = 15
    rate: float = 0.0  # Hz


class TickReport(NamedTuple):
    """Reports one servo tick: its number, its time on the server's monotonic clock, and its values."""

    tick: int = 0
    time: int = 0  # ns
    revision: int = 0
    hand: Vec3 = (0.0, 0.0, 0.0)  # m
    proxy: Vec3 = (0.0, 0.0, 0.0)  # m
    velocity: Vec3 = (0.0, 0.0, 0.0)  # m/s
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    force: Vec3 = (0.0, 0.0, 0.0)  # N
    depth: float = 0.0  # m
    object: int = -1
    buttons: int = 0
    guard_active: int = 0
    guard_latched: int = 0


class ContactList(NamedTuple):
    """Reports every touched object of a tick: object, point, normal, force on the hand (10 numbers each)."""

    tick: int = 0
    time: int = 0  # ns
    contacts: Numbers = ()


class StopForces(NamedTuple):
    """Brings the force to zero within one tick, until re-armed. Any client may."""


class RearmForces(NamedTuple):
    """Clears a stop and latched faults; forces return over 0.5 s."""


class GuardState(NamedTuple):
    """Reports, on change, which trips hold the force (bits) and whether it is armed or stopped."""

    active: int = 0
    latched: int = 0
    armed: int = 0
    stopped: int = 0


class Heartbeat(NamedTuple):
    """Starts a watchdog: a client that then sends none for 500 ms is lost; watch 0 ends it."""

    watch: int = 1


class HoldHand(NamedTuple):
    """Moves the simulated hand's target while hold is set; one client holds it at a time."""

    hold: int = 0
    position: Vec3 = (0.0, 0.0, 0.0)  # world units
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    buttons: int = 0


class RemoteContacts(NamedTuple):
    """Replaces the client's contacts near the hand, up to 16 (24 numbers each): felt until they expire."""

    time: int = 0  # ns
    state_time: int = 0  # ns
    contacts: Numbers = ()


class HeldForce(NamedTuple):
    """Sets a force that the server holds for its lifetime, within a budget of energy."""

    time: int = 0  # ns
    force: Vec3 = (0.0, 0.0, 0.0)  # N
    torque: Vec3 = (0.0, 0.0, 0.0)  # N m
    lifetime: float = 0.0  # s


class HandState(NamedTuple):
    """Reports the newest tick: pose, velocity, buttons, force written, remote contacts (8 numbers each)."""

    tick: int = 0
    time: int = 0  # ns
    contacts_time: int = 0  # ns
    force_time: int = 0  # ns
    position: Vec3 = (0.0, 0.0, 0.0)  # m
    orientation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    velocity: Vec3 = (0.0, 0.0, 0.0)  # m/s
    angular_velocity: Vec3 = (0.0, 0.0, 0.0)  # rad/s
    force: Vec3 = (0.0, 0.0, 0.0)  # N
    held_force: Vec3 = (0.0, 0.0, 0.0)  # N
    energy: float = 0.0  # J
    gripper: float = 0.0  # rad
    buttons: int = 0
    flags: int = 0
    guard_active: int = 0
    contacts: Numbers = ()


class Identify(NamedTuple):
    """Presents a token for a role, and a random key that the connections of one program share."""

    token: str = ""
    key: int = 0


class ReleaseControl(NamedTuple):
    """Gives up the control that `control = "first"` gave to this client, for the next one to command."""


class Poses(NamedTuple):
    """Reports the objects that move, until 1 s after they rest: 13 numbers each, up to 256 in one tick."""

    tick: int = 0
    time: int = 0  # ns
    poses: Numbers = ()


class SetObjectName(NamedTuple):
    """Names an object, for the viewer and for recordings."""

    object: int = 0
    text: str = ""


class Marker(NamedTuple):
    """Marks a moment, such as "trial 3 begins": recorded, and reported to all clients with its time."""

    time: int = 0  # ns
    text: str = ""


class ReplayControl(NamedTuple):
    """Pauses a replayed recording, changes its speed (0 keeps it), or seeks (a negative time does not)."""

    paused: int = 0
    speed: float = 0.0
    position: float = -1.0  # s


class RecordingControl(NamedTuple):
    """Begins or ends a recording on the server, in a file of this name; answered by a text."""

    record: int = 0
    name: str = ""


#: The layout of every message, in the order of the table.
LAYOUTS: Final[Tuple[Layout[Any], ...]] = (
    define(Text, "vrpn_Base text_message", (
        ("severity", "I"),
        ("level", "I"),
        ("text", "text", 1024),
    )),
    define(Ping, "vrpn_Base ping_message", ()),
    define(Pong, "vrpn_Base pong_message", ()),
    define(Force, "vrpn_ForceDevice Force", (
        ("force", "d", 3),
    )),
    define(Scp, "vrpn_ForceDevice SCP", (
        ("position", "d", 3),
        ("orientation", "d", 4),
    )),
    define(ForceError, "vrpn_ForceDevice Force_Error", (
        ("code", "i"),
    )),
    define(ForceField, "vrpn_ForceDevice Force_Field", (
        ("origin", "f", 3),
        ("force", "f", 3),
        ("jacobian", "f", 9),
        ("radius", "f"),
    )),
    define(Plane, "vrpn_ForceDevice Plane", (
        ("plane", "f", 4),
        ("stiffness", "f"),
        ("damping", "f"),
        ("dynamic_friction", "f"),
        ("static_friction", "f"),
        ("index", "i"),
        ("recovery_cycles", "i"),
    )),
    define(Plane2, "vrpn_ForceDevice Plane2", (
        ("normal_adhesion", "f"),
        ("lateral_adhesion", "f"),
        ("texture_amplitude", "f"),
        ("texture_wavelength", "f"),
        ("buzz_amplitude", "f"),
        ("buzz_frequency", "f"),
    )),
    define(CustomEffect, "vrpn_ForceDevice Custom Effect", (
        ("effect", "I"),
        ("parameters", "listIf", 15998),
    )),
    define(ConstraintEnable, "vrpn_ForceDevice constraint_enable", (
        ("enable", "i"),
    )),
    define(ConstraintMode, "vrpn_ForceDevice constraint_mode", (
        ("mode", "i"),
    )),
    define(ConstraintPoint, "vrpn_ForceDevice constraint_point", (
        ("point", "f", 3),
    )),
    define(ConstraintLinePoint, "vrpn_ForceDevice constraint_linept", (
        ("point", "f", 3),
    )),
    define(ConstraintLineDirection, "vrpn_ForceDevice constraint_linedir", (
        ("direction", "f", 3),
    )),
    define(ConstraintPlanePoint, "vrpn_ForceDevice constraint_plpt", (
        ("point", "f", 3),
    )),
    define(ConstraintPlaneNormal, "vrpn_ForceDevice constraint_plnorm", (
        ("normal", "f", 3),
    )),
    define(ConstraintStiffness, "vrpn_ForceDevice constraint_KSpring", (
        ("stiffness", "f"),
    )),
    define(AddObject, "vrpn_ForceDevice addObject", (
        ("object", "i"),
        ("parent", "i"),
    )),
    define(AddObjectExScene, "vrpn_ForceDevice addObjectExScene", (
        ("object", "i"),
    )),
    define(MoveToParent, "vrpn_ForceDevice moveToParent", (
        ("object", "i"),
        ("parent", "i"),
    )),
    define(SetObjectPosition, "vrpn_ForceDevice setObjectPosition", (
        ("object", "i"),
        ("position", "f", 3),
    )),
    define(SetObjectOrientation, "vrpn_ForceDevice setObjectOrientation", (
        ("object", "i"),
        ("axis", "f", 3),
        ("angle", "f"),
    )),
    define(SetObjectScale, "vrpn_ForceDevice setObjectScale", (
        ("object", "i"),
        ("scale", "f", 3),
    )),
    define(RemoveObject, "vrpn_ForceDevice removeObject", (
        ("object", "i"),
    )),
    define(SetVertex, "vrpn_ForceDevice setVertex", (
        ("object", "i"),
        ("vertex", "i"),
        ("position", "f", 3),
    )),
    define(SetNormal, "vrpn_ForceDevice setNormal", (
        ("object", "i"),
        ("normal", "i"),
        ("direction", "f", 3),
    )),
    define(SetTriangle, "vrpn_ForceDevice setTriangle", (
        ("object", "i"),
        ("triangle", "i"),
        ("vertices", "i", 3),
        ("normals", "i", 3),
    )),
    define(RemoveTriangle, "vrpn_ForceDevice removeTriangle", (
        ("object", "i"),
        ("triangle", "i"),
    )),
    define(UpdateTrimeshChanges, "vrpn_ForceDevice updateTrimeshChanges", (
        ("object", "i"),
        ("stiffness", "f"),
        ("damping", "f"),
        ("static_friction", "f"),
        ("dynamic_friction", "f"),
    )),
    define(TransformTrimesh, "vrpn_ForceDevice transformTrimesh", (
        ("object", "i"),
        ("matrix", "f", 16),
    )),
    define(SetTrimeshType, "vrpn_ForceDevice setTrimeshType", (
        ("object", "i"),
        ("type", "i"),
    )),
    define(ClearTrimesh, "vrpn_ForceDevice clearTrimesh", (
        ("object", "i"),
    )),
    define(SetHapticOrigin, "vrpn_ForceDevice setHapticOrigin", (
        ("position", "f", 3),
        ("axis", "f", 3),
        ("angle", "f"),
    )),
    define(SetHapticScale, "vrpn_ForceDevice setHapticScale", (
        ("scale", "f"),
    )),
    define(SetSceneOrigin, "vrpn_ForceDevice setSceneOrigin", (
        ("position", "f", 3),
        ("axis", "f", 3),
        ("angle", "f"),
    )),
    define(GetNewObjectId, "vrpn_ForceDevice getNewObjectID", ()),
    define(SetObjectIsTouchable, "vrpn_ForceDevice setObjectIsTouchable", (
        ("object", "i"),
        ("touchable", "h"),
    )),
    define(SetWorkspaceBoundingBox, "vrpn_ForceDevice setWorkspaceBoundingBox", (
        ("model", "d", 16),
        ("box", "d", 6),
    )),
    define(SetWorkspaceProjectionMatrix, "vrpn_ForceDevice setWorkspaceProjectionMatrix", (
        ("model", "d", 16),
        ("projection", "d", 16),
    )),
    define(SetObjectNumber, "vrpn_ForceDevice setObjectNumber", (
        ("count", "i"),
    )),
    define(SetTransformMatrix, "vrpn_ForceDevice setTransformMatrix", (
        ("object", "i"),
        ("matrix", "d", 16),
    )),
    define(SetHapticProperty, "vrpn_ForceDevice setHapticProperty", (
        ("object", "i"),
        ("property", "name", 20),
        ("value", "f"),
    )),
    define(SetTouchableFace, "vrpn_ForceDevice setTouchableFace", (
        ("face", "i"),
    )),
    define(Effect, "vrpn_ForceDevice Effect", (
        ("type", "name", 20),
        ("index", "i"),
        ("gain", "d"),
        ("magnitude", "d"),
        ("duration", "d"),
        ("frequency", "d"),
        ("position", "d", 3),
        ("direction", "d", 3),
    )),
    define(StartEffect, "vrpn_ForceDevice startEffect", (
        ("index", "i"),
    )),
    define(StopEffect, "vrpn_ForceDevice stopEffect", (
        ("index", "i"),
    )),
    define(ResetScene, "vrpn_ForceDevice resetScene", (
        ("ignored", "B"),
    )),
    define(Dop, "vrpn_ForceDevice DOP", (
        ("depth", "d"),
    )),
    define(IsTouching, "vrpn_ForceDevice isTouching", (
        ("touching", "h"),
    )),
    define(TouchedObject, "vrpn_ForceDevice TouchedObject", (
        ("object", "i"),
    )),
    define(Angle, "vrpn_ForceDevice Angle", (
        ("angle", "d"),
        ("touching", "h"),
    )),
    define(TrackerPosQuat, "vrpn_Tracker Pos_Quat", (
        ("sensor", "i"),
        ("filler", "i"),
        ("position", "d", 3),
        ("orientation", "d", 4),
    )),
    define(TrackerVelocity, "vrpn_Tracker Velocity", (
        ("sensor", "i"),
        ("filler", "i"),
        ("velocity", "d", 3),
        ("rotation", "d", 4),
        ("interval", "d"),
    )),
    define(TrackerAcceleration, "vrpn_Tracker Acceleration", (
        ("sensor", "i"),
        ("filler", "i"),
        ("acceleration", "d", 3),
        ("rotation", "d", 4),
        ("interval", "d"),
    )),
    define(TrackerToRoom, "vrpn_Tracker To_Room", (
        ("position", "d", 3),
        ("orientation", "d", 4),
    )),
    define(TrackerUnitToSensor, "vrpn_Tracker Unit_To_Sensor", (
        ("sensor", "i"),
        ("filler", "i"),
        ("position", "d", 3),
        ("orientation", "d", 4),
    )),
    define(TrackerWorkspace, "vrpn_Tracker Workspace", (
        ("min", "d", 3),
        ("max", "d", 3),
    )),
    define(TrackerRequestToRoom, "vrpn_Tracker Request_Tracker_To_Room", ()),
    define(TrackerRequestUnitToSensor, "vrpn_Tracker Request_Unit_To_Sensor", ()),
    define(TrackerRequestWorkspace, "vrpn_Tracker Request_Tracker_Workspace", ()),
    define(TrackerSetUpdateRate, "vrpn_Tracker set_update_rate", (
        ("rate", "d"),
    )),
    define(TrackerResetOrigin, "vrpn_Tracker Reset_Origin", ()),
    define(ButtonChange, "vrpn_Button Change", (
        ("button", "i"),
        ("state", "i"),
    )),
    define(ButtonStates, "vrpn_Button States", (
        ("states", "listii", 256),
    )),
    define(ButtonAdmin, "vrpn_Button Admin", (
        ("button", "i"),
        ("event", "i"),
    )),
    define(ButtonAlert, "vrpn_Button Alert", (
        ("button", "i"),
        ("event", "i"),
    )),
    define(AnalogChannels, "vrpn_Analog Channel", (
        ("channels", "listdd", 128),
    )),
    define(QueryCapabilities, "hapticd Query_Capabilities", ()),
    define(Capabilities, "hapticd Capabilities", (
        ("version", "i"),
        ("features", "I"),
        ("servo_rate", "d"),
        ("report_rate", "d"),
        ("peak_force", "d"),
        ("buttons", "i"),
        ("workspace", "d", 6),
    )),
    define(MeshVertices, "hapticd Mesh_Vertices", (
        ("object", "i"),
        ("first", "i"),
        ("positions", "listif", 15000),
    )),
    define(MeshTriangles, "hapticd Mesh_Triangles", (
        ("object", "i"),
        ("first", "i"),
        ("vertices", "listii", 15000),
    )),
    define(BatchBegin, "hapticd Batch_Begin", ()),
    define(BatchCommit, "hapticd Batch_Commit", ()),
    define(Subscribe, "hapticd Subscribe", (
        ("kinds", "I"),
        ("rate", "d"),
    )),
    define(TickReport, "hapticd Tick", (
        ("tick", "Q"),
        ("time", "q"),
        ("revision", "Q"),
        ("hand", "d", 3),
        ("proxy", "d", 3),
        ("velocity", "d", 3),
        ("orientation", "d", 4),
        ("force", "d", 3),
        ("depth", "d"),
        ("object", "i"),
        ("buttons", "I"),
        ("guard_active", "I"),
        ("guard_latched", "I"),
    )),
    define(ContactList, "hapticd Contacts", (
        ("tick", "Q"),
        ("time", "q"),
        ("contacts", "listid", 80),
    )),
    define(StopForces, "hapticd Stop_Forces", ()),
    define(RearmForces, "hapticd Rearm_Forces", ()),
    define(GuardState, "hapticd Guard_State", (
        ("active", "I"),
        ("latched", "I"),
        ("armed", "h"),
        ("stopped", "h"),
    )),
    define(Heartbeat, "hapticd Heartbeat", (
        ("watch", "h"),
    )),
    define(HoldHand, "hapticd Hold_Hand", (
        ("hold", "h"),
        ("position", "d", 3),
        ("orientation", "d", 4),
        ("buttons", "I"),
    )),
    define(RemoteContacts, "hapticd Remote_Contacts", (
        ("time", "q"),
        ("state_time", "q"),
        ("contacts", "listid", 384),
    )),
    define(HeldForce, "hapticd Held_Force", (
        ("time", "q"),
        ("force", "d", 3),
        ("torque", "d", 3),
        ("lifetime", "d"),
    )),
    define(HandState, "hapticd Hand_State", (
        ("tick", "Q"),
        ("time", "q"),
        ("contacts_time", "q"),
        ("force_time", "q"),
        ("position", "d", 3),
        ("orientation", "d", 4),
        ("velocity", "d", 3),
        ("angular_velocity", "d", 3),
        ("force", "d", 3),
        ("held_force", "d", 3),
        ("energy", "d"),
        ("gripper", "d"),
        ("buttons", "I"),
        ("flags", "I"),
        ("guard_active", "I"),
        ("contacts", "listid", 128),
    )),
    define(Identify, "hapticd Identify", (
        ("token", "name", 128),
        ("key", "Q"),
    )),
    define(ReleaseControl, "hapticd Release_Control", ()),
    define(Poses, "hapticd Poses", (
        ("tick", "Q"),
        ("time", "q"),
        ("poses", "listid", 3328),
    )),
    define(SetObjectName, "hapticd Set_Object_Name", (
        ("object", "i"),
        ("text", "name", 64),
    )),
    define(Marker, "hapticd Marker", (
        ("time", "q"),
        ("text", "text", 256),
    )),
    define(ReplayControl, "hapticd Replay_Control", (
        ("paused", "h"),
        ("speed", "d"),
        ("position", "d"),
    )),
    define(RecordingControl, "hapticd Recording_Control", (
        ("record", "h"),
        ("name", "name", 128),
    )),
)

#: Vertices or triangles in one message at most.
MOST_IN_ONE_MESSAGE: Final = 5000
#: The effect of CustomEffect that stops it.
STOP_CUSTOM_EFFECT: Final = 4294967295
#: Bits of Subscribe.kinds.
REPORT_TRACKER: Final = 1
REPORT_FORCE: Final = 2
REPORT_BUTTON: Final = 4
REPORT_ANALOG: Final = 8
REPORT_TICK: Final = 16
REPORT_CONTACTS: Final = 32
REPORT_HAND: Final = 64
REPORT_CONTACT_POINT: Final = 128
REPORT_TOUCH_BUTTON: Final = 256
REPORT_CONTACT_ANALOG: Final = 512
REPORT_HIP: Final = 1024
REPORT_POSES: Final = 2048
#: Bits of Capabilities.features.
FEATURE_BULK_MESH: Final = 1
FEATURE_BATCH: Final = 2
FEATURE_SUBSCRIBE: Final = 4
FEATURE_STOP: Final = 8
FEATURE_HEARTBEAT: Final = 16
FEATURE_HOLD_HAND: Final = 32
FEATURE_REMOTE_CONTACTS: Final = 64
#: Bits of HandState.flags.
HAND_HAS_GRIPPER: Final = 1
HAND_ENERGY_SPENT: Final = 2
HAND_CORRECTIONS_HELD: Final = 4
#: Names, sentences and remedies of the trips, by bit.
TRIPS: Final[Tuple[Tuple[str, str, str], ...]] = (
    ("not_finite", "The rendered force or the device state was not a finite number.", "Check the meshes and effects for values that are not finite."),
    ("peak_force", "The rendered force exceeded the peak force of the device.", "No action is needed; a lower stiffness or effect magnitude avoids it."),
    ("thermal", "The mean force over 5 s reached the continuous force of the device.", "Press less for a few seconds; the full force returns by itself."),
    ("slew", "The rendered force rose faster than 1 N in 1 ms.", "No action is needed; the force follows within a few milliseconds."),
    ("speed", "The device moved faster than 1.2 m/s.", "Hold the device still, then re-arm."),
    ("late", "A servo tick was more than 3 ms late.", "Reduce the load on the machine; `hapticd doctor` checks its real-time settings."),
    ("stalled", "A servo tick was more than 50 ms late.", "Re-arm when the machine is no longer overloaded."),
    ("no_state", "The device returned no state or did not accept the force.", "Check the cable and the power of the device."),
    ("not_calibrated", "The device is not calibrated.", "Start the server with --calibrate, or calibrate the device with the vendor's tool."),
    ("dead_man", "The dead-man or presence switch is open.", "Hold the stylus so that the switch closes."),
    ("inkwell", "The stylus is docked.", "Take the stylus out of the inkwell."),
    ("hot", "The motors are too hot.", "Let the motors cool; the force returns by itself."),
    ("device_fault", "The driver reports a fault.", "Clear the fault, then re-arm."),
    ("stopped", "A client stopped the forces.", "Re-arm to continue."),
    ("disarmed", "Forces are not enabled for this device.", "Start the server with --enable-forces."),
    ("geometry_jump", "A command changed geometry or surface in contact at once, and the force was blended over 20 ms.", "No action is needed; smaller steps avoid it."),
    ("deep_contact", "An object appeared around the device or jumped over it, or the first contact was too deep: it exerts no force.", "Move the device out of the object; then the object can be felt."),
)
