"""Sampled controllers act at their samples, for every communication step."""

from ctypes import byref

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.linalg import expm

from c_abi import ERROR, MODEL_EXCHANGE, EventInfo, Instance
from design_file import vector
from excitation import restore, serialized
from named_equations import losses, size_of, state_names
from sampled_oracle import SampledController
from test_designs import SAMPLE_TIME, begun, fmu_with, random_design

T = SAMPLE_TIME
# Sizes, limits that some command reaches or leaves, extras of `random_design`.
CASES = [
    ((1, 1, 1, 1), [[0.1, 1.2]], "c"),
    ((2, 2, 2, 2), [[-5.0, 5.0], None], "coe"),
    ((3, 2, 1, 2), [[-1.5, 1.0], None], "cae"),
    ((2, 2, 2, 1), [None, [-1.0, 0.6]], "cawoe"),
    ((1, 1, 1, 1), [[0.1, 1.2]], "p"),
    ((3, 2, 1, 2), None, "pao"),
    ((2, 2, 2, 1), [None, [-1.0, 0.8]], "pawoe"),
]
SAMPLES = 40


@pytest.fixture(params=CASES, ids=str)
def fmu(request, controller, tmp_path):
    """The FMU of a sampled design."""
    return fmu_with(controller, random_design(*request.param), tmp_path)


def start_of(fmu):
    """Initial estimates, initial measurements and their slopes."""
    n, _, p, q = size_of(fmu.design)
    return np.linspace(-1, 1.5, n + q), np.linspace(0.5, -0.7, p), np.linspace(0.3, -0.4, p)


def signals(fmu):
    """Names of estimates, filtered measurements and commands."""
    return state_names(fmu.design) + vector("u", size_of(fmu.design)[1])


def expected(fmu):
    """The signals at each sample, for measurements that grow linearly."""
    z, y, slope = start_of(fmu)
    controller = SampledController(fmu.design, z, y)
    rows = []
    for k in range(SAMPLES + 1):
        z, y_f, u = controller.sample(y + k * T * slope)
        rows.append([*z, *(y_f if "filter" in fmu.design else []), *u])
    return np.array(rows)


def test_these_tests_include_commands_at_limits(fmu):
    limits = [actuator.get("limits") for actuator in fmu.design["actuators"]]
    commands = expected(fmu)[:, -len(limits) :].T
    for command, pair in zip(commands, limits):
        assert pair is None or 0 < sum(np.isin(command, pair)) < len(command)


@pytest.mark.parametrize("parts", [10, 3, 10 / 7, 1, 1 / 2, 1 / 2.7, 1 / 13])
def test_it_acts_at_its_samples_for_every_communication_step(fmu, parts):
    size, rows = T / parts, expected(fmu)
    z, y, slope = start_of(fmu)
    names = [f"y{k + 1}" for k in range(len(y))]
    with begun(fmu, size_of(fmu.design), z, y) as instance:
        assert instance.get(*signals(fmu)) == pytest.approx(rows[0], rel=1e-9, abs=1e-12)
        for i in range(int(SAMPLES * parts)):
            instance.set(dict(zip(names, y + i * size * slope)))
            instance.set_slopes(**dict(zip(names, slope)))
            instance.step(i * size, size)
            row = rows[int((i + 1) / parts + 1e-9)]
            assert instance.get(*signals(fmu)) == pytest.approx(row, rel=1e-9, abs=1e-12)
            values = dict(zip(signals(fmu), instance.get(*signals(fmu))))
            for name, k, j, least in losses(fmu.design):
                u = values[vector("u", size_of(fmu.design)[1])[j]]
                f_hat = values[vector("f_hat", size_of(fmu.design)[3])[k]]
                loss = -u * f_hat / (u * u + least * least)
                assert instance.get(name) == pytest.approx([loss], rel=1e-13)


def test_its_commands_have_no_slopes(fmu):
    z, y, slope = start_of(fmu)
    with begun(fmu, size_of(fmu.design), z, y) as instance:
        instance.set_slopes(y1=slope[0])
        instance.step(0.0, T)
        assert set(instance.slopes_of(*fmu.names(causality="output"))) == {0.0}


def test_outputs_do_not_change_when_inputs_are_set_between_steps(fmu):
    assert not any(unknown.dependencies for unknown in fmu.description.outputs)
    z, y, _ = start_of(fmu)
    with begun(fmu, size_of(fmu.design), z, y) as instance:
        instance.step(0.0, T)
        before = instance.outputs()
        instance.set({name: 9.0 for name in fmu.names(causality="input", type="Real")})
        instance.set({"compensate": False})
        assert instance.outputs() == before


def test_it_has_discrete_outputs_no_states_and_a_constant_sample_time(fmu):
    assert fmu.states == fmu.indicators == 0
    assert not any(name.startswith("der(") for name in fmu.variables)
    assert fmu.names(causality="output") == fmu.names(variability="discrete", causality="output")
    sample_time = fmu.variables["T_s"]
    assert (sample_time.variability, float(sample_time.start)) == ("constant", T)
    with Instance(fmu) as instance:
        assert instance.start().get("T_s") == [T]
        assert instance.set_one("T_s", 2 * T) == ERROR


def test_the_step_size_of_the_default_experiment_is_the_sample_time(controller, tmp_path):
    design = random_design((1, 1, 1, 1), None, "c")
    del design["experiment"]["step_size"]
    fmu = fmu_with(controller, design, tmp_path)
    assert float(fmu.description.defaultExperiment.stepSize) == T


def test_a_step_is_rolled_back_with_the_same_bits(fmu):
    z, y, slope = start_of(fmu)
    names = [f"y{k + 1}" for k in range(len(y))]
    with begun(fmu, size_of(fmu.design), z, y) as instance, Instance(fmu) as other:
        instance.step(0.0, 1.7 * T)
        saved = serialized(instance)
        runs = []
        for one in (instance, instance, other):
            restore(one, saved)
            one.set_slopes(**dict(zip(names, slope)))
            one.step(1.7 * T, 2.6 * T)
            runs.append(one.outputs())
        assert runs[0] == runs[1] == runs[2]


def sampled_in_exchange(fmu):
    """The signals after each time event, with the inputs set at the event."""
    z, y, slope = start_of(fmu)
    n, _, p, q = size_of(fmu.design)
    names = [f"y{k + 1}" for k in range(p)]
    starts = dict(zip(vector("x_hat_0", n) + vector("f_hat_0", q), z)) | dict(zip(names, y))
    with Instance(fmu, kind=MODEL_EXCHANGE) as instance:
        instance.start(starts)
        rows, info = [], EventInfo()
        for k in range(SAMPLES + 1):
            instance.set(dict(zip(names, y + k * T * slope)))
            instance.must("NewDiscreteStates", byref(info))
            assert (info.next_event_time_defined, info.new_discrete_states_needed) == (1, 0)
            assert info.next_event_time == (k + 1) * T
            rows.append(instance.get(*signals(fmu)))
            instance.must("EnterContinuousTimeMode")
            instance.must("SetTime", info.next_event_time)
            assert instance.get(*signals(fmu)) == rows[-1], "nothing changes before the event"
            instance.must("EnterEventMode")
    return np.array(rows)


def test_in_model_exchange_each_sample_is_a_time_event(fmu):
    assert sampled_in_exchange(fmu) == pytest.approx(expected(fmu), rel=1e-9, abs=1e-12)


def test_fmpy_runs_it_in_model_exchange(fmu):
    z, y, slope = start_of(fmu)
    n, _, p, q = size_of(fmu.design)
    names = [f"y{k + 1}" for k in range(p)]
    end = SAMPLES * T
    rows = [(time, *(y + time * slope)) for time in (0.0, 2 * end)]
    result = simulate_fmu(
        str(fmu.folder),
        fmi_type="ModelExchange",
        stop_time=end - 0.5 * T,
        output_interval=T,
        record_events=True,
        input=np.array(rows, dtype=[("time", float), *((name, float) for name in names)]),
        output=signals(fmu),
        start_values=dict(zip(vector("x_hat_0", n) + vector("f_hat_0", q) + names, [*z, *y])),
    )
    reference = expected(fmu)
    for k in range(SAMPLES - 1):
        after = result[result["time"] <= (k + 0.9) * T][-1]
        values = [after[name] for name in signals(fmu)]
        assert values == pytest.approx(reference[k], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("parts", [1, 4, 10])
@pytest.mark.parametrize("slopes", [False, True])
@pytest.mark.parametrize("estimator", ["current", "prediction"])
def test_there_is_no_delay_in_a_loop_with_a_plant_that_is_stepped_first(
    controller, tmp_path, estimator, slopes, parts
):
    # A double integrator; the loop below is exact if steps divide the sample time.
    A, B, C = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    whole = lambda h: expm(np.block([[A, B], [np.zeros((1, 3))]]) * h)[:2]
    Phi, Gamma = whole(T)[:, :2], whole(T)[:, 2:]
    signal = lambda name: [{"name": name}]
    design = {"description": "double integrator", "t_on": 0.0, "monitor": False}
    design |= {"A": Phi, "B": Gamma, "C": C, "F_a": Gamma, "K_x": [[-4.0, -3.0]], "K_f": [[-1.0]]}
    design |= {"L_x": [[0.9], [6.0]], "L_f": [[20.0]], "sample_time": T, "estimator": estimator}
    design |= {"states": signal("x") + signal("v"), "actuators": signal("force")}
    design |= {"measurements": signal("y1"), "faults": signal("f")}
    design |= {"experiment": {"stop_time": 2.0}}
    fmu = fmu_with(controller, design, tmp_path)
    x = np.array([1.0, 0.0])
    ideal, reference, commands = SampledController(design, np.zeros(3), C @ x), [], []
    for _ in range(SAMPLES):
        _, _, u = ideal.sample(C @ x)
        reference.append(u[0])
        x = Phi @ x + Gamma @ (u + 0.7)
    x, part = np.array([1.0, 0.0]), whole(T / parts)
    with begun(fmu, size_of(design), np.zeros(3), C @ x) as instance:
        for i in range((SAMPLES - 1) * parts + 1):
            u = instance.get("force")
            commands += u if i % parts == 0 else []
            before, x = C @ x, part @ [*x, u[0] + 0.7]
            measurement = before if slopes else C @ x
            instance.set({"y1": measurement[0]})
            if slopes:
                instance.set_slopes(y1=((C @ x - before) * parts / T)[0])
            instance.step(i * T / parts, T / parts)
    assert commands == pytest.approx(reference, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("period", [0.1, 0.001])
def test_ten_steps_of_a_tenth_of_the_sample_time_take_one_sample(controller, tmp_path, period):
    # x_hat counts the samples.
    one, signal = [[1.0]], lambda name: [{"name": name}]
    design = {name: [[0.0]] for name in ("C", "K_x", "K_f", "L_x", "L_f")} | {"A": one, "B": one}
    design |= {"description": "counter", "t_on": 0.0, "monitor": False, "F_a": one}
    design |= {"states": signal("k"), "actuators": signal("u"), "measurements": signal("y1")}
    design |= {"faults": signal("f"), "experiment": {"stop_time": 1.0, "step_size": period / 10}}
    design |= {"sample_time": period, "estimator": "current"}
    fmu = fmu_with(controller, design, tmp_path)
    with begun(fmu, (1, 1, 1, 1), [0.0, 1.0], [0.0]) as instance:
        time = 0.0
        for i in range(1, 100_001):
            instance.step(time, period / 10)
            time += period / 10
            if i % 10 in (0, 9):
                assert instance.get("x_hat") == [i // 10]
