"""Recordings against what `hapticd export` and the committed list of commands say of them."""

import csv
import json
import pathlib
import re
import struct
import subprocess
import time
import zlib
from typing import Any, Callable, Dict, List

import numpy as np
import pytest

import hapticd
from conftest import HAPTICD, ROOT, Server, feel_a_sphere
from hapticd import session as module
from hapticd.session import _COMMANDS

RECORDINGS = ROOT / "testdata/recordings"
FILES = ["all_commands_law11", "all_commands_law5", "all_commands_law4", "all_commands_law3", "all_commands_law2",
         "all_commands_v1", "gripper_v2"]  # fmt: skip


def exported(file: pathlib.Path, to: pathlib.Path) -> List[Dict[str, str]]:
    subprocess.run([HAPTICD, "export", "--to", "csv", "-o", str(to), str(file)], check=True, capture_output=True)
    return list(csv.DictReader(to.read_text().splitlines()))


def columns_of(ticks: hapticd.session.Ticks) -> Dict[str, Any]:
    """The columns under the names of the CSV file."""
    table: Dict[str, Any] = {}
    for name in ("time_ns", "tick", "revision", "depth_m", "touching", "object", "buttons", "render_status",
                 "wakeup_error_ns", "compute_ns"):  # fmt: skip
        table[name] = ticks[name]
    for name, pattern in (("hip_m", "hip_{}_m"), ("proxy_m", "proxy_{}_m"), ("velocity_m_per_s", "velocity_{}_m_per_s"),
                          ("force_N", "force_{}_N"), ("rendered_force_N", "rendered_force_{}_N"),
                          ("normal", "normal_{}"), ("contact_point_m", "contact_point_{}_m"),
                          ("orientation_xyzw", "q{}")):  # fmt: skip
        array = ticks[name]
        for i in range(array.shape[1]):
            table[pattern.format("xyzw"[i])] = array[:, i]
    table["gripper_rad"] = ticks["gripper_rad"]
    return table


def check_against_export(file: pathlib.Path, tmp_path: pathlib.Path) -> None:
    rows = exported(file, tmp_path / "export.csv")
    with hapticd.Session(file) as session:
        ticks = session.ticks
        assert len(rows) == len(ticks) > 0
        columns = columns_of(ticks)
        assert set(rows[0]) == {*columns, "device", "guard_active", "guard_latched"}
        for name, column in columns.items():
            theirs = np.array([float(row[name] or "nan") for row in rows])
            assert np.array_equal(theirs, column.astype(float), equal_nan=True), name
        for column, name in (("guard_active", "guard_active"), ("guard_latched", "guard_latched")):
            assert ["+".join(session.trips(bits).names) for bits in ticks[name]] == [row[column] for row in rows]


@pytest.mark.parametrize("name", FILES)
def test_columns_are_those_of_the_export(name: str, tmp_path: pathlib.Path) -> None:
    check_against_export(RECORDINGS / f"{name}.haptics", tmp_path)


def test_a_fresh_recording(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "fresh.haptics"
    server = Server("--record", str(file))
    with hapticd.connect(server.tcp) as hand:
        feel_a_sphere(hand)
        hand.run_for(0.2)
    server.stop()
    check_against_export(file, tmp_path)
    with hapticd.Session(file) as session:
        assert session.remark == "" and session.devices[0].names == ("Phantom",)
        assert session.devices[0].rate_Hz == 1000 and "Phantom" in session.config
        ticks = session.ticks
        assert np.all(np.diff(ticks["tick"].astype(np.int64)) >= 1)
        assert session.lost == () or session.lost[0].count > 0
        contacts = ticks.contacts()
        assert len(contacts) == ticks["contact_count"].sum() > 0
        touching = ticks["touching"]
        assert np.array_equal(np.isfinite(ticks["contact_point_m"]).all(axis=1), touching)
        assert np.allclose(np.linalg.norm(ticks["contact_point_m"][touching], axis=1), 0.025, atol=3e-4)
        last = contacts[contacts["tick"] == contacts["tick"][-1]]
        total = last["force_N"].sum(axis=0)
        assert np.allclose(total, ticks["contact_force_N"][np.searchsorted(ticks["tick"], contacts["tick"][-1])])
        meshes = [c for c in session.commands() if c.name == "SetVertices"]
        assert np.allclose(np.linalg.norm(np.concatenate([c.fields["positions"] for c in meshes]), axis=1), 25, atol=1e-3)
        to_world = ticks["T_world_device"][-1]
        assert to_world.shape == (3, 4) and np.allclose(to_world[:, :3], 1000 * np.eye(3))
        assert ticks["guard_counts"].shape == (len(ticks), 17)
        assert ticks.to_array(["tick", "force_N"]).dtype["force_N"].shape == (3,)
        assert np.array_equal(ticks.to_array("force_N")["force_N"], ticks["force_N"])  # one name is one column
        with pytest.raises(KeyError, match="no column 'forces'; there are time_ns"):
            ticks.to_array("forces")
        with pytest.raises(KeyError, match="no column 'forces'; there are time_ns"):
            ticks["forces"]
        with pytest.raises(KeyError, match="no device 'Omni'.*there is Phantom"):
            session.ticks_of("Omni")


def test_the_contact_point_of_a_ball_in_a_corner_is_on_a_wall(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "corner.haptics"
    (tmp_path / "ball.toml").write_text('[[device]]\nname = "Phantom"\ntool_radius_mm = 3\n')
    server = Server("--config", str(tmp_path / "ball.toml"), "--record", str(file))
    corner = np.array([[0, -20, 0], [0, 20, 0], [0, 20, 20], [0, -20, 20], [20, -20, 0], [20, 20, 0]])
    with hapticd.connect(server.tcp) as hand:
        hand.hold_hand((10, 0, 10))
        hand.run_for(0.5)
        with hand.batch():
            hand.set_object_count(2)
            hand.upload_mesh(0, corner, [[0, 1, 2], [0, 2, 3]])
            hand.upload_mesh(1, corner, [[0, 4, 5], [0, 5, 1]])
            for wall in (0, 1):
                hand.set_surface(wall, hapticd.Surface(0.8))
        for deep in ((0, 0, 1), (1, 0, 0)):
            hand.hold_hand(deep)
            hand.run_for(0.4)
    server.stop()
    check_against_export(file, tmp_path)
    with hapticd.Session(file) as session:
        ticks = session.ticks
        both = ticks["contact_count"] == 2
        assert {0, 1} == set(ticks["object"][both])
        across = np.where(ticks["object"][both] == 0, 0, 2)  # a wall x = 0, a floor z = 0
        rows = np.arange(both.sum())
        assert np.allclose(ticks["contact_point_m"][both][rows, across], 0, atol=1e-7)
        assert np.allclose(ticks["normal"][both][rows, across], 1)


@pytest.mark.parametrize("name", FILES)
def test_the_guard_is_told_wherever_it_changes(name: str) -> None:
    with hapticd.Session(RECORDINGS / f"{name}.haptics") as session:
        ticks = session.ticks
        changes = {int(row["tick"]): tuple(row)[2:] for row in ticks.guard()}
        told: List[Any] = []
        for tick, *state in zip(*(ticks[c] for c in ("tick", "guard_active", "guard_latched", "guard_armed", "guard_stopped"))):
            if not told or tuple(state) != told[-1]:
                told.append(tuple(state))
                assert changes.pop(int(tick)) == told[-1]
        assert not changes and len(told) > 1


def test_pandas_gets_a_column_for_each_axis() -> None:
    pytest.importorskip("pandas")
    with hapticd.Session(RECORDINGS / "gripper_v2.haptics") as session:
        ticks = session.ticks
        table = ticks.to_pandas(["tick", "force_N", "T_world_device"])
        assert list(table.columns[:4]) == ["tick", "force_N_x", "force_N_y", "force_N_z"] and len(table.columns) == 16
        assert np.array_equal(table.index, ticks["time_ns"])
        assert np.array_equal(table["force_N_z"], ticks["force_N"][:, 2])
        assert np.array_equal(table["T_world_device_7"], ticks["T_world_device"][:, 1, 3])


MARKS = ["first", "trial 3 beginnt: Größe µ", "x" * 255, ""]


def record_marks(file: pathlib.Path) -> None:
    server = Server("--record", str(file))
    with hapticd.connect(server.tcp) as hand:
        for text in MARKS:
            hand.mark(text)
            hand.run_for(0.05)
    server.stop()


def markers_by_info(file: pathlib.Path) -> List[Any]:
    said = subprocess.run([HAPTICD, "info", "--json", str(file)], check=True, capture_output=True, text=True).stdout
    return [(int(marker["time_ns"]), marker["text"]) for marker in json.loads(said)["markers"]]


def test_markers_are_those_that_clients_set(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "marks.haptics"
    before = time.time_ns()
    record_marks(file)
    with hapticd.Session(file) as session:
        assert [marker.text for marker in session.markers] == MARKS
        times = [marker.time_ns for marker in session.markers]
        assert before < times[0] and times == sorted(times) and times[-1] < time.time_ns()
        assert list(session.markers) == markers_by_info(file)


def blocks_of(data: bytes) -> List[Any]:
    """Kind and content of each block."""
    found, at = [], 8
    while at < len(data):
        kind, length, _ = struct.unpack_from(">III", data, at)
        found.append((kind, data[at + 12 : at + 12 + length]))
        at += 12 + length
    return found


def written(blocks: List[Any]) -> bytes:
    out = b"HAPTICS\n"
    for kind, content in blocks:
        head = struct.pack(">II", kind, len(content))
        out += head + struct.pack(">I", zlib.crc32(head + content)) + content
    return out


@pytest.mark.parametrize("damping", [0.1, float("inf"), 0.0])
def test_a_passivity_controller_is_no_marker(tmp_path: pathlib.Path, damping: float) -> None:
    """As a server with such a device writes it: the simulated hand has no controller."""
    file, with_passivity = tmp_path / "marks.haptics", tmp_path / "passivity.haptics"
    record_marks(file)
    blocks = blocks_of(file.read_bytes())
    assert [kind for kind, _ in blocks[:2]] == [1, 7]
    blocks.insert(2, (9, struct.pack(">Id", 1, damping)))
    with_passivity.write_bytes(written(blocks))
    with hapticd.Session(file) as session, hapticd.Session(with_passivity) as other:
        assert list(other.markers) == list(session.markers) == markers_by_info(with_passivity)
        assert [marker.text for marker in other.markers] == MARKS
        assert other.remark == "" and other.law == session.law
        assert np.array_equal(other.ticks["time_ns"], session.ticks["time_ns"])
        assert [c.name for c in other.commands()] == [c.name for c in session.commands()]


def test_a_block_with_another_layout_is_named(tmp_path: pathlib.Path) -> None:
    blocks = blocks_of((RECORDINGS / "gripper_v2.haptics").read_bytes())
    at = 8 + 12 + len(blocks[0][1])
    file = tmp_path / "damaged.haptics"

    def write(kind: int, content: bytes) -> None:
        file.write_bytes(written([*blocks[:1], (kind, content), *blocks[1:]]))

    for content in (struct.pack(">qI", 0, 3) + b"ab", struct.pack(">qI", 0, 1) + b"ab", b""):
        write(10, content)
        with hapticd.Session(file) as session:
            assert len(list(session.commands())) > 0
            with pytest.raises(hapticd.RecordingError, match=f"block at byte {at}: a marker is "):
                session.markers
    write(5, struct.pack(">iI", 0, 0))
    with hapticd.Session(file) as session:
        with pytest.raises(hapticd.RecordingError, match=f"block at byte {at}: a loss is truncated"):
            session.lost
    for content in (b"", b"\0\0\0"):
        write(4, content)
        ends = tmp_path / "ends.haptics"
        ends.write_bytes(written([*blocks, (4, content)]))
        for damaged, place in ((file, at), (ends, len(written(blocks)))):
            with hapticd.Session(damaged) as session:
                with pytest.raises(hapticd.RecordingError, match=f"block at byte {place}: a block of ticks is truncated"):
                    len(session.ticks)
    write(7, b"\0\0")
    with pytest.raises(hapticd.RecordingError, match=f"block at byte {at}: the force law is truncated"):
        hapticd.Session(file)


def test_losses_are_told_apart(tmp_path: pathlib.Path) -> None:
    blocks = blocks_of((RECORDINGS / "gripper_v2.haptics").read_bytes())
    lost = [(0, 0, 3), (1, 0, 4), (2, 0, 1 << 40)]
    blocks[-1:-1] = [(5, struct.pack(">iIQ", *numbers)) for numbers in lost]
    file = tmp_path / "lost.haptics"
    file.write_bytes(written(blocks))
    with hapticd.Session(file) as session:
        assert session.lost == (("ticks", 0, 3), ("scene events", 0, 4), ("streamed values", 0, 1 << 40))
        assert session.markers == () and session.remark == ""


def test_a_wall_clock_that_is_set_is_followed(tmp_path: pathlib.Path) -> None:
    blocks = blocks_of((RECORDINGS / "gripper_v2.haptics").read_bytes())
    with hapticd.Session(RECORDINGS / "gripper_v2.haptics") as session:
        servo, offset = session.ticks["servo_time_ns"], session.wall_offset_ns
    middle = int(servo[len(servo) // 2])
    blocks[-1:-1] = [(14, struct.pack(">qq", middle, offset + 5_000_000_000))]
    blocks[-1:-1] = [(10, struct.pack(">qI", middle + 1, 1) + b"m")]
    file = tmp_path / "set.haptics"
    file.write_bytes(written(blocks))
    with hapticd.Session(file) as session:
        step = session.ticks["time_ns"] - servo - offset
        assert np.array_equal(step, np.where(servo < middle, 0, 5_000_000_000))
        assert session.markers[0].time_ns == middle + 1 + offset + 5_000_000_000


def test_the_kinds_of_blocks_are_those_of_the_documents() -> None:
    text = (ROOT / "docs/recording-format.md").read_text()
    rows = re.findall(r"^\| (\d+) ([a-z ]+) \|", text, re.M)
    documented = {name.replace(" ", "_"): int(number) for number, name in rows}
    assert len(documented) == 14
    header = (ROOT / "src/record/block_file.h").read_text()
    listed = re.search(r"enum class BlockKind[^{]*\{([^}]*)\}", header)
    assert listed is not None
    kinds = re.findall(r"(\w+) = (\d+)", listed[1])
    assert documented == {re.sub("([A-Z])", r"_\1", name).lower(): int(number) for name, number in kinds}
    assert documented == {name: getattr(module, f"_{name.upper()}") for name in documented}


def test_commands_are_those_of_the_committed_list() -> None:
    expected = [json.loads(line) for line in (RECORDINGS / "all_commands.jsonl").read_text().splitlines()]
    for name in ("all_commands_v1", "all_commands_law2"):
        with hapticd.Session(RECORDINGS / f"{name}.haptics") as session:
            ours = [c for c in session.commands()]
            listed = [c for c in ours if c.name != "ClientLeft"]
            compared = [e for e in expected if e["command"] in {c.name for c in listed}]
            assert [c.name for c in listed] == [e["command"] for e in compared]
            for command, e in zip(listed, compared):
                assert list(command.fields) == list(e["fields"])
                for member, value in e["fields"].items():
                    mine = command.fields[member]
                    assert np.asarray(mine, dtype=object if isinstance(mine, str) else None).size == np.asarray(value).size
                    if isinstance(value, str):
                        assert mine == value
                    else:
                        assert np.allclose(np.ravel(mine), np.ravel(value), rtol=1e-6), (command.name, member)


def test_the_list_of_commands_is_that_of_the_documents() -> None:
    text = (ROOT / "docs/recording-format.md").read_text()
    documented = {}
    for number, name, members in re.findall(r"^\| (\d+) \| `(\w+)` \| (.*) \|$", text, re.M):
        documented[int(number)] = (name, tuple((m, t) for t, m in re.findall(r"([^,`]+) `(\w+)`", members)))
    short = {"i32": "i", "i64": "q", "u32": "I", "f32": "f", "f64": "d", "truth": "?", "text": "text"}

    def form(type_: str) -> str:
        type_ = type_.strip()
        listed = type_.startswith("list of ")
        base, _, count = type_.replace("list of ", "").rstrip("]").partition("[")
        return f"list{count or 1}{short[base]}" if listed else count + short[base]

    ours = {number: entry for number, entry in _COMMANDS.items() if number}
    assert len(documented) == len(ours)
    for number, (name, members) in documented.items():
        assert ours[number] == (name, tuple((member, form(type_)) for member, type_ in members))


def test_damage_is_named_and_everything_before_it_is_read(tmp_path: pathlib.Path) -> None:
    data = (RECORDINGS / "all_commands_law2.haptics").read_bytes()
    file = tmp_path / "cut.haptics"
    file.write_bytes(data[: len(data) // 2])
    with hapticd.Session(file) as cut:
        assert re.fullmatch(r"the block at byte \d+ is cut; everything before it was read", cut.remark)
        assert 0 < len(list(cut.commands()))
        cut.ticks["force_N"]
    file.write_bytes(data + data)
    with hapticd.Session(file) as joined:
        assert joined.remark == f"another recording begins at byte {len(data)}; everything before it was read"
    broken = bytearray(data)
    broken[len(data) // 2] ^= 1
    file.write_bytes(broken)
    with hapticd.Session(file) as damaged:
        assert "the checksum of the block at byte" in damaged.remark
    file.write_bytes(b"nothing like it")
    with pytest.raises(hapticd.RecordingError, match="is not a recording of hapticd"):
        hapticd.Session(file)
    head = struct.pack(">II", 1, 4)
    content = struct.pack(">I", 99)
    file.write_bytes(b"HAPTICS\n" + head + struct.pack(">I", zlib.crc32(head + content)) + content)
    with pytest.raises(hapticd.RecordingError, match="version 99 of the format, this program reads versions 1 to 2"):
        hapticd.Session(file)


@pytest.mark.parametrize("what", ["cut", "emptied", "overwritten"])
def test_a_recording_that_another_program_changes_ends_with_a_text(tmp_path: pathlib.Path, what: str) -> None:
    """Reading a mapped file behind its end would end the program without one."""
    file = tmp_path / "a.haptics"
    whole = (RECORDINGS / "gripper_v2.haptics").read_bytes()
    file.write_bytes(whole)
    with hapticd.Session(file) as session:
        ticks = session.ticks
        read = ticks["tick"]
        with open(file, "r+b") as other:
            if what == "overwritten":
                other.write(bytes(len(whole)))
            else:
                other.truncate(4096 if what == "cut" else 0)
        for use in (lambda: ticks["force_N"], ticks.contacts, lambda: list(session.commands()), lambda: session.markers):
            with pytest.raises(hapticd.RecordingError, match="another program has cut or overwritten .*a.haptics.*: open it again"):
                use()
        assert len(ticks["tick"]) == len(read) > 0


def test_a_recording_that_grows_is_read_as_far_as_it_was(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "a.haptics"
    whole = (RECORDINGS / "gripper_v2.haptics").read_bytes()
    cut = len(whole) - 20
    file.write_bytes(whole[:cut])
    with hapticd.Session(file) as session:
        count = len(session.ticks)
        with open(file, "ab") as other:
            other.write(whole[cut:])
        assert len(session.ticks["force_N"]) == count > 0
        assert session.remark
    with hapticd.Session(file) as session:
        assert not session.remark


def test_columns_are_found_by_their_names() -> None:
    with hapticd.Session(RECORDINGS / "gripper_v2.haptics") as session:
        ticks = session.ticks
        assert "force_N" in ticks and "force_N_x" not in ticks and 0 not in ticks
        assert tuple(ticks) == ticks.columns
        for several in (["force_N", "tick"], slice(0, 3)):
            with pytest.raises(KeyError, match="give the name of one column"):
                ticks[several]  # type: ignore[index]


def test_columns_outlive_the_session() -> None:
    with hapticd.Session(RECORDINGS / "gripper_v2.haptics") as session:
        ticks, opening = session.ticks, session.ticks["gripper_rad"]
    assert np.all(np.isfinite(opening))
    with pytest.raises(ValueError):
        opening[0] = 1
    assert ticks["gripper_rad"] is opening
    reads: List[Callable[[], Any]] = [
        lambda: ticks["force_N"],
        lambda: ticks["touching"],
        lambda: ticks.contacts(),
        lambda: list(session.commands()),
        lambda: session.markers,
        lambda: session.lost,
        lambda: session.ticks_of(0),
    ]
    for read in reads:
        with pytest.raises(ValueError, match="the session of '.*gripper_v2.haptics' is closed"):
            read()
