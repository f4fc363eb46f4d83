"""The source code of sampled controllers: compiled, with the bits of the FMU in double, within its bound in float."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from fmpy import extract

from c_abi import OK, Fmu, Instance
from code_cases import CASES, HELD, Built, Plant, bound_of, fed, masses, run, spoiled
from conftest import ROOT
from design_file import vector
from design_loop import packed_plant


@pytest.fixture(scope="module")
def designed(aso_ftc, packed, tmp_path_factory):
    """The design of a case with its FMU, in double precision."""
    codes = {}

    def of(name):
        if name not in codes:
            packed_plant(aso_ftc, "ThreeTank")
            folder = tmp_path_factory.mktemp(name)
            codes[name] = BuiltWithFmu(aso_ftc, CASES[name], folder)
        return codes[name]

    return of


class BuiltWithFmu(Built):
    """The source code and the FMU of a design, and what the FMU does in the loop with the plant."""

    def __init__(self, aso_ftc, case, folder):
        super().__init__(aso_ftc, case.text, folder, "--fmu", folder / "Own.fmu")
        self.fmu = Fmu(extract(str(folder / "Own.fmu"), str(folder / "fmu")))
        self.samples, self.expected, self.flags = in_the_loop(self, case)


def in_the_loop(code, case):
    """Measurements and switch of each sample in the loop of the FMU with the plant, the FMU's outputs, its flags of measurements."""
    n, m, p, q = code.sizes
    design, plant = code.design, Plant(code.design)
    chance = np.random.default_rng(3)
    names = vector("x_hat", n) + vector("f_hat", q)
    names += [vector("E_hat", q)[k] for k, fault in enumerate(design["faults"]) if "loss_of" in fault]
    references = design.get("references", [])
    names += vector("x_i", len(references)) if "H" in design else []
    outputs = [signal["name"] for signal in design["actuators"]] + names
    inputs = [signal["name"] for signal in [*design["measurements"], *references]]
    schedule = design.get("schedule")
    inputs += [schedule["variable"]] if code.has("schedule") else []
    operating = np.array([signal.get("operating", 0.0) for signal in references])
    period, fault, detection = design["sample_time"], np.zeros(q), design.get("detection")
    samples, expected, flags = [], [], []
    switched, shares, known = switches_of(design)
    # Decisive losses of effectiveness occur at last.
    reconfigured = [entry["gone"] for entry in design.get("reconfigurations", []) if "loss" in entry]
    lost = [k for k, entry in enumerate(design["faults"]) if entry.get("loss_of") in reconfigured]
    of_lost = [outputs.index(design["faults"][k]["loss_of"]) for k in lost]
    with Instance(code.fmu) as instance:
        for k in range(case.samples):
            if k % 500 == 100:
                fault = case.fault * chance.uniform(-1, 1, q)
            y = plant.measured(fault) + case.noise * chance.normal(size=p) * (k > 50)
            y = np.append(y, operating * (1 + 0.1 * (k // 700 % 2)))
            if schedule:
                value = swept(schedule, k)
                y = np.append(y, value) if code.has("schedule") else np.where(np.array(inputs) == schedule["variable"], value, y)
            if case.is_spoiled:
                values = spoiled(k, p)
                y[:p] = np.where(np.isnan(values), y[:p], values)
            known = [k < 2000 and chance.random() < share for share in shares] if k % 100 == 70 else known
            compensate, reset = not 1700 < k < 1800, k % 700 in (640, 641)
            if k == 0:
                instance.start(dict(zip(inputs, y)))
            else:
                switches = {"compensate": compensate, **({"detection_reset": reset} if detection else {}), **dict(zip(switched, known))}
                instance.set({**dict(zip(inputs, y)), **switches})
                # A scheduling variable outside of the schedule gives a warning.
                accepted = (OK, OK + 1) if schedule else (OK,)
                assert instance.call("DoStep", (k - 1) * period, period, 1) in accepted
            samples.append([*y, compensate, *([reset] if detection else []), *known])
            expected.append(instance.get(*outputs) + decided(instance, detection))
            expected[-1] += instance.get("reconfiguration") if code.has("reconfigurations") else []
            flags.append(instance.get("measurement_held", "measurement_lost") if case.is_spoiled else [0, 0])
            if k > 2300 and lost:
                fault[lost[0]] = -expected[-1][of_lost[0]]
            plant.step(np.array(expected[-1][:m]), fault)
    return np.array(samples, dtype=float), np.array(expected), np.array(flags) @ [1, 16]


def switches_of(design):
    """Names of the inputs on actuators, the parts of time in which they are true, their first values."""
    names = [actuator["name"] for actuator in design["actuators"]]
    places = [names.index(entry["gone"]) for entry in design.get("reconfigurations", [])]
    inputs, shares = [vector("actuator_gone", len(names))[place] for place in places], [0.25] * len(places)
    if "fallback" in design:
        inputs, shares = [*inputs, "fall_back"], [*shares, 0.15]
    return inputs, shares, [False] * len(inputs)


def decided(instance, detection):
    """Decision, residuals and statistics of the FMU of a design with this detection."""
    if not detection:
        return []
    lists = [vector("residual", len(detection["C"])), vector("statistic", len(detection["tests"]))]
    decision = instance.get("fault_detected") + instance.get("fault_isolated") + instance.get("t_detected", "t_onset")
    return [float(value) for value in decision] + instance.get(*lists[0], *lists[1])


def swept(schedule, k):
    """The scheduling variable in sample k: it moves over the grid and beyond both ends, and stays at each point for a while."""
    grid = [point["at"] for point in schedule["points"]]
    if k % 500 < 50:
        return grid[k // 500 % len(grid)]
    return 0.5 * (grid[0] + grid[-1]) + 0.6 * (grid[-1] - grid[0]) * np.sin(k / 130)


def bits(values):
    """Bit patterns, which tell -0.0 from 0.0."""
    return np.ascontiguousarray(values).view(np.uint64)


@pytest.mark.parametrize("name", CASES)
def test_c_has_the_bits_of_the_fmu_at_each_optimisation(designed, name):
    code = designed(name)
    for options in (["-O0"], ["-O2"], ["-O3", "-march=native"], ["-O1", "-g", "-fsanitize=address,undefined"]):
        outputs, size = fed(code.compiled(*options), code.samples)
        assert (bits(outputs[:, :-1]) == bits(code.expected)).all(), options
        assert f"Memory: {size} bytes for an instance" in code.header
    limited = any("limits" in actuator for actuator in code.design["actuators"])
    known = {0.0, 2.0} if limited else {0.0}
    known |= {8.0 + status for status in known} if "schedule" in code.design else set()
    status = outputs[:, -1].astype(int)
    assert set(status & ~17) == known, "the limits and the ends of the schedule are reached and left"
    assert (status & 17 == code.flags).all()
    has_limit = any("longest_hold" in signal for signal in code.design["measurements"])
    assert set(code.flags) == ({0, 1, 17} if has_limit else {0, 1} if name in HELD else {0})


@pytest.mark.parametrize("name", CASES)
def test_the_crate_has_the_bits_of_the_fmu(designed, name):
    code = designed(name)
    outputs, size = fed(code.crate(), code.samples)
    assert (bits(outputs[:, :-1]) == bits(code.expected)).all()
    assert f"Memory: {size} bytes for an instance" in code.header


@pytest.mark.skipif(not shutil.which("clang"), reason="clang is not installed")
def test_clang_compiles_it_without_warnings_and_with_the_same_bits(designed):
    code = designed("sensor-fault")
    outputs, _ = fed(code.compiled("-O2", "-march=native", compiler="clang"), code.samples)
    assert (bits(outputs[:, :-1]) == bits(code.expected)).all()


@pytest.mark.parametrize("option", ["-ffast-math", "-ffinite-math-only"])
def test_an_option_that_removes_the_checks_of_nan_is_an_error(designed, option):
    code = designed("constant-prediction")
    source = code.folder / "c" / f"{code.name}.c"
    done = subprocess.run(["gcc", "-std=c99", option, "-fsyntax-only", source], capture_output=True, text=True)
    assert done.returncode != 0 and "remove the checks of NaN" in done.stderr


@pytest.mark.skipif(not shutil.which("cppcheck"), reason="cppcheck is not installed")
@pytest.mark.parametrize(
    "name",
    ["sensor-fault", "scheduled-drive", "detection-window", "detection-isolation", "fall-back", "reconfiguration-detection",
     "proportional-integral-sensor", "sliding-mode-detection", "feedthrough", "held-transfer", "held-feedthrough"],
)  # fmt: skip
def test_the_c_code_follows_all_rules_of_misra_c_that_are_not_advisory(designed, name):
    """Those of MISRA C:2012 that cppcheck knows. Advisory ones: unused macros (2.5), tables outside of functions (8.9), #include (20.1)."""
    code = designed(name)
    command = ["cppcheck", "--std=c99", "--addon=misra", "--quiet", "--enable=warning,style,performance,portability"]
    source = code.folder / "c" / f"{code.name}.c"
    violations = subprocess.run([*command, "--template={id}", source], capture_output=True, text=True, check=True).stderr
    advisory = {"misra-c2012-2.5", "misra-c2012-8.9", "misra-c2012-20.1"}
    # The status starts without flags.
    assert set(violations.split()) <= {*advisory, "badBitmaskCheck"}, violations


@pytest.mark.parametrize("name", ["reconfiguration-detection", "transfer-reconfiguration", "held-detection"])
def test_an_instance_has_its_fields_by_size(designed, name):
    """Numbers, counters, flags: without padding between them, the stated memory is right for any number of actuators and tests."""
    body = designed(name).header.split("its fields belong to the functions below. */")[1].split("}")[0]
    of_type = {"double": 8, "uint32_t": 4, "int32_t": 4, "bool": 1}
    sizes = [of_type[line.split()[0]] for line in body.splitlines() if line.startswith("    ")]
    assert set(sizes) == {8, 4, 1} and sizes == sorted(sizes, reverse=True)


def test_the_stated_arithmetic_is_that_of_the_equations(designed):
    code = designed("sensor-fault")
    n, m, p, q = code.sizes  # n with the filter's states
    products = p * n + n * p + q * p + m * n + m * q + n * n + n * m + n * q + p
    # Deviations, y + 0, e, values of x_hat, f_hat, u, sums of u and of x_hat[k+1], f_hat[k+1] + 0, the filter.
    others = (p + p + n + p) + p + (n + q + m) + m + 3 * n + q + 3 * p
    comparisons = 2 * (p + m + n + q + n + q + p) + 2 * m
    expected = f"{products} multiplications, {products - p + others} additions, {comparisons} comparisons, 0 divisions."
    assert expected in code.header.replace("\n *", "")


def test_the_stated_arithmetic_of_a_schedule_is_that_of_its_interpolation(designed):
    code = designed("scheduled-drive")
    (n, m, p, q), t = code.sizes, len(code.design["references"])
    # A, B, C, F_a, K_x, K_f, L_x, L_f, K_i, L_w, N_r are interpolated, H is not.
    moving = n * n + n * m + p * n + n * q + m * n + m * q + n * p + q * p + m * t + t * m + m * t
    vectors = n + m + p + t
    products = 3 * moving + t * p + 2 * vectors + t
    # As without a schedule: deviations, e, values, u, x_hat[k+1], f_hat[k+1], x_i[k+1].
    others = (p + p + n + t + t) + p + (n + q + m) + 3 * m + 3 * n + q + (t + m + t + t)
    # The operating point, theta + 0 and its weights, the limits.
    others += vectors + 4 + 2 * m
    comparisons = 2 * (p + t + m + n + q + n + q + t) + 2 * m + len(code.design["schedule"]["points"]) + 2
    expected = f"{products} multiplications, {2 * moving + t * p + others} additions, {comparisons} comparisons, 1 divisions."
    assert expected in code.header.replace("\n *", ""), expected


@pytest.mark.parametrize("name", ["detection-cusum", "detection-window", "detection-isolation"])
def test_the_stated_arithmetic_of_a_detection_is_that_of_its_filter_and_tests(designed, name):
    code = designed(name)
    (n, m, p, q), detection = code.sizes, code.design["detection"]
    k, rows, tests = len(detection["A"]), len(detection["C"]), len(detection["tests"])
    count = lambda operation: int(re.search(rf"(\d+) {operation}", code.header.replace("\n *", "")).group(1))
    products = p * n + n * p + q * p + m * n + m * q + n * n + n * m + n * q + p + (k + rows) * (k + m + p)
    # A comparison for each end of the range, for the sign of a sum, for the larger sum, for the threshold; times in s.
    windows = "window" in detection["tests"][0]
    others = 2 * (p + m + n + q + n + q + p + k + rows) + 2 * m * any("limits" in actuator for actuator in code.design["actuators"])
    assert count("multiplications") == products + 2 + (rows if windows else 0)
    assert count("comparisons") == others + (2 * rows + 3 * tests if windows else 10 * tests)
    assert count("divisions") == (tests if windows else 0)


@pytest.mark.parametrize("name", ["detection-cusum", "detection-window", "detection-isolation"])
def test_the_samples_of_a_detection_have_alarms_resets_and_decisions(designed, name):
    """What the comparison of bits would miss if it never happened."""
    code = designed(name)
    m, n, q = code.sizes[1], code.sizes[0], code.sizes[3]
    detected, isolated, t_detected, t_onset = code.expected[:, m + n + q : m + n + q + 4].T
    first = round(code.design["detection"]["from"] / code.design["sample_time"])
    assert not detected[:first].any() and set(detected) == {0.0, 1.0}
    assert (np.diff(t_detected) != 0).sum() > 3, "alarms after resets"
    faults = len(code.design["detection"]["faults"])
    assert {0.0, -1.0} < set(isolated) <= set(range(-1, faults + 1)) if name != "detection-window" else len(set(isolated)) > 1
    assert (t_onset[detected > 0] <= t_detected[detected > 0]).all() and (t_onset[detected == 0] == -1).all()


def test_a_start_at_other_estimates_has_the_bits_of_the_fmu(designed):
    code, count = designed("detection-cusum"), 200
    (n, _, p, q), k = code.sizes, len(code.design["detection"]["C"])
    x_0 = np.array([state["operating"] for state in code.design["states"]]) + 0.01 * np.arange(1, n + 1)
    inputs = [signal["name"] for signal in code.design["measurements"]]
    names = [actuator["name"] for actuator in code.design["actuators"]] + vector("x_hat", n) + vector("f_hat", q)
    with Instance(code.fmu) as instance:
        expected = []
        for at, y in enumerate(code.samples[:count, :p]):
            if at == 0:
                instance.start({**dict(zip(inputs, y)), **dict(zip(vector("x_hat_0", n), x_0))})
            else:
                instance.set(dict(zip(inputs, y)))
                instance.step((at - 1) * code.design["sample_time"], code.design["sample_time"])
            expected.append(instance.get(*names) + instance.get(*vector("residual", k)))
    outputs, _ = looped(code, code.samples[:count, :p], x_0)
    assert (bits(outputs) == bits(np.array(expected))).all()


def test_a_fall_back_that_does_not_compensate_has_the_bits_of_the_fmu(designed):
    """The cases compare its bits; here: it has no K_f, is in force while faults are compensated otherwise, and estimates then."""
    code = designed("fall-back-alone")
    n, m, _, _ = code.sizes
    assert "K_f" not in code.design["fallback"] and not code.design.get("monitor", False)
    alone, t_on = code.expected[:, -1] == -1, round(code.design["t_on"] / code.design["sample_time"])
    compensates = code.samples[:, code.sizes[2]] > 0
    assert alone[t_on:][compensates[t_on:]].sum() > 100 and (alone & ~compensates).sum() > 5
    f_hat = code.expected[:, m + n]
    assert abs(np.diff(f_hat)[alone[1:] & alone[:-1]]).min() > 0
    x_hat, u_op = code.expected[:, m : m + n], [actuator.get("operating", 0.0) for actuator in code.design["actuators"]]
    commands, feedback = code.expected[alone, :m] - u_op, x_hat[alone] @ np.array(code.design["fallback"]["K_x"]).T
    stuck = [[place, entry["stuck_at"]] for entry in code.design["reconfigurations"]
             for place, actuator in enumerate(code.design["actuators"]) if actuator["name"] == entry["gone"]]
    free = np.array([all(value != row[place] + u_op[place] for place, value in stuck) for row in commands])
    assert free.sum() > 50 and np.allclose(commands[free], feedback[free], rtol=0, atol=1e-12), "u = K_x x_hat"


@pytest.mark.parametrize("name", ["fall-back", "reconfiguration", "reconfiguration-detection"])
def test_the_samples_of_a_reconfiguration_have_each_kind_of_gains(designed, name):
    """What the comparison of bits would miss if it never happened."""
    code = designed(name)
    actuators, cases = len(code.design["actuators"]), len(code.design["reconfigurations"])
    switches = code.samples[:, -cases - 1 : -1] if "fallback" in code.design else code.samples[:, -cases:]
    number = code.expected[:, -1]
    assert {0, 1, 3, *([-1] if "fallback" in code.design else [])} <= set(number) <= set(range(-1, actuators + 1))
    assert set(switches.sum(axis=1)) >= {0, 1, 2, 3}, "several actuators are gone"
    stuck = {code.design["actuators"].index(actuator): entry["stuck_at"] for entry in code.design["reconfigurations"]
             for actuator in code.design["actuators"] if actuator["name"] == entry["gone"]}
    for place, value in stuck.items():
        assert (code.expected[number == place + 1, place] == value).all()
    if any("loss" in entry for entry in code.design["reconfigurations"]):
        assert ((number > 0) & ~switches.any(axis=1)).any(), "an estimated loss decides"


def test_after_2_to_32_samples_losses_decide_as_before(designed):
    """Two instances that both compensate from their first sample on differ in nothing but the number of samples before it."""
    code = designed("reconfiguration")
    numbers = (100_000, 2**32 - 100)
    early, late = (fed(code.compiled("-O2", f"-DFIRST_SAMPLE={number}U"), code.samples)[0] for number in numbers)
    assert (bits(early) == bits(late)).all()
    reported = code.samples[:, -len(code.design["reconfigurations"]) :].any(axis=1)
    assert ((late[:, -2] > 0) & ~reported)[100:].any(), "an estimated loss decides"


@pytest.mark.parametrize("name", ["fall-back", "reconfiguration"])
def test_the_stated_arithmetic_of_a_reconfiguration_has_the_commands_of_stuck_actuators(designed, name):
    code = designed(name)
    n, m, p, q = code.sizes
    losses = sum("loss_of" in fault for fault in code.design["faults"])
    gone = max([1, *(len(entry["gone"]) for entry in code.design.get("combinations", []))])
    count = lambda operation: int(re.search(rf"(\d+) {operation}", code.header.replace("\n *", "")).group(1))
    products = p * n + n * p + q * p + m * n + m * q + n * n + n * m + n * q
    assert count("multiplications") == products + m * gone + 3 * losses
    limited = 2 * m * any("limits" in actuator for actuator in code.design["actuators"])
    assert count("comparisons") == 2 * (p + m + n + q + n + q + losses) + limited + len(code.design["reconfigurations"])
    assert f"Memory: {fed(code.crate(), code.samples[:1])[1]} bytes for an instance" in code.header


def test_after_an_overflow_the_detection_is_that_of_the_sample_before(designed):
    code = designed("detection-cusum")
    samples, first = code.samples[:150].copy(), sum(code.sizes) - code.sizes[2]
    samples[140, :3] = 1.7e308 * np.array([1, -1, 1])
    for program in (code.compiled("-O2"), code.crate()):
        outputs = fed(program, samples)[0]
        assert np.isfinite(outputs).all() and outputs[140, -1] == 4
        assert (outputs[140, first:-1] == outputs[139, first:-1]).all()


def test_a_statistic_beyond_the_range_of_float_is_its_largest_number(aso_ftc, tmp_path, designed):
    code = Built(aso_ftc, CASES["detection-window"].text, tmp_path, "--float")
    # No window has more than 128 samples.
    samples = designed("detection-window").samples[:640].copy()
    samples[390:, 0] = 1e25
    for program in (code.compiled("-O2"), code.crate()):
        outputs = fed(program, samples)[0]
        assert np.isfinite(outputs).all() and outputs[390:, -2].max() == np.finfo(np.float32).max


def test_a_scheduled_controller_in_float_states_that_it_has_no_bound(aso_ftc, tmp_path, designed):
    code = designed("scheduled-drive")
    single = Built(aso_ftc, CASES["scheduled-drive"].text, tmp_path, "--float")
    reason = "matrices and operating point change with the scheduling variable"
    assert f"No bound of the difference: {reason}." in single.header.replace("\n *", "")
    assert f"warning: float: no bound of the rounding errors: {reason}" in single.done.stderr
    (in_c, _), (in_rust, _) = (fed(program, code.samples) for program in (single.compiled("-O2"), single.crate()))
    assert (bits(in_c) == bits(in_rust)).all()
    assert abs(in_c[:, :-1] - code.expected).max() < 1e-4 * abs(code.expected).max()


def test_a_scheduling_input_that_is_no_number_keeps_its_last_value(designed):
    code = designed("scheduled-drive")
    samples = code.samples[:400].copy()
    samples[0, -2], samples[200:210, -2] = np.nan, np.inf
    held = samples.copy()
    held[0, -2], held[200:210, -2] = code.design["schedule"]["points"][0]["at"], samples[199, -2]
    for program in (code.compiled("-O2"), code.crate()):
        outputs, expected = fed(program, samples)[0], fed(program, held)[0]
        assert (bits(outputs[:, :-1]) == bits(expected[:, :-1])).all()
        assert (np.flatnonzero(outputs[:, -1].astype(int) & 1) == [0, *range(200, 210)]).all()


def test_nan_and_infinite_measurements_are_replaced_by_the_last_finite_ones(designed):
    code = designed("ramp-current")
    samples = code.samples[:600].copy()
    samples[0, 0], samples[200:210, 1], samples[300, 0] = np.nan, np.inf, -np.inf
    held = samples.copy()
    held[0, 0] = code.design["measurements"][0]["operating"]
    held[200:210, 1], held[300, 0] = samples[199, 1], samples[299, 0]
    for program in (code.compiled("-O2"), code.crate()):
        outputs, expected = fed(program, samples)[0], fed(program, held)[0]
        assert (bits(outputs[:, :-1]) == bits(expected[:, :-1])).all() and np.isfinite(outputs).all()
        marked = outputs[:, -1].astype(int) & 1
        assert (np.flatnonzero(marked) == [0, *range(200, 210), 300]).all()


def test_after_an_overflow_commands_and_estimates_are_those_of_the_sample_before(designed):
    code = designed("constant-prediction")
    m, samples = code.sizes[1], code.samples[:100].copy()
    samples[50, 0] = 1.7e308 * np.sign(code.design["L_x"][0][0])
    samples[50, 1] = -1.7e308 * np.sign(code.design["L_x"][0][1] * code.design["L_x"][0][0])
    usual = fed(code.compiled("-O2"), code.samples[:100])[0]
    for program in (code.compiled("-O2"), code.crate()):
        outputs = fed(program, samples)[0]
        assert np.isfinite(outputs).all()
        assert (outputs[:50] == usual[:50]).all() and outputs[50, -1] == 4 and not outputs[51:, -1].any()
        assert (outputs[50, :m] == outputs[49, :m]).all()
        assert (outputs[50, m:-1] == outputs[51, m:-1]).all(), "the estimate of the sample before"


@pytest.mark.parametrize(
    "text",
    [*(CASES[name].text for name in ("three-tank", "sensor-fault", "constant-prediction", "detection-cusum")), masses("current", "true")],
    ids=["three-tank", "sensor-fault", "constant-prediction", "detection-cusum", "ramp"],
)
def test_float_stays_within_its_bound_of_double_in_the_loop(aso_ftc, tmp_path, text):
    """The bound is for a loop without limits; it may be up to 200 times the largest difference that occurs."""
    difference, bound, checked = differences(aso_ftc, tmp_path, text)
    assert (difference < bound).all(), difference / bound
    assert (difference[checked] > bound[checked] / 200).all(), bound / difference


def differences(aso_ftc, tmp_path, text):
    """Differences of float from double in the loop, their bounds, the rows without rates of ramps; the design has no warning."""
    text = re.sub(r", limits = \[.*?\]|^limits = .*$|^t_on = .*$", "", text, flags=re.MULTILINE)
    packed_plant(aso_ftc, "ThreeTank")
    loops = []
    for kind in ("double", "single"):
        (folder := tmp_path / kind).mkdir()
        code = Built(aso_ftc, text, folder, *(["--float"] if kind == "single" else []))
        loops.append((code, *looped(code)))
    (_, exact, _), (code, outputs, y) = loops
    n, m, p, q = code.sizes
    plant = Plant(code.design)
    largest = lambda columns, at: abs(columns - at).max(axis=0)
    commands, x_hat, f_hat = np.split(outputs[:, : m + n + q], [m, m + n], axis=1)
    signals = [largest(x_hat, plant.x_op), largest(f_hat, 0), largest(y, plant.y_op), largest(commands, plant.u_op), [1]]
    bound = bound_of(code.header) @ np.concatenate(signals)
    difference = abs(outputs - exact).max(axis=0)
    residuals = len(bound) - m - q
    difference = np.concatenate([difference[:m], difference[m + n : m + n + q], difference[len(difference) - residuals :]])
    faults = [k for k, fault in enumerate(code.design["faults"]) if not fault["name"].endswith("_rate")]
    assert "warning" not in code.done.stderr
    return difference, bound, [*range(m), *(m + k for k in faults), *range(m + q, m + q + residuals)]


def looped(code, measurements=None, x_0=None):
    """Outputs and measurements in the loop of the compiled code with the plant, or outputs for given measurements."""
    source = code.folder / "c" / f"{code.name}.c"
    run("gcc", "-std=c99", "-O2", "-shared", "-fPIC", source, "-o", code.folder / "own.so")
    import ctypes

    library, real = ctypes.CDLL(str(code.folder / "own.so")), ctypes.c_float if code.single else ctypes.c_double
    n, m, p, q = code.sizes
    losses = sum("loss_of" in fault for fault in code.design["faults"])
    state = (ctypes.c_double * 1000)()
    commands, estimates = (real * m)(), (real * (n + q + losses))()
    getattr(library, f"{code.name}_init")(state)
    step, plant = getattr(library, f"{code.name}_step"), Plant(code.design)
    residuals, tests = (len(code.design.get("detection", {}).get(name, [])) for name in ("C", "tests"))
    fields = [("detected", ctypes.c_bool), ("isolated", ctypes.c_int32), ("times", real * 2), ("residual", real * residuals)]
    detection = type("Detection", (ctypes.Structure,), {"_fields_": [*fields, ("statistic", real * tests)]})()
    more = ([ctypes.c_bool(False)], [ctypes.byref(detection)]) if residuals else ([], [])
    chance, rows, measured = np.random.default_rng(5), [], []
    scale = 1e-5 if "Q_1" in code.header and "Q_2" in code.header else 0.3
    if x_0 is not None:
        getattr(library, f"{code.name}_init_at")(state, (real * n)(*x_0), (real * q)())
    for k in range(4000 if measurements is None else len(measurements)):
        if k % 1000 == 100:
            fault = scale * chance.uniform(-1, 1, q)
            fault[[entry["name"].endswith("_rate") for entry in code.design["faults"]]] = 0
        y = plant.measured(fault if k >= 100 else np.zeros(q)) + 1e-3 * chance.normal(size=p)
        y = y if measurements is None else measurements[k]
        step(state, (real * p)(*y), ctypes.c_bool(True), *more[0], commands, estimates, *more[1])
        rows.append([*commands, *estimates, *detection.residual])
        measured.append(y)
        plant.step(np.array(commands), fault if k >= 100 else np.zeros(q))
    return np.array(rows), np.array(measured)


def test_float_is_refused_a_green_light_where_rounding_hides_the_changes(aso_ftc, tmp_path):
    """At 10 us, the poles of a loop of 0.1 1/s are 1 - 1e-6, 17 rounding errors from 1."""
    text = re.sub(r"sample_time = .*", "sample_time = 1e-5", CASES["constant-prediction"].text)
    code = Built(aso_ftc, text, tmp_path, "--float")
    assert re.search(r"warning: float: rounding may change \S+ by .* % of itself: the slowest eigenvalue", code.done.stderr)


def sheared(size):
    """An oscillator whose states are x_1 + size x_2 and x_2: entries of its matrices cancel."""
    to, back = np.array([[1, size], [0, 1]]), np.array([[1, -size], [0, 1]])
    a, b, c = to @ np.array([[0, 1], [-1.0, -0.5]]) @ back, to @ np.array([[0.0], [1]]), np.array([[1.0, 0]]) @ back
    return f"""sample_time = 0.05
A = {a.tolist()}
B = {b.tolist()}
C = {c.tolist()}
actuator_faults = "all"
feedback.eigenvalues = [-1.0, -1.5]
observer.eigenvalues = [-3, -3.5, -4]
robustness.cases = 0
experiment = {{ stop_time = 10, step_size = 0.05 }}
"""


@pytest.mark.parametrize(("size", "is_stable"), [(10.0, True), (1e4, False)])
def test_float_warns_of_a_loop_that_rounding_makes_unstable(aso_ftc, tmp_path, size, is_stable):
    text, largest = "nothing excludes that rounding makes the loop unstable", []
    for options in ([], ["--float"]):
        (folder := tmp_path / f"o{len(options)}").mkdir()
        code = Built(aso_ftc, sheared(size), folder, *options)
        largest.append(abs(looped(code)[0][:, 0]).max())
    assert largest[0] < 1 and (largest[1] < 1) == is_stable, "the loops themselves"
    assert (text in code.done.stderr) == (text.replace("nothing", "Nothing") in code.header.replace("\n *", "")) == (not is_stable)


def test_names_become_different_identifiers_and_the_header_lists_them(aso_ftc, tmp_path):
    code = Built(aso_ftc, masses("current", "true"), tmp_path, name="String")
    assert code.name == "String_ctl"
    rows = [line.split()[1:3] for line in code.header.splitlines() if line.startswith((" * Measurements.", " * Estimates.f"))]
    assert rows == [
        ["Measurements.q_1", "q[1]"],
        ["Measurements.Q_1_2", "Q_1"],
        ["Estimates.f_hat_int_2", "int"],
        ["Estimates.f_hat_int_rate", "int_rate"],
    ]
    assert "Commands.motor_1" in code.header
    code.compiled("-O2"), code.crate()


def test_a_signal_may_have_the_name_of_the_header(aso_ftc, tmp_path):
    Built(aso_ftc, masses("current", "true").replace('"Q_1"', '"Q_H"'), tmp_path, name="q").compiled("-O2")


def test_a_continuous_design_has_no_code_and_float_needs_code(aso_ftc, tmp_path):
    plant = ROOT / "examples" / "plants" / "quadruple-tank.toml"
    done = aso_ftc("design", plant, "--out", tmp_path / "d.toml", "--c-code", tmp_path / "c")
    assert done.returncode == 2 and "state `sample_time` in the plant file" in done.stderr
    assert not list(tmp_path.iterdir())
    done = aso_ftc("design", plant, "--out", tmp_path / "d.toml", "--float")
    assert done.returncode == 2 and "--float" in done.stderr and not list(tmp_path.iterdir())


def test_code_of_others_is_overwritten_on_request_only(aso_ftc, tmp_path):
    text = CASES["constant-prediction"].text
    Built(aso_ftc, text, tmp_path)
    Built(aso_ftc, text.replace("0.32", "0.33"), tmp_path)
    (tmp_path / "c" / "plant.c").write_text("int main(void) { return 0; }\n", encoding="utf-8")
    options = ("--out", tmp_path / "design.toml", "--c-code", tmp_path / "c")
    done = aso_ftc("design", tmp_path / "plant.toml", *options, "--certificate-time", "0")
    assert done.returncode == 2 and "--force" in done.stderr
    assert aso_ftc("design", tmp_path / "plant.toml", *options, "--certificate-time", "0", "--force").returncode in (0, 1)
