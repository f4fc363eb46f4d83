"""Controllers with a fault model, filter, operating point, loss of effectiveness, samples."""

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree
from scipy.integrate import solve_ivp

from c_abi import ERROR, OK, Instance, describe
from design_file import MATRICES, design_text, vector
from excitation import restore, serialized
from named_equations import evaluated, losses, size_of, state_names
from observer_oracle import element_name
from test_designs import SCHEMA, begun, fmu_with, random_design

# Sizes, limits that some command reaches or leaves, extras of `random_design`.
CASES = [
    ((2, 1, 2, 2), None, "a"),
    ((2, 2, 2, 1), None, "w"),
    ((3, 1, 1, 2), None, "o"),
    ((2, 2, 1, 2), None, "e"),
    ((3, 2, 1, 1), [None, [-1.5, 1.0]], "awoe"),
    ((1, 1, 1, 1), None, "c"),
    ((2, 2, 2, 2), [[-1.0, 1.0]] * 2, "pawoe"),
]
IN_TIME = CASES[:5]


@pytest.fixture(params=CASES, ids=str)
def fmu(request, controller, tmp_path):
    """The FMU of a design."""
    return fmu_with(controller, random_design(*request.param), tmp_path)


def stated(design):
    """The parameters that only this kind of design has."""
    n, m, p, q = size_of(design)
    names = []
    if "A_f" in design:
        names += [element_name("A_f", i, j) for i in range(q) for j in range(q)]
    if "filter" in design:
        names += vector("filter", p)
    if "operating" in design["states"][0]:
        names += vector("x_op", n) + vector("u_op", m) + vector("y_op", p)
    return set(names)


def test_it_has_exactly_the_variables_of_its_entries(fmu):
    design = fmu.design
    n, m, p, q = size_of(design)
    shapes = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p)]
    always = {
        element_name(name, i, j)
        for name, (rows, columns) in zip(MATRICES, shapes)
        for i in range(rows)
        for j in range(columns)
    }
    always |= {*vector("x_hat_0", n), *vector("f_hat_0", q), "t_on", "monitor"}
    limits = [parameter for parameter in fmu.names(causality="parameter") if parameter.startswith(("u_min", "u_max"))]
    parameters = set(fmu.names(causality="parameter")) - set(limits)
    assert parameters == always | stated(design)
    outputs = {*state_names(design), *vector("u", m), *(name for name, *_ in losses(design))}
    assert set(fmu.names(causality="output")) == outputs
    assert ("T_s" in fmu.variables) == ("sample_time" in design)
    states = [] if "sample_time" in design else state_names(design)
    assert fmu.states == len(states) and {f"der({name})" for name in states} <= set(fmu.variables)
    for name, *_ in losses(design):
        assert fmu.variables[name].unit == "1"


def test_it_describes_itself_validly(fmu):
    tree = etree.parse(fmu.folder / "modelDescription.xml")
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(tree)
    assert validate_fmu(str(fmu.folder)) == []


def test_the_estimate_starts_at_the_operating_point(fmu):
    design = fmu.design
    n, m, p, _ = size_of(design)
    with Instance(fmu) as instance:
        instance.start()
        names = {"states": vector("x_op", n), "actuators": vector("u_op", m)}
        names["measurements"] = vector("y_op", p)
        for signals, parameters in names.items():
            expected = [signal.get("operating", 0.0) for signal in design[signals]]
            if "operating" in design["states"][0]:
                assert instance.get(*parameters) == expected
        expected = [signal.get("operating", 0.0) for signal in design["states"]]
        assert instance.get(*vector("x_hat_0", n)) == expected


@pytest.mark.parametrize("size", [0.005, 0.05, 0.25])
@pytest.mark.parametrize("case", IN_TIME, ids=str)
def test_steps_with_slopes_of_the_measurements_equal_scipys(controller, tmp_path, case, size):
    fmu = fmu_with(controller, random_design(*case), tmp_path)
    design = fmu.design
    n, m, p, q = size_of(design)
    z, y, slope = np.linspace(-1, 1.5, n + q), np.linspace(0.5, -0.7, p), np.linspace(2, -3, p)
    names, states = [f"y{k + 1}" for k in range(p)], state_names(design)
    outputs = vector("u", m) + [name for name, *_ in losses(design)]
    times = np.linspace(0, 1, round(1 / size) + 1)
    with begun(fmu, size_of(design), z, y) as instance:
        parameters = fmu.names(type="Real", causality="parameter")
        constants = dict(zip(parameters, instance.get(*parameters))) | {"inputs": names}

        def at(time, z):
            values = constants | dict(zip([*names, *states], [*(y + time * slope), *z]))
            return evaluated(values, design, (True, True))

        right = lambda time, z: [at(time, z)[f"der({name})"] for name in states]
        options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13, "max_step": 0.01}
        start = [*z, *(y if "filter" in design else [])]
        done = solve_ivp(right, (0, 1), start, t_eval=times, **options)
        assert done.success
        for time, end, expected in zip(times, times[1:], done.y.T[1:]):
            instance.set(dict(zip(names, y + time * slope)))
            instance.set_slopes(**dict(zip(names, slope)))
            instance.step(time, size)
            assert instance.get(*states) == pytest.approx(expected, rel=1e-6, abs=1e-7)
            exact = at(end, expected)
            results = dict(zip(outputs, instance.get(*outputs)))
            expected = {name: exact[name] for name in outputs}
            assert results == pytest.approx(expected, rel=1e-6, abs=1e-6)
            present = at(end, instance.get(*states))
            expected = [present[f"der({name})"] for name in states]
            assert instance.slopes_of(*states) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_slope_of_a_loss_is_the_derivative_of_its_quotient(controller, tmp_path):
    fmu = fmu_with(controller, random_design((2, 2, 1, 2), None, "e"), tmp_path)
    (name, k, j, least), *_ = losses(fmu.design)
    with begun(fmu, (2, 2, 1, 2), [1.0, -0.5, 0.3, 0.7], [0.4]) as instance:
        instance.step(0.0, 0.1)
        u, f = instance.get(f"u[{j + 1}]")[0], instance.get(f"f_hat[{k + 1}]")[0]
        du, df = instance.slopes_of(f"u[{j + 1}]", f"f_hat[{k + 1}]")
        scale = u * u + least * least
        expected = -(du * f + u * df) / scale + u * f * 2 * u * du / scale**2
        assert instance.slopes_of(name) == pytest.approx([expected], rel=1e-12)


def test_a_step_is_rolled_back_with_the_same_bits(fmu):
    n, _, p, q = size_of(fmu.design)
    with begun(fmu, size_of(fmu.design), np.ones(n + q), np.ones(p)) as instance:
        instance.step(0.0, 0.13)
        saved, runs = serialized(instance), []
        with Instance(fmu) as other:
            for one in (instance, instance, other):
                restore(one, saved)
                one.set_slopes(y1=0.3)
                one.step(0.13, 0.21)
                runs.append(one.outputs())
        assert runs[0] == runs[1] == runs[2]
        instance.must("Reset")
        assert instance.start().outputs() == Instance(fmu).start().outputs()


def test_an_invalid_filter_rate_stops_the_initialization(controller, tmp_path):
    for extras, value in (("w", 0.0), ("w", -1.0), ("cw", 1.01)):
        folder = tmp_path / f"{extras}{value}"
        folder.mkdir()
        fmu = fmu_with(controller, random_design((1, 1, 1, 1), None, extras), folder)
        with Instance(fmu) as instance:
            assert instance.set_one("filter", value) == OK
            assert instance.call("EnterInitializationMode") == ERROR
            assert f"filter = {value:g}" in instance.last_message()


WRONG = [
    ({"A_f": [[1.0, 2.0]]}, "A_f is 1 x 2, expected 1 x 1 (faults x faults)"),
    ({"filter": [1.0, 2.0]}, "filter is 2 numbers, expected 1 numbers (measurements)"),
    ({"filter": [-1.0]}, "filter = -1, expected more than 0 1/s"),
    ({"sample_time": 0.1}, "sample_time is stated and estimator is not"),
    ({"estimator": "current"}, "estimator is stated and sample_time is not"),
    ({"estimator": "best", "sample_time": 0.1}, "best"),
    ({"estimator": "current", "sample_time": -0.1}, "sample_time = -0.1, expected more than 0 s"),
    ({"estimator": "current", "sample_time": 0.1, "filter": [2.0]}, "at most 1"),
    ({"faults": [{"name": "f", "loss_of": "x", "least_command": 1.0}]}, "expected one of u"),
    ({"faults": [{"name": "f", "loss_of": "u"}]}, "least_command is not"),
    ({"faults": [{"name": "f", "least_command": 1.0}]}, "loss_of is not"),
    ({"faults": [{"name": "f", "operating": 1.0}]}, "operating"),
    ({"actuators": [{"name": "u", "operating": 3.0, "limits": [1.0, 2.0]}]}, "operating of u = 3"),
]


@pytest.mark.parametrize(("change", "message"), WRONG, ids=lambda value: str(value)[:40])
def test_a_design_with_entries_that_do_not_fit_is_refused(controller, tmp_path, change, message):
    design = random_design((1, 1, 1, 1)) | change
    (tmp_path / "design.toml").write_text(design_text(design), encoding="utf-8")
    status, said = describe(controller.library, tmp_path)
    assert status != OK and "design.toml" in said and message in said
