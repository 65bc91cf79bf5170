"""The archives that users install: what is in them, and that they work without the repository."""

import email
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

import mpm_ref

ROOT = Path(__file__).parents[2]
LARGEST = 5_000_000     # bytes of an archive


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Path of the wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    path, = WheelBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])
    return Path(path)


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    """Path of the source archive."""
    folder = tmp_path_factory.mktemp("sdist")
    path, = SdistBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])
    return Path(path)


@pytest.fixture(scope="module")
def unpacked(wheel, tmp_path_factory):
    """Folder of what the wheel installs."""
    folder = tmp_path_factory.mktemp("installed")
    zipfile.ZipFile(wheel).extractall(folder)
    return folder


def sources(folder, pattern):
    """Paths of the repository's files in a folder, without those that Python writes."""
    return {str(path.relative_to(ROOT)) for path in (ROOT / folder).rglob(pattern)
            if "__pycache__" not in path.parts}


def test_the_wheel_has_the_package_with_its_scenes_and_studies(wheel):
    found = {*zipfile.ZipFile(wheel).namelist()}
    asked = (sources("mpm_ref", "*.py") | sources("mpm_ref", "*.html")
             | {f"mpm_ref/{path}" for name in ("scenes", "studies")
                for path in sources(name, "*.toml")})
    assert asked <= found
    assert {path.split("/")[0] for path in found} == {
        "mpm_ref", f"mpm_ref-{mpm_ref.__version__}.dist-info"}
    assert wheel.stat().st_size < LARGEST


def test_the_wheel_says_its_version_licence_and_python(unpacked):
    folder = unpacked / f"mpm_ref-{mpm_ref.__version__}.dist-info"
    head = email.message_from_string((folder / "METADATA").read_text(encoding="utf-8"))
    assert (head["Name"], head["Version"]) == ("mpm_ref", mpm_ref.__version__)
    assert (head["License-Expression"], head["Requires-Python"]) == ("MIT", ">=3.11")
    assert (folder / "licenses" / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    assert "mpm-ref = mpm_ref.__main__:main" in (folder / "entry_points.txt").read_text()


def python(unpacked, folder, *arguments):
    """What Python prints with the installed package, in a folder that is no repository."""
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(unpacked)})
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_installed_command_line_finds_its_scenes_and_studies(unpacked, tmp_path):
    file = python(unpacked, tmp_path, "-c", "import mpm_ref; print(mpm_ref.__file__)")
    assert Path(file.strip()) == unpacked / "mpm_ref" / "__init__.py"
    for command, pattern in (("scenes", "scenes/*.toml"), ("law studies", "studies/law_*.toml")):
        lines = python(unpacked, tmp_path, "-m", "mpm_ref", *command.split()).splitlines()
        assert {line.split()[0] for line in lines} == {path.stem for path in ROOT.glob(pattern)}


@pytest.mark.slow
def test_the_installed_command_line_runs_a_scene(unpacked, tmp_path):
    run = "-m", "mpm_ref", "run", "hello", "--steps", "20"
    assert "step 20, " in python(unpacked, tmp_path, *run)
    python(unpacked, tmp_path, "-m", "mpm_ref", "plot", "hello.h5", "-o", "hello.png")
    assert (tmp_path / "hello.png").stat().st_size > 1000


def test_a_wheel_can_be_built_from_the_source_archive(sdist, tmp_path, wheel):
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    folder, = tmp_path.iterdir()
    path, = WheelBuilder(str(folder)).build(directory=str(tmp_path), versions=["standard"])
    assert {*zipfile.ZipFile(path).namelist()} == {*zipfile.ZipFile(wheel).namelist()}


def test_the_source_archive_leaves_records_and_tests_out(sdist):
    with tarfile.open(sdist) as archive:
        folders = {Path(name).parts[1] for name in archive.getnames() if len(Path(name).parts) > 1}
    assert {"mpm_ref", "scenes", "studies", "examples", "LICENSE", "README.md"} <= folders
    assert not {"results", "tests", "docs", "validation"} & folders
    assert sdist.stat().st_size < LARGEST
