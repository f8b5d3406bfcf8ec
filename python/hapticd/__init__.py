"""Client of the haptics server hapticd and of VRPN servers, and reader of its recordings.

    import hapticd
    with hapticd.connect("Phantom@localhost") as hand:
        hand.upload_mesh(0, *hapticd.sphere(30))
        hand.set_surface(0, hapticd.Surface(stiffness=0.8))
        ticks = hand.collect("pose", seconds=2)

`hapticd.aio` is the same client for asyncio; `hapticd.Session` reads recordings.
"""

from . import aio
from ._commands import ALL_BUTTONS
from ._core import Options, Subscription, UploadProgress
from ._messages import TRIPS
from ._statistics import LatencyHistogram, ReportStatistics, Statistics
from .client import Client, connect
from .errors import ConnectError, ConnectionLost, Error, RecordingError, ServerError, Unsupported
from .reports import (
    AccelerationReport,
    AnalogReport,
    AngleReport,
    ButtonReport,
    ConnectionReport,
    Contact,
    ContactPointReport,
    ContactsReport,
    DepthReport,
    ForceError,
    ForceErrorReport,
    ForceReport,
    GuardReport,
    HandReport,
    LatestReports,
    PoseReport,
    RemoteContactForce,
    Severity,
    TextReport,
    TickReport,
    ToRoomReport,
    TouchedObjectReport,
    TouchingReport,
    Trips,
    UnitToSensorReport,
    VelocityReport,
    WorkspaceReport,
)
from .scene import (
    IDENTITY,
    ButtonMode,
    Capabilities,
    Effect,
    Faces,
    ForceField,
    Plane,
    PlaneTexture,
    RemoteContact,
    RemoteShape,
    Reports,
    Surface,
    sphere,
    translation,
)
from .session import Session

__version__ = "0.1.0"

__all__ = [
    "ALL_BUTTONS",
    "AccelerationReport",
    "AnalogReport",
    "AngleReport",
    "ButtonMode",
    "ButtonReport",
    "Capabilities",
    "Client",
    "ConnectError",
    "ConnectionLost",
    "ConnectionReport",
    "Contact",
    "ContactPointReport",
    "ContactsReport",
    "DepthReport",
    "Effect",
    "Error",
    "Faces",
    "ForceError",
    "ForceErrorReport",
    "ForceField",
    "ForceReport",
    "GuardReport",
    "HandReport",
    "IDENTITY",
    "LatencyHistogram",
    "LatestReports",
    "Options",
    "Plane",
    "PlaneTexture",
    "PoseReport",
    "RecordingError",
    "RemoteContact",
    "RemoteContactForce",
    "RemoteShape",
    "ReportStatistics",
    "Reports",
    "ServerError",
    "Session",
    "Severity",
    "Statistics",
    "Subscription",
    "Surface",
    "TRIPS",
    "TextReport",
    "TickReport",
    "ToRoomReport",
    "TouchedObjectReport",
    "TouchingReport",
    "Trips",
    "UnitToSensorReport",
    "Unsupported",
    "UploadProgress",
    "VelocityReport",
    "WorkspaceReport",
    "aio",
    "connect",
    "sphere",
    "translation",
]
