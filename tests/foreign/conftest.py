"""Shared fixtures: the packed FMUs, unpacked, and the command. They need `aso-ftc pack` first."""

import subprocess
import sys
from pathlib import Path

import pytest
from fmpy import extract

from c_abi import Fmu

ROOT = Path(__file__).resolve().parents[2]
PACKED = {
    "plant": ROOT / "dist" / "FrictionPendulum.fmu",
    "controller": ROOT / "dist" / "AsoController.fmu",
}
EXAMPLES = {
    "van-der-pol": "VanDerPol",
    "bouncing-ball": "BouncingBall",
    "pid": "Pid",
    "lookup-table": "LookupTable",
    "three-tank": "ThreeTank",
    "dc-servo": "DcServo",
}


def pytest_collection_modifyitems(items):
    """The file that takes longest is first, so that no process works on it alone at the end."""
    items.sort(key=lambda item: item.path.name != "test_book.py")


@pytest.fixture(scope="session")
def root():
    """Folder of the workspace."""
    return ROOT


@pytest.fixture(scope="session")
def packed():
    """The FMUs of `aso-ftc pack`, by role."""
    for path in PACKED.values():
        assert path.is_file(), f"{path} is missing: run aso-ftc pack first"
    return PACKED


@pytest.fixture(scope="session")
def unpacked(packed, tmp_path_factory):
    """The FMUs of this workspace, unpacked once, by role."""
    folder = tmp_path_factory.mktemp("unpacked")
    return {role: Fmu(extract(str(fmu), str(folder / role))) for role, fmu in packed.items()}


@pytest.fixture(scope="session")
def plant(unpacked):
    """FrictionPendulum."""
    return unpacked["plant"]


@pytest.fixture(scope="session")
def controller(unpacked):
    """AsoController."""
    return unpacked["controller"]


@pytest.fixture(scope="session")
def hostile(aso_ftc, root, tmp_path_factory):
    """HostileNames: its module defines names that the export macro could confuse, and it panics on request."""
    folder = tmp_path_factory.mktemp("hostile")
    done = aso_ftc("pack", root / "tests" / "models" / "hostile-names", "--out", folder)
    assert done.returncode == 0, done.stderr
    return Fmu(extract(str(folder / "HostileNames.fmu"), str(folder / "unpacked")))


@pytest.fixture(params=["plant", "controller"])
def fmu(request, unpacked):
    """Each FMU of this workspace."""
    return unpacked[request.param]


@pytest.fixture(scope="session")
def aso_ftc():
    """Runs the command; returns exit status and output."""

    def run(*arguments, **options):
        command = [ROOT / "target" / "release" / "aso-ftc", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, **options)

    return run


@pytest.fixture(scope="session")
def python():
    """Runs this Python interpreter with arguments; returns exit status and output."""

    def run(*arguments, **options):
        command = [sys.executable, *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, **options)

    return run


@pytest.fixture(scope="session")
def examples(aso_ftc, root, tmp_path_factory):
    """The packed examples, by name of the model."""
    out = tmp_path_factory.mktemp("examples")
    done = aso_ftc("pack", *(root / "examples" / name for name in EXAMPLES), "--out", out)
    assert done.returncode == 0, done.stderr
    return {model: out / f"{model}.fmu" for model in EXAMPLES.values()}


@pytest.fixture(scope="session")
def package(root):
    """The SSP of `aso-ftc pack --ssp`."""
    path = root / "dist" / "InvertedPendulum.ssp"
    assert path.is_file(), f"{path} is missing: run aso-ftc pack --ssp first"
    return path


@pytest.fixture
def refusal(aso_ftc, tmp_path):
    """The message for a plant file; afterwards its folder must contain no other file."""

    def run(text, *options):
        file = tmp_path / "plant.toml"
        file.write_text(text, encoding="utf-8")
        before = sorted(tmp_path.rglob("*"))
        done = aso_ftc("design", file, "--out", tmp_path / "design.toml", *options)
        assert done.returncode == 2 and done.stdout == "", done
        assert sorted(tmp_path.rglob("*")) == before, "nothing is written"
        assert done.stderr.count("error:") == 1, done
        return done.stderr.replace(f"{tmp_path}/", "")

    return run
