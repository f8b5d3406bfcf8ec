"""Configuration of the teleoperator."""

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("hapticd")
@dataclass(kw_only=True)
class HapticdTeleopConfig(TeleoperatorConfig):
    """Which device, and how its state becomes an action."""

    #: NAME@host, NAME@host:port or NAME@tcp://host:port.
    device: str = "Phantom@localhost"
    #: How long connect() waits for the server, and get_action() for one that was lost (at least 1 s), in seconds.
    connect_timeout: float = 3.0
    #: Reports per second that the server sends; the loop of LeRobot reads the newest one.
    rate_Hz: float = 250.0
    #: "hand": where the device is. "proxy": the same, but never inside a surface.
    point: str = "hand"
    #: Position of the action = scale * position of the device + offset (m).
    scale: float = 1.0
    offset_x: float = 0.0
    offset_y: float = 0.0
    offset_z: float = 0.0
    #: Buttons in the action.
    buttons: int = 2
    #: Opening of the device's gripper that counts as fully open, in radians.
    gripper_open_rad: float = 0.5
    #: Without a gripper on the device, this button closes the gripper of the robot.
    gripper_button: int = 0
    #: Feedback that is not renewed for so long ends.
    feedback_hold_s: float = 0.1
    #: Upper limit of a force in send_feedback(), in N; the server limits forces to those of the device, too.
    max_force_N: float = 3.0
