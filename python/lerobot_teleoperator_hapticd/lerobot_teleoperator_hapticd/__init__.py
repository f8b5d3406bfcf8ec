"""LeRobot teleoperator for every haptic device that the server hapticd drives."""

from .config_hapticd_teleop import HapticdTeleopConfig
from .hapticd_teleop import HapticdTeleop

__all__ = ["HapticdTeleop", "HapticdTeleopConfig"]
