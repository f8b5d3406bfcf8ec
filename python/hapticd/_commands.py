"""Commands: from calls to messages of the wire. Both faces of the client inherit them."""

from numbers import Real
from typing import Any, Callable, Sequence, Type, TypeVar

import numpy as np
import numpy.typing as npt

from . import _messages as m
from ._codec import Numbers, real_array, shortened
from .scene import IDENTITY, ButtonMode, Effect, Faces, ForceField, Plane, PlaneTexture, Surface
from .reports import Severity

#: The button number that means all buttons.
ALL_BUTTONS = -99

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])

_PROPERTIES = ("stiffness", "damping", "static friction", "dynamic friction", "popthrough", "mass")


def _column_major(matrix: Any) -> "npt.NDArray[np.float64]":
    """A 4x4 array column by column; 16 numbers are taken as they are."""
    expected = "a 4x4 array, or 16 numbers column by column"
    array = real_array(matrix, "a matrix", expected).astype(np.float64)
    if array.shape == (4, 4):
        return array.T.ravel()
    if array.shape == (16,):
        return array
    raise ValueError(f"a matrix of shape {array.shape}: give {expected}")


def instance(value: Any, cls: Type[T]) -> T:
    """The value. Raises ValueError when it is of another class, which might lack fields."""
    if not isinstance(value, cls):
        raise ValueError(f"{shortened(value)}: give a hapticd.{cls.__name__}")
    return value


def flag(value: bool, what: str = "") -> int:
    """A truth as messages carry it. Raises ValueError for what is none."""
    if not isinstance(value, (Real, np.bool_)) or value not in (0, 1):
        raise ValueError(f"{what}{shortened(value)}: give True or False")
    return int(value)


def function(callback: F, expected: str) -> F:
    """The callback. Raises ValueError for what cannot be called."""
    if not callable(callback):
        raise ValueError(f"{shortened(callback)}: give {expected}")
    return callback


class Commands:
    """Every command is collected and sent by the next poll or flush, or when 64 KiB have accumulated."""

    def _send(self, message: Any, fast: bool = False) -> None:
        """Sends a message of the device, stamped now, in the order of the calls; `fast`: by datagram where there
        are any."""
        raise NotImplementedError

    def _send_all(self, *messages: Any) -> None:
        """Sends messages, or none when a value of one does not fit."""
        raise NotImplementedError

    # --- Scene, in world units. Objects are numbered from 0; object 0 always exists.

    def set_object_count(self, count: int) -> None:
        """Makes the scene have at least this many objects, at most 10 000. It never removes objects."""
        self._send(m.SetObjectNumber(count))

    def set_vertex(self, object: int, vertex: int, x: float, y: float, z: float) -> None:
        """Sets one vertex of a mesh. Object units, object frame. Without set_triangle(), consecutive triples are
        triangles."""
        self._send(m.SetVertex(object, vertex, (x, y, z)))

    def set_surface(self, object: int, surface: Surface) -> None:
        """Sets all properties of an object's surface."""
        values = zip(_PROPERTIES, instance(surface, Surface))
        self._send_all(*(m.SetHapticProperty(object, name, value) for name, value in values))

    def set_surface_property(self, object: int, property: str, value: float) -> None:
        """Sets one property: "stiffness", "damping", "static friction", "dynamic friction", "popthrough" (0 to 1)
        or "mass" (kg)."""
        self._send(m.SetHapticProperty(object, property, value))

    def set_transform(self, object: int, T_world_object: "npt.ArrayLike") -> None:
        """Places an object in the world, by a 4x4 array with the translation in [:3, 3]. It may be called at any
        rate: the hand feels the object move."""
        self._send(m.SetTransformMatrix(object, _column_major(T_world_object)))

    def set_touchable(self, object: int, touchable: bool) -> None:
        """Starts or stops rendering an object."""
        self._send(m.SetObjectIsTouchable(object, flag(touchable)))

    def set_touchable_faces(self, faces: Faces) -> None:
        """Chooses which sides of all objects are rendered; both initially."""
        self._send(m.SetTouchableFace(faces))

    def set_workspace_box(self, min: Numbers, max: Numbers, model: "npt.ArrayLike" = IDENTITY) -> None:
        """Fits the device's workspace to a box of the world, seen through a model matrix (world to eye)."""
        corners = [real_array(corner, "a corner", "3 numbers") for corner in (min, max)]
        if corners[0].shape != (3,) or corners[1].shape != (3,):
            raise ValueError(f"corners {shortened(min)} and {shortened(max)}: give 3 numbers each")
        self._send(m.SetWorkspaceBoundingBox(_column_major(model), (*corners[0], *corners[1])))

    def set_workspace_projection(self, model: "npt.ArrayLike", projection: "npt.ArrayLike") -> None:
        """Fits the device's workspace to the view volume of an OpenGL camera."""
        self._send(m.SetWorkspaceProjectionMatrix(_column_major(model), _column_major(projection)))

    def set_effect(self, index: int, effect: Effect) -> None:
        """Defines or redefines an effect by its number, 0 or more; a running one changes in place. At most 64
        effects. An effect ends when the client that set it leaves, over 250 ms."""
        self._send(m.Effect(instance(effect, Effect).type, index, *effect[1:]))

    def start_effect(self, index: int) -> None:
        """Starts an effect, or restarts it."""
        self._send(m.StartEffect(index))

    def stop_effect(self, index: int) -> None:
        """Stops an effect."""
        self._send(m.StopEffect(index))

    def reset_scene(self) -> None:
        """Resets workspace, objects and effects to the initial state."""
        self._send(m.ResetScene())

    # --- Stock VRPN scene, in metres. The first of these calls that names an object makes it an object in metres.

    def add_object(self, object: int, parent: int = -1) -> None:
        """Adds an object below a parent, -1: below the scene."""
        self._send(m.AddObject(object, parent))

    def add_object_outside_scene(self, object: int) -> None:
        """Adds an object that set_scene_origin() does not move."""
        self._send(m.AddObjectExScene(object))

    def move_to_parent(self, object: int, parent: int) -> None:
        """Attaches an object to another parent, -1: to the scene."""
        self._send(m.MoveToParent(object, parent))

    def remove_object(self, object: int) -> None:
        """Removes an object and everything below it; object 0 becomes empty instead."""
        self._send(m.RemoveObject(object))

    def set_object_position(self, object: int, position_m: Numbers) -> None:
        """Position in the frame of the parent."""
        self._send(m.SetObjectPosition(object, position_m))

    def set_object_orientation(self, object: int, axis: Numbers, angle_rad: float) -> None:
        """Rotation about an axis of any length, in the frame of the parent."""
        self._send(m.SetObjectOrientation(object, axis, angle_rad))

    def set_object_scale(self, object: int, scale: Numbers) -> None:
        """Scale along the object's own axes."""
        self._send(m.SetObjectScale(object, scale))

    def set_normal(self, object: int, normal: int, x: float, y: float, z: float) -> None:
        """Ignored by servers of this project, which answer with a text: normals follow from the triangles."""
        self._send(m.SetNormal(object, normal, (x, y, z)))

    def set_triangle(
        self, object: int, triangle: int, vertices: Sequence[int], normals: Sequence[int] = (-1, -1, -1)
    ) -> None:
        """Defines a triangle by its vertex numbers. Servers of this project ignore the normal numbers (-1: none)."""
        self._send(m.SetTriangle(object, triangle, vertices, normals))

    def remove_triangle(self, object: int, triangle: int) -> None:
        """Removes a triangle of an object's mesh."""
        self._send(m.RemoveTriangle(object, triangle))

    def update_mesh(self, object: int, surface: Surface) -> None:
        """Makes preceding edits of the mesh take effect. The surface is in stock units: a stiffness of 1 is 1000
        N/m, a damping of 0.005, which is the maximum, is 5 N s/m. Popthrough and mass are not sent."""
        self._send(m.UpdateTrimeshChanges(object, *instance(surface, Surface)[:4]))

    def transform_mesh(self, object: int, matrix: "npt.ArrayLike") -> None:
        """Transforms the vertices within their object by a 4x4 array with the translation in [:3, 3]."""
        array = real_array(matrix, "a matrix", "a 4x4 array")
        if array.shape != (4, 4):
            raise ValueError(f"a matrix of shape {array.shape}: give a 4x4 array")
        self._send(m.TransformTrimesh(object, array.ravel()))

    def set_mesh_type(self, object: int, type: int) -> None:
        """Chooses the collision library of old servers: 0 Ghost, 1 Hcollide. Ignored by servers of this project,
        which answer with a text."""
        self._send(m.SetTrimeshType(object, type))

    def set_object_name(self, object: int, name: str) -> None:
        """Names an object for people, in the viewer and in recordings. Raises ValueError for more than 64 bytes."""
        self._send(m.SetObjectName(object, name))

    def clear_mesh(self, object: int) -> None:
        """Removes all vertices and triangles of an object."""
        self._send(m.ClearTrimesh(object))

    def set_haptic_origin(self, position_m: Numbers, axis: Numbers, angle_rad: float) -> None:
        """Places the device in the world: position, and rotation about an axis."""
        self._send(m.SetHapticOrigin(position_m, axis, angle_rad))

    def set_haptic_scale(self, scale: float) -> None:
        """Scales the motion of the device in the world."""
        self._send(m.SetHapticScale(scale))

    def set_scene_origin(self, position_m: Numbers, axis: Numbers, angle_rad: float) -> None:
        """Places the scene in the world: position, and rotation about an axis."""
        self._send(m.SetSceneOrigin(position_m, axis, angle_rad))

    # --- Stock VRPN forces, in metres. They end when the client that set them leaves, over 250 ms.

    def set_plane(self, plane: Plane) -> None:
        """Starts or changes the plane of this index."""
        p = instance(plane, Plane)
        self._send(
            m.Plane(p.plane, p.stiffness, p.damping, p.dynamic_friction, p.static_friction, p.index, p.recovery_ms)
        )

    def set_plane_texture(self, texture: PlaneTexture) -> None:
        """Sets adhesion, texture and buzz of plane 0."""
        self._send(m.Plane2(*instance(texture, PlaneTexture)))

    def stop_plane(self, index: int = 0) -> None:
        """Removes the plane of this index."""
        self._send(m.Plane()._replace(index=index))

    def set_force_field(self, field: ForceField) -> None:
        """Sets the force field of the device. Sent by datagram where the connection has them: a lost or late one is
        not repeated, so send it again and again."""
        jacobian = real_array(instance(field, ForceField).jacobian_N_per_m, "a jacobian", "9 numbers, or a 3x3 array").ravel()
        self._send(m.ForceField(field.origin_m, field.force_N, jacobian, field.radius_m), fast=True)

    def stop_force_field(self) -> None:
        """Ends the force field."""
        self._send(m.ForceField())

    def constrain_to_point(self, point_m: Numbers, stiffness_N_per_m: float) -> None:
        """Pulls the device to a point by a spring, until release_constraint()."""
        self._constrain(1, stiffness_N_per_m, m.ConstraintPoint(point_m))

    def constrain_to_line(self, point_m: Numbers, direction: Numbers, stiffness_N_per_m: float) -> None:
        """Pulls the device to a line, given by a point and a direction of any length, until release_constraint()."""
        self._constrain(2, stiffness_N_per_m, m.ConstraintLinePoint(point_m), m.ConstraintLineDirection(direction))

    def constrain_to_plane(self, point_m: Numbers, normal: Numbers, stiffness_N_per_m: float) -> None:
        """Pulls the device to a plane, given by a point and a normal of any length, until release_constraint()."""
        self._constrain(3, stiffness_N_per_m, m.ConstraintPlanePoint(point_m), m.ConstraintPlaneNormal(normal))

    def _constrain(self, mode: int, stiffness: float, *places: Any) -> None:
        self._send_all(m.ConstraintMode(mode), *places, m.ConstraintStiffness(stiffness), m.ConstraintEnable(1))

    def release_constraint(self) -> None:
        """Ends the constraint."""
        self._send(m.ConstraintEnable(0))

    def start_custom_effect(self, effect: int, parameters: Numbers = ()) -> None:
        """Starts an effect that the server knows by number. Servers of this project know 0, a buzz: amplitude (N),
        frequency (Hz), duration (s), direction x y z; missing parameters are 1, 40, 2, (0, 0, 1)."""
        self._send(m.CustomEffect(effect, parameters))

    def stop_custom_effect(self) -> None:
        """Stops the effect of start_custom_effect()."""
        self._send(m.CustomEffect(m.STOP_CUSTOM_EFFECT, ()))

    # --- Tracker and buttons

    def request_to_room(self) -> None:
        """Asks for a ToRoomReport."""
        self._send(m.TrackerRequestToRoom())

    def request_unit_to_sensor(self) -> None:
        """Asks for a UnitToSensorReport of each sensor."""
        self._send(m.TrackerRequestUnitToSensor())

    def request_workspace(self) -> None:
        """Asks for a WorkspaceReport."""
        self._send(m.TrackerRequestWorkspace())

    def set_update_rate(self, rate_Hz: float) -> None:
        """Sets the report rate of this client."""
        self._send(m.TrackerSetUpdateRate(rate_Hz))

    def reset_origin(self) -> None:
        """Makes the present position of the proxy the origin of poses."""
        self._send(m.TrackerResetOrigin())

    def set_button_mode(self, button: int, mode: ButtonMode) -> None:
        """Makes a button, or all (ALL_BUTTONS), momentary or a toggle. With all, what is a toggle keeps its state."""
        self._send(m.ButtonAdmin(button, mode))

    def send_text(self, text: str, severity: Severity = Severity.NORMAL) -> None:
        """Sends a text, which servers of this project write to their log. Raises ValueError for more than 1023
        bytes."""
        self._send(m.Text(severity, 0, text))
