"""The teleoperator: actions from pose, gripper and buttons; feedback by a force or a contact."""

import logging
import math
import time
from collections import deque
from numbers import Real
from typing import Any, Callable, Deque, Dict, Optional, Tuple

import numpy as np
from lerobot.teleoperators.teleoperator import Teleoperator

import hapticd

from .config_hapticd_teleop import HapticdTeleopConfig

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_FORCE = ("force_x", "force_y", "force_z")
_CONTACT = (
    "contact_x", "contact_y", "contact_z", "contact_nx", "contact_ny", "contact_nz", "contact_stiffness"
)  # fmt: skip
_EFFECT = 63  # the last of the server's 64 effects: a program beside this one starts from 0
_PLANE = 7  # likewise
_SENSORS = {"proxy": 0, "hand": 1}
_LOG = logging.getLogger(__name__)
_LEVELS = {hapticd.Severity.WARNING: logging.WARNING, hapticd.Severity.ERROR: logging.ERROR}


#: What the fields of the configuration must be.
_FINITE = ("a finite number", math.isfinite)
_NOT_NEGATIVE = ("a finite number of at least 0", lambda value: 0 <= value < math.inf)
_LIMITS: Dict[str, Tuple[str, Callable[[float], bool]]] = {
    "scale": ("a finite number other than 0", lambda value: value != 0 and math.isfinite(value)),
    "gripper_open_rad": ("a finite number above 0", lambda value: 0 < value < math.inf),
    **dict.fromkeys(("offset_x", "offset_y", "offset_z"), _FINITE),
    **dict.fromkeys(("rate_Hz", "connect_timeout", "feedback_hold_s", "max_force_N"), _NOT_NEGATIVE),
    **dict.fromkeys(("buttons", "gripper_button"), ("a whole number of at least 0", lambda number: number >= 0 and number.is_integer())),
}


def _check(config: HapticdTeleopConfig) -> None:
    """Raises ValueError for a field that would fail only in the session."""
    if config.point not in _SENSORS:
        raise ValueError(f'point {config.point!r}: expected "hand" or "proxy"')
    for name, (expected, holds) in _LIMITS.items():
        value = getattr(config, name)
        if not isinstance(value, Real) or not holds(float(value)):
            raise ValueError(f"{name} {value!r}: expected {expected}")


def _finite(name: str, value: Any) -> float:
    """A number of the feedback; of an array or tensor with one number, too."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"feedback {name} {value!r}: expected a finite number")
    return number


class HapticdTeleop(Teleoperator):
    """One haptic device of one server.

    Action, all of them floats: x, y, z (m, server's frame: +x right, +y up, +z towards the user), qx, qy, qz, qw
    (from stylus to world), gripper (0 closed, 1 open), button_0 and so on (0 or 1).

    Feedback, any of: force_x, force_y, force_z (N, on the hand), held until the next call; contact_x, contact_y,
    contact_z (m, a point of a surface in the frame of the action), contact_nx, contact_ny, contact_nz (its normal,
    out of the surface), contact_stiffness (N/m at the device, 0: none), which the server renders at 1 kHz. A contact
    is stiff and stable where a held force is not: prefer it. A call ends what it does not name: a force without a key of
    the force, a contact without contact_stiffness. Feedback ends `feedback_hold_s` after the last call of
    send_feedback(), with the next call of get_action(); when the program hangs, the server ends it after 500 ms, with the
    connection. The client reconnects by itself.
    """

    config_class = HapticdTeleopConfig
    name = "hapticd"

    def __init__(self, config: HapticdTeleopConfig) -> None:
        _check(config)
        self._hand: Optional[hapticd.Client] = None
        super().__init__(config)
        self.config = config
        self._offset = np.array([config.offset_x, config.offset_y, config.offset_z])
        self._feedback_at = 0.0
        # The newest one that began or ended since the last feedback.
        self._connections: "Deque[hapticd.reports.ConnectionReport]" = deque(maxlen=1)
        self._force = False
        self._contact = False
        self._beats = False
        self._reports_hand = False

    @property
    def action_features(self) -> Dict[str, type]:
        names = (*_POSE, "gripper", *(f"button_{i}" for i in range(self.config.buttons)))
        return {name: float for name in names}

    @property
    def feedback_features(self) -> Dict[str, type]:
        return {name: float for name in (*_FORCE, *_CONTACT)}

    @property
    def is_connected(self) -> bool:
        return self._hand is not None and self._hand.connected

    def connect(self, calibrate: bool = True) -> None:
        """Raises ConnectionError with the server's address and the remedy."""
        if self.is_connected:
            raise ConnectionError(f"{self} is connected already")
        self.disconnect()
        self._hand = hapticd.connect(self.config.device, connect_timeout=self.config.connect_timeout)
        self._hand.on_connection(self._connections.append)
        self._hand.on_text(self._log)
        try:
            self.configure()
            if not self._wait_reported(self._hand):
                raise ConnectionError(f"{self.config.device} reports no pose")
        except BaseException:
            self.disconnect()
            raise

    def _log(self, report: hapticd.TextReport) -> None:
        """Logs texts from the server, such as the reason of a refused feedback: without it, nobody would know why nothing is felt."""
        _LOG.log(_LEVELS.get(report.severity, logging.INFO), "%s: %s", self.config.device, report.text)

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """Nothing to do: the server calibrates its device (`hapticd serve --calibrate`)."""

    def configure(self) -> None:
        hand = self._connected()
        self._reports_hand = hand.wait_capabilities() is not None
        if self._reports_hand:
            # The gripper comes with the hand's reports: they say in each whether there is one. The place of its analog
            # channel depends on the subscription and on the server's configuration.
            kinds = hapticd.Reports.TRACKER | hapticd.Reports.BUTTON | hapticd.Reports.HAND
            hand.subscribe(kinds, self.config.rate_Hz)

    def _reported(self, latest: hapticd.LatestReports) -> bool:
        """Whether an action is known. Without the first report of the hand, a closed gripper would be taken for none,
        and the robot's would open."""
        return _SENSORS[self.config.point] in latest.pose and (not self._reports_hand or latest.hand.time > 0)

    def _wait_reported(self, hand: hapticd.Client) -> bool:
        """Waits until an action is known; false after the timeout."""
        deadline = time.monotonic() + max(self.config.connect_timeout, 1.0)
        while not (hand.connected and self._reported(hand.latest)):
            if time.monotonic() > deadline:
                return False
            hand.poll(0.1)
        return True

    def _connected(self) -> hapticd.Client:
        if self._hand is None:
            raise ConnectionError(f"{self} is not connected: call connect() first")
        return self._hand

    def get_action(self) -> Dict[str, float]:
        """The newest one. Waits for a connection that was lost up to connect_timeout (at least 1 s), and raises
        ConnectionError after it."""
        hand = self._connected()
        while hand.poll(0):
            pass
        if (self._force or self._contact) and time.monotonic() - self._feedback_at > self.config.feedback_hold_s:
            self._end_feedback(hand)
        if not self._wait_reported(hand):
            raise ConnectionError(f"{self}: connection to {self.config.device} lost")
        latest = hand.latest
        pose = latest.pose[_SENSORS[self.config.point]]
        position = self.config.scale * pose.position_m + self._offset
        values = [*position, *pose.orientation, self._gripper(latest)]
        values += [float(latest.pressed.get(i, False)) for i in range(self.config.buttons)]
        return dict(zip(self.action_features, map(float, values)))

    def _gripper(self, latest: hapticd.LatestReports) -> float:
        opening_rad = latest.hand.gripper_rad
        if not math.isnan(opening_rad):
            return float(np.clip(opening_rad / self.config.gripper_open_rad, 0.0, 1.0))
        return 0.0 if latest.pressed.get(self.config.gripper_button, False) else 1.0

    def send_feedback(self, feedback: Dict[str, Any]) -> None:
        hand = self._connected()
        unknown = set(feedback) - set(self.feedback_features)
        if unknown:
            raise ValueError(f"feedback {sorted(unknown)}: expected {', '.join(self.feedback_features)}")
        numbers = {name: _finite(name, value) for name, value in feedback.items()}
        force_N = np.array([numbers.get(name, 0.0) for name in _FORCE])
        contact = [numbers.get(name, 0.0) for name in _CONTACT]
        if contact[6] > 0 and np.linalg.norm(contact[3:6]) == 0:
            raise ValueError("a contact with the normal 0, 0, 0: give contact_nx, contact_ny, contact_nz")
        self._feedback_at = time.monotonic()
        if self._connections:  # nothing of what was felt through another one goes on
            self._connections.clear()
            self._force = self._contact = False
        # What it does not name ends: the caller would otherwise renew it for ever by feedback of another kind.
        self._send_force(hand, force_N)
        self._send_contact(hand, contact)
        self._beat(hand)
        hand.flush()

    def _beat(self, hand: hapticd.Client) -> None:
        """Heartbeats only while feedback acts: LeRobot pauses for seconds while it saves an episode."""
        acts = self._force or self._contact
        if self._reports_hand and acts != self._beats:
            hand.enable_heartbeat(acts)
            self._beats = acts

    def _send_force(self, hand: hapticd.Client, force_N: "np.ndarray[Any, Any]") -> None:
        size = float(np.linalg.norm(force_N))
        if size == 0:
            if self._force:
                hand.stop_effect(_EFFECT)
            self._force = False
            return
        hand.set_effect(_EFFECT, hapticd.Effect.constant(force_N / size, min(size, self.config.max_force_N)))
        if not self._force:
            hand.start_effect(_EFFECT)
        self._force = True

    def _send_contact(self, hand: hapticd.Client, contact: "list[float]") -> None:
        point = (np.array(contact[:3]) - self._offset) / self.config.scale  # in the frame of the device
        normal = np.array(contact[3:6]) * math.copysign(1.0, self.config.scale)
        stiffness = contact[6]
        if stiffness <= 0:
            if self._contact:
                hand.stop_plane(_PLANE)
            self._contact = False
            return
        normal /= float(np.linalg.norm(normal))
        hand.set_plane(
            hapticd.Plane((*normal, -float(normal @ point)), min(stiffness / 1000.0, 1.0), index=_PLANE, recovery_ms=20)
        )
        self._contact = True

    def _end_feedback(self, hand: hapticd.Client) -> None:
        if self._force:
            hand.stop_effect(_EFFECT)
        if self._contact:
            hand.stop_plane(_PLANE)
        self._force = self._contact = False
        self._beat(hand)
        hand.flush()

    def disconnect(self) -> None:
        hand, self._hand = self._hand, None
        self._force = self._contact = self._beats = False
        if hand is not None:
            hand.close()
