"""The numbers of `aso-ftc design --json`, compared with numpy and scipy."""

import tomllib

import numpy as np
import pytest
from fmpy import extract, read_model_description
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from conftest import ROOT
from design_loop import Designed, changed, coupled, packed_plant
from design_oracle import (
    WITHOUT_PROOFS,
    Matrices,
    closed_loop,
    commands,
    frequency_response,
    lyapunov,
    responses,
    total,
)
from matrices import zoh

PENDULUM = "fmu-controller/pendulum.toml"
# Plant files, and when their responses have settled: in s, or in samples.
DESIGNS = {
    PENDULUM: 8.0,
    "fmu-controller/pendulum-three-measurements.toml": 8.0,
    "examples/dc-servo/plant.toml": 1.0,
    "examples/dc-servo/ramp.toml": 1.0,
    "examples/three-tank/plant.toml": 1500,
    "examples/three-tank/loss-of-effectiveness.toml": 1500,
    "examples/three-tank/sensor-fault.toml": 1500,
}


def read(file):
    """A plant file as a dictionary."""
    return tomllib.loads((ROOT / file).read_text(encoding="utf-8"))


@pytest.fixture(scope="module", params=DESIGNS, ids=lambda file: file.partition("/")[2][:-5])
def case(request, aso_ftc, tmp_path_factory):
    """A design, its matrices, and when its responses have settled."""
    for plant in ("DcServo", "ThreeTank"):
        packed_plant(aso_ftc, plant)
    designed = Designed(aso_ftc, request.param, tmp_path_factory.mktemp("design"))
    return designed, Matrices(designed.design), DESIGNS[request.param]


def numbers(report, name):
    """A matrix of the report."""
    return np.array([matrix for matrix in report["gains"] if matrix["name"] == name][0]["values"])


def complex_numbers(pairs):
    """Eigenvalues of the report, in the order of numpy."""
    return np.sort_complex([complex(*pair) for pair in pairs])


def outputs(designed):
    """The names of the outputs of the loop, in the order of the oracle."""
    states = [state["name"] for state in designed.design["states"]]
    return [*states, *(f"error of {name}" for name in [*states, *faults(designed)])]


def faults(designed):
    """The names of the faults and the rates of ramps, in the order of the oracle."""
    return [fault["name"] for fault in designed.design["faults"]]


def stated_faults(designed):
    """Positions of the faults that the report has, without the rates."""
    return [faults(designed).index(fault["name"]) for fault in designed.report["plant"]["faults"]]


def test_the_design_file_has_the_gains_of_the_report_and_the_fmu_reads_it(case, tmp_path):
    designed, matrices, _ = case
    for name in ("K_x", "K_f", "L_x", "L_f"):
        assert (numbers(designed.report, name) == getattr(matrices, name)).all()
    unpacked = extract(str(designed.fmu), unzipdir=str(tmp_path))
    starts = {v.name: v.start for v in read_model_description(unpacked).modelVariables}
    for name in ("A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"):
        for (i, j), value in np.ndenumerate(getattr(matrices, name)):
            assert float(starts[f"{name}[{i + 1},{j + 1}]"]) == value
    interface = {variable["name"]: variable["start"] for variable in designed.report["interface"]}
    assert {name: starts[name] for name in interface} == interface


def test_the_eigenvalues_of_both_loops_are_those_of_the_plant_file(case):
    designed, matrices, _ = case
    for name, dynamics in (("feedback", matrices.fed_back), ("observer", matrices.error_dynamics)):
        loop, wish = designed.report[name], designed.plant_file[name]
        eigenvalues = np.sort_complex(np.linalg.eigvals(dynamics))
        assert eigenvalues == pytest.approx(complex_numbers(loop["eigenvalues"]), rel=1e-8)
        if "eigenvalues" in wish:
            required = np.sort(wish["eigenvalues"])
            required = required if matrices.period is None else np.exp(required * matrices.period)
            assert complex_numbers(loop["required"]) == pytest.approx(required, rel=1e-14)
            assert eigenvalues == pytest.approx(required, rel=1e-8) and loop["pole_error"] < 1e-9
    a = np.array(designed.report["plant"]["matrices"][0]["values"])
    stated = complex_numbers(designed.report["plant"]["eigenvalues"])
    assert np.sort_complex(np.linalg.eigvals(a)) == pytest.approx(stated, abs=1e-9)


def test_the_sampled_plant_is_the_matrix_exponential(case):
    designed, matrices, _ = case
    a, b, _, *_ = (np.array(m["values"]) for m in designed.report["plant"]["matrices"])
    n, m = b.shape
    if matrices.period is None:
        assert (matrices.A[:n, :n] == a).all() and (matrices.B[:n] == b).all()
        return
    phi, gamma = zoh(a, b, matrices.period)
    assert matrices.A[:n, :n] == pytest.approx(phi, rel=1e-13)
    assert matrices.B[:n] == pytest.approx(gamma, rel=1e-13)
    assert matrices.F_a[:n, :m] == pytest.approx(matrices.B[:n], rel=1e-13), "a fault of each pump"
    shown = {m["name"]: np.array(m["values"]) for m in designed.report["plant"]["matrices"]}
    assert (shown["F_a"][:, :m] == b).all()
    if matrices.filtered:
        part = 1 - np.exp(-designed.plant_file["filter"] * matrices.period)
        assert designed.design["filter"] == pytest.approx([part] * 3, rel=1e-14)


def test_the_ranks_are_full(case):
    designed, matrices, _ = case
    a, b, c, *_ = (np.array(m["values"]) for m in designed.report["plant"]["matrices"])
    powers = [np.linalg.matrix_power(a / np.linalg.norm(a), k) for k in range(len(a))]
    reached = np.linalg.matrix_rank(np.hstack([power @ b for power in powers]))
    checks = {check["condition"]: check for check in designed.report["checks"]}
    controllable = checks["(A, B) is controllable"]
    assert controllable["holds"] and controllable["explanation"].startswith(f"rank {reached} of ")
    assert reached == len(a)
    # For constant faults: no invariant zero at 0, or at 1 for the sampled plant.
    shift = 0.0 if matrices.period is None else 1.0
    first = stated_faults(designed)
    pencil = np.block(
        [
            [matrices.A - shift * np.eye(matrices.n), matrices.F_a[:, first]],
            [matrices.C, np.zeros((len(matrices.C), len(first)))],
        ]
    )
    scale = abs(pencil).max(axis=0)
    assert np.linalg.matrix_rank(pencil / scale) == matrices.n + len(first)
    assert checks["the augmented observer exists"]["holds"]


def test_the_compensation_cancels_the_faults(case):
    designed, matrices, _ = case
    n = len(designed.report["plant"]["states"])
    expected = -np.linalg.pinv(matrices.B[:n]) @ matrices.F_a[:n]
    assert matrices.K_f == pytest.approx(expected, abs=1e-12)
    stable = [c for c in designed.report["checks"] if c["condition"].startswith("plant and con")][0]
    eigenvalues = np.linalg.eigvals(closed_loop(matrices)[0])
    worst = eigenvalues.real.max() if matrices.period is None else abs(eigenvalues).max() - 1
    assert stable["value"] == pytest.approx(worst, rel=1e-6) and worst < 0


PARTS = 32


def between_samples(designed, matrices, samples):
    """Sums of the moduli of the loop's responses to faults that are an impulse, and a step, of one part of
    an interval; of the states the largest over the parts at which they are read."""
    shown = {m["name"]: np.array(m["values"]) for m in designed.report["plant"]["matrices"]}
    (n, m), q, whole = shown["B"].shape, matrices.q, matrices.n
    held = np.zeros((n + m + q, n + m + q))
    held[:n] = np.hstack([shown["A"], shown["B"], matrices.F_a[:n] * 0])
    # A fault that does not act on the plant's states acts on the filter, which sees it at the samples.
    held[:n, n + m : n + m + shown["F_a"].shape[1]] = shown["F_a"]
    step = expm(held * matrices.period / PARTS)[:n]
    # Columns: the part of the impulse, then the fault.
    wide = PARTS * q
    kind = np.tile(np.eye(q), PARTS)
    part = np.repeat(np.arange(PARTS), q)
    gains = []
    for lasts in (False, True):
        x, x_hat, f_hat = np.zeros((whole, wide)), np.zeros((whole, wide)), np.zeros((q, wide))
        sums = np.zeros((PARTS, n, wide))
        errors = np.zeros((whole + q, wide))
        for k in range(samples):

            def fault(i, first=k == 0):
                if lasts:
                    return kind * (matrices.period / PARTS) * ((part < i) | (not first))
                return kind * (first & (part == i))

            innovation = matrices.C @ (x - x_hat)
            estimate, faults_seen = x_hat, f_hat
            if matrices.current:
                estimate, faults_seen = x_hat + matrices.L_x @ innovation, f_hat + matrices.L_f @ innovation
            u = matrices.K_x @ estimate + matrices.K_f @ faults_seen
            errors += abs(np.vstack([x - estimate, faults_seen - fault(0)]))
            late = (1 - matrices.current) * innovation
            x_hat = matrices.A @ estimate + matrices.B @ u + matrices.F_a @ faults_seen + matrices.L_x @ late
            f_hat = matrices.A_f @ faults_seen + matrices.L_f @ late
            filtered = matrices.A[n:] @ x + matrices.F_a[n:] @ fault(0)
            own_x = x[:n]
            for i in range(PARTS):
                sums[i] += abs(own_x)
                own_x = step @ np.vstack([own_x, u, fault(i)])
            x = np.vstack([own_x, filtered])
        each = lambda rows: rows.reshape(*rows.shape[:-1], PARTS, q).sum(axis=-2)
        filters = np.zeros((whole - n, q))
        gains.append(np.vstack([each(sums).max(axis=0), filters, each(errors)]))
    return gains


def test_the_peak_gains_are_integrals_of_the_impulse_response(case):
    """The gain from the rate of a constant fault is the integral of the step response. In a sampled loop
    faults change, and states are seen, between the samples too."""
    designed, matrices, horizon = case
    if matrices.period is None:
        system = closed_loop(matrices)
        times, impulse, step = responses(system, matrices.period, horizon)
        of_fault = abs(system[3]) + total(times, abs(impulse), matrices.period)
        of_rate = total(times, abs(step), matrices.period)
    else:
        of_fault, of_rate = between_samples(designed, matrices, horizon)
    stated = {entry["name"]: entry for entry in designed.plant_file.get("faults", [])}
    for bound in designed.report["bounds"]:
        at = outputs(designed).index(bound["error"]), faults(designed).index(bound["fault"])
        # If a fault does not affect a state, both values are rounding errors.
        tiny = 1e-9 * of_fault[:, at[1]].max()
        assert bound["gain_of_fault"] == pytest.approx(of_fault[at], rel=1e-2, abs=tiny)
        tiny = 1e-9 * of_rate[:, at[1]].max()
        assert bound["gain_of_rate"] == pytest.approx(of_rate[at], rel=1e-2, abs=tiny)
        fault = stated.get(bound["fault"], {})
        products = [of_fault[at] * fault["bound"]] if "bound" in fault else []
        products += [of_rate[at] * fault["rate_bound"]] if "rate_bound" in fault else []
        if products:
            assert bound["largest"] == pytest.approx(min(products), rel=1e-2, abs=tiny)
        else:
            assert bound["largest"] is None


def driven(system, direction, rate, size, period, times):
    """States and fault after a jump by `size`, or a rise to it at a rate: one row for each time."""
    a, b, *_ = system
    n = len(a)
    # [states; fault; its rate]
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n] = a, b @ direction
    start = np.zeros(n + 2)
    if period is not None:
        assert rate is None
        whole[n, n], start[n] = 1, size
        return np.array([np.linalg.matrix_power(whole, round(t / period)) @ start for t in times])
    end = 0.0 if rate is None else size / rate
    start[n:] = [size, 0.0] if rate is None else [0.0, rate]
    rising = whole.copy()
    rising[n, n + 1] = 1
    top = expm(rising * end) @ start
    before = expm(rising * np.minimum(times, end)[:, None, None]) @ start
    after = expm(whole * np.maximum(times - end, 0)[:, None, None]) @ top
    return np.where((times < end)[:, None], before, after)


def between(report, states, commands, fault, times):
    """The plant's states after `times` within a sample, from those at the sample, with held commands and faults."""
    a, b, f_a = (plant_matrix(report, name) for name in ("A", "B", "F_a"))
    n = len(a)
    inputs = np.hstack([b, f_a])
    whole = np.zeros((n + inputs.shape[1],) * 2)
    whole[:n, :n], whole[:n, n:] = a, inputs
    rows = zip(states[:, :n], commands, times, strict=True)
    return np.array([(expm(whole * t) @ np.concatenate([x, u, fault]))[:n] for x, u, t in rows])


def plant_matrix(report, name):
    """A matrix of the plant in continuous time."""
    return np.array(next(matrix["values"] for matrix in report["plant"]["matrices"] if matrix["name"] == name))


def test_the_responses_to_changes_of_faults_are_those_of_scipy(case):
    """States, errors and commands, each fault alone and all together; between samples, too."""
    designed, matrices, _ = case
    system = closed_loop(matrices)
    names, order = outputs(designed), len(system[0])
    actuators = [f"command {actuator['name']}" for actuator in designed.design["actuators"]]
    together = [steps for steps in designed.report["steps"] if len(steps["parts"]) > 1]
    assert len(together) == (len(stated_faults(designed)) > 1)
    for steps in designed.report["steps"]:
        direction = np.zeros(matrices.q)
        for part in steps["parts"]:
            direction[faults(designed).index(part["name"])] = part["value"] / steps["size"]
        rows = np.hstack([system[2], system[3] @ direction[:, None]])
        rows = np.vstack([rows, np.hstack([commands(matrices), np.zeros((len(actuators), 1))])])
        every = [*names, *actuators]
        shown = [curve["name"] for curve in steps["curves"]]
        assert set(actuators) <= set(shown)
        for curve in steps["curves"]:
            at, times = every.index(curve["name"]), np.array(curve["times"])
            some = times[::7]
            samples = some if matrices.period is None else np.floor(some / matrices.period + 1e-6) * matrices.period
            change = (direction, steps["rate"], steps["size"], matrices.period, samples)
            states = driven(system, *change)[:, : order + 1]
            expected = states @ rows[at]
            within = np.flatnonzero(some - samples > 1e-6 * (matrices.period or np.inf))
            if matrices.period is not None:
                is_state = at < len(designed.report["plant"]["states"])
                assert (len(within) > 0) == (is_state or curve["name"] in actuators)
                if is_state:
                    u = states[within] @ rows[len(names) :].T
                    fault = direction * steps["size"]
                    elapsed = (some - samples)[within]
                    expected[within] = between(designed.report, states[within], u, fault, elapsed)[:, at]
            values = np.array(curve["values"])
            # If the fault does not affect an error, the error is due to rounding.
            band = 1e-5 * abs(values).max() + 1e-17 * steps["size"]
            assert values[::7] == pytest.approx(expected, abs=band), curve["name"]
            assert abs(values).max() <= abs(curve["peak"]) * (1 + 1e-12)
            assert abs(values).max() == pytest.approx(abs(curve["peak"]), rel=1e-2)
            if curve["settling_time"] is None:
                # Only rounding moves the signal.
                assert abs(values).max() <= 1e-12 * steps["size"], curve["name"]
                continue
            distance = abs(values - values[-1])
            last = np.flatnonzero(distance > 0.02 * distance.max())[-1]
            assert times[last] <= curve["settling_time"] <= times[last + 1]


def error_response(designed, matrices, frequency):
    """From the faults to the errors of their estimates."""
    response = frequency_response(closed_loop(matrices), matrices.period, frequency)[2 * matrices.n :]
    return response[np.ix_(stated_faults(designed), stated_faults(designed))]


def rate_response(designed, matrices, frequency):
    """From the rates of the faults to the errors of their estimates."""
    response = frequency_response(closed_loop(matrices), matrices.period, frequency)[2 * matrices.n :]
    point = 1j * frequency if matrices.period is None else np.exp(1j * frequency * matrices.period)
    response = response @ np.linalg.inv(point * np.eye(matrices.q) - matrices.A_f)
    return response[np.ix_(stated_faults(designed), stated_faults(designed))]


def test_the_singular_values_are_those_of_numpy(case):
    designed, matrices, _ = case
    error = lambda w: error_response(designed, matrices, w)
    rate = lambda w: rate_response(designed, matrices, w)
    expected = {
        "faults to their estimates": lambda w: error(w) + np.eye(len(stated_faults(designed))),
        "faults to the errors of their estimates": error,
        "rates of the faults to the errors of their estimates": rate,
    }
    curves = {curve["name"]: curve for curve in designed.report["frequency"]}
    assert set(curves) == set(expected)
    for name, response in expected.items():
        frequencies = curves[name]["frequencies"]
        values = [np.linalg.svd(response(w), compute_uv=False) for w in frequencies]
        sigma = np.transpose(curves[name]["singular_values"])
        assert sigma == pytest.approx(np.array(values), rel=1e-5, abs=1e-9)


def test_t_has_as_many_singular_values_as_its_rank(case):
    counts = {curve["name"]: len(curve["singular_values"]) for curve in case[0].report["robustness"]["curves"]}
    rank = min(counts["S at the input"], counts["S at the output"])
    assert counts["T at the input"] == counts["T at the output"] == rank


def must_have_energy_norms(designed, matrices):
    """Compares H2 and generalised H2 norm with scipy; returns all norms."""
    norms = {norm["name"]: norm["value"] for norm in designed.report["certificate"]["norms"]}
    rows = matrices.n + np.array(stated_faults(designed))
    # A rate of T^-1/2 for one sample has unit energy, the integral of its square, and changes the fault by T^1/2.
    rate = -np.eye(matrices.n + matrices.q)[:, rows] * np.sqrt(matrices.period or 1.0)
    if matrices.current:
        _, c_0, gain = matrices.augmented
        rate = rate - gain @ c_0 @ rate
    covariance = lyapunov(matrices.error_dynamics.T, rate @ rate.T, matrices.period)
    covariance = covariance[np.ix_(rows, rows)]
    assert norms["H2"] == pytest.approx(np.sqrt(np.trace(covariance)), rel=1e-6)
    largest = np.linalg.eigvalsh(covariance)[-1]
    assert norms["generalised H2"] == pytest.approx(np.sqrt(largest), rel=1e-6)
    return norms


def test_the_norms_are_those_of_numpy_and_scipy(case):
    designed, matrices, _ = case
    norms = must_have_energy_norms(designed, matrices)
    size = lambda w: np.linalg.norm(rate_response(designed, matrices, w), 2)
    highest = 1e5 if matrices.period is None else np.pi / matrices.period
    grid = np.geomspace(1e-6 * highest, highest, 2000)
    at = grid[np.argmax([size(w) for w in grid])]
    optimum = minimize_scalar(lambda w: -size(w), bounds=(0.9 * at, min(1.1 * at, highest)))
    assert norms["H-infinity"] == pytest.approx(max(-optimum.fun, size(at)), rel=2e-3)


def test_theorem_1_is_that_of_scipy(case):
    designed, matrices, _ = case
    certificate = designed.report["certificate"]
    if matrices.period is not None:
        assert "continuous time" in certificate["printed"]["reason"]
        return
    bounds = [fault.get("bound") for fault in designed.plant_file.get("faults", [{}])]
    if matrices.A_f.any() or None in bounds:
        assert any(text in certificate["printed"]["reason"] for text in ("constant", "`bound`"))
        return
    printed, dynamics, beta = certificate["printed"], matrices.error_dynamics, 30.0
    assert printed["beta"] == beta == np.linalg.norm(bounds)
    p = lyapunov(dynamics, printed["alpha"] * beta * np.eye(len(dynamics)), None)
    fault = np.vstack([matrices.F_a, np.zeros((matrices.q, matrices.q))])
    delta = 2 / printed["alpha"] * np.linalg.norm(p @ fault, 2)
    assert printed["delta"] == pytest.approx(delta, rel=1e-6)
    assert np.array(printed["p"]) == pytest.approx(p, rel=1e-6, abs=1e-6 * abs(p).max())
    free = certificate["free"]
    assert free["delta"] < printed["delta"]
    assert 2 * beta * np.linalg.norm(np.array(free["p"]) @ fault, 2) == pytest.approx(free["delta"], rel=1e-6)
    slowest = -np.linalg.eigvals(dynamics).real.max()
    assert 0.99 * slowest < free["decay"] < slowest


def test_the_largest_stable_loss_is_where_an_eigenvalue_becomes_unstable(aso_ftc, tmp_path):
    """The pendulum's actuator loses effectiveness: the loop becomes unstable before all of it is lost."""
    begin, end = "F_a = [\n", "[experiment]"
    file = changed(PENDULUM, tmp_path)
    text = file.read_text(encoding="utf-8")
    head, rest = text.split(begin)
    text = head + end + rest.split(end)[1].split("[[faults]]")[0]
    text += '[[faults]]\nname = "f_loss"\nloss_of = "u"\nleast_command = 1.0\n'
    file.write_text(text, encoding="utf-8")
    designed = Designed(aso_ftc, file, tmp_path, WITHOUT_PROOFS)
    matrices = Matrices(designed.design)
    unstable = lambda loss: np.linalg.eigvals(closed_loop(matrices, [loss])[0]).real.max() > 0
    low, high = 0.0, 1.0
    for loss in np.linspace(0, 1, 2001):
        if unstable(loss):
            high = loss
            break
        low = loss
    (effectiveness,) = designed.report["effectiveness"]
    assert effectiveness["actuator"] == "u"
    assert low - 1e-3 <= effectiveness["largest_stable_loss"] <= high + 1e-3


def test_bounds_and_predictions_bracket_the_simulation(aso_ftc, python, packed, tmp_path):
    """Within a factor of 3, as control::response::fault_bounds and reversal state.

    Compares bounds of positions and of the error of the estimate, the peaks of the positions after a
    sudden reversal, and all peaks after a reversal at the bound of the rate.
    """
    designed = Designed(aso_ftc, PENDULUM, tmp_path)
    table, _ = coupled(python, designed, packed["plant"], {})
    late = {name: column[table["time"] > 60] for name, column in table.items()}
    friction, (fault,) = late["plant.f_fric"], read(PENDULUM)["faults"]
    # While the cart sticks the friction varies without jumps.
    rate = abs(np.diff(friction)).max() / np.diff(late["time"])[0]
    assert fault["rate_bound"] == pytest.approx(rate, rel=1e-2)
    names = ["x_p", "theta", "v_p", "omega"]
    shown = {name: np.ptp(late[f"plant.{name}"]) / 2 for name in names}
    shown["error of f_fric"] = abs(late["controller.f_hat"] - friction).max()
    bounds = {bound["error"]: bound["largest"] for bound in designed.report["bounds"]}
    for name in ("x_p", "theta", "error of f_fric"):
        assert shown[name] <= bounds[name] <= 3 * shown[name]
    jump, glide = designed.report["steps"]
    assert jump["rate"] is None and glide["rate"] == fault["rate_bound"]
    for steps, predicted in ((jump, names[:2]), (glide, shown)):
        peaks = {curve["name"]: abs(curve["peak"]) for curve in steps["curves"]}
        for name in predicted:
            assert shown[name] / 3 < peaks[name] < 3 * shown[name], name


def test_an_fmu_is_made_without_a_compiler(aso_ftc, tmp_path):
    fmus = [tmp_path / name for name in ("with.fmu", "without.fmu")]
    for fmu, environment in zip(fmus, ({}, {"env": {"PATH": "/nonexistent"}})):
        # The time decides which proofs the report in the FMU has.
        arguments = (PENDULUM, "--out", tmp_path / "design.toml", "--fmu", fmu, *WITHOUT_PROOFS)
        done = aso_ftc("design", *arguments, **environment)
        assert done.returncode == 1 and "verdict: red" in done.stdout, done.stderr
    assert fmus[0].read_bytes() == fmus[1].read_bytes()


@pytest.mark.parametrize("period, bound", [(0.001, "bound = 100, "), (0.004, "bound = 100, "), (0.004, "")])
def test_the_bound_for_a_rate_in_seconds_holds_for_any_sample_time(aso_ftc, python, tmp_path, period, bound):
    """A fault that grows at its largest rate causes nearly the largest error, also without a bound of its size."""
    rate = 10.0  # V/s
    fault = f'faults = [{{ name = "f_u", actuator = "u", {bound}rate_bound = {rate} }}]'
    sampled = f"sample_time = {period}\n{fault}"
    file = changed("examples/dc-servo/plant.toml", tmp_path, ('actuator_faults = "all"', sampled))
    designed = Designed(aso_ftc, file, tmp_path)
    must_have_energy_norms(designed, Matrices(designed.design))
    settings = {"plant.friction": "false", "plant.r_u": rate}
    steps = ("--step", period, "--stop-time", 0.4)
    table, _ = coupled(python, designed, packed_plant(aso_ftc, "DcServo"), settings, *steps)
    error = abs(table["controller.f_hat"] - rate * table["time"]).max()
    (largest,) = (b["largest"] for b in designed.report["bounds"] if b["error"] == "error of f_u")
    assert 0.9 * error <= largest <= 1.5 * error
    assert all(b["largest"] is not None for b in designed.report["bounds"])
