"""Wrong arguments: each is a ValueError that names the value, sends nothing, and leaves the client as it was."""

import asyncio
import re
from typing import Any, Callable, Iterator, List, Tuple

import numpy as np
import pytest

import hapticd

from conftest import COMMANDS, Server


class Wrong:
    """A value that no argument takes."""

    def __repr__(self) -> str:
        return "Wrong()"


WRONG = Wrong()


def wrong_ones(value: Any) -> Iterator[Any]:
    """An argument with each of its parts replaced by a wrong one, and the whole of it."""
    yield WRONG
    if isinstance(value, (tuple, list)):
        for at, part in enumerate(value):
            for wrong in wrong_ones(part):
                parts = [*value[:at], wrong, *value[at + 1 :]]
                yield type(value)(*parts) if hasattr(value, "_fields") else parts
    elif isinstance(value, np.ndarray):
        yield from wrong_ones(value.tolist())


def cases() -> Iterator[Tuple[str, List[Any]]]:
    contact = hapticd.RemoteContact(1, (0, 0, 0), (0, 0, 1))
    for call, arguments in {**COMMANDS, "set_remote_contacts": ([contact],)}.items():
        for at, argument in enumerate(arguments):
            for wrong in wrong_ones(argument):
                if call == "update_mesh" and isinstance(wrong, hapticd.Surface) and WRONG in wrong[4:]:
                    continue  # popthrough and mass are not sent
                yield call, [*arguments[:at], wrong, *arguments[at + 1 :]]


def check(error: "pytest.ExceptionInfo[ValueError]") -> None:
    assert re.search(r"Wrong\(\).*(expected|give) ", str(error.value)), error.value


@pytest.fixture(scope="module")
def hand() -> Iterator[hapticd.Client]:
    server = Server()
    with hapticd.connect(server.tcp) as client:
        client.wait_capabilities()
        yield client
    server.stop()


@pytest.mark.parametrize("call", sorted(call for call, arguments in COMMANDS.items() if arguments))
def test_wrong_arguments_are_named_and_nothing_is_sent(hand: hapticd.Client, call: str) -> None:
    for _, arguments in (case for case in cases() if case[0] == call):
        sent = hand.statistics().messages_out
        with pytest.raises(ValueError) as error:
            getattr(hand, call)(*arguments)
        check(error)
        assert hand.statistics().messages_out == sent, arguments


def test_the_same_in_asyncio(hand: hapticd.Client) -> None:
    async def run() -> None:
        async with hapticd.aio.connect(f"Phantom@tcp://{hand.server}") as other:
            await other.wait_capabilities()
            for call, arguments in cases():
                sent = other.statistics().messages_out
                with pytest.raises(ValueError) as error:
                    await asyncio.ensure_future(_result(getattr(other, call), arguments))
                check(error)
                assert other.statistics().messages_out == sent, (call, arguments)
            for wait in (other.poll, other.wait_connected):
                with pytest.raises(ValueError, match="nan: give a time in seconds"):
                    await wait(float("nan"))
            with pytest.raises(ValueError, match="nan: give a time in seconds"):
                await other.collect("force", float("nan"))

    asyncio.run(run())


async def _result(call: Callable[..., Any], arguments: List[Any]) -> None:
    result = call(*arguments)
    if result is not None:
        await result


def test_fields_of_values_are_checked_one_by_one(hand: hapticd.Client) -> None:
    for call in ("set_surface", "update_mesh"):
        with pytest.raises(ValueError, match=r"^\(0.5, 0.1\): give a hapticd.Surface$"):
            getattr(hand, call)(0, (0.5, 0.1))
    with pytest.raises(ValueError, match=r"object is 1.5, expected an integer from -2147483648 to 2147483647$"):
        hand.clear_mesh(1.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"buttons is -1, expected an integer from 0 to 4294967295$"):
        hand.hold_hand((0, 0, 0), buttons=-1)
    with pytest.raises(ValueError, match="parameters has array.*, expected a finite number"):
        hand.start_custom_effect(0, np.ones((2, 3)))
    with pytest.raises(ValueError, match="kinds is 'tick', expected an integer"):
        hand.subscribe("tick")  # type: ignore[arg-type]


def numbers_in(value: Any, wrong: float) -> Iterator[Any]:
    """An argument with each of its numbers replaced by a wrong one."""
    if isinstance(value, (tuple, list)):
        for at, part in enumerate(value):
            for one in numbers_in(part, wrong):
                parts = [*value[:at], one, *value[at + 1 :]]
                yield type(value)(*parts) if hasattr(value, "_fields") else parts
    elif isinstance(value, np.ndarray):
        for at in range(value.size):
            array = np.array(value, dtype=np.float64)
            array.flat[at] = wrong
            yield array
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield wrong


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), float("-inf")])
def test_a_number_that_is_not_finite_is_named_and_nothing_is_sent(hand: hapticd.Client, wrong: float) -> None:
    contact = hapticd.RemoteContact(1, (0, 0, 0), (0, 0, 1))
    calls = {**COMMANDS, "set_remote_contacts": ([contact],), "start_custom_effect": (0, [1.0])}
    count = 0
    for call, arguments in calls.items():
        for at, argument in enumerate(arguments):
            for value in numbers_in(argument, wrong):
                if call == "update_mesh" and isinstance(value, hapticd.Surface) and wrong not in value[:4]:
                    continue  # popthrough and mass are not sent
                if call == "upload_mesh" and at == 2:
                    continue  # triangles are refused by the type of the array
                sent = hand.statistics().messages_out
                with pytest.raises(ValueError, match=rf"\b{wrong}\b.*(expected|give) ".replace(r"\b-", "-")):
                    getattr(hand, call)(*arguments[:at], value, *arguments[at + 1 :])
                assert hand.statistics().messages_out == sent, (call, value)
                count += 1
    assert count > 200


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), 1e39, None])
def test_a_vertex_that_is_none_is_named_by_its_row(hand: hapticd.Client, wrong: Any) -> None:
    vertices, triangles = hapticd.sphere(20)
    broken = vertices.astype(object)
    broken[1234, 1] = wrong
    text = r"^vertex 1234 is \[.*(nan|inf|1e\+39).*\]: give finite numbers"
    sent = hand.statistics().messages_out
    for call in (
        lambda: hand.upload_mesh(0, broken, triangles),
        lambda: hand.upload_corners(0, broken),
        lambda: hand.set_vertices(0, 5, broken),
    ):
        with pytest.raises(ValueError, match=text):
            call()
    assert hand.statistics().messages_out == sent


def test_a_member_of_a_contact_that_is_wrong_is_named(hand: hapticd.Client) -> None:
    right = hapticd.RemoteContact(1, (0, 0, 0), (0, 0, 1))
    for member, wrong, expected in (
        ("normal", (0, 1), "three finite numbers"),
        ("point_m", (0, 0, float("nan")), "three finite numbers"),
        ("radius_m", "7", "a finite number"),
        ("id", 10**400, "a finite number"),
    ):
        with pytest.raises(ValueError, match=rf"^remote contact 1: {member} is .*, expected {expected}$"):
            hand.set_remote_contacts([right, right._replace(**{member: wrong})])


def test_a_single_number_is_no_list(hand: hapticd.Client) -> None:
    for call, arguments in (
        ("set_force", (np.array(3.0),)),
        ("hold_hand", (np.array(3.0),)),
        ("set_triangle", (0, 0, np.array(3))),
        ("start_custom_effect", (0, np.array(3.0))),
        ("set_remote_contacts", (np.array(3.0),)),
    ):
        with pytest.raises(ValueError, match=r"array\(3.*(expected|give) a list"):
            getattr(hand, call)(*arguments)


@pytest.mark.parametrize("call", ["mark", "send_text", "present_token", "set_object_name", "set_effect"])
def test_half_a_character_is_refused(hand: hapticd.Client, call: str) -> None:
    text = "trial \udcfc of thursday"  # as names of files that are no UTF-8 have them
    arguments = {"set_object_name": (0, text), "set_effect": (0, hapticd.Effect(text))}.get(call, (text,))
    sent = hand.statistics().messages_out
    with pytest.raises(ValueError, match=r"'trial .udcfc of thursday': give a text without surrogates"):
        getattr(hand, call)(*arguments)
    assert hand.statistics().messages_out == sent


def test_what_takes_the_progress_is_checked_before_the_upload(hand: hapticd.Client) -> None:
    sent = hand.statistics().messages_out
    with pytest.raises(ValueError, match="^7: give a function that takes one hapticd.UploadProgress$"):
        hand.upload_mesh(0, *hapticd.sphere(20), progress=7)  # type: ignore[arg-type]
    assert hand.statistics().messages_out == sent


@pytest.mark.parametrize("wrong", ["a", None, [1], 1j, 10**400, float("nan")])
def test_a_translation_by_what_is_no_number_is_refused(wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"^a translation by \(0, .*: give three finite numbers$"):
        hapticd.translation(0, wrong, 0)


def test_a_sphere_of_what_is_no_number_is_refused() -> None:
    for wrong in ("a", None, [1], 1j, 10**400, 1e39):
        with pytest.raises(ValueError, match=r"^a sphere of radius .*: give a number above 0$"):
            hapticd.sphere(wrong)  # type: ignore[arg-type]
    for wrong in ("a", None, 2.5, 2):
        with pytest.raises(ValueError, match=rf"^a sphere of {wrong!r} rings: give a whole number of at least 3$"):
            hapticd.sphere(20, rings=wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^a sphere around \(0, 0, 'a'\): give x, y and z$"):
        hapticd.sphere(20, (0, 0, "a"))  # type: ignore[arg-type]


@pytest.mark.parametrize("radius", [float("nan"), float("inf"), -20, 0])
def test_a_sphere_without_a_radius_is_refused(radius: float) -> None:
    with pytest.raises(ValueError, match=f"^a sphere of radius {radius}: give a number above 0$"):
        hapticd.sphere(radius)


@pytest.mark.parametrize("center", [(0, float("nan"), 0), (0, 0, float("inf")), (1, 2), 3])
def test_a_sphere_around_no_point_is_refused(center: Any) -> None:
    with pytest.raises(ValueError, match=f"^a sphere around {re.escape(str(center))}: give x, y and z$"):
        hapticd.sphere(20, center)


def test_meshes_of_what_is_no_number_are_refused(hand: hapticd.Client) -> None:
    vertices, triangles = hapticd.sphere(20)
    for wrong, text in (
        (vertices + 1j, "vertices of type complex64: give"),
        (vertices.astype(str), "vertices of type <U.*: give"),
        (vertices.astype("i8").astype("M8[s]"), "vertices of type datetime64.*: give"),
        (np.zeros(5, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4")]), "vertices of type .*: give"),
        (np.ma.masked_array(vertices, mask=vertices > 10), "vertices with masked values: give"),
        ([[1, 2, 3], [4, 5]], r"vertices \[\[1, 2, 3\], \[4, 5\]\]: give \(n, 3\) numbers"),
        ((row for row in vertices), "vertices <generator .*>: give"),
    ):
        with pytest.raises(ValueError, match=text):
            hand.upload_mesh(0, wrong, triangles)  # type: ignore[arg-type]
    numbers = np.where(triangles == 0, 9999, triangles)
    for wrong, text in (
        (np.ma.masked_array(numbers, mask=numbers == 9999), "triangles with masked values: give"),
        ([[0, 1, 2], [1, 2]], r"triangles \[\[0, 1, 2\], \[1, 2\]\]: give \(m, 3\) integers"),
    ):
        with pytest.raises(ValueError, match=text):
            hand.upload_mesh(0, vertices, wrong)


def test_what_is_numbers_is_taken(hand: hapticd.Client) -> None:
    vertices, triangles = hapticd.sphere(20)
    expected = hand._mesh_frames(0, np.asarray(vertices, ">f4"), np.asarray(triangles, ">i4"))[1]
    for one in (
        vertices.astype(">f8"), vertices.astype(object), vertices[::-1][::-1], np.asfortranarray(vertices),
        np.hstack([vertices, vertices])[:, :3], vertices.tolist(), np.ma.masked_array(vertices),
    ):  # fmt: skip
        sent = hand.statistics().messages_out
        hand.upload_mesh(0, one, triangles)
        assert hand.statistics().messages_out == sent + expected
    for touchable in (True, 0, np.bool_(False), np.True_):
        hand.set_touchable(0, touchable)  # type: ignore[arg-type]
    hand.set_object_count(np.int64(1))  # type: ignore[arg-type]
    hand.set_vertex(0, 0, np.float32(1), 2, np.float64(3))  # type: ignore[arg-type]


def test_a_marker_without_a_text_marks_the_time(hand: hapticd.Client) -> None:
    hand.mark("")


def test_a_time_that_has_passed_is_over_at_once(hand: hapticd.Client) -> None:
    assert hand.poll(-1) >= 0
    hand.run_for(-1)
    assert list(hand.reports("force", -1)) == []
    assert len(hand.collect("force", -1)) == 0


@pytest.mark.parametrize("seconds", [float("nan"), None, "1", 1j, 10**400])
def test_a_time_that_is_none_is_refused(hand: hapticd.Client, seconds: Any) -> None:
    text = f"^{re.escape(repr(seconds)[:90])}.*: give a time in seconds"
    for wait in (hand.poll, hand.run_for, hand.wait_connected):
        with pytest.raises(ValueError, match=text):
            wait(seconds)
    for read in (hand.reports, hand.rows, hand.collect):
        with pytest.raises(ValueError, match=text):
            list(read("force", seconds))


def test_callbacks_and_kinds_that_are_none_are_refused(hand: hapticd.Client) -> None:
    with pytest.raises(ValueError, match="Wrong.*: give a function that takes one report"):
        hand.on_force(WRONG)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"no reports of kind \[\]; there are pose"):
        hand.on([], print)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"no rows of kind \[\]; there are pose"):
        hand.collect([], 0)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [-1, float("nan"), None, "3", 10**400])
def test_options_out_of_range_are_refused(value: Any) -> None:
    for name in ("connect_timeout", "send_timeout", "queue_limit_bytes"):
        with pytest.raises(ValueError, match=f"{name} is {repr(value)[:90]}.*: give a number of at least 0"):
            hapticd.connect("Phantom@localhost", **{name: value})
    for name in ("reconnect", "throw_on_error"):
        with pytest.raises(ValueError, match=f"{name} is {repr(value)[:90]}.*: give True or False"):
            hapticd.connect("Phantom@localhost", **{name: value})
    with pytest.raises(ValueError, match="3.0: give a hapticd.Options"):
        hapticd.connect("Phantom@localhost", 3.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("device", [None, 7, b"Phantom@localhost", "Phan\0tom@localhost"])
def test_a_device_that_is_no_text_is_refused(device: Any) -> None:
    with pytest.raises(ValueError, match="expected NAME@host"):
        hapticd.connect(device)


def test_a_name_that_no_device_can_have_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^device 'ÄÄÄ.*: a name of 96 bytes, at most 95$"):
        hapticd.connect("Ä" * 48 + "@localhost")
    with pytest.raises(ValueError, match=r"^device 'Phan.udcfctom': give a text without surrogates"):
        hapticd.connect("Phan\udcfctom@localhost")


def test_a_host_that_cannot_be_is_an_unknown_host() -> None:
    with pytest.raises(hapticd.ConnectError, match="no server at .:3883"):
        hapticd.connect("Phantom@tcp://.")
