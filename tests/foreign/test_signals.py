"""Signals from CSV files, compared with FMPy, which reads the same files: `fmpy.util.read_csv`, and
`fmpy.simulation.Input`, which sets the inputs of a recording FMU."""

import subprocess
from math import isclose
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.simulation import Input
from fmpy.util import read_csv, write_csv

CONTINUOUS = SimpleNamespace(
    name="u", type="Real", causality="input", variability="continuous", valueReference=0
)
DISCRETE = SimpleNamespace(
    name="u", type="Real", causality="input", variability="discrete", valueReference=0
)
VARIABLES = {"line": CONTINUOUS, "hold": DISCRETE}


class Listener(FMU2Slave):
    """An FMU without a library that records the calls of its setters."""

    def __init__(self):
        self.component = None

    def fmi2SetReal(self, _component, _references, _count, values):
        self.value = values[0]

    def fmi2SetInteger(self, *_arguments):
        raise AssertionError("not an Integer")

    fmi2SetBoolean = fmi2SetInteger


def of_fmpy(file, between, times):
    """Value, slope and time of the next event, by FMPy after the event at each time.

    The test reads the slopes from FMPy's object: FMPy 0.3.32 sets derivatives for exactly nine inputs only."""
    listener = Listener()
    description = SimpleNamespace(modelVariables=[VARIABLES[between]])
    source = Input(listener, description, read_csv(file))
    table = (source.continuous or source.discrete)[0].table
    rows = []
    for time in times:
        source.apply(time, after_event=True)
        _, slope = source.interpolate(time, source.t, table, between == "hold", True)
        rows.append((listener.value, np.ravel(slope)[0], source.nextEvent(time)))
    return np.array(rows)


@pytest.fixture(scope="session")
def of_ours(root):
    """Value, slope and time of the next break, by the program tests/examples/signal.rs."""

    def run(file, between, times):
        command = [root / "target" / "release" / "examples" / "signal", file, "u", between]
        lines = "".join(f"{time!r}\n" for time in map(float, times))
        done = subprocess.run(command, capture_output=True, text=True, input=lines)
        assert done.returncode == 0, done.stderr
        return np.array([list(map(float, line.split())) for line in done.stdout.splitlines()])

    return run


def write(file, times, values):
    """A file in FMPy's layout."""
    rows = np.array(list(zip(times, values)), dtype=[("time", float), ("u", float)])
    write_csv(file, rows)


def around(times):
    """Times at, near and between the points, in an order that goes back and forth."""
    times = np.asarray(times, dtype=float)
    at = np.concatenate([times, times * (1 + 1e-10), times * (1 - 1e-10), times * (1 + 1e-8)])
    beyond = [times[0] - 1, times[-1] + 1, times[0] - 1e-12, times[-1] + 1e-12]
    between = np.random.default_rng(1).uniform(times[0] - 1, times[-1] + 1, 600)
    grid = times[0] + 0.01 * np.arange(400)
    return np.concatenate([at, beyond, between, grid])


def with_jumps(seed):
    """Random points, some of them with the same time two or three times."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.01, 0.3, 60)) - random.uniform(0, 5)
    times = np.sort(np.concatenate([times, random.choice(times, 12), random.choice(times, 4)]))
    return times, random.normal(size=times.size) * 10.0 ** random.integers(-3, 4, times.size)


CASES = {
    "of the documentation of FMPy": ([0, 0.5, 0.5, 1], [0, 0, 0.1, 1]),
    "of one row": ([1], [3]),
    "of two rows": ([1, 3], [3, 4]),
    "with a jump at its begin": ([0, 0, 1, 2], [5, 6, 7, 8]),
    "with a jump at its end": ([0, 1, 2, 2], [5, 6, 7, 8]),
    "that is one jump": ([1, 1], [5, 6]),
    "with three values at one time": ([0, 1, 1, 1, 2], [5, 6, 7, 8, 9]),
    "with times that differ by rounding": ([0, 1, 1 + 1e-12, 2], [5, 6, 7, 8]),
    "of decimal fractions": (np.arange(30) * 0.1, np.arange(30) % 7),
    **{f"of random points, seed {seed}": with_jumps(seed) for seed in range(8)},
}


# FMPy has no discrete signals of one row.
BOTH = [(case, between) for case in CASES for between in VARIABLES]
BOTH.remove(("of one row", "hold"))


@pytest.mark.parametrize(("case", "between"), BOTH)
def test_values_equal_those_of_fmpy_to_the_last_bit(case, between, of_ours, tmp_path):
    file = tmp_path / "inputs.csv"
    write(file, *CASES[case])
    times = around(CASES[case][0])
    expected, rows = of_fmpy(file, between, times), of_ours(file, between, times)
    wrong = expected[:, 0] != rows[:, 0]
    assert not wrong.any(), list(zip(times[wrong], expected[wrong, 0], rows[wrong, 0]))[:5]


@pytest.mark.parametrize("case", CASES)
def test_slopes_between_the_points_equal_those_of_fmpy(case, of_ours, tmp_path):
    file = tmp_path / "inputs.csv"
    write(file, *CASES[case])
    points = CASES[case][0]
    times = np.array([t for t in around(points) if not any(isclose(t, p) for p in points)])
    expected, rows = of_fmpy(file, "line", times), of_ours(file, "line", times)
    assert (expected[:, 1] == rows[:, 1]).all()
    # At a point, ours is the slope of the line that starts there, FMPy's that of the line that ends
    # there.
    write(file, [0, 1, 2], [0, 1, 5])
    assert of_fmpy(file, "line", [1.0])[0, 1] == 1
    assert of_ours(file, "line", [1.0])[0, 1] == 4


# FMPy jumps if times differ by rounding only, but has no event there.
EVENTS = [pair for pair in BOTH if pair != ("with times that differ by rounding", "line")]


@pytest.mark.parametrize(("case", "between"), EVENTS)
def test_steps_end_at_the_events_of_fmpy(case, between, of_ours, tmp_path):
    file = tmp_path / "inputs.csv"
    write(file, *CASES[case])
    points, values = map(np.asarray, CASES[case])
    times = around(points)
    expected, rows = of_fmpy(file, between, times), of_ours(file, between, times)
    assert rows.shape == expected.shape
    if between == "line":
        assert (rows[:, 2] == expected[:, 2]).all()
        return
    # FMPy's events at repeated times belong to all columns, so some are without a change of this
    # one.
    changes = {float(t) for t, before, after in zip(points[1:], values, values[1:]) if before != after}
    for time, theirs, ours in zip(times, expected[:, 2], rows[:, 2]):
        later = [t for t in changes if t > time and not isclose(t, time)]
        assert ours == min(later, default=np.inf)
        assert theirs <= ours


def test_a_file_of_many_digits_is_read_as_by_fmpy(of_ours, tmp_path):
    random = np.random.default_rng(5)
    values = np.frombuffer(random.bytes(8 * 4000), dtype=float)
    values = values[np.isfinite(values)]
    times = np.arange(values.size) * 0.1
    file = tmp_path / "inputs.csv"
    rows = [f"{float(t)!r},{float(v)!r}" for t, v in zip(times, values)]
    file.write_text('"time",u\n' + "\n".join(rows) + "\n")
    assert (of_fmpy(file, "hold", times)[:, 0] == values).all()
    assert (of_ours(file, "hold", times)[:, 0] == values).all()
