"""What a client puts into the scene, as plain values.

Lengths are units of the client's world, in the world frame, where nothing else is said; without a workspace
command, one unit is 1 mm of the device. Types of stock VRPN (ForceField, Plane, PlaneTexture) are in metres
instead. Servers check the values: a value out of range is clamped, an invalid one refused, each with a text.
"""

import enum
from numbers import Integral, Real
from typing import NamedTuple, Tuple

import numpy as np
import numpy.typing as npt

from ._codec import Numbers, shortened, vector

#: The identity; matrices are 4x4 arrays that act on column vectors: the translation is in [:3, 3].
IDENTITY: npt.NDArray[np.float64] = np.eye(4)
IDENTITY.setflags(write=False)


def translation(x: float, y: float, z: float) -> npt.NDArray[np.float64]:
    """The 4x4 matrix that translates by (x, y, z)."""
    matrix = np.eye(4)
    matrix[:3, 3] = vector((x, y, z), "a translation by", "three finite numbers")
    return matrix


class Surface(NamedTuple):
    """Haptic properties of an object's surface. All but the mass range from 0 to 1; docs/haptics.md gives their
    units and laws, of which `material_scale` in the server's configuration selects one of two."""

    stiffness: float = 0.5  # 1: 500 N/m, or the device's nominal stiffness; 0 cannot be felt
    damping: float = 0.0  # 1: 2 N s/m
    static_friction: float = 0.0  # Coulomb coefficient
    dynamic_friction: float = 0.0  # Coulomb coefficient, at most the static one
    popthrough: float = 0.0  # force at which the surface gives way, 1: 3.3 N or the device's peak; 0: never
    mass_kg: float = 0.0  # stored by the server and not rendered


class Faces(enum.IntEnum):
    """Sides of triangles that are rendered."""

    FRONT = 0
    BACK = 1
    BOTH = 2


class ButtonMode(enum.IntEnum):
    """How a button reports; the numbers are VRPN's."""

    MOMENTARY = 10
    TOGGLE_STARTS_OFF = 20
    TOGGLE_STARTS_ON = 21


class Reports(enum.IntFlag):
    """Kinds of reports to subscribe to; combine them by |. Force errors, guard states and texts are always sent."""

    NONE = 0
    PROXY = 1  # poses of sensor 0, the proxy
    FORCE = 2  # force, contact point, depth, touching, touched object, angle
    BUTTON = 4
    ANALOG = 8  # the opening of a gripper
    TICK = 16
    CONTACTS = 32
    HAND = 64  # HandReport
    CONTACT_POINT = 128  # poses of sensor 2, the surface contact point
    TOUCH_BUTTON = 256  # contact as one more button than the device has
    CONTACT_ANALOG = 512  # contact as analog channels
    HIP = 1024  # poses and velocities of sensor 1, the device itself
    TRACKER = PROXY | HIP | CONTACT_POINT
    USUAL = TRACKER | FORCE | BUTTON | ANALOG  # what a client without a subscription receives
    ALL = 2047


class Effect(NamedTuple):
    """A force that belongs to no object. The type decides which fields count: use the functions below."""

    type: str = "constant"  # constant, spring, viscous, friction, vibrationMotor or vibrationContact
    gain: float = 0.0  # spring, friction: N/mm; viscous: N per mm/s; millimetres of the device
    magnitude_N: float = 0.0  # the force, or its upper limit
    duration_ms: float = 0.0  # 0: until stopped
    frequency: float = 0.0  # vibrationMotor: Hz; vibrationContact: rad/s, or as vibration_contact_unit says
    position: Numbers = (0.0, 0.0, 0.0)  # spring: world units, world frame
    direction: Numbers = (0.0, 0.0, 0.0)  # constant: world frame, of any length

    @classmethod
    def constant(cls, direction: Numbers, magnitude_N: float, duration_ms: float = 0) -> "Effect":
        """A force of this magnitude in this direction."""
        return cls("constant", 0, magnitude_N, duration_ms, 0, (0, 0, 0), direction)

    @classmethod
    def spring(cls, position: Numbers, gain_N_per_mm: float, magnitude_N: float, duration_ms: float = 0) -> "Effect":
        """A pull to the position that grows with the distance up to the magnitude."""
        return cls("spring", gain_N_per_mm, magnitude_N, duration_ms, 0, position)

    @classmethod
    def viscous(cls, gain_N_s_per_mm: float, magnitude_N: float, duration_ms: float = 0) -> "Effect":
        """A force against the motion that grows with the speed up to the magnitude."""
        return cls("viscous", gain_N_s_per_mm, magnitude_N, duration_ms)

    @classmethod
    def friction(cls, gain_N_per_mm: float, magnitude_N: float, duration_ms: float = 0) -> "Effect":
        """Dry friction in free space: sticks up to the magnitude, then slips."""
        return cls("friction", gain_N_per_mm, magnitude_N, duration_ms)

    @classmethod
    def motor_vibration(cls, frequency_Hz: float, magnitude_N: float) -> "Effect":
        """A vibration of the device until it is stopped."""
        return cls("vibrationMotor", 0, magnitude_N, 0, frequency_Hz)

    @classmethod
    def contact_vibration(cls, frequency_rad_per_s: float, magnitude_N: float) -> "Effect":
        """A vibration along the surface normal while something is touched, until it is stopped."""
        return cls("vibrationContact", 0, magnitude_N, 0, frequency_rad_per_s)


class ForceField(NamedTuple):
    """A force that varies linearly with the position within a radius. Stock VRPN, metres."""

    origin_m: Numbers = (0.0, 0.0, 0.0)
    force_N: Numbers = (0.0, 0.0, 0.0)  # at the origin
    jacobian_N_per_m: Numbers = (0.0,) * 9  # dF_i/dx_j, row by row, or a 3x3 array
    radius_m: float = 0.0  # no force beyond it


class Plane(NamedTuple):
    """A half-space that is solid where a x + b y + c z + d < 0, and its surface. Stock VRPN, metres."""

    plane: Numbers = (0.0, 1.0, 0.0, 0.0)  # a, b, c, d; the normal (a, b, c) of any length, d in metres times it
    stiffness: float = 0.5  # in 1000 N/m
    damping: float = 0.0  # in 1000 N s/m, at most 0.005
    static_friction: float = 0.0  # Coulomb coefficient
    dynamic_friction: float = 0.0  # Coulomb coefficient
    index: int = 0  # type: ignore[assignment]  # 0 to 7
    recovery_ms: int = 10  # time over which a new placement moves in under the hand: 1 to 10 000 ms


class PlaneTexture(NamedTuple):
    """Adhesion, texture and buzz of plane 0. Stock VRPN, metres."""

    normal_adhesion_N: float = 0.0  # force up to which the plane pulls back a hand that leaves
    lateral_adhesion_N: float = 0.0  # tangential force that the plane holds besides friction
    texture_amplitude_m: float = 0.0  # height of waves around the first contact
    texture_wavelength_m: float = 0.01  # 0: no texture
    buzz_amplitude_m: float = 0.0  # height by which the plane vibrates
    buzz_frequency_Hz: float = 60.0


class Capabilities(NamedTuple):
    """What a server and one of its devices support."""

    version: int  # of the extensions, from 1
    bulk_mesh: bool  # meshes in messages of thousands of vertices
    batch: bool
    subscribe: bool
    stop: bool  # stop_forces() and rearm_forces()
    heartbeat: bool
    hold_hand: bool  # the device is simulated
    servo_rate_Hz: float
    report_rate_Hz: float  # unless a client chooses its own
    peak_force_N: float
    buttons: int  # number of buttons
    workspace_min_m: Tuple[float, ...]  # reach of the device in its own frame, real metres
    workspace_max_m: Tuple[float, ...]
    remote_contacts: bool = False  # set_remote_contacts(), set_force() and Reports.HAND


class RemoteShape(enum.IntEnum):
    """Shape of a remote contact."""

    HALF_SPACE = 0
    SPHERE = 1
    CYLINDER = 2  # without ends


class RemoteContact(NamedTuple):
    """One surface near the tool, as the client's simulation knows it now. World frame; lengths as in the reports
    (world units / 1000: metres when the world is in millimetres)."""

    id: int  # the same surface keeps its number from update to update, and moves without a step
    point_m: Numbers  # on the surface
    normal: Numbers  # of any length, out of the material
    stiffness_N_per_m: float = 500.0  # of the device's metres; the server lowers it to what its loop can bear
    damping_Ns_per_m: float = 0.0
    static_friction: float = 0.0  # Coulomb coefficient, at most 1
    dynamic_friction: float = 0.0  # at most the static one
    velocity_m_per_s: Numbers = (0.0, 0.0, 0.0)  # of the surface at the point, at most 1 m/s of the device
    angular_velocity_rad_per_s: Numbers = (0.0, 0.0, 0.0)  # at most 20 rad/s
    shape: RemoteShape = RemoteShape.HALF_SPACE
    radius_m: float = 0.0  # of a sphere or cylinder; negative: touched from inside
    axis: Numbers = (0.0, 0.0, 1.0)  # of a cylinder, across the normal
    lifetime_s: float = 0.1  # 0.01 to 0.1, with the fade at its end
    # The surface follows the hand, as a simulated object that the hand pushes: its position may change at any rate, and
    # the client's round trip lowers the stiffness that the server allows. Otherwise it moves by its stated velocity.
    yields: bool = False


def sphere(radius: float, center: Numbers = (0.0, 0.0, 0.0), rings: int = 32) -> "Tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]":
    """A sphere as (vertices (n, 3), triangles (m, 3)) for upload_mesh(), in world units."""
    if not isinstance(rings, Integral) or rings < 3:
        raise ValueError(f"a sphere of {shortened(rings)} rings: give a whole number of at least 3")
    if not isinstance(radius, Real) or not 0 < radius < 3.4e38:
        raise ValueError(f"a sphere of radius {shortened(radius)}: give a number above 0")
    middle_point = vector(center, "a sphere around", "x, y and z")
    segments = 2 * rings
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    around = np.arange(segments) * (2 * np.pi / segments)
    p, a = np.meshgrid(polar, around, indexing="ij")
    middle = np.stack([np.sin(p) * np.cos(a), np.cos(p), np.sin(p) * np.sin(a)], axis=-1).reshape(-1, 3)
    points = np.concatenate([[[0, 1, 0]], middle, [[0, -1, 0]]]) * radius + middle_point
    i = np.arange(segments)
    j = (i + 1) % segments
    top = np.stack([np.zeros_like(i), 1 + j, 1 + i], axis=1)
    bottom = np.stack([np.full_like(i, len(points) - 1), len(points) - 1 - segments + i, len(points) - 1 - segments + j], axis=1)
    bands = []
    for ring in range(rings - 2):
        upper, lower = 1 + ring * segments, 1 + (ring + 1) * segments
        bands.append(np.stack([upper + i, upper + j, lower + i], axis=1))
        bands.append(np.stack([upper + j, lower + j, lower + i], axis=1))
    return points.astype(np.float32), np.concatenate([top, *bands, bottom]).astype(np.int32)
