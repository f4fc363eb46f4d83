"""Parameters, designs and measures of campaigns, against scipy, SALib and NumPy."""

import itertools
import json
import pickle

import aso_ftc as af
import numpy as np
import pyarrow.parquet as parquet
import pytest
from aso_ftc.campaign import Campaign
from aso_ftc.campaign._folder import Folder, system_of
from aso_ftc.campaign._measures import Expression
from scipy import stats

MEASURES = {"peak": "max(abs(plant.x_p))"}


def paper(**entries):
    """A campaign of the paper's loop, 0.1 s long."""
    return Campaign("paper", **{"measures": MEASURES, "experiment": {"stop-time": 0.1}} | entries)


def columns(campaign):
    """The values of the parameters by name."""
    return {name: list(values) for name, values in campaign.plan.sampled.values.items()}


def test_a_grid_has_every_combination_once():
    campaign = paper(
        parameters={
            "plant.F_c": {"from": 20.0, "to": 30.0, "steps": 3},
            "controller.compensate": [True, False],
            "plant.v_s": {"from": 1e-4, "to": 1e-2, "steps": 3, "logarithmic": True},
        }
    )
    rows = list(zip(*columns(campaign).values(), strict=True))
    expected = list(itertools.product([20.0, 25.0, 30.0], [True, False], [1e-4, 1e-3, 1e-2]))
    assert len(rows) == len(expected) == len(campaign)
    for row, combination in zip(rows, expected, strict=True):
        assert row[:2] == combination[:2]
        assert row[2] == pytest.approx(combination[2], rel=1e-14)


def test_whole_levels_between_whole_ends_stay_whole():
    parameter = {"from": 1, "to": 7, "steps": 4, "set": "plant.F_c"}
    for change, expected in (({}, [1, 3, 5, 7]), ({"to": 7.0}, [1.0, 3.0, 5.0, 7.0]), ({"steps": 5}, [1.0, 2.5, 4.0, 5.5, 7.0])):
        levels = columns(paper(parameters={"n": parameter | change}))["n"]
        assert levels == expected and {type(level) for level in levels[1:-1]} == {type(expected[1])}


@pytest.mark.parametrize("design", [{"method": "grid"}, {"method": "random", "runs": 4}])
def test_a_range_with_whole_steps_is_written_as_its_design_has_it(design, tmp_path):
    study = paper(parameters={"n": {"from": 1, "to": 7, "steps": 4, "set": "plant.F_c"}}, design=design)
    Folder(tmp_path, study).begin(study)
    written = parquet.read_table(tmp_path / "plan.parquet")["n"].to_pylist()
    assert written == columns(study)["n"] and {type(value) for value in written} == {int if design["method"] == "grid" else float}


@pytest.mark.parametrize(
    "name, entries", [("norm", {"loc": 25.0, "scale": 2.0}), ("gamma", {"a": 3.0}), ("expon", {})]
)
def test_random_values_have_the_distribution_that_they_name(name, entries):
    campaign = paper(
        parameters={"plant.F_c": {"distribution": name, **entries}},
        design={"method": "random", "runs": 2000},
        seed=3,
    )
    values = columns(campaign)["plant.F_c"]
    assert stats.kstest(values, getattr(stats, name)(**entries).cdf).pvalue > 0.01


def test_a_discrete_distribution_gives_whole_numbers():
    campaign = paper(
        parameters={"controller.substeps": {"distribution": "randint", "low": 1, "high": 5}}
        if "controller.substeps" in {v.name for v in af.paper().variables()}
        else {"n": {"distribution": "randint", "low": 1, "high": 5, "set": "algorithm.jobs"}},
        design={"method": "random", "runs": 400},
    )
    (values,) = columns(campaign).values()
    assert {type(value) for value in values} == {int}
    assert set(values) == {1, 2, 3, 4}


def test_a_logarithmic_range_has_its_own_ends_at_the_ends_of_a_design():
    # exp(log(20)) is 19.999999999999996, exp(log(30)) is 30.000000000000004.
    ranges = {"plant.F_c": {"from": 20.0, "to": 30.0, "logarithmic": True}, "plant.F_s": {"relative": 0.1}}
    values = columns(paper(parameters=ranges, design={"method": "morris", "trajectories": 40}))["plant.F_c"]
    assert (min(values), max(values)) == (20.0, 30.0)


def test_a_discrete_distribution_has_its_own_numbers_at_the_ends_of_a_design():
    # The positions of a design morris with four levels are 0, 1/3, 2/3 and 1, the quantiles of 1 to 4 there 1, 2, 3 and 4.
    for parameter in ({"distribution": "randint", "low": 1, "high": 5}, {"distribution": stats.randint(1, 5)}):
        campaign = paper(
            parameters={"n": {**parameter, "set": "algorithm.jobs"}, "plant.F_c": {"relative": 0.1}},
            design={"method": "morris", "trajectories": 40},
        )
        values = columns(campaign)["n"]
        assert set(values) <= {1, 2, 3, 4} and {1, 4} <= set(values)


@pytest.mark.parametrize("method", ["latin-hypercube", "sobol", "halton"])
def test_space_filling_designs_have_less_discrepancy_than_random_ones(method):
    ranges = {name: {"from": 0.0, "to": 1.0} for name in ("plant.x_p_0", "plant.theta_0", "plant.v_p_0")}
    unit = {}
    for chosen in (method, "random"):
        campaign = paper(parameters=ranges, design={"method": chosen, "runs": 256}, seed=1)
        unit[chosen] = stats.qmc.discrepancy(campaign.plan.sampled.unit)
    assert unit[method] < 0.5 * unit["random"]


def test_each_tenth_of_a_latin_hypercube_has_a_tenth_of_the_runs():
    campaign = paper(
        parameters={"plant.F_c": {"relative": 0.2}, "plant.F_s": {"relative": 0.1}},
        design={"method": "latin-hypercube", "runs": 50},
    )
    nominal = {variable.name: variable.start for variable in af.paper().variables()}
    for (name, values), part in zip(columns(campaign).items(), (0.2, 0.1), strict=True):
        low, high = nominal[name] * (1 - part), nominal[name] * (1 + part)
        assert list(np.histogram(values, bins=10, range=(low, high))[0]) == [5] * 10


def test_the_same_seed_gives_the_same_runs_and_another_seed_others():
    def values(seed):
        campaign = paper(
            parameters={"plant.F_c": {"relative": 0.2}},
            disturbances={"noise": {"connection": "controller.x_p", "noise": {"deviation": 1e-5}}},
            design={"method": "random", "runs": 5},
            seed=seed,
        )
        return [json.dumps(campaign.changes(run)) for run in range(5)]

    assert values(7) == values(7)
    assert all(one != two for one, two in zip(values(7), values(8), strict=True))
    seeds = {json.loads(text)["faults"][0]["noise"]["seed"] for text in values(7)}
    assert len(seeds) == 5


def test_a_parameter_sets_variables_steps_and_entries_of_disturbances():
    campaign = paper(
        parameters={
            "mass": {"values": [2.0], "set": ["plant.m_c", "plant.m_p"], "unit": "kg"}
            if {"plant.m_c", "plant.m_p"} <= {v.name for v in af.paper().variables()}
            else {"values": [2.0], "set": ["plant.F_c", "plant.F_s"]},
            "H": {"values": [0.002], "set": "algorithm.step"},
            "late.seconds": [0.01],
        },
        disturbances={"late": {"connection": "plant.u", "delay": {"seconds": 0.0, "hold": True}}},
    )
    changes = campaign.changes(0)
    assert list(changes["start_values"].values()) == [2.0, 2.0]
    assert changes["algorithm"] == {"step": 0.002}
    assert changes["faults"] == [{"connection": "plant.u", "delay": {"seconds": 0.01, "hold": True}}]


def test_a_time_with_the_name_of_python_is_shown_with_that_of_the_file(tmp_path):
    study = paper(parameters={"experiment.stop_time": [0.1, 0.2]})
    Folder(tmp_path, study).begin(study)
    assert [system_of(tmp_path, run).experiment["stop-time"] for run in (0, 1)] == [0.1, 0.2]
    assert "stop-time = 0.2" in system_of(tmp_path, 1).to_toml()


def test_only_times_are_in_seconds():
    study = paper(
        parameters={"algorithm.step": [0.001], "rough.step": [1e-3], "rough.until": [0.05], "experiment.stop_time": [0.1]},
        disturbances={"rough": {"connection": "controller.x_p", "quantisation": {"step": 1e-4}}},
    )
    assert [parameter.unit for parameter in study.parameters] == ["s", None, "s", "s"]


def test_a_fault_campaign_has_each_fault_at_each_connection_time_and_size():
    campaign = paper(
        faults=[
            {"bias": {"value": [0.001, 0.01], "from": [0.02, 0.05]}},
            {"connection": "plant.u", "stuck": {}},
        ],
    )
    labels = [case.label for case in campaign.plan.faults]
    assert labels[0] == ""
    connected = {"controller.x_p", "controller.theta", "plant.u"}
    assert {case.connection for case in campaign.plan.faults[1:]} == connected
    assert len(labels) == len(set(labels)) == 1 + 3 * 4 + 1


def test_a_table_of_the_user_is_taken_row_by_row(tmp_path):
    (tmp_path / "runs.csv").write_text("run,plant.F_c,plant.F_s\n7,20.5,30\n8,21,31\n", encoding="utf-8")
    campaign = paper(design={"method": "table", "file": "runs.csv"}, folder=tmp_path)
    assert columns(campaign) == {"plant.F_c": [20.5, 21.0], "plant.F_s": [30, 31]}


def test_a_table_with_a_name_twice_is_refused(tmp_path):
    (tmp_path / "runs.csv").write_text("plant.F_c,plant.F_s,plant.F_c\n20.5,30,21\n", encoding="utf-8")
    with pytest.raises(af.ConfigurationError, match="has several columns plant.F_c"):
        paper(design={"method": "table", "file": "runs.csv"}, folder=tmp_path)


TIME = np.linspace(0.0, 2.0, 2001)
SIGNALS = {"a.x": np.exp(-3.0 * TIME) * np.cos(20.0 * TIME), "a.der(x)": TIME, "a.K[1,2]": TIME**2}
SIGNALS |= {"a.on": TIME > 1.0, "a.count": np.arange(2001, dtype=np.int32) * 1000}


@pytest.mark.parametrize(
    "text, expected, tolerance",
    [
        ("max(abs(a.x))", 1.0, 1e-12),
        ("max(a.x, start=0.1, end=0.5)", SIGNALS["a.x"][100:501].max(), 1e-12),
        ("rms(signal('a.der(x)'))", 2.0 / np.sqrt(3.0), 1e-3),
        ("integral(a.K[1, 2])", 8.0 / 3.0, 1e-5),
        ("mean(a.K[1,2])", 4.0 / 3.0, 1e-5),
        ("settling_time(a.x, 0.05)", None, 0.0),
        ("first_time(abs(a.x) < 0.1)", 1.4710 / 20.0, 2e-2),
        ("time_above(signal('a.der(x)'), 1.5)", 0.5, 2e-3),
        ("at(a.K[1,2], 0.5)", 0.25, 1e-12),
        ("last(a.K[1,2]) - first(a.K[1,2]) + 2 * pi", 4.0 + 2.0 * np.pi, 1e-12),
        ("amplitude(3 * sin(pi * time))", 3.0, 1e-5),
        ("rises(a.x > 0)", 6.0, 0.0),
        ("parameter('k') * max(time, start=fault_start)", 6.0, 1e-12),
        ("time_while(time > 0.5 and not time >= 1.5)", 1.0, 2e-3),
        ("last_time(a.x > 0.5)", None, 0.0),
        ("min(time, start=3)", np.nan, 0.0),
        ("max(a.on + a.on)", 2.0, 0.0),
        ("max((time > 0.5) + (time > 1.5))", 2.0, 0.0),
        ("min(-a.on)", -1.0, 0.0),
        ("amplitude(a.on)", 0.5, 0.0),
        ("max(a.count * 2000)", 4e9, 0.0),
    ],
)
def test_a_measure_has_the_value_of_its_definition(text, expected, tolerance):
    if text.startswith("settling_time"):
        outside = np.flatnonzero(np.abs(SIGNALS["a.x"]) > 0.05)
        expected = TIME[outside[-1] + 1]
    if text.startswith("last_time"):
        expected = TIME[SIGNALS["a.x"] > 0.5][-1]
    value = Expression("m", text).value(SIGNALS, TIME, {"k": 3.0}, 0.5)
    assert value == pytest.approx(expected, rel=tolerance, abs=tolerance, nan_ok=True)


def test_a_measure_in_seconds_since_1970_ends_at_its_time():
    for text in ("at(time, 1700000000.5)", "last(time, end=1700000000.5)", "first(time, start=1700000000.5)"):
        value = Expression("m", text).value({}, 1.7e9 + TIME, {}, np.nan)
        assert value == pytest.approx(1.7e9 + 0.5, rel=0, abs=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "at(a.x, fault_start)",
        "at(a.x, fault_start + 1)",
        "max(a.x, start=fault_start)",
        "last(a.x, end=fault_start)",
        "first_time(time > fault_start)",
    ],
)
def test_a_measure_from_the_start_of_a_fault_is_nan_in_the_run_without_one(text):
    assert np.isnan(Expression("m", text).value(SIGNALS, TIME, {}, np.nan))


@pytest.mark.parametrize(
    "entries, words",
    [
        ({"parameters": {"plant.F_q": [1.0]}}, "parameters.plant.F_q"),
        ({"parameters": {"plant.F_c": {"distribution": "nrom"}}}, "scipy.stats"),
        ({"parameters": {"plant.F_c": {"distribution": "gamma"}}}, "needs a"),
        ({"parameters": {"plant.F_c": {"distribution": "norm", "sigma": 1.0}}}, "unknown entry sigma"),
        ({"design": {"method": "grid", "points": 4}}, "design: unknown entry points: expected method"),
        ({"parameters": {"plant.F_c": {"distribution": "norm", "scale": -1.0}}}, "out of range"),
        (
            {
                "parameters": {"n": {"distribution": "poisson", "mu": 3.0, "set": "algorithm.jobs"}},
                "design": {"method": "morris", "trajectories": 40},
            },
            "reaches the ends of a distribution that has none",
        ),
        ({"parameters": {"plant.F_c": {"from": 2.0, "to": 1.0}}}, "from below to"),
        ({"parameters": {"plant.F_c": {"from": 2.0, "to": 3.0}}}, "steps"),
        ({"parameters": {"plant.F_c": {"values": []}}}, "at least one"),
        ({"parameters": {"plant.F_c": 25.0}}, "parameters.plant.F_c: expected a list of values or a table"),
        ({"design": {"method": "sobol", "runs": 8}}, "at least one parameter"),
        ({"design": {"method": "monte-carlo"}}, "latin-hypercube"),
        ({"design": {"method": "table", "file": "no.csv"}}, "no.csv"),
        ({"measures": {"m": "max(plant.x_q)"}}, "plant.x_q"),
        ({"measures": {"m": "plant.x_p"}}, "is a signal"),
        ({"measures": {"m": "maximal(plant.x_p)"}}, "unknown function maximal"),
        ({"measures": {"m": "max(plant.x_p"}}, "no expression"),
        ({"measures": {"m": "__import__('os').system('true')"}}, "unknown function"),
        ({"measures": {"m": "parameter('k')"}}, "no parameter k"),
        ({"measures": {}}, "at least one measure"),
        ({"measures": {"m": lambda results: 1.0}}, "measures.m: expected a function of two arguments"),
        ({"limits": {"speed": {"below": 1.0}}}, "no measure"),
        ({"limits": {"peak": {"below": "1 mm"}}}, "a finite number"),
        ({"faults": [{"connection": "plant.u", "bias": {"value": "x"}}]}, "value"),
        ({"faults": [{"connection": "plant.z", "bias": {"value": 1.0}}]}, "plant.z"),
        ({"faults": [{"connection": "plant.u", "biass": {"value": 1.0}}]}, "exactly one of"),
        ({"faults": [{"connection": "plant.u", "bias": {"value": [], "from": 1.0}}]}, "faults[0]: bias.value = []"),
        ({"disturbances": {"n": {"connection": "plant.u", "noise": {"amplitud": 1.0}}}}, "amplitud"),
        ({"stop": {"limit": "peak", "width": 0.1}}, "limit"),
        ({"keep": {"runs": [17]}}, "0 to 0"),
        ({"keep": {"runs": 3}}, "keep.runs: 3: expected a list"),
        ({"keep": {"record": "plant.x_p"}}, "keep.record: 'plant.x_p': expected a list"),
        ({"keep": {"runs": [0], "record": ["plant.x_q"]}}, "plant.x_q"),
        ({"keep": {"runs": [0], "every": -1.0}}, "found -1"),
        ({"seed": -1}, "seed"),
        ({"sistem": "paper"}, "similar: system"),
        ({"parameters": {"plant.f_c": [1.0]}}, "similar: plant.F_c"),
        ({"parameters": {"plant.theta": [1.0]}}, "cannot be set"),
        *(
            ({"parameters": {name: {"values": [20.0], "set": "plant.F_c"}}}, f"parameters.{name}: a column of the results")
            for name in ("run", "row", "status", "seconds", "fault.size")
        ),
        ({"parameters": {"plant.F_c": {"relative": 0.1}}, "design": {"method": "random", "runs": 10**9}}, "design.runs"),
        ({"parameters": {"plant.F_c": {"relative": 0.1}}, "design": {"method": "random", "runs": 5.5}}, "5.5"),
        ({"parameters": {name: {"relative": 0.1, "steps": 1000} for name in ("plant.F_c", "plant.F_s", "plant.M")}}, "1000000000 runs"),
        ({"parameters": {"plant.F_c": stats.norm(1.0, -1.0)}}, "out of range"),
        ({"measures": {"m": "max(plant.xp)"}}, "similar: plant.x_p"),
        ({"measures": {"m": "maxi(plant.x_p)"}}, "similar: max"),
        ({"experiment": {"stop_time": -1.0}}, "the stop time is -1 s, expected more than the start time, 0 s"),
        ({"experiment": {"start_time": 2.0, "stop_time": 1.0}}, "the stop time is 1 s, expected more than the start time, 2 s"),
        ({"parameters": {"experiment.stop-time": [1.0, -2.0, 3.0]}}, "parameters.experiment.stop-time: stop time -2 s"),
        ({"parameters": {"late": {"values": [0.0, 0.2, 0.0], "set": "experiment.start-time"}}}, "parameters.late: stop time 0.1 s"),
        ({"record_every": -1.0}, "found -1"),
        ({"isolate": True, "memory_limit": "2 gigs"}, "2GiB"),
    ],
)
def test_what_is_wrong_is_named_before_the_first_run(entries, words):
    with pytest.raises(af.ConfigurationError) as caught:
        paper(**entries)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_error_in_a_campaign_file_has_its_line(tmp_path):
    file = tmp_path / "campaign.toml"
    file.write_text(
        'system = "paper"\n\n[measures]\npeak = "max(plant.x_p)"\n\n[parameters]\n"plant.F_q" = [1.0]\n',
        encoding="utf-8",
    )
    with pytest.raises(af.ConfigurationError) as caught:
        Campaign.from_toml(file)
    assert str(caught.value).startswith(f"{file}:7: parameters.plant.F_q")
    assert caught.value.line == 7


def test_numbers_of_numpy_and_distributions_of_scipy_are_entries():
    grid = paper(parameters={"plant.F_c": np.linspace(20.0, 30.0, 5), "controller.compensate": np.array([True])})
    assert columns(grid) == {"plant.F_c": [20.0, 22.5, 25.0, 27.5, 30.0], "controller.compensate": [True] * 5}
    frozen = {"plant.F_c": stats.norm(25.0, scale=2.0), "plant.F_s": {"distribution": stats.uniform(28.0, 4.0)}}
    named = {
        "plant.F_c": {"distribution": "norm", "loc": 25.0, "scale": 2.0},
        "plant.F_s": {"distribution": "uniform", "loc": 28.0, "scale": 4.0},
    }
    design = {"method": "latin-hypercube", "runs": np.int64(8)}
    one, other = (paper(parameters=entries, design=design, seed=np.uint8(3)) for entries in (frozen, named))
    assert columns(one) == columns(other) and one.describe() == other.describe()
    assert columns(paper(parameters={"plant.F_c": range(20, 23)})) == {"plant.F_c": [20, 21, 22]}
    whole = paper(
        parameters={"n": {"distribution": stats.randint(1, 5), "set": "algorithm.jobs"}},
        design={"method": "random", "runs": 50},
    )
    assert set(columns(whole)["n"]) == {1, 2, 3, 4}


def test_a_campaign_travels():
    parameters = {
        "plant.F_c": stats.norm(25.0, 2.0),
        "plant.F_s": {"from": 28.0, "to": 32.0, "logarithmic": True},
        "controller.compensate": [True, False],
        "n": {"distribution": "poisson", "mu": 3.0, "set": "algorithm.jobs"},
    }
    one = paper(parameters=parameters, design={"method": "latin-hypercube", "runs": 8})
    other = pickle.loads(pickle.dumps(one))
    assert other.describe() == one.describe() and columns(other) == columns(one)
    for ours, theirs in zip(one.parameters, other.parameters, strict=True):
        assert list(ours.quantile(np.array([0.0, 0.3]))) == list(theirs.quantile(np.array([0.0, 0.3])))


def test_tables_have_names_of_python_or_of_the_file():
    stop_times = [
        Campaign("paper", experiment={name: 0.1}, measures=MEASURES).system.experiment["stop-time"]
        for name in ("stop_time", "stop-time")
    ]
    assert stop_times == [0.1, 0.1]


@pytest.mark.parametrize("workers", [0, -1, 1.5, True, "2"])
def test_a_wrong_number_of_workers_is_refused_before_anything_is_written(workers, tmp_path):
    with pytest.raises(af.ConfigurationError, match="workers: .*expected a whole number of at least 1"):
        paper().run(tmp_path / "out", workers=workers)
    assert not list(tmp_path.iterdir())
