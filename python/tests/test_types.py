"""mypy --strict, on the package and on a program that uses it as the documents show."""

import asyncio
import pathlib
import re
import subprocess
import sys

import hapticd

PACKAGE = pathlib.Path(hapticd.__file__).parent
ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs/python.md"
#: What the modules show beyond the package: kinds and arrays of reports, and what a Session returns.
MORE = {
    "hapticd.reports": {"dtype_of", "rows_of"},
    "hapticd.session": {"Command", "Lost", "Marker", "RecordedDevice", "Ticks"},
    "hapticd.aio": {"Client", "connect"},
}


def mypy(tmp_path: pathlib.Path, *what: str) -> None:
    command = [sys.executable, "-m", "mypy", "--strict", "--python-version", "3.9", "--cache-dir", str(tmp_path / "cache"), *what]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_package_and_the_examples_of_its_document_are_typed(tmp_path: pathlib.Path) -> None:
    programs = re.findall(r"```python\n(.*?)```", DOCS.read_text(), re.S)
    assert len(programs) >= 5
    files = []
    for number, program in enumerate(programs):
        file = tmp_path / f"example_{number}.py"
        file.write_text(program)
        compile(program, str(file), "exec")
        files.append(str(file))
    mypy(tmp_path, str(PACKAGE), *files)


def test_what_an_example_uploads_is_felt() -> None:
    """An object without a stiffness is not."""
    documents = [*(ROOT / "docs").glob("*.md"), ROOT / "python/README.md"]
    examples = [text for file in documents for text in re.findall(r"```python\n(.*?)```", file.read_text(), re.S)]
    examples += [str(hapticd.__doc__), str(hapticd.aio.__doc__), str(hapticd.client.__doc__)]
    uploads = [(set(re.findall(r"upload_mesh\((\d+)", e)), set(re.findall(r"set_surface\((\d+)", e)), e) for e in examples]
    assert sum(bool(objects) for objects, _, _ in uploads) >= 7
    for objects, surfaces, example in uploads:
        assert objects <= surfaces, example


def test_a_client_has_the_calls_of_the_cplusplus_client_and_few_more() -> None:
    calls = set(re.findall(r"\b([a-z]\w*)\(", (ROOT / "include/hapticd/client.h").read_text()))

    async def asynchronous() -> "set[str]":
        client = hapticd.aio.Client("Phantom@tcp://127.0.0.1:1", hapticd.Options(connect_timeout=0))
        names = set(dir(client))
        await client.close()
        return names

    with hapticd.connect("Phantom@tcp://127.0.0.1:1", connect_timeout=0) as client:
        both = set(dir(client)) | asyncio.run(asynchronous())
    names = {name for name in both if not name.startswith("_")}
    inherited = {name for name in names if re.sub(r"_(\w)", lambda part: part[1].upper(), name) in calls}
    assert len(inherited) > 80
    assert names - inherited == {"close", "collect", "on", "reports", "rows"}


def test_modules_and_subscriptions_show_what_is_documented_only() -> None:
    with hapticd.connect("Phantom@tcp://127.0.0.1:1", connect_timeout=0) as client:
        subscription = client.on_force(print)
    assert {name for name in dir(subscription) if not name.startswith("_")} == {"active", "end"}
    assert {name for name in dir(hapticd) if not name.startswith("_")} - set(hapticd.__all__) == {
        "client", "errors", "reports", "scene", "session"
    }  # fmt: skip
    for module in (hapticd.client, hapticd.aio, hapticd.errors, hapticd.reports, hapticd.scene, hapticd.session):
        own = {name for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__}
        shown = {name for name in own if not name.startswith("_")}
        assert shown <= set(hapticd.__all__) | MORE.get(module.__name__, set()), module.__name__


def test_the_package_declares_its_types() -> None:
    assert (PACKAGE / "py.typed").exists()
