"""Controllers of other sizes, and controllers whose actuators have limits."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from c_abi import DISCARD, ERROR, OK, Instance
from design_file import LISTS, MATRICES, design_text, redesigned, shipped_design, vector
from observer_oracle import command, propagated, read_matrices, saturated

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
SIZES = [(1, 1, 1, 1), (2, 2, 2, 2), (3, 2, 1, 1), (2, 1, 2, 3), (5, 3, 4, 2)]


def random_design(sizes, limits=None, extras=""):
    """A stable design of n states, m actuators, p measurements, q faults.

    `extras` has an `a` for a fault model, `w` for a filter, `o` for an operating point, `e` for a
    loss of effectiveness, `c` or `p` for samples with a current or a prediction estimator.
    """
    n, m, p, q = sizes
    chance = np.random.default_rng([7, *sizes])
    shapes = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p)]
    design = {name: chance.normal(size=shape) for name, shape in zip(MATRICES, shapes)}
    design["A"] -= 6 * np.eye(n)
    signals = lambda letter, count: [
        {"name": f"{letter}{k + 1}", "unit": "m"} for k in range(count)
    ]
    design |= {
        "description": 'A "random" design < of any size',
        "t_on": 0.0,
        "monitor": False,
        "states": signals("s", n),
        "actuators": [{"name": name, "unit": "m"} for name in vector("u", m)],
        "measurements": signals("y", p),
        "faults": signals("f", q),
        "experiment": {"stop_time": 2.0, "step_size": 0.01},
    }
    for actuator, pair in zip(design["actuators"], limits or []):
        if pair:
            actuator["limits"] = pair
    return extended(design, extras, chance)


SAMPLE_TIME = 0.05  # s
ESTIMATORS = {"c": "current", "p": "prediction"}


def extended(design, extras, chance):
    """The design with the entries that `extras` names."""
    n, _, p, q = (len(design[name]) for name in LISTS)
    if "a" in extras:
        design["A_f"] = chance.normal(size=(q, q)) - 2 * np.eye(q)
    if "w" in extras:
        design["filter"] = list(map(float, chance.uniform(0.3, 0.9, size=p)))
    if "o" in extras:
        for name in LISTS[:3]:
            for signal in design[name]:
                signal["operating"] = chance.normal()
    if "e" in extras:
        design["faults"][0] |= {"loss_of": design["actuators"][-1]["name"], "least_command": 0.7}
    for estimator in (ESTIMATORS[letter] for letter in extras if letter in ESTIMATORS):
        design |= {"sample_time": SAMPLE_TIME, "estimator": estimator}
        for name in ("A", "A_f", "K_x", "K_f", "L_x", "L_f"):
            if name in design:
                design[name] = 0.3 * chance.normal(size=np.shape(design[name]))
    return design


def fmu_with(controller, design, folder):
    """The FMU with this design in it."""
    fmu = redesigned(controller, design_text(design), folder / "fmu")
    fmu.design = design
    return fmu


def begun(fmu, sizes, z, y, values=None):
    """An instance after initialization at the estimate `z` with the measurements `y`."""
    n, _, p, q = sizes
    starts = dict(zip(vector("x_hat_0", n) + vector("f_hat_0", q), z))
    inputs = {f"y{k + 1}": y[k] for k in range(p)}
    return Instance(fmu).start({**starts, **inputs, **(values or {})})


@pytest.mark.parametrize("sizes", SIZES, ids=str)
def test_a_design_of_any_size_has_the_variables_of_that_size(controller, tmp_path, sizes):
    n, m, p, q = sizes
    fmu = fmu_with(controller, random_design(sizes), tmp_path)
    shapes = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p)]
    elements = {
        f"{name}[{i + 1},{j + 1}]"
        for name, (rows, columns) in zip(MATRICES, shapes)
        for i in range(rows)
        for j in range(columns)
    }
    starts = {*vector("x_hat_0", n), *vector("f_hat_0", q), "t_on", "monitor"}
    assert set(fmu.names(causality="parameter")) == elements | starts
    assert fmu.names(causality="input") == [f"y{k + 1}" for k in range(p)] + ["compensate"]
    outputs = [*vector("u", m), *vector("f_hat", q), *vector("x_hat", n)]
    assert set(fmu.names(causality="output")) == set(outputs)


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("sizes", SIZES, ids=str)
def test_a_design_of_any_size_describes_itself_validly(controller, tmp_path, sizes, limited):
    design = random_design(sizes, [[-1.0, 2.0]] * sizes[1] if limited else None)
    fmu = fmu_with(controller, design, tmp_path)
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(
        etree.parse(fmu.folder / "modelDescription.xml")
    )
    assert validate_fmu(str(fmu.folder)) == []
    assert fmu.description.description == design["description"]
    assert {"u_min", "u_max"} <= {name.split("[")[0] for name in fmu.variables} or not limited


@pytest.mark.parametrize("sizes", SIZES, ids=str)
def test_a_step_of_a_design_of_any_size_is_the_matrix_exponential(controller, tmp_path, sizes):
    n, m, p, q = sizes
    design = random_design(sizes)
    fmu = fmu_with(controller, design, tmp_path)
    z, y, slope = np.linspace(-1, 1.5, n + q), np.linspace(0.5, -0.7, p), np.linspace(2, -3, p)
    with begun(fmu, sizes, z, y) as instance:
        read = read_matrices(instance)
        assert all((read[name] == design[name]).all() for name in MATRICES)
        instance.set_slopes(**{f"y{k + 1}": slope[k] for k in range(p)})
        instance.step(0.0, 0.05)
        estimate = instance.get(*vector("x_hat", n), *vector("f_hat", q))
        expected = propagated(design, z, y, slope, 0.05, True, True)
        assert estimate == pytest.approx(expected, rel=1e-9, abs=1e-12)
        assert instance.get(*vector("u", m)) == pytest.approx(
            command(design, estimate, True), rel=1e-9
        )


# Limits that some channel reaches and leaves within the first second.
LIMITED = [
    ((1, 1, 1, 1), [[-0.3, 1.2]]),
    ((2, 2, 2, 2), [[-1.0, 1.0], [-0.2, 4.0]]),
    ((3, 2, 1, 1), [[-0.5, 1.0], None]),
    ((3, 2, 1, 1), [None, [-3.0, 0.5]]),
]


@pytest.mark.parametrize("size", [0.005, 0.05, 0.25])
@pytest.mark.parametrize(("sizes", "limits"), LIMITED, ids=str)
def test_with_limited_actuators_the_observer_follows_scipys_integration(
    controller, tmp_path, sizes, limits, size
):
    n, m, p, q = sizes
    design = random_design(sizes, limits)
    fmu = fmu_with(controller, design, tmp_path)
    pairs = [pair or [-np.inf, np.inf] for pair in limits]
    z, y, slope = np.linspace(-1, 1.5, n + q), np.linspace(0.5, -0.7, p), np.linspace(2, -3, p)
    times = np.linspace(0, 1, round(1 / size) + 1)
    expected = saturated(design, z, y, slope, times, pairs)
    commands = np.array([command(design, z, True, pairs) for z in expected])
    at_limit = (commands == np.transpose(pairs)[0]) | (commands == np.transpose(pairs)[1])
    assert (np.diff(at_limit, axis=0)).any(), "a limit is reached or left"
    with begun(fmu, sizes, z, y) as instance:
        for time, estimate, u in zip(times, expected[1:], commands[1:]):
            instance.set({f"y{j + 1}": y[j] + time * slope[j] for j in range(p)})
            instance.set_slopes(**{f"y{j + 1}": slope[j] for j in range(p)})
            instance.step(time, size)
            outputs = instance.get(*vector("x_hat", n), *vector("f_hat", q))
            assert outputs == pytest.approx(estimate, rel=1e-6, abs=1e-7)
            assert instance.get(*vector("u", m)) == pytest.approx(u, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("size", [1e-4, 1e-3, 5e-3])
def test_the_shipped_controller_with_limits_follows_scipys_integration(controller, tmp_path, size):
    design = shipped_design(controller)
    limits = [-40.0, 30.0]
    design["actuators"][0]["limits"], design["t_on"] = limits, 0.0
    fmu = redesigned(controller, design_text(design), tmp_path / "fmu")
    y, slope, times = np.array([0.001, -0.002]), np.array([0.3, -0.2]), np.linspace(0, 0.01, 101)
    expected = saturated(design, np.zeros(5), y, slope, times, [limits])
    commands = {float(command(design, z, True, [limits])[0]) for z in expected}
    assert set(limits) <= commands, "the command goes from one limit to the other"
    with Instance(fmu) as instance:
        instance.start()
        for k in range(round(0.01 / size)):
            at = y + k * size * slope
            instance.set({"x_p": at[0], "theta": at[1]})
            instance.set_slopes(x_p=slope[0], theta=slope[1])
            instance.step(k * size, size)
            assert -40 <= instance.get("u")[0] <= 30
        estimate = instance.get("x_hat[1]", "x_hat[2]", "x_hat[3]", "x_hat[4]", "f_hat")
    assert estimate == pytest.approx(list(expected[-1]), rel=1e-6)


def test_limits_can_be_changed_during_the_run_and_must_be_in_order(controller, tmp_path):
    sizes = (1, 1, 1, 1)
    fmu = fmu_with(controller, random_design(sizes, [[-0.3, 0.4]]), tmp_path)
    with begun(fmu, sizes, [9.0, 9.0], [0.0]) as instance:
        instance.step(0.0, 0.01)
        side = "u_min" if instance.get("u") == [-0.3] else "u_max"
        instance.set({side: instance.get(side)[0] * 2})
        instance.step(0.01, 0.01)
        assert instance.get("u") == instance.get(side)
        assert instance.set_one("u_max", np.inf) == DISCARD
        instance.set({"u_min": 0.9, "u_max": 0.8})
        assert instance.call("DoStep", 0.02, 0.01, 1) == ERROR
        assert all(part in instance.last_message() for part in ("u_min", "0.9", "u_max", "0.8"))


def test_the_initial_command_of_a_limited_actuator_depends_on_its_limits_too(controller, tmp_path):
    sizes = (2, 2, 2, 2)
    fmu = fmu_with(controller, random_design(sizes, [[-0.5, 0.6], [-0.2, 1.5]]), tmp_path)
    unknowns = {unknown.variable.name: unknown.dependencies for unknown in fmu.description.initialUnknowns}
    for j, name in enumerate(vector("u", 2)):
        names = {variable.name for variable in unknowns[name]}
        assert {f"u_min[{j + 1}]", f"u_max[{j + 1}]", f"K_x[{j + 1},1]"} <= names
        assert not any(other.startswith(f"K_x[{2 - j},") for other in names)
    with begun(fmu, sizes, [9.0, 9.0, 9.0, 9.0], [0.0, 0.0]) as instance:
        assert {tuple(instance.get("u[1]", "u[2]"))} <= {
            (a, b) for a in (-0.5, 0.6) for b in (-0.2, 1.5)
        }
        assert instance.call("Terminate") == OK
