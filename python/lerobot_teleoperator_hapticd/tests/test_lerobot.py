"""The teleoperator against a real server, below a test double of LeRobot's base class.

LeRobot is no Debian package, so the abstract class and the registry stand here as its documentation describes them.
"""

import abc
import contextlib
import importlib
import importlib.metadata
import os
import pathlib
import struct
import sys
import time
import types
from dataclasses import dataclass
from typing import Any, Dict, Iterator

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests"))

import hapticd  # noqa: E402
from conftest import HAPTICD, Server  # noqa: E402


def lerobot_double() -> Dict[str, types.ModuleType]:
    @dataclass(kw_only=True)
    class TeleoperatorConfig(abc.ABC):
        id: "str | None" = None
        calibration_dir: "pathlib.Path | None" = None
        registry = {}  # type: ignore[var-annotated]

        @classmethod
        def register_subclass(cls, name: str) -> Any:
            def register(config: type) -> type:
                cls.registry[name] = config
                return config

            return register

    class Teleoperator(abc.ABC):
        def __init__(self, config: Any) -> None:
            self.id = config.id

        def __str__(self) -> str:
            return f"{self.id} {type(self).__name__}"

        def __enter__(self) -> Any:
            self.connect()
            return self

        def __exit__(self, *_: object) -> None:
            self.disconnect()

        action_features = property(abc.abstractmethod(lambda self: None))
        feedback_features = property(abc.abstractmethod(lambda self: None))
        is_connected = property(abc.abstractmethod(lambda self: None))
        is_calibrated = property(abc.abstractmethod(lambda self: None))

        @abc.abstractmethod
        def connect(self, calibrate: bool = True) -> None: ...
        @abc.abstractmethod
        def calibrate(self) -> None: ...
        @abc.abstractmethod
        def configure(self) -> None: ...
        @abc.abstractmethod
        def get_action(self) -> Dict[str, Any]: ...
        @abc.abstractmethod
        def send_feedback(self, feedback: Dict[str, Any]) -> None: ...
        @abc.abstractmethod
        def disconnect(self) -> None: ...

    modules = {name: types.ModuleType(name) for name in ("lerobot", "lerobot.teleoperators", "lerobot.teleoperators.config",
                                                         "lerobot.teleoperators.teleoperator")}  # fmt: skip
    modules["lerobot.teleoperators.config"].TeleoperatorConfig = TeleoperatorConfig  # type: ignore[attr-defined]
    modules["lerobot.teleoperators.teleoperator"].Teleoperator = Teleoperator  # type: ignore[attr-defined]
    return modules


sys.modules.update(lerobot_double())
plugin = importlib.import_module("lerobot_teleoperator_hapticd")


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.stop()


def make(server: Server, **fields: Any) -> Any:
    """As LeRobot makes it: the class is named as its configuration without "Config", in the same package."""
    config = sys.modules["lerobot.teleoperators.config"].TeleoperatorConfig.registry["hapticd"](device=server.tcp, **fields)
    module = importlib.import_module(type(config).__module__.rpartition(".")[0])
    return getattr(module, type(config).__name__.removesuffix("Config"))(config)


def until(condition: Any, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_the_installed_package_has_the_prefix_that_lerobot_looks_for() -> None:
    names = [d.metadata["Name"] for d in importlib.metadata.distributions()]
    if pathlib.Path(plugin.__file__).parts[-3] == "site-packages":
        assert "lerobot_teleoperator_hapticd" in [name.replace("-", "_") for name in names]


def test_actions_follow_the_hand(server: Server) -> None:
    with make(server, id="right") as teleop, hapticd.connect(server.tcp) as person:
        person.hold_hand((20, 10, 5), (0, 0, 1, 0), buttons=2)
        goal = np.array([0.02, 0.01, 0.005])
        until(lambda: np.linalg.norm([teleop.get_action()[k] for k in "xyz"] - goal) < 1e-3)
        until(lambda: teleop.get_action()["button_1"] == 1.0)
        action = teleop.get_action()
        assert list(action) == list(teleop.action_features)
        assert all(type(value) is teleop.action_features[name] for name, value in action.items())
        assert action["gripper"] == 1.0
        until(lambda: abs(teleop.get_action()["qz"]) > 0.99)
        person.hold_hand((20, 10, 5), buttons=1)
        until(lambda: teleop.get_action()["gripper"] == 0.0)
    assert not teleop.is_connected


def test_a_gripper_is_measured_under_every_subscription(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A device with a gripper: its library is the mock, to which ArmBlock of tests/mocks/arm_block.h gives the opening."""
    arm = tmp_path / "arm"

    def open_to(angle_rad: float) -> None:
        with arm.open("r+b") as file:
            file.seek(8)
            file.write(struct.pack("=i", 1))  # one place, the origin
            file.seek(24600)
            file.write(struct.pack("=d", angle_rad))

    with arm.open("wb") as file:
        file.truncate(32 << 20)
    open_to(0.25)
    mocks = pathlib.Path(HAPTICD).parents[1] / "mocks"
    monkeypatch.setenv("HAPTICD_MOCK_ARM", str(arm))
    monkeypatch.setenv("HAPTICD_DHD_LIB", os.environ.get("HAPTICD_MOCK_DRD", str(mocks / "libmock_drd.so")))
    gripping = Server("--device", "forcedimension")
    with make(gripping) as teleop:
        assert teleop.get_action()["gripper"] == pytest.approx(0.5)  # from the first action on
        open_to(0.1)
        until(lambda: teleop.get_action()["gripper"] == pytest.approx(0.2))
        open_to(0.9)
        until(lambda: teleop.get_action()["gripper"] == 1.0)
        open_to(0.4)
        analog = hapticd.Reports.ANALOG | hapticd.Reports.CONTACT_ANALOG
        teleop._hand.subscribe(hapticd.Reports.TRACKER | hapticd.Reports.HAND | analog)
        until(lambda: teleop.get_action() and len(teleop._hand.latest.analog.channels) == 7)
        until(lambda: teleop.get_action()["gripper"] == pytest.approx(0.8))
    gripping.stop()


def test_scale_and_offset_place_the_action(server: Server) -> None:
    with make(server, scale=2.0, offset_x=0.3) as teleop, hapticd.connect(server.tcp) as person:
        person.hold_hand((20, 10, 5))
        goal = np.array([0.34, 0.02, 0.01])
        until(lambda: np.linalg.norm([teleop.get_action()[k] for k in "xyz"] - goal) < 2e-3)


def test_a_contact_is_felt_and_ends_without_renewal(server: Server) -> None:
    with make(server) as teleop, hapticd.connect(server.tcp) as person:
        person.hold_hand((0, 0, 0))
        until(lambda: person.poll(0.05) is not None and abs(teleop.get_action()["y"]) < 1e-3)
        contact = dict(contact_x=0.0, contact_y=0.004, contact_z=0.0, contact_nx=0.0, contact_ny=2.0, contact_nz=0.0,
                       contact_stiffness=400.0)  # fmt: skip
        felt = []
        person.on_force(lambda report: felt.append(report.force_N))

        def feel() -> bool:
            teleop.send_feedback(contact)
            teleop.get_action()
            person.poll(0.01)
            return bool(felt and felt[-1][1] > 0.3)

        until(feel)
        assert abs(felt[-1][0]) < 0.05

        def ended() -> bool:
            teleop.get_action()
            person.poll(0.01)
            return bool(felt[-1][1] == 0)

        until(ended)


def test_a_force_is_limited_and_ends(server: Server) -> None:
    with make(server, max_force_N=1.0) as teleop, hapticd.connect(server.tcp) as person:
        person.hold_hand((0, 0, 0))
        felt = []
        person.on_force(lambda report: felt.append(report.force_N))

        def feel() -> bool:
            teleop.send_feedback({"force_x": 50.0, "force_y": 0.0, "force_z": 0.0})
            person.poll(0.01)
            return bool(felt and felt[-1][0] > 0.99)

        until(feel)
        assert max(force[0] for force in felt) < 1.01
        teleop.send_feedback({"force_x": 0.0})
        until(lambda: person.poll(0.01) is not None and felt[-1][0] == 0)


@pytest.mark.parametrize("with_force", [True, False])
def test_a_call_ends_what_it_does_not_name(server: Server, with_force: bool) -> None:
    contact = dict(contact_y=0.004, contact_ny=1.0, contact_stiffness=400.0)
    both = {"force_x": 1.0, **contact}
    rest = {"force_x": 1.0} if with_force else contact
    with make(server) as teleop, hapticd.connect(server.tcp) as person:
        person.hold_hand((0, 0, 0))

        def feel(feedback: Dict[str, float], forces: "tuple[bool, bool]") -> bool:
            teleop.send_feedback(feedback)
            teleop.get_action()
            person.poll(0.01)
            force_N = person.latest.force.force_N
            return (force_N[0] > 0.5, force_N[1] > 0.3) == forces

        until(lambda: feel(both, (True, True)))
        until(lambda: feel(rest, (with_force, not with_force)), 2)
        until(lambda: feel(both, (True, True)))
        until(lambda: feel({}, (False, False)), 2)


def test_feedback_is_felt_again_after_a_restart_of_the_server() -> None:
    restarted = Server()
    with make(restarted) as teleop, hapticd.connect(restarted.tcp) as person:

        def feel() -> bool:
            with contextlib.suppress(ConnectionError):
                teleop.get_action()
            teleop.send_feedback({"force_x": 1.0, "contact_y": 0.004, "contact_ny": 1.0, "contact_stiffness": 400.0})
            person.poll(0.01)
            if person.connected:
                person.hold_hand((0, 0, 0))
            force_N = person.latest.force.force_N
            return bool(force_N[0] > 0.5 and force_N[1] > 0.3)

        until(feel)
        restarted.stop()
        until(lambda: not feel())
        restarted.start(f"127.0.0.1:{restarted.port}")
        until(feel)
    restarted.stop()


@pytest.mark.parametrize("with_feedback", [False, True])
def test_a_pause_does_not_end_the_session(with_feedback: bool) -> None:
    """LeRobot saves an episode between two actions. Felt feedback must not go on meanwhile, nor end the session."""
    server = Server()
    with make(server) as teleop, hapticd.connect(server.tcp) as person:
        person.hold_hand((0, 0, 0))
        person.flush()

        def feel() -> bool:
            teleop.get_action()
            teleop.send_feedback({"force_x": 1.0})
            person.poll(0.01)
            return bool(person.latest.force.force_N[0] > 0.5)

        until(feel)
        if not with_feedback:
            teleop.send_feedback({})
        connections = teleop._hand.statistics().connections
        time.sleep(1.5)
        if with_feedback:
            until(lambda: person.poll(0.01) is not None and person.latest.force.force_N[0] == 0)
        for _ in range(10):
            teleop.get_action()
        assert teleop._hand.statistics().connections == connections + with_feedback
        until(feel)
    server.stop()


def test_what_is_wrong_is_named(server: Server) -> None:
    teleop = make(server, id="left")
    with pytest.raises(ConnectionError, match="left HapticdTeleop is not connected: call connect"):
        teleop.get_action()
    with pytest.raises(ValueError, match="point 'stylus'"):
        make(server, point="stylus")
    with make(server) as teleop:
        with pytest.raises(ConnectionError, match="is connected already"):
            teleop.connect()
        with pytest.raises(ValueError, match=r"feedback \['force'\]: expected force_x"):
            teleop.send_feedback({"force": 1.0})
        with pytest.raises(ValueError, match="expected a finite number"):
            teleop.send_feedback({"force_x": float("nan")})
        assert teleop.is_calibrated and set(teleop.feedback_features) >= {"force_x", "contact_stiffness"}
        teleop.calibrate()
    wrong = make(server, connect_timeout=0.2)
    wrong.config.device = "Phantom@tcp://127.0.0.1:1"
    with pytest.raises(ConnectionError, match="nothing listens on 127.0.0.1:1"):
        wrong.connect()
    assert not wrong.is_connected


@pytest.mark.parametrize(
    "name, value",
    [
        ("offset_y", float("nan")), ("buttons", -1), ("gripper_open_rad", 0.0), ("feedback_hold_s", -1.0),
        ("max_force_N", -0.5), ("rate_Hz", -1.0), ("scale", "1"), ("buttons", 2.5), ("gripper_button", -1),
        ("gripper_button", "a"), ("connect_timeout", -1.0),
    ],
)  # fmt: skip
def test_a_configuration_out_of_range_is_named_before_the_session(server: Server, name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"{name} {value!r}: expected "):
        make(server, **{name: value})


def test_feedback_that_is_wrong_acts_in_no_part(server: Server) -> None:
    contact = {"contact_y": 0.0, "contact_stiffness": 500.0}  # its normal is missing
    with make(server) as teleop, hapticd.connect(server.tcp) as other:
        teleop.get_action()
        for wrong, text in (
            ({"force_z": 1.0, **contact}, "the normal 0, 0, 0"),
            ({"force_z": "much"}, "force_z 'much': expected a finite number"),
            ({"force_z": None}, "force_z None: expected a finite number"),
        ):
            with pytest.raises(ValueError, match=text):
                teleop.send_feedback(wrong)
        teleop._hand.wait_capabilities()
        other.run_for(0.2)
        assert abs(other.latest.force.force_N[2]) < 0.2
        assert not teleop._force and not teleop._contact


def test_what_the_server_refuses_is_in_the_log(server: Server, caplog: pytest.LogCaptureFixture) -> None:
    """Otherwise nothing is felt, and nobody knows why."""
    with make(server) as teleop:
        teleop.send_feedback({"contact_y": 1e30, "contact_ny": 1.0, "contact_stiffness": 500.0})  # far away from everything
        until(lambda: teleop.get_action() and caplog.records)
    assert caplog.records[-1].levelname == "ERROR"
    assert f"{server.tcp}: sendSurface plane 7" in caplog.text and "refused" in caplog.text


def test_a_demonstration_of_a_hundred_frames(server: Server) -> None:
    """The loop of LeRobot's recorder: an action and a feedback for each frame."""
    with make(server) as teleop, hapticd.connect(server.tcp) as person:
        frames = []
        for i in range(100):
            person.hold_hand((10 * np.sin(i / 10), 0, 10 * np.cos(i / 10)))
            action = teleop.get_action()
            teleop.send_feedback({"force_x": 0.0, "force_y": 0.1, "force_z": 0.0})
            frames.append(action)
            time.sleep(0.01)
        path = np.array([[frame[k] for k in "xyz"] for frame in frames])
        assert np.all(np.isfinite(path)) and np.ptp(path[:, 0]) > 0.004
