"""mypy --strict, on the package and on a program that uses it as the documents show."""

import pathlib
import re
import subprocess
import sys

import hapticd

PACKAGE = pathlib.Path(hapticd.__file__).parent
ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs/python.md"


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


def test_the_package_declares_its_types() -> None:
    assert (PACKAGE / "py.typed").exists()
