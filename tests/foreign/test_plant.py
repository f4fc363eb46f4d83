"""The friction pendulum against formulas and against solvers of scipy."""

from math import cos, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from c_abi import Instance

STATES = ["x_p", "theta", "v_p", "omega"]
M, m, J, l, F_x, F_theta, g = 3.2, 0.535, 0.062, 0.365, 6.2, 0.009, 9.807
F_c, F_s, v_s, delta = 25.0, 30.0, 0.15, 2.0
FREE = {"F_c": 0.0, "F_s": 0.0}


def derivative(state, force):
    """Equation (20) as a linear system for the two accelerations, with `force` minus the friction."""
    _, theta, v, omega = state
    matrix = [[M + m, m * l * cos(theta)], [m * l * cos(theta), J]]
    right = [
        force - F_x * v + m * l * omega**2 * sin(theta),
        m * l * g * sin(theta) - F_theta * omega,
    ]
    return [v, omega, *np.linalg.solve(matrix, right)]


def start_values(state):
    """Starts a run in this state."""
    return {f"{name}_0": value for name, value in zip(STATES, state)}


def run(plant, end, size, values=None, force=None, tolerance=None, begin=0.0):
    """Returns the state at `end`; `force(t)` gives u and its first two derivatives before each step."""
    with Instance(plant) as instance:
        instance.start(values, start=begin, tolerance=tolerance)
        count = round((end - begin) / size)
        for k in range(count):
            time = begin + k * size
            if force:
                u, *slopes = force(time)
                instance.set({"u": u})
                for order, slope in enumerate(slopes, start=1):
                    instance.set_slopes(order, u=slope)
            instance.step(time, size)
        return np.array(instance.get(*STATES))


def cut(plant, size):
    """The states after each half second, for a force that changes at these times."""
    states = []
    with Instance(plant) as instance:
        instance.start({"theta_0": 0.05})
        do_step, component = plant.library.fmi2DoStep, instance.component
        for k, force in enumerate((55.0, -60.0, 20.0, 70.0)):
            instance.set({"u": force})
            begin, end = 0.5 * k, 0.5 * k + 0.5
            whole = int(0.5 / size + 1e-9)
            for j in range(whole):
                assert do_step(component, begin + j * size, size, 1) == 0
            if (reached := begin + whole * size) < end - 1e-9:
                instance.step(reached, end - reached)
            states.append([*instance.get(*STATES), *instance.get("f_fric")])
    return np.array(states)


def test_the_result_does_not_depend_on_how_the_interval_is_divided_into_steps(plant):
    reference = cut(plant, 1e-3)
    span = np.ptp(reference, axis=0)
    assert (span > 0.05).all()
    for size in (1e-6, 7e-3, 0.13, 0.5):
        assert (abs(cut(plant, size) - reference) <= 1e-5 * span).all(), size


def test_steps_of_a_second_give_the_result_of_steps_of_a_millisecond(plant):
    force = lambda _: (38.0,)
    values = {"theta_0": 0.02}
    by_second, by_milli = (run(plant, 2.0, size, values, force) for size in (1.0, 1e-3))
    assert by_second == pytest.approx(by_milli, rel=1e-7)
    assert abs(by_second[0] - 0.1) > 0.05


def test_a_smaller_tolerance_gives_a_smaller_error(plant):
    values = {"theta_0": 0.3, "v_p_0": 0.5, **FREE}
    reference = run(plant, 2.0, 1.0, values, tolerance=1e-12)
    errors = [
        abs(run(plant, 2.0, 1.0, values, tolerance=tolerance) - reference).max()
        for tolerance in (1e-3, 1e-5, 1e-7, 1e-9)
    ]
    assert all(small < large / 5 for large, small in zip(errors, errors[1:]))
    assert errors[0] > 1e-6 and errors[-1] < 1e-6
    default = abs(run(plant, 2.0, 1.0, values) - reference).max()
    assert default == pytest.approx(errors[-1], rel=1e-6)


def polynomial(time):
    """A force with its first two derivatives, large enough to make the cart slip."""
    return 34.0 + 900.0 * time - 6e4 * time**2, 900.0 - 1.2e5 * time, -1.2e5


def test_derivatives_of_the_force_give_the_result_of_a_finely_sampled_polynomial(plant):
    values = {"theta_0": 0.02, "v_p_0": 0.05}
    one = run(plant, 0.01, 0.01, values, polynomial)
    middle = lambda time: polynomial(time + 5e-7)[:1]
    many = run(plant, 0.01, 1e-6, values, middle)
    assert one == pytest.approx(many, rel=1e-8)
    for order in (1, 2):
        held = run(plant, 0.01, 0.01, values, lambda time: polynomial(time)[:order])
        assert abs(held[2] - many[2]) > 1e-4, f"derivative {order} matters"


def test_slopes_apply_to_one_step_only(plant):
    with Instance(plant) as sloped, Instance(plant) as plain:
        for instance in (sloped, plain):
            instance.start({"v_p_0": 0.5})
            instance.set({"u": 5.0})
        sloped.set_slopes(u=300.0)
        sloped.step(0.0, 0.01)
        plain.step(0.0, 0.01)
        assert sloped.get("v_p") != plain.get("v_p")
        slopes = (
            sloped.slopes_of("v_p"),
            [derivative(sloped.get(*STATES), 5.0 - sloped.get("f_fric")[0])[2]],
        )
        sloped.set({"u": 5.0})
        sloped.step(0.01, 1e-9)
        change = derivative(sloped.get(*STATES), 5.0 - sloped.get("f_fric")[0])[2]
        assert sloped.slopes_of("v_p") == [pytest.approx(change, rel=1e-12)]
        assert slopes[0] != pytest.approx(slopes[1], rel=1e-3)


def test_friction_at_rest_balances_the_other_forces(plant):
    for theta, omega, u, f_a in (
        (0.1, 0.3, 12.0, 4.0),
        (-0.2, -1.0, -3.0, 0.0),
        (0.0, 0.0, 29.99, 0.0),
    ):
        with Instance(plant) as instance:
            instance.start({**start_values((0.3, theta, 0.0, omega)), "u": u, "f_a": f_a})
            for k in range(20):
                _, theta, v, omega = instance.get(*STATES)
                assert instance.get("regime") == [0] and v == 0 and instance.get("x_p") == [0.3]
                turn = (m * l * g * sin(theta) - F_theta * omega) / J
                balance = u + f_a + m * l * (omega**2 * sin(theta) - turn * cos(theta))
                assert instance.get("f_fric") == [pytest.approx(balance, rel=1e-12)]
                instance.step(k * 1e-3, 1e-3)


def test_the_slope_of_the_friction_is_its_difference_quotient_held_and_sliding(plant):
    apart, begin = 1e-5, 4e-3
    for start, regime in (({"theta_0": 0.1, "omega_0": 0.4}, 0), ({"v_p_0": -0.2}, -1)):

        def after(duration):
            with Instance(plant) as instance:
                instance.start(start | {"u": 3.0})
                instance.set_slopes(u=50.0)
                instance.step(0.0, duration)
                assert instance.get("regime") == [regime]
                return instance.get("f_fric")[0], instance.slopes_of("f_fric")[0]

        change = after(begin + apart)[0] - after(begin - apart)[0]
        assert after(begin)[1] == pytest.approx(change / (2 * apart), rel=1e-6)
        assert abs(change) > 1e-4


def test_friction_of_a_sliding_cart_follows_stribecks_law(plant):
    with Instance(plant) as instance:
        instance.start({"v_p_0": 0.6, "theta_0": 0.3, "delta": 1.3, "u": 10.0})
        for k in range(40):
            velocity = instance.get("v_p")[0]
            law = F_c + (F_s - F_c) * np.exp(-((abs(velocity) / v_s) ** 1.3))
            assert instance.get("regime") == [np.sign(velocity)]
            assert instance.get("f_fric") == [pytest.approx(np.sign(velocity) * law, rel=1e-12)]
            instance.step(k * 1e-3, 1e-3)


def test_only_a_force_above_the_static_friction_moves_the_cart(plant):
    level = {"theta_0": 0.0}
    for force, moves in ((29.999, False), (30.001, True), (-29.999, False), (-30.001, True)):
        state = run(plant, 0.5, 0.1, level, lambda _: (force,))
        assert (abs(state[0] - 0.1) > 0) == moves
        assert not moves or np.sign(state[0] - 0.1) == np.sign(force)


def test_without_friction_the_pendulum_moves_as_scipy_integrates_equation_20(plant):
    state = (0.1, -0.4, 0.3, 0.5)
    force = lambda time: (8.0 - 6.0 * time, -6.0)
    mine = run(plant, 2.0, 0.05, {**start_values(state), **FREE}, force)
    right = lambda time, state: derivative(state, force(time)[0])
    reference = solve_ivp(right, (0, 2), state, method="DOP853", rtol=1e-12, atol=1e-13)
    assert mine == pytest.approx(reference.y[:, -1], rel=1e-6)


def test_a_sliding_cart_stops_at_scipys_time_and_position(plant):
    state = (0.0, 0.2, 0.8, -0.1)

    def right(_, state):
        friction = F_c + (F_s - F_c) * np.exp(-((state[2] / v_s) ** delta))
        return derivative(state, -friction)

    stops = lambda _, state: state[2]
    vars(stops).update(terminal=True)
    reference = solve_ivp(
        right, (0, 1), state, method="DOP853", rtol=1e-12, atol=1e-13, events=stops
    )
    end, there = reference.t_events[0][0], reference.y_events[0][0]
    before, after = (
        run(plant, end + shift, (end + shift) / 7, start_values(state)) for shift in (-1e-7, 1e-7)
    )
    assert 0 < before[2] < 1e-5 and after[2] == 0
    assert after[[0, 1, 3]] == pytest.approx(there[[0, 1, 3]], rel=1e-5)


def test_the_linearised_body_follows_the_matrix_exponential(plant):
    D = (M + m) * J - (m * l) ** 2
    A = np.array(
        [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [0, -((m * l) ** 2) * g / D, -F_x * J / D, m * l * F_theta / D],
            [0, (M + m) * m * l * g / D, m * l * F_x / D, -(M + m) * F_theta / D],
        ]
    )
    B = np.array([[0], [0], [J / D], [-m * l / D]])
    augmented = np.block([[A, B], [np.zeros((1, 5))]])
    state = np.array([1.1, -1.1, 0.2, 0.4])
    for end in (0.1, 1.5):
        expected = (expm(augmented * end) @ [*state, 13.0])[:4]
        values = {**start_values(state), **FREE, "linearised": True}
        assert run(plant, end, end / 10, values, lambda _: (13.0,)) == pytest.approx(
            expected, rel=1e-7
        )
    friction = {**start_values(state), "linearised": True, "u": 13.0}
    with Instance(plant) as instance:
        instance.start(friction)
        force = 13.0 - instance.get("f_fric")[0]
        assert instance.slopes_of(*STATES) == pytest.approx(A @ state + B[:, 0] * force, rel=1e-12)


def test_the_upright_equilibrium_is_kept_and_the_hanging_one_is_reached(plant):
    assert (run(plant, 5.0, 1.0, {"theta_0": 0.0}) == [0.1, 0, 0, 0]).all()
    end = run(plant, 60.0, 1.0, {"theta_0": 0.5, "F_theta": 0.2})
    assert end[1] == pytest.approx(np.pi, abs=1e-6) and abs(end[2:]).max() < 1e-6


def test_a_run_may_start_at_any_time(plant):
    force = lambda begin: lambda time: polynomial((time - begin) / 10)[:1]
    zero, late = (run(plant, b + 0.1, 0.01, {"v_p_0": 0.2}, force(b), begin=b) for b in (0.0, 64.0))
    assert late == pytest.approx(zero, rel=1e-9)


def test_each_initial_output_depends_on_the_listed_variables_only(plant):
    order = plant.description.modelVariables
    listed = {
        u.variable.name: {v.name for v in u.dependencies} for u in plant.description.initialUnknowns
    }
    base = {"theta_0": 0.2, "omega_0": 0.4, "u": 3.0}
    sliding = {**base, "v_p_0": 0.2}
    dependencies = {name: set() for name in listed}
    changeable = [v for v in order if v.causality in ("parameter", "input")]
    for point in (base, sliding):
        with Instance(plant) as instance:
            before = dict(zip(listed, instance.enter(point).get(*listed)))
        for variable in changeable:
            start = point.get(
                variable.name, None if variable.type == "Boolean" else float(variable.start)
            )
            value = 1 if variable.type == "Boolean" else start * 1.0625 + 0.001
            with Instance(plant) as instance:
                after = instance.enter({**point, variable.name: value}).get(*listed)
            for name, changed in zip(listed, after):
                if changed != before[name]:
                    dependencies[name].add(variable.name)
    assert dependencies == listed
