"""Our SSP, and those written for the tests, in FMPy, libcosim and Ecos."""

import ctypes
from importlib import metadata

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import find_components, get_connections, read_ssd
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

from held_loop import COUNT, LINKS, SETTINGS, STEP, HeldLoop, expect_equal, held_loop, real_outputs
from ssp_files import ecos_style, libcosim_style

# libecosc needs this library; the package tbb installs it outside of the dynamic linker's search
# path.
(TBB,) = (file for file in metadata.files("tbb") if file.name == "libtbb.so.12")
ctypes.CDLL(str(TBB.locate()))

from ecospy import EcosSimulation  # noqa: E402

NANOSECOND = 1_000_000_000  # per s
# The step that our SSP states, in s, and how many of them are compared.
OWN_STEP, OWN_COUNT = 1e-3, 2_000
NO_SETTINGS = {"plant": {}, "controller": {}}


def sums(step, count):
    """The times of tools that add the step to the previous time."""
    time = 0.0
    for _ in range(count):
        yield time, step
        time += step


def nanoseconds(step, count):
    """The times of libcosim."""
    times = [k * round(step * NANOSECOND) / NANOSECOND for k in range(count + 1)]
    return [(start, end - start) for start, end in zip(times, times[1:])]


def columns(unpacked):
    """Every Real output: (element, variable)."""
    return [(role, name) for role in unpacked for name in real_outputs(unpacked[role].description)]


def by_libcosim(path, step, count, unpacked):
    """Every Real output after each step; if no step is given, libcosim uses that of the SSD."""
    nanoseconds_each = None if step is None else round(step * NANOSECOND)
    execution = CosimExecution.from_ssp_file(str(path), nanoseconds_each)
    infos = execution.slave_infos()
    index = {info.name.decode(): info.index for info in infos}
    assert set(index) == set(unpacked)
    observer = CosimObserver.create_time_series(count + 1)
    assert execution.add_observer(observer)
    places = [
        (index[role], unpacked[role].variables[name].valueReference)
        for role, name in columns(unpacked)
    ]
    for place in places:
        assert observer.start_time_series(*place, CosimVariableType.REAL)
    assert execution.step(count)
    series = [
        observer.time_series_real_samples(*place, from_step=1, sample_count=count)
        for place in places
    ]
    return [time / NANOSECOND for time in series[0][0]], np.transpose([s[2] for s in series])


def by_ecos(path, step, count, unpacked, parameter_set=None):
    """Every Real output after each step."""
    texts = [f"{role}::{name}" for role, name in columns(unpacked)]
    rows = []
    with EcosSimulation(step, ssp_path=str(path)) as running:
        assert running.init(parameter_set=parameter_set)
        for _ in range(count):
            running.step()
            rows.append([running.get_real(text) for text in texts])
        running.terminate()
    return np.array(rows)


def late_loop(unpacked, grid):
    """The loop of FMPy: no exchange before the first step, in which all inputs are 0."""
    loop = HeldLoop(unpacked, NO_SETTINGS)
    loop.finish_initialization()
    for _, _, sink, name in LINKS:
        loop.slaves[sink].set([name], [0.0])
    rows = []
    for time, step in grid:
        loop.step(time, step)
        rows.append(loop.row())
        loop.exchange()
    loop.close()
    return loop.names(), np.array(rows)


def test_fmpy_reads_elements_connectors_and_connections_of_our_ssp(package, unpacked):
    system = read_ssd(str(package)).system
    components = {each.name: each for each in find_components(system)}
    assert list(components) == ["plant", "controller"]
    for role, fmu in unpacked.items():
        kinds = {each.name: each.kind for each in components[role].connectors}
        assert kinds == {name: fmu.variables[name].causality for name in kinds}
        assert set(real_outputs(fmu.description)) <= set(kinds)
    connections = {(a.parent.name, a.name, b.parent.name, b.name) for a, b in get_connections(system)}
    assert connections == set(LINKS)


def test_libcosim_runs_our_ssp_with_the_bits_of_the_loop_in_fmpy(package, unpacked):
    grid = nanoseconds(OWN_STEP, OWN_COUNT)
    names, expected = held_loop(unpacked, grid, NO_SETTINGS)
    times, results = by_libcosim(package, None, OWN_COUNT, unpacked)
    # Without a stated step it uses the step of our SSP.
    assert times == [(k + 1) * 1_000_000 / NANOSECOND for k in range(OWN_COUNT)]
    expect_equal(names, expected, results)


def test_ecos_runs_our_ssp_with_the_bits_of_the_loop_in_fmpy(package, unpacked):
    grid = sums(OWN_STEP, OWN_COUNT)
    names, expected = held_loop(unpacked, grid, NO_SETTINGS, exchange_before_reading=True)
    expect_equal(names, expected, by_ecos(package, OWN_STEP, OWN_COUNT, unpacked))


def test_fmpy_runs_our_ssp_with_its_first_exchange_one_step_late(package, unpacked):
    """simulate_ssp leaves the initialization mode without an exchange of values, so the first step has
    all inputs 0, whatever the outputs are. Each row has the time at which its step starts and the
    values at its end."""
    result = simulate_ssp(str(package), stop_time=OWN_COUNT * OWN_STEP - 1e-9, step_size=OWN_STEP)
    grid = list(sums(OWN_STEP, OWN_COUNT))
    assert list(result["time"]) == [time for time, _ in grid]
    values = np.transpose([result[f"{role}.{name}"] for role, name in columns(unpacked)])
    names, late = late_loop(unpacked, grid)
    expect_equal(names, late, values)
    _, right = held_loop(unpacked, grid, NO_SETTINGS)
    u = names.index(("controller", "u"))
    # The controller's first command, computed from the initial position of the pendulum, arrives
    # one step late; the pendulum has hardly moved by then.
    assert values[0, u] == 0.0
    assert abs(right[0, u]) > 1000.0 and values[1, u] == pytest.approx(right[0, u], rel=1e-4)


def test_libcosim_runs_a_structure_of_its_own_style(packed, unpacked, tmp_path):
    path = libcosim_style(packed, tmp_path)
    names, expected = held_loop(unpacked, nanoseconds(STEP, COUNT))
    _, results = by_libcosim(path, None, COUNT, unpacked)
    expect_equal(names, expected, results)


def test_ecos_runs_a_structure_of_its_own_style(packed, unpacked, tmp_path):
    path = ecos_style(packed, tmp_path)
    names, expected = held_loop(unpacked, sums(STEP, COUNT), exchange_before_reading=True)
    expect_equal(names, expected, by_ecos(path, STEP, COUNT, unpacked, "initialValues"))


def test_libcosim_runs_a_structure_in_the_style_of_ecos_if_both_read_it_alike(
    packed, unpacked, tmp_path
):
    assert set(SETTINGS) == set(unpacked)
    path = ecos_style(packed, tmp_path)
    names, expected = held_loop(unpacked, nanoseconds(STEP, 200))
    _, results = by_libcosim(path, STEP, 200, unpacked)
    expect_equal(names, expected, results)
