"""The shipped controller: its eigenvalues, its steps, its switches, its dependencies."""

import numpy as np
import pytest
from scipy.linalg import expm

from c_abi import Instance
from observer_oracle import command, linear_system, propagated, read_matrices

ESTIMATES = ["x_hat[1]", "x_hat[2]", "x_hat[3]", "x_hat[4]", "f_hat"]
STARTS = ["x_hat_0[1]", "x_hat_0[2]", "x_hat_0[3]", "x_hat_0[4]", "f_hat_0"]
Z_0 = np.array([0.1, -0.2, 0.5, 0.3, 7.0])
Y, SLOPE = np.array([0.12, -0.18]), np.array([0.4, -1.5])
ON, OFF = {"t_on": 0.0}, {"t_on": 9.0}


@pytest.fixture(scope="module")
def design(controller):
    """The matrices of the shipped design, as the FMU's parameters say."""
    with Instance(controller) as instance:
        return read_matrices(instance.start())


def begun(controller, values):
    """An instance after initialization with the estimate `Z_0` and the measurements `Y`."""
    instance = Instance(controller)
    start = {**dict(zip(STARTS, Z_0)), "x_p": Y[0], "theta": Y[1], **values}
    return instance.start(start)


def advance(instance, time, size, y=Y, slope=SLOPE):
    """Makes one step with measurements that start at `y`; returns the estimate at its end."""
    instance.set({"x_p": y[0], "theta": y[1]})
    if any(slope):
        instance.set_slopes(x_p=slope[0], theta=slope[1])
    instance.step(time, size)
    return np.array(instance.get(*ESTIMATES))


def test_the_shipped_design_has_the_required_eigenvalues(design):
    A, B, C, K_x, K_f, L_x, L_f = (design[n] for n in ("A", "B", "C", "K_x", "K_f", "L_x", "L_f"))
    feedback = np.sort(np.linalg.eigvals(A + B @ K_x))
    assert feedback == pytest.approx([-9.0, -7.5, -6.0, -4.5], rel=1e-6)
    observer = np.block([[A - L_x @ C, B @ K_f], [L_f @ C, np.zeros((1, 1))]])
    assigned = np.sort(np.linalg.eigvals(observer))
    assert assigned == pytest.approx([-3000, -2100, -1800, -1500, -1200], rel=1e-6)


def test_the_shipped_matrices_are_those_of_the_paper(design):
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [0, -1.9333, -1.9872, 0.0091], [0, 36.9771, 6.2589, -0.1738]]
    assert design["A"] == pytest.approx(np.array(A), abs=6e-5)
    assert design["B"][:, 0] == pytest.approx([0, 0, 0.3205, -1.0095], abs=6e-5)
    assert (design["F_a"] == -design["B"]).all() and (design["C"] == np.eye(4)[:2]).all()
    assert design["K_x"][0] == pytest.approx([184.10, 365.71, 123.66, 63.86], abs=0.02)
    assert design["K_f"] == pytest.approx(np.array([[1.0]]))


@pytest.mark.parametrize("monitor", [False, True])
@pytest.mark.parametrize(
    "switch", [ON, OFF, {**ON, "compensate": False}], ids=["on", "before", "off"]
)
@pytest.mark.parametrize("slope", [np.zeros(2), SLOPE], ids=["held", "sloped"])
@pytest.mark.parametrize("size", [1e-5, 1e-3, 0.1])
def test_a_step_of_any_size_equals_the_matrix_exponential(
    controller, design, size, slope, switch, monitor
):
    compensating = switch is ON
    with begun(controller, {**switch, "monitor": monitor}) as instance:
        state = advance(instance, 0.0, size, slope=slope)
        expected = propagated(design, Z_0, Y, slope, size, compensating, compensating or monitor)
        assert state == pytest.approx(expected, rel=1e-9)
        assert (state[4] == Z_0[4]) == (not compensating and not monitor)
        u = command(design, state, compensating)
        assert instance.get("u") == pytest.approx(u, rel=1e-12)


def test_a_small_step_also_equals_scipys_integration(controller, design):
    size = 1e-4
    M, N = linear_system(design, True, True)
    scale = np.array([1, 1, 1e3, 1e3, 1e6])
    augmented = np.zeros((9, 9))
    augmented[:5, :5], augmented[:5, 5:7] = M / scale[:, None] * scale, N / scale[:, None]
    augmented[5:7, 7:] = np.eye(2)
    expected = (expm(augmented * size) @ [*(Z_0 / scale), *Y, *SLOPE])[:5] * scale
    with begun(controller, ON) as instance:
        assert advance(instance, 0.0, size) == pytest.approx(expected, rel=1e-9)


def test_a_hundred_steps_end_where_one_step_of_their_total_size_ends(controller):
    with begun(controller, ON) as one, begun(controller, ON) as many:
        whole = advance(one, 0.0, 0.05)
        for k in range(100):
            parts = advance(many, k * 5e-4, 5e-4, Y + k * 5e-4 * SLOPE)
        assert parts == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("monitor", [False, True])
def test_the_compensation_starts_inside_of_the_step_that_contains_t_on(controller, design, monitor):
    switch, size = 0.00037, 0.001
    with begun(controller, {"t_on": switch, "monitor": monitor}) as instance:
        state = advance(instance, 0.0, size)
        before = propagated(design, Z_0, Y, SLOPE, switch, False, monitor)
        expected = propagated(design, before, Y + switch * SLOPE, SLOPE, size - switch, True, True)
        assert state == pytest.approx(expected, rel=1e-9)
        assert instance.get("u") == pytest.approx(command(design, state, True), rel=1e-12)


def test_the_compensation_is_on_at_t_on_and_off_just_before(controller, design):
    for t_on, compensating in ((0.003, True), (0.0030001, False)):
        with begun(controller, {"t_on": t_on}) as instance:
            for k in range(3):
                state = advance(instance, k * 0.001, 0.001, slope=np.zeros(2))
            assert instance.get("u") == pytest.approx(
                command(design, state, compensating), rel=1e-12
            )
            assert state[4] == Z_0[4]


def test_without_compensate_t_on_has_no_effect(controller):
    values = {"t_on": 0.002, "compensate": False}
    with begun(controller, values) as instance, begun(controller, OFF) as never:
        for k in range(5):
            assert (advance(instance, k * 0.001, 0.001) == advance(never, k * 0.001, 0.001)).all()
            assert instance.get("u") == never.get("u")
        instance.set({"compensate": True})
        assert (advance(instance, 0.005, 0.001) != advance(never, 0.005, 0.001)).any()


def test_slopes_of_the_outputs_are_those_of_the_right_hand_side(controller, design):
    M, N = linear_system(design, True, True)
    with begun(controller, ON) as instance:
        z = advance(instance, 0.0, 1e-3)
        y = Y + 1e-3 * SLOPE
        rate = M @ z + N @ y
        size = abs(M) @ abs(z) + abs(N) @ abs(y)
        assert (abs(np.array(instance.slopes_of(*ESTIMATES)) - rate) <= 1e-13 * size).all()
        slope = command(design, rate, True)[0]
        scale = command({**design, "K_x": abs(design["K_x"])}, size, True)[0]
        assert abs(instance.slopes_of("u")[0] - slope) <= 1e-13 * scale


def test_slopes_of_the_measurements_apply_to_one_step_only(controller, design):
    with begun(controller, ON) as instance:
        z = advance(instance, 0.0, 1e-3)
        state = advance(instance, 1e-3, 1e-3, slope=np.zeros(2))
        assert state == pytest.approx(
            propagated(design, z, Y, np.zeros(2), 1e-3, True, True), rel=1e-9
        )


@pytest.mark.parametrize("changed", [{"x_p": 5.0}, {"theta": -3.0}, {"compensate": False}])
def test_outputs_do_not_change_when_inputs_are_set_between_steps(controller, changed):
    for unknown in controller.description.outputs:
        assert all(known.causality != "input" for known in unknown.dependencies)
    with begun(controller, ON) as instance:
        advance(instance, 0.0, 1e-3)
        before = instance.outputs()
        instance.set(changed)
        assert instance.outputs() == before


BASE = {
    **dict(zip(STARTS, Z_0)),
    "t_on": 0.5,
    "x_p": 0.1,
    "theta": 0.2,
    "compensate": True,
    "monitor": False,
}


def at_start(controller, values, time=1.0):
    """All outputs in initialization mode."""
    names = controller.names(causality="output")
    with Instance(controller) as instance:
        return dict(zip(names, instance.enter({**BASE, **values}, start=time).get(*names)))


def test_each_initial_output_depends_on_the_listed_variables_only(controller):
    before = at_start(controller, {})
    variants = {"time": at_start(controller, {}, time=0.25)}
    for name, variable in controller.variables.items():
        if variable.causality in ("parameter", "input"):
            start = BASE.get(name, None if variable.type == "Boolean" else float(variable.start))
            value = not start if variable.type == "Boolean" else start + 1.25
            variants[name] = at_start(controller, {name: value})
    dependencies = {
        output: {name for name, values in variants.items() if values[output] != before[output]}
        for output in before
    }
    listed = {
        unknown.variable.name: {variable.name for variable in unknown.dependencies}
        for unknown in controller.description.initialUnknowns
        if unknown.variable.causality == "output"
    }
    assert dependencies == listed


def test_parameters_affect_the_steps(controller, design):
    changed = {**design, "L_f": design["L_f"] * 0.5, "A": design["A"] + np.eye(4)}
    values = {f"A[{k},{k}]": changed["A"][k - 1, k - 1] for k in range(1, 5)}
    values |= {f"L_f[1,{k}]": changed["L_f"][0, k - 1] for k in (1, 2)}
    with begun(controller, {**ON, **values}) as instance:
        state = advance(instance, 0.0, 1e-3)
        assert state == pytest.approx(
            propagated(changed, Z_0, Y, SLOPE, 1e-3, True, True), rel=1e-9
        )
