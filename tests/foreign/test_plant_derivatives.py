"""Directional derivatives and ModelStructure of the plant, against complex steps."""

from itertools import product

import numpy as np
import pytest

from c_abi import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Instance, reals
from pendulum_oracle import DERIVATIVES, STATES, evaluated

STEP = 1e-30
KINDS = {"co-simulation": CO_SIMULATION, "model exchange": MODEL_EXCHANGE}
INPUTS = ["u", "f_a"]
# Regime, x_p, theta, v_p, omega, u.
POINTS = [
    (1, 0.1, 0.4, 0.3, -1.3, 12.0),
    (1, -0.2, -1.1, 0.06, 2.0, 0.0),
    (1, 0.0, 0.2, 0.01, 0.4, 45.0),
    (-1, 0.3, 2.6, -0.2, 0.7, -20.0),
    (-1, 0.0, -0.3, -0.9, -3.0, 35.0),
    (0, 0.1, 0.3, 0.0, 1.5, 7.0),
    (0, 0.0, -0.6, 0.0, -0.8, -9.0),
]
OTHER = {
    **{"M": 2.5, "m": 0.7, "J": 0.08, "l": 0.3, "F_x": 4.0, "F_theta": 0.02, "g": 9.0},
    **{"F_c": 20.0, "F_s": 27.0, "v_s": 0.2, "delta": 1.3},
}
CASES = list(product(POINTS, (False, True), ({}, OTHER)))
ALMOST_EXACT = 1e-13  # of a derivative, or of one where that is less


def starts(point, linearised, parameters):
    """Start values at a point."""
    _, *state, u = point
    initial = {f"{name}_0": value for name, value in zip(STATES, state)}
    return {**initial, "u": u, "f_a": 1.5, "linearised": linearised, **parameters}


def values_of(instance):
    """The values of all numbers by name, and whether the body is linearised."""
    names = instance.fmu.names(type="Real")
    return {**dict(zip(names, instance.get(*names))), "linearised": instance.get("linearised")[0]}


def errors(instance, unknowns, knowns, start=False, rise=0.0):
    """Differences between the derivatives and complex steps, for each known and for all together.

    u has risen since the start of the last step.
    """
    values, regime = values_of(instance), instance.get("regime")[0]
    values["u"] += rise
    seed = np.random.default_rng(5).normal(size=len(knowns))
    for direction in [{name: 1.0} for name in knowns] + [dict(zip(knowns, seed))]:
        moved = {name: values[name] + 1j * STEP * part for name, part in direction.items()}
        complex_values = evaluated({**values, **moved}, regime, start)
        for name, derivative in instance.directional(unknowns, direction).items():
            expected = np.imag(complex_values[name]) / STEP
            yield abs(derivative - expected) / max(abs(expected), 1.0)


def initial_unknowns(fmu):
    """Names of the unknowns at initialization."""
    return [unknown.variable.name for unknown in fmu.description.initialUnknowns]


def unknowns_of(fmu):
    """Names of the unknowns after initialization."""
    return [u.variable.name for u in fmu.description.outputs + fmu.description.derivatives]


@pytest.mark.parametrize("kind", KINDS)
def test_at_initialization_they_are_exact_for_every_known(plant, kind):
    knowns = plant.names(type="Real", causality="parameter") + INPUTS
    unknowns = initial_unknowns(plant)
    assert len(knowns) == 17 and unknowns == [*STATES, "f_fric", *DERIVATIVES]
    for point, linearised, parameters in CASES:
        with Instance(plant, kind=KINDS[kind]) as instance:
            instance.enter(starts(point, linearised, parameters))
            assert instance.get("regime") == [point[0]]
            assert max(errors(instance, unknowns, knowns, start=True)) < ALMOST_EXACT


def at_a_point(instance, point, linearised, parameters):
    """Steps the instance to a point of its run; returns the increase of u since the start of the last step."""
    values = starts(point, linearised, parameters)
    if instance.kind == MODEL_EXCHANGE:
        instance.start_exchange(values)
        return 0.0
    instance.start(values)
    instance.set_slopes(u=300.0)
    instance.step(0.0, 1e-3)
    return 0.3


@pytest.mark.parametrize("kind", KINDS)
def test_during_the_run_they_are_exact_for_every_input_and_state(plant, kind):
    for case in CASES:
        with Instance(plant, kind=KINDS[kind]) as instance:
            rise, unknowns = at_a_point(instance, *case), unknowns_of(plant)
            assert instance.get("regime") == [case[0][0]]
            assert max(errors(instance, unknowns, STATES + INPUTS, rise=rise)) < ALMOST_EXACT
            along_time = instance.directional(unknowns, {"time": 1.0})
            assert set(along_time.values()) == {0.0}


def test_a_force_above_the_static_friction_does_not_change_the_friction_before_the_event(plant):
    for kind, (u, slope) in product(KINDS.values(), ((29.0, 1.0), (30.5, 0.0), (-30.5, 0.0))):
        with Instance(plant, kind=kind) as instance:
            at_a_point(instance, (0, 0.0, 0.0, 0.0, 0.0, 0.0), False, {})
            instance.set({"u": u, "f_a": 0.0})
            assert instance.get("regime") == [0]
            assert instance.get("f_fric") == [pytest.approx(np.clip(u, -30, 30), rel=1e-12)]
            derivatives = instance.directional(["f_fric", "der(v_p)"], {"u": 1.0})
            assert derivatives == {"f_fric": slope, "der(v_p)": 0.0}


def test_variables_that_are_no_known_or_no_unknown_are_refused(plant):
    wrong = [("u", "v_p"), ("M", "v_p"), ("f_fric", "M"), ("f_fric", "x_p_0"), ("f_fric", "f_fric")]
    for unknown, known in wrong:
        with Instance(plant) as instance:
            instance.start()
            to, of = plant.references(unknown), plant.references(known)
            arguments = (to, 1, of, 1, reals(1.0), reals(0.0))
            assert instance.call("GetDirectionalDerivative", *arguments) == ERROR
        with Instance(plant) as instance:
            instance.enter()
            allowed = unknown == "f_fric" and known in ("M", "x_p_0")
            status = instance.call("GetDirectionalDerivative", *arguments)
            assert status == (OK if allowed else ERROR)


def factors(plant):
    """Entries of the Jacobian by pair of names, for all parameters and regimes."""
    jacobian = {}
    for (point, linearised, parameters), jump in product(CASES, (0.0, 40.0)):
        with Instance(plant, kind=MODEL_EXCHANGE) as instance:
            at_a_point(instance, point, linearised, parameters)
            instance.set({"u": point[5] + jump})  # A held cart is not free before the event.
            case = linearised, bool(parameters), point[0]
            for known in STATES + INPUTS:
                for name, factor in instance.directional(unknowns_of(plant), {known: 1.0}).items():
                    jacobian.setdefault((name, known), {}).setdefault(case, set()).add(factor)
    return jacobian


def kind_of(by_case):
    """The kind of dependency that the factors show."""
    every = set().union(*by_case.values())
    if every == {0.0}:
        return None
    if len(every) == 1:
        return "constant"
    return "dependent" if any(len(part) > 1 for part in by_case.values()) else "discrete or less"


def test_outputs_and_derivatives_have_exactly_the_listed_dependencies_with_their_kinds(plant):
    listed = {}
    for unknown in plant.description.outputs + plant.description.derivatives:
        kinds = unknown.dependenciesKind or ["dependent"] * len(unknown.dependencies)
        for known, kind in zip(unknown.dependencies, kinds, strict=True):
            listed[unknown.variable.name, known.name] = kind
    dependencies = {pair: kind_of(by_case) for pair, by_case in factors(plant).items()}
    assert {pair: kind for pair, kind in dependencies.items() if kind} == listed


def test_values_change_with_the_listed_inputs_and_states_only(plant):
    listed = {
        unknown.variable.name: {known.name for known in unknown.dependencies}
        for unknown in plant.description.outputs + plant.description.derivatives
    }
    dependencies = {name: set() for name in listed}
    for case in CASES:
        with Instance(plant, kind=MODEL_EXCHANGE) as instance:
            at_a_point(instance, *case)
            names, knowns = list(listed), STATES + INPUTS
            before = instance.get(*names)
            for known, value in zip(knowns, instance.get(*knowns)):
                for shift in (-0.3, -1e-3, 1e-3, 0.3):
                    instance.set({known: value + shift})
                    for name, old, new in zip(names, before, instance.get(*names)):
                        if new != old:
                            dependencies[name].add(known)
                instance.set({known: value})
            assert instance.get(*names) == before
    assert dependencies == listed
