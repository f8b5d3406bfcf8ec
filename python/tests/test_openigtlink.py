"""Messages of OpenIGTLink against bytes that the protocol's own library wrote: version 1.11, and 3.1 for header version 2."""

import struct
import warnings
from typing import Any, Tuple

import numpy as np
import pytest

from hapticd import _openigtlink as igtl

TIME_S = 1700000000.0
#: Header, name, time stamp, size and CRC as the library packs them, then the content.
GOLDEN = {
    "transform": (
        "00015452414e53464f524d0000005068616e746f6d50726f787900000000000000006553f100000000000000000000000030"
        "5aa0e6e492b7d4bb000000003f80000000000000bf800000000000000000000000000000000000003f80000041280000c1a0"
        "000041f20000"
    ),
    "string": (
        "0001535452494e470000000000005068616e746f6d466f72636500000000000000006553f100000000000000000000000015"
        "189bab4e4ffe864900030011302e30303020302e30303020312e323530"
    ),
    "capability": (
        "00014341504142494c49545900005068616e746f6d000000000000000000000000006553f10000000000000000000000003c"
        "e077a07e23283de05452414e53464f524d000000504f4c594441544100000000535452494e470000000000004745545f4341"
        "504142494c004745545f5354415455530000"
    ),
    "status": (
        "00015354415455530000000000005068616e746f6d000000000000000000000000006553f10000000000000000000000001f"
        "1b21935860613012000100000000000000004f4b00000000000000000000000000000000000000"
    ),
    "polydata": (
        "0001504f4c5944415441000000004d6f64656c0000000000000000000000000000006553f100000000000000000000000128"
        "d605279c0efd7b58000000070000000100000008000000010000000c00000002000000240000000100000018000000010000"
        "000000000000000000003f80000000000000000000003f8000003f80000000000000000000003f8000000000000000000000"
        "000000003f8000003f800000000000003f8000003f00000040000000c0400000000000010000000300000002000000000000"
        "0006000000040000000000000001000000020000000300000003000000000000000100000004000000050000000000000001"
        "0000000400000005000000060203000000076e00000000003f80000040000000404000004080000040a0000040c0000040e0"
        "0000410000004110000041200000413000004140000041500000416000004170000041800000418800004190000041980000"
        "41a00000"
    ),
    "transform, header version 2": (
        "00025452414e53464f524d000000506c6174650000000000000000000000000000006553f100000000000000000000000060"
        "867546e2f34f01c6000c0012000000120000004d000000003f80000000000000bf8000000000000000000000000000000000"
        "00003f80000041280000c1a0000041f200000002000300030000000500060003000000046b657976616c756573656e646572"
        "70656572"
    ),
    "string, header version 2": (
        "0002535452494e47000000000000506c6174650000000000000000000000000000006553f10000000000000000000000001f"
        "9553abcf57f771cd000c000200000000000000000003000d73746966666e6573733d302e340000"
    ),
}


def split(data: bytes) -> Tuple[igtl.Header, bytes]:
    return igtl.parse_header(data[: igtl.HEADER.size]), data[igtl.HEADER.size :]


def content(data: bytes) -> bytes:
    return igtl.content_of(*split(data))


def message(kind: str, body: bytes, version: int = 1, crc: int = 0) -> bytes:
    return struct.pack(">H12s20sQQQ", version, kind.encode(), b"Model", 0, len(body), crc or igtl.crc64(body)) + body


def polydata(points: Any, polygons: bytes = b"", count: int = 0, strips: bytes = b"", strip_count: int = 0) -> bytes:
    data = np.array(points, dtype=">f4").tobytes()
    table = struct.pack(">10I", len(data) // 12, 0, 0, 0, 0, count, len(polygons), strip_count, len(strips), 0)
    return table + data + polygons + strips


def test_crcs_are_those_of_the_library() -> None:
    assert igtl.crc64(b"") == 0
    assert igtl.crc64(b"123456789") == 0x6C40DF5F0B497347
    i = np.arange(100003, dtype=np.int64)
    assert igtl.crc64(((i * i + 7 * i) >> 3).astype(np.uint8).tobytes()) == 0xFBC5BD70F003FB38


@pytest.mark.parametrize("size", [32767, 32768, 32769, 40960, 100001])
def test_long_bodies_have_the_crc_that_their_bytes_have_one_by_one(size: int) -> None:
    data = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8).tobytes()
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 & (1 << 64) - 1) ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)
    assert igtl.crc64(data) == crc


def test_what_is_written_is_what_the_library_writes() -> None:
    matrix = np.array([[0, -1, 0, 10.5], [1, 0, 0, -20], [0, 0, 1, 30.25], [0, 0, 0, 1]])
    types = ("TRANSFORM", "POLYDATA", "STRING", "GET_CAPABIL", "GET_STATUS")
    for kind, name, written in (
        ("transform", "PhantomProxy", igtl.transform_content(matrix)),
        ("string", "PhantomForce", igtl.string_content("0.000 0.000 1.250")),
        ("capability", "Phantom", igtl.capability_content(types)),
        ("status", "Phantom", igtl.status_content("")),
    ):
        assert igtl.message(kind.upper(), name, written, TIME_S).hex() == GOLDEN[kind]


def test_what_the_library_writes_is_read() -> None:
    header, _ = split(bytes.fromhex(GOLDEN["transform"]))
    assert header[:4] == (1, "TRANSFORM", "PhantomProxy", 48)
    expected = [[0, -1, 0, 10.5], [1, 0, 0, -20], [0, 0, 1, 30.25], [0, 0, 0, 1]]
    assert igtl.read_transform(content(bytes.fromhex(GOLDEN["transform"]))).tolist() == expected
    assert igtl.read_string(content(bytes.fromhex(GOLDEN["string"]))) == "0.000 0.000 1.250"


def test_polygons_and_strips_of_the_library_become_triangles() -> None:
    points, triangles = igtl.read_polydata(content(bytes.fromhex(GOLDEN["polydata"])))
    assert points.tolist()[1] == [1, 0, 0] and points.tolist()[6] == [0.5, 2, -3] and len(points) == 7
    # A triangle; a quadrilateral as a fan; a strip of five corners, the second triangle turned.
    assert triangles.tolist() == [[0, 1, 4], [0, 1, 2], [0, 2, 3], [0, 1, 4], [4, 1, 5], [4, 5, 6]]


def test_polygons_of_one_size_and_of_hardly_any_corners() -> None:
    corners = np.arange(24, dtype=">u4") % 8
    points = np.zeros((8, 3))
    for size in range(7):
        cells = np.insert(corners[: 3 * size].reshape(3, size), 0, size, axis=1).astype(">u4").tobytes()
        triangles = igtl.read_polydata(polydata(points, cells, 3, cells, 3))[1]
        assert len(triangles) == 2 * 3 * max(size - 2, 0)
    assert len(igtl.read_polydata(bytes(40))[1]) == 0


def test_header_version_2_of_the_library_is_read() -> None:
    data = bytes.fromhex(GOLDEN["transform, header version 2"])  # with two entries of metadata
    header, _ = split(data)
    assert header[:3] == (2, "TRANSFORM", "Plate")
    assert content(data) == content(bytes.fromhex(GOLDEN["transform"]))
    assert igtl.read_string(content(bytes.fromhex(GOLDEN["string, header version 2"]))) == "stiffness=0.4"


def test_extended_header_and_metadata_are_skipped() -> None:
    matrix = igtl.transform_content(np.diag([2.0, 3.0, 4.0, 1.0]))
    metadata_header, metadata = struct.pack(">HHHI", 1, 3, 3, 5), b"keyvalue"
    for version in (2, 3):
        for more in (b"", b"later"):  # a longer extended header, of a later version
            extended = struct.pack(">HHII", 12 + len(more), len(metadata_header), len(metadata), 77) + more
            body = extended + matrix + metadata_header + metadata
            assert content(message("TRANSFORM", body, version)) == matrix
    assert content(message("TRANSFORM", struct.pack(">HHII", 12, 0, 0, 0) + matrix, 2)) == matrix


@pytest.mark.parametrize(
    "data, text",
    [
        (message("STRING", b"\0\3\0\1a", crc=1), r"its CRC is 0000000000000001, that of its body is [0-9a-f]{16}: the bytes changed"),
        (message("STRING", b"12345678901", 2), "a body of 11 bytes has no room for the extended header of 12"),
        (message("STRING", struct.pack(">HHII", 11, 0, 0, 0), 2), "an extended header of 11 and metadata of 0 in a body of 12 bytes"),
        (message("STRING", struct.pack(">HHII", 13, 0, 0, 0), 2), "an extended header of 13 and metadata of 0 in a body of 12 bytes"),
        (message("STRING", struct.pack(">HHII", 12, 1, 2**32 - 1, 0), 2), "metadata of 4294967296 in a body of 12 bytes"),
    ],
)
def test_bodies_that_do_not_fit_their_header(data: bytes, text: str) -> None:
    with pytest.raises(igtl.MessageError, match=text):
        content(data)


TRIANGLE = struct.pack(">4I", 3, 0, 1, 2)


@pytest.mark.parametrize(
    "data, text",
    [
        (bytes(39), "39 bytes has no room for the table of 40"),
        (polydata(np.eye(3))[:-1], r"its parts have 76 bytes, but the content 75"),
        (struct.pack(">10I", *[2**32 - 1] * 10), "its parts have [0-9]+ bytes, but the content 40"),
        (polydata([[0, 0, 0], [0, np.nan, 0]]), r"point 1 is \[0.0, nan, 0.0\], expected finite numbers"),
        (polydata(np.eye(3), struct.pack(">4I", 3, 0, 1, 3), 1), "a triangle names point 3, there are 3"),
        (polydata(np.eye(3), struct.pack(">4I", 3, 0, 1, 2**32 - 1), 1), "a triangle names point 4294967295, there are 3"),
        (polydata(np.eye(3), TRIANGLE[:-1], 1), "1 polygons do not fill their 15 bytes"),
        (polydata(np.eye(3), TRIANGLE, 2), "2 polygons do not fill their 16 bytes"),
        (polydata(np.eye(3), TRIANGLE, 0), "0 polygons do not fill their 16 bytes"),
        (polydata(np.eye(3), TRIANGLE, 2**32 - 1), "4294967295 polygons do not fill their 16 bytes"),
        (polydata(np.eye(3), struct.pack(">4I", 4, 0, 1, 2), 1), "1 polygons do not fill their 16 bytes"),
        (polydata(np.eye(3), struct.pack(">4I", 2**32 - 1, 0, 1, 2), 1), "1 polygons do not fill their 16 bytes"),
        (polydata(np.eye(3), b"", 0, TRIANGLE, 2), "2 triangle strips do not fill their 16 bytes"),
    ],
)
def test_models_that_are_none(data: bytes, text: str) -> None:
    with pytest.raises(igtl.MessageError, match=text):
        igtl.read_polydata(data)


def test_transforms_and_texts_that_are_none() -> None:
    for size in (0, 47, 49):
        with pytest.raises(igtl.MessageError, match=f"its content has {size} bytes, expected 48"):
            igtl.read_transform(bytes(size))
    for nan in (b"\x7f\xc0\0\0", b"\x7f\x80\0\1"):  # a quiet and a signalling one
        with warnings.catch_warnings(), pytest.raises(igtl.MessageError, match="its matrix is .*nan.*, expected finite numbers"):
            warnings.simplefilter("error")
            igtl.read_transform(12 * nan)
    for data in (b"", b"\0\3\0", b"\0\3\0\2a", b"\0\3\0\0a"):
        with pytest.raises(igtl.MessageError, match=f"its content of {len(data)} bytes is not as long as it states"):
            igtl.read_string(data)
    assert igtl.read_string(b"\0\x6a\0\3\xc3\xa4\xff") == "ä\ufffd"


def test_headers_behind_which_no_message_is_found() -> None:
    for version in (0, 4, 18245):  # the last is an HTTP request
        with pytest.raises(igtl.StreamError, match=f"a header of version {version}, expected 1 to 3"):
            split(message("STRING", b"", version))
    with pytest.raises(igtl.StreamError, match="a message 'POLYDATA' of 18446744073709551615 bytes"):
        igtl.parse_header(struct.pack(">H12s20sQQQ", 1, b"POLYDATA", b"", 0, 2**64 - 1, 0))
