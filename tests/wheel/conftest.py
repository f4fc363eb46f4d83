"""What the tests of the wheel share. They run from the installed wheel: see scripts/wheel."""

import signal
import subprocess
import sys
from pathlib import Path

import aso_ftc as af
import pytest

ROOT = Path(__file__).resolve().parents[2]
# For the modules that tests share.
sys.path.insert(0, str(Path(__file__).parent))


def pytest_sessionstart(session):
    """The tests are of the wheel, never of the sources."""
    del session
    assert ROOT / "python" not in Path(af.__file__).parents, af.__file__


@pytest.fixture
def paper():
    """The paper's loop with 0.2 s, so that a test takes milliseconds."""
    system = af.paper()
    system.experiment["stop-time"] = 0.2
    return system


@pytest.fixture
def command():
    """Runs the command of the wheel; returns its standard output."""

    def run(*words):
        done = subprocess.run(
            [str(af.command()), *map(str, words)], check=True, capture_output=True, text=True
        )
        return done.stdout

    return run


@pytest.fixture
def python():
    """Runs a program in a new interpreter; returns the finished process."""

    def run(text, **options):
        return subprocess.run(
            [sys.executable, "-I", "-c", text], capture_output=True, text=True, check=False, **options
        )

    return run


@pytest.fixture(scope="session")
def packed(tmp_path_factory):
    """Packs a model of this repository as an FMU of FMI 3.0; returns its path."""

    def pack(model):
        folder = tmp_path_factory.mktemp("packed")
        words = [af.command(), "pack", ROOT / model, "--fmi", "3", "--out", folder]
        subprocess.run([str(word) for word in words], check=True, capture_output=True, cwd=ROOT)
        (fmu,) = folder.glob("*.fmu")
        return fmu

    return pack


@pytest.fixture
def interruptible():
    """Ctrl-C raises KeyboardInterrupt, also in tests started in the background, where SIGINT is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
