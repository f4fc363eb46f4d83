"""Measurements that a controller does not use: ranges, the longest time for which a last value is used.

`test_code.py` compares the bits of the source code with those of the FMU.
"""

import json
import re

import numpy as np
import pytest
from fmpy import extract

from c_abi import Fmu, Instance
from code_cases import CASES, MOST_HELD, Built, fed, held, masses, stated
from conftest import ROOT
from design_loop import packed_plant

# The force has limits; faults are compensated from the start.
TWO_MASSES = masses("current", "false").replace("t_on = 1.5", "t_on = 0.0")
NO_NUMBER = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1000.5]


@pytest.fixture(scope="module")
def built(aso_ftc, packed, tmp_path_factory):
    """The code of a plant file; each is written once."""
    packed_plant(aso_ftc, "ThreeTank")
    cache = {}

    def of(text, *options):
        if (text, options) not in cache:
            cache[text, options] = Built(aso_ftc, text, tmp_path_factory.mktemp("held"), *options)
        return cache[text, options]

    return of


@pytest.fixture(scope="module")
def programs(built):
    """The programs in C, at two levels, and in Rust of a plant file."""

    def of(text, *options):
        code = built(text, *options)
        return [code.compiled("-O0"), code.compiled("-O3", "-march=native"), code.crate()]

    return of


def measured(code, count, extra=1):
    """Samples of measurements about the operating point without a pattern; the inputs after them are 1."""
    y = np.array([signal.get("operating", 0.0) for signal in code.design["measurements"]])
    noise = 1e-4 * np.random.default_rng(1).normal(size=(count, len(y)))
    return np.hstack([y + noise, np.ones((count, extra))])


def statuses(outputs):
    """The bits of the status."""
    return outputs[:, -1].astype(int)


def test_one_sample_of_1e300_leaves_the_commands_at_a_limit_only_without_a_range(built, programs):
    count, at = 400, 100
    samples = measured(built(held(TWO_MASSES)), count)
    samples[at, 0] = 1e300
    low, high = built(TWO_MASSES).design["actuators"][0]["limits"]
    for program in programs(TWO_MASSES):
        commands = fed(program, samples)[0][at + 1 :, 0]
        assert np.isin(commands, [low, high]).all(), "the command stays at its limits for 300 samples"
    usual = samples.copy()
    usual[at, 0] = usual[at - 1, 0]
    for program in programs(held(TWO_MASSES)):
        outputs, expected = fed(program, samples)[0], fed(program, usual)[0]
        assert outputs[:, :-1].tobytes() == expected[:, :-1].tobytes(), "the last value replaces it"
        assert ((outputs[:, 0] > low) & (outputs[:, 0] < high)).mean() > 0.9
        assert (np.flatnonzero(statuses(outputs) & 1) == [at]).all() and not (statuses(expected) & 1).any()


@pytest.mark.parametrize("value", NO_NUMBER)
def test_a_measurement_that_stays_away_ends_at_the_operating_point(built, programs, value):
    code, at = built(held(TWO_MASSES)), 100
    samples = measured(code, 300)
    samples[at:, 1] = value
    m, n = code.sizes[1], code.sizes[0]
    u_op, x_op = ([signal.get("operating", 0.0) for signal in code.design[kind]] for kind in ("actuators", "states"))
    for program in programs(held(TWO_MASSES)):
        outputs = fed(program, samples)[0]
        assert not statuses(outputs)[:at].any() and set(statuses(outputs)[at : at + MOST_HELD] & 17) == {1}
        rest = outputs[at + MOST_HELD :]
        assert set(statuses(rest)) == {17}, "held and lost"
        assert (rest[:, :m] == u_op).all() and (rest[:, m : m + n] == x_op).all() and not rest[:, m + n : -1].any()
        assert (outputs[at + MOST_HELD - 1, :m] != u_op).all(), "before, the controller acts with the last value"


def test_values_outside_and_values_that_are_no_numbers_have_the_same_effect(built, programs):
    code = built(held(TWO_MASSES))
    samples, chance = measured(code, 600), np.random.default_rng(4)
    places = chance.random((600, 2)) < 0.4
    for program in programs(held(TWO_MASSES)):
        results = []
        for value in NO_NUMBER:
            spoilt = samples.copy()
            spoilt[:, :2][places] = value
            results.append(fed(program, spoilt)[0].tobytes())
        assert len(set(results)) == 1
        assert set(statuses(fed(program, spoilt)[0]) & 17) == {0, 1, 17}


@pytest.mark.parametrize("name", ["held-detection", "held-feedthrough", "masses"])
def test_after_a_loss_the_controller_is_one_that_starts(built, programs, name):
    """A second run starts with the first sample in which no measurement is lost; its times start there, too."""
    text = CASES[name].text if name in CASES else held(TWO_MASSES)
    text = re.sub(r"^t_on = .*$", "t_on = 0.0", text, flags=re.MULTILINE)
    code, lost, back = built(text), 80, 80 + MOST_HELD + 20
    n, m, p, q = code.sizes
    has_detection = "detection" in code.design
    samples = measured(code, 400, 2 if has_detection else 1)
    if has_detection:
        samples[:, -1] = 0
    samples[lost:back, 0] = np.nan
    columns = np.ones(len(fed(programs(text)[0], samples)[0][0]), dtype=bool)
    columns[m + n + q : m + n + q + 4] = not has_detection
    for program in programs(text):
        outputs, anew = fed(program, samples)[0], fed(program, samples[back:])[0]
        assert (statuses(outputs)[back - 1], statuses(outputs)[back]) == (17, statuses(anew)[0])
        assert outputs[back:, columns].tobytes() == anew[:, columns].tobytes()


def test_a_decision_of_the_detection_stays_and_no_alarm_is_given_while_a_measurement_is_lost(built, programs):
    text = CASES["held-detection"].text
    code, (n, m, _, q) = built(text), built(text).sizes
    first = round(code.design["detection"]["from"] / code.design["sample_time"])
    lost, back = first + 300, first + 400
    samples = measured(code, back + first + 300, 2)
    samples[:, -1] = 0
    quiet = samples.copy()
    for one in (samples, quiet):
        one[lost:back, 0] = 1e300
    samples[first + 50 : lost, 1] += 0.05  # A fault of a sensor.
    for program in programs(text):
        decision = fed(program, samples)[0][:, m + n + q : m + n + q + 4]
        assert decision[lost, 0] == 1 and (decision[lost : back + first] == decision[lost - 1]).all()
        outputs = fed(program, quiet)[0]
        assert not outputs[:, m + n + q].any(), "neither the loss nor the start after it is an alarm"
        assert not outputs[lost + MOST_HELD : back, m + n + q + 4 : -1].any(), "residuals and statistics are 0"
        assert outputs[back + first + 10, m + n + q + 4 : -1].any(), "residuals again"


def test_the_cost_of_a_range_is_two_comparisons_a_measurement(built):
    plain, ranged = stated(built(TWO_MASSES)), stated(built(held(TWO_MASSES)))
    assert ranged == plain | {"comparisons": plain["comparisons"] + 2 * built(TWO_MASSES).sizes[2]}
    of = lambda text, what: int(re.search(rf"(\d+) bytes {what}", built(text).header.replace("\n *", "")).group(1))
    counters = 4 * built(TWO_MASSES).sizes[2]
    assert of(held(TWO_MASSES), "for an instance") == of(TWO_MASSES, "for an instance") + counters
    assert of(held(TWO_MASSES, has_limit=False), "for an instance") == of(TWO_MASSES, "for an instance")


def test_single_precision_has_the_same_bits_in_c_and_rust(built, programs):
    code = built(held(TWO_MASSES), "--float")
    samples, chance = measured(code, 600), np.random.default_rng(5)
    samples[:, :2][chance.random((600, 2)) < 0.4] = 1e300
    results = {fed(program, samples)[0].tobytes() for program in programs(held(TWO_MASSES), "--float")}
    assert len(results) == 1 and code.single


def test_report_and_header_state_ranges_and_times(built, aso_ftc, tmp_path):
    code = built(held(TWO_MASSES))
    header = code.header.replace("\n *", "")
    assert "Range of Measurements.q_1: -1000.0 to 1000.0" in code.header
    assert f"(q[1] for {MOST_HELD}, Q_1 for {MOST_HELD})" in header and f"#define {code.name.upper()}_LOST 16U" in code.header
    done = aso_ftc("design", code.folder / "plant.toml", "--out", tmp_path / "d.toml", "--json", "--certificate-time", "0")
    notes = [signal["notes"] for signal in json.loads(done.stdout)["plant"]["measurements"]]
    assert notes == ["used from -1000 to 1000, held for 0.11 s at most"] * 2


# A continuous controller that acts on the measurement of the page on ranges.
CONTINUOUS = (ROOT / "docs/reference/plant-file/measurements.toml").read_text("utf-8").replace("sample_time = 0.05\n", "") + """
[detection]
method = "cusum"
false_alarm_interval = 1000.0
noise = 1e-3
process_noise = 1e-3
sizes.f_force = 1.0
from = 1.0
"""


def test_a_continuous_controller_rests_while_a_measurement_is_lost_and_keeps_its_decision(aso_ftc, packed, tmp_path):
    (tmp_path / "plant.toml").write_text(CONTINUOUS, encoding="utf-8")
    options = ("--out", tmp_path / "d.toml", "--fmu", tmp_path / "Own.fmu", "--certificate-time", "0")
    done = aso_ftc("design", tmp_path / "plant.toml", *options)
    assert done.returncode in (0, 1), done.stderr
    fmu = Fmu(extract(str(tmp_path / "Own.fmu"), str(tmp_path / "fmu")))
    names = ("force", "f_hat", "x_hat[1]", "residual", "statistic", "t_detected")
    size, lost = 0.05, [(3.0, 5.0), (13.0, 15.0)]
    outputs, flags = [], []
    with Instance(fmu) as instance:
        instance.start({"position": 0.0})
        for k in range(400):
            time = k * size
            # A fault of the sensor at 10 s.
            y = 1e300 if any(start <= time < end for start, end in lost) else 1e-6 * np.sin(time) + 0.5 * (time >= 10.0)
            instance.set({"position": y})
            instance.step(time, size)
            outputs.append(instance.get(*names))
            flags.append(instance.get("measurement_held", "measurement_lost", "fault_detected"))
    rows, (held_flag, lost_flag, detected), times = np.array(outputs), np.array(flags, dtype=bool).T, np.arange(400) * size
    spoilt = np.any([(times > start - 1e-9) & (times < end - 1e-9) for start, end in lost], axis=0)
    late = np.any([(times > start + 0.5 - 1e-9) & (times < end - 1e-9) for start, end in lost], axis=0)
    assert (held_flag == spoilt).all() and (lost_flag == late).all()
    assert not rows[late, :5].any() and rows[~late & (times > 0.1), 0].all(), "zero, the operating point, while it is lost"
    assert not detected[times < 10 - 1e-9].any() and detected[times > 11].all()
    [t_detected] = set(rows[times > 11, 5])
    assert 10 <= t_detected <= 11
