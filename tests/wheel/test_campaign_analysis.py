"""Analysis of a campaign, against closed forms and other formulas."""

import gc
import os
import subprocess
import sys

import numpy as np
import pytest
from aso_ftc import ConfigurationError, ResultsError
from aso_ftc.campaign import load
from SALib.sample import fast_sampler, morris, sobol
from scipy import stats

from campaign_folder import campaign, fault_campaign, ishigami, problem, random_campaign, write

# Closed form of Ishigami and Homma (1990) with a = 7, b = 0.1.
ISHIGAMI = {"S1": [0.3139, 0.4424, 0.0], "ST": [0.5576, 0.4424, 0.2437]}
A = np.array([0.0, 1.0, 4.5, 9.0])


def sobol_g(unit):
    return np.prod((np.abs(4 * unit - 2) + A) / (1 + A), axis=1)


def sobol_g_indices():
    """Closed form: V_i = 1 / (3 (1 + a_i)^2), V = prod(1 + V_i) - 1."""
    variances = 1 / (3 * (1 + A) ** 2)
    total = np.prod(1 + variances) - 1
    rest = [np.prod(1 + np.delete(variances, i)) for i in range(len(A))]
    return {"S1": variances / total, "ST": variances * rest / total}


@pytest.mark.parametrize("second_order", [True, False])
@pytest.mark.parametrize(
    ("function", "count", "expected"), [(ishigami, 3, ISHIGAMI), (sobol_g, 4, sobol_g_indices())]
)
def test_sobol_indices_are_within_their_confidence_of_the_closed_form(
    tmp_path, function, count, expected, second_order
):
    unit = sobol.sample(problem(count), 4096, calc_second_order=second_order, seed=1)
    design = {"method": "saltelli", "base": 4096, "second-order": second_order}
    indices = campaign(tmp_path / "c", design, unit, function).sobol("y")
    assert list(indices.index) == problem(count)["names"]
    for name, values in expected.items():
        assert (abs(indices[name] - values) <= indices[f"{name}_conf"]).all(), name
        assert (indices[f"{name}_conf"] < 0.1).all(), name


def test_second_order_indices_of_ishigami_show_its_only_interaction(tmp_path):
    unit = sobol.sample(problem(3), 4096, calc_second_order=True, seed=1)
    outcome = campaign(tmp_path / "c", {"method": "saltelli", "second-order": True}, unit, ishigami)
    indices = outcome.sobol_second_order("y")
    expected = {
        ("plant.p0", "plant.p1"): 0.0,
        ("plant.p0", "plant.p2"): 0.2437,
        ("plant.p1", "plant.p2"): 0.0,
    }
    assert list(indices.index) == list(expected)
    assert (abs(indices["S2"] - list(expected.values())) <= indices["S2_conf"]).all()
    without = sobol.sample(problem(3), 64, calc_second_order=False, seed=1)
    outcome = campaign(tmp_path / "d", {"method": "saltelli", "second-order": False}, without, ishigami)
    with pytest.raises(ConfigurationError, match="second-order = true"):
        outcome.sobol_second_order("y")


def test_sobol_indices_of_a_seed_are_the_same_also_in_parts(tmp_path, monkeypatch):
    unit = sobol.sample(problem(3), 1024, calc_second_order=False, seed=1)
    outcome = campaign(tmp_path / "c", {"method": "saltelli", "second-order": False}, unit, ishigami)
    one = outcome.sobol("y")
    assert one.equals(outcome.sobol("y", seed=0)) and not one.equals(outcome.sobol("y", seed=1))
    wide = outcome.sobol("y", confidence=0.99)
    ratio = stats.norm.ppf(0.995) / stats.norm.ppf(0.975)
    assert np.allclose(wide["ST_conf"], ratio * one["ST_conf"], rtol=1e-12)
    monkeypatch.setattr("aso_ftc.campaign._analysis._ROWS_OF_A_CALL", 1024 * 10)
    parts = outcome.sobol("y")
    assert parts["S1"].equals(one["S1"]) and parts["ST"].equals(one["ST"])
    # Two estimates of a standard deviation from 100 resamples each: 7 % of standard error, five of them.
    assert (abs(parts["ST_conf"] / one["ST_conf"] - 1) < 0.5).all()
    assert not parts["ST_conf"].equals(one["ST_conf"])


def test_morris_of_a_linear_function_returns_its_slopes(tmp_path):
    slopes = np.array([3.0, -2.0, 0.5])
    unit = morris.sample(problem(3), 20, num_levels=6, seed=1)
    design = {"method": "morris", "trajectories": 20, "levels": 6}
    effects = campaign(tmp_path / "c", design, unit, lambda u: u @ slopes + 7).morris("y")
    assert np.allclose(effects["mu"], slopes, rtol=0, atol=1e-12)
    assert np.allclose(effects["mu_star"], abs(slopes), rtol=0, atol=1e-12)
    assert np.allclose(effects[["sigma", "mu_star_conf"]], 0, atol=1e-12)


def test_morris_of_a_product_has_the_effect_of_the_other_factor(tmp_path):
    """d(ab)/da = b: mean and standard deviation of b over the trajectories."""
    unit = morris.sample(problem(2), 200, num_levels=4, seed=2)
    outcome = campaign(tmp_path / "c", {"method": "morris", "levels": 4}, unit, lambda u: u[:, 0] * u[:, 1])
    other = unit.reshape(200, 3, 2)
    moves = [np.argmax(abs(np.diff(trajectory[:, 0]))) for trajectory in other]
    b = np.array([trajectory[at, 1] for trajectory, at in zip(other, moves)])
    row = outcome.morris("y").loc["plant.p0"]
    assert np.isclose(row["mu"], b.mean(), rtol=1e-12) and np.isclose(row["sigma"], b.std(ddof=1), rtol=1e-12)


def test_fast_indices_of_ishigami_are_near_the_closed_form(tmp_path):
    unit = fast_sampler.sample(problem(3), 4001, M=4, seed=1)
    outcome = campaign(tmp_path / "c", {"method": "fast", "harmonics": 4}, unit, ishigami)
    np.random.seed(5)
    before = np.random.get_state()[1].copy()
    indices = outcome.fast("y")
    assert np.array_equal(np.random.get_state()[1], before)
    assert indices.equals(outcome.fast("y")) and not indices.equals(outcome.fast("y", seed=1))
    # The method is biased: harmonics above the fourth, and harmonics of the other parameters.
    for name, values in ISHIGAMI.items():
        assert np.allclose(indices[name], values, rtol=0, atol=0.03), name


def test_indices_name_the_design_that_they_need(tmp_path):
    outcome = write(tmp_path / "c", {"method": "random"}, {"p": np.arange(10.0)}, {"y": np.arange(10.0)})
    for call, design in [(outcome.sobol, "saltelli"), (outcome.morris, "morris"), (outcome.fast, "fast")]:
        with pytest.raises(
            ConfigurationError, match=f"need a campaign with the design '{design}'.* 'random'"
        ):
            call("y")
    with pytest.raises(ConfigurationError, match="no measure 'z'; its measures are y"):
        outcome.influence("z")


def test_indices_of_a_design_with_lost_runs_say_how_many_and_why(tmp_path):
    unit = sobol.sample(problem(3), 16, calc_second_order=False, seed=1)
    status = ["ok"] * len(unit)
    status[3], status[5], status[60] = "crashed", "time limit", "crashed"
    values = ishigami(unit)
    values[[3, 5, 60]], values[7] = np.nan, np.inf
    columns = dict(zip(problem(3)["names"], unit.T))
    design = {"method": "saltelli", "second-order": False}
    outcome = write(tmp_path / "c", design, columns, {"y": values}, unit=unit, status=status, runs=90)
    expected = "14 of 90 have no value: 2 crashed, 1 time limit, 1 without a finite 'y', 10 not run yet"
    with pytest.raises(ConfigurationError, match=expected):
        outcome.sobol("y")
    constant = write(tmp_path / "d", design, columns, {"y": np.ones(len(unit))}, unit=unit)
    with pytest.raises(ConfigurationError, match="all runs have the same value 1"):
        constant.sobol("y")


def test_a_stated_value_of_unfinished_runs_completes_a_design(tmp_path):
    unit = sobol.sample(problem(3), 64, calc_second_order=False, seed=1)
    values = ishigami(unit)
    values[[3, 70]] = 5.0
    columns, design = dict(zip(problem(3)["names"], unit.T)), {"method": "saltelli", "second-order": False}
    status = ["crashed" if run in (3, 70) else "ok" for run in range(len(unit))]
    stated = {"measures": {"y": {"expression": "last(plant.x_p)", "unfinished": 5.0}}}
    outcome = write(tmp_path / "c", design, columns, {"y": values}, unit=unit, status=status, changes=stated)
    finished = write(tmp_path / "d", design, columns, {"y": values}, unit=unit)
    assert outcome.sobol("y").equals(finished.sobol("y"))


@pytest.mark.parametrize(("failures", "runs"), [(0, 300), (3, 40), (40, 40), (17, 1000)])
@pytest.mark.parametrize("confidence", [0.9, 0.95])
def test_failure_probability_has_clopper_pearson_bounds(tmp_path, failures, runs, confidence):
    values = np.where(np.arange(runs) < failures, 2.0, 0.5)
    estimate = random_campaign(tmp_path / "c", values, {"below": 1.0}).failure_probability("y", confidence)
    a = 1 - confidence
    low = stats.beta.ppf(a / 2, failures, runs - failures + 1) if failures else 0.0
    high = stats.beta.ppf(1 - a / 2, failures + 1, runs - failures) if failures < runs else 1.0
    assert (estimate.failures, estimate.runs, estimate.probability) == (failures, runs, failures / runs)
    assert np.allclose([estimate.lower, estimate.upper], [low, high], rtol=1e-9, atol=1e-12) and estimate.note == ""


def test_without_failure_the_upper_bound_follows_the_rule_of_three(tmp_path):
    """One-sided 95 % is two-sided 90 %: 1 - 0.05^(1/n), about 3/n."""
    estimate = random_campaign(tmp_path / "c", np.zeros(1000), {"below": 1.0}).failure_probability("y", 0.9)
    assert estimate.lower == 0 and np.isclose(estimate.upper, 1 - 0.05 ** (1 / 1000), rtol=1e-9)
    assert np.isclose(estimate.upper, 3 / 1000, rtol=5e-3)


def test_what_counts_as_a_failure(tmp_path):
    values = [0.5, 1.0, np.nan, np.nan, -np.inf, np.inf]
    status = ["ok", "ok", "ok", "failed", "ok", "ok"]
    below = random_campaign(tmp_path / "b", values, {"below": 1.0}, status=status)
    assert below.failed("y").tolist() == [False, True, True, True, False, True]
    above = random_campaign(tmp_path / "a", values, {"above": 0.5}, status=status)
    assert above.failed().tolist() == [True, False, True, True, True, False]
    assert below.failure_probability().name == "any limit"
    assert below.failure_probability(unfinished="exclude").runs == 5
    assert below.failure_probability(unfinished="exclude").failures == 3
    with pytest.raises(ConfigurationError, match="no limit on 'z'; its limits are on y"):
        below.failure_probability("z")
    assert below.failure_probability(fault="") == below.failure_probability()
    with pytest.raises(ConfigurationError, match="has no faults, found the fault 'stuck 1'"):
        below.failure_probability(fault="stuck 1")


def test_a_run_fails_if_any_limit_fails(tmp_path):
    limits = {"y": {"below": 1.0}, "z": {"above": 0.0}}
    measures = {"y": np.array([0.0, 2.0, 0.0, 2.0]), "z": np.array([1.0, 1.0, -1.0, -1.0])}
    outcome = write(tmp_path / "c", {"method": "random"}, {"p": np.arange(4.0)}, measures, limits=limits)
    assert outcome.failure_probability().failures == 3
    assert outcome.failure_probability("z").failures == 2


def test_designs_that_are_not_independent_samples_are_refused_or_noted(tmp_path):
    for method in ("latin-hypercube", "sobol", "halton"):
        outcome = random_campaign(tmp_path / method, np.zeros(8), {"below": 1.0}, design={"method": method})
        assert "more even than independent" in outcome.failure_probability().note
    for method in ("grid", "table", "saltelli", "morris", "fast"):
        outcome = random_campaign(tmp_path / method, np.zeros(8), {"below": 1.0}, design={"method": method})
        with pytest.raises(ConfigurationError, match=f"needs a design of random samples.* found '{method}'"):
            outcome.failure_probability()
    outcome = random_campaign(tmp_path / "part", np.zeros(8), {"below": 1.0}, runs=20)
    assert "number of runs depends on the results" in outcome.failure_probability().note
    outcome = random_campaign(tmp_path / "now", np.zeros(8), {"below": 1.0}, runs=20, complete=False)
    assert "8 of 20 runs have ended" in outcome.failure_probability().note


def test_influence_has_the_rank_correlation_and_the_failures_of_the_tenths(tmp_path):
    generator = np.random.default_rng(4)
    columns = {
        "weak": generator.random(2000),
        "strong": generator.random(2000),
        "kind": np.array(["b", "a"] * 1000, dtype=object),
        "constant": np.ones(2000),
    }
    values = -(columns["strong"] ** 3) + 0.05 * columns["weak"]
    values[10] = np.nan
    status = np.array(["ok"] * 2000, dtype=object)
    status[10] = "crashed"
    outcome = write(
        tmp_path / "c",
        {"method": "random"},
        columns,
        {"y": values},
        limits={"y": {"above": -0.5}},
        status=status,
    )
    influence = outcome.influence("y")
    assert list(influence.index) == ["strong", "weak", "constant", "kind", "kind"]
    good = np.arange(2000) != 10
    for name in ("weak", "strong"):
        ranks = [stats.rankdata(column[good]) for column in (columns[name], values)]
        assert np.isclose(influence.loc[name, "correlation"], np.corrcoef(ranks)[0, 1], rtol=1e-9)
    failed = ~(values > -0.5)
    assert influence.loc["strong", "lowest_tenth"] == failed[np.argsort(columns["strong"])[:200]].mean()
    assert influence.loc["strong", "highest_tenth"] == 1.0
    assert influence.loc["strong", "p_value"] < 1e-100 and np.isnan(influence.loc["constant", "correlation"])
    kinds = influence.loc["kind"].set_index("value")
    assert (
        list(kinds["failed"]) == [failed[1::2].mean(), failed[::2].mean()]
        and list(kinds["runs"]) == [1000] * 2
    )
    assert np.isclose(kinds.loc["a", "median"], np.median(values[1::2]))


def test_the_heat_map_has_the_worst_value_of_each_fault(tmp_path):
    table = fault_campaign(tmp_path / "c", {"below": 4.5}).heat_map("y")
    assert list(table.index) == [("gain", "a.y"), ("stuck", "a.y"), ("stuck", "b.y")]
    assert table.columns.names == ["size", "from"] and table.shape == (3, 3)
    cells = {
        (*row, None if np.isnan(size) else size, start): value
        for row, values in zip(table.index, table.to_numpy())
        for (size, start), value in zip(table.columns, values)
        if not np.isnan(value)
    }
    expected = {
        ("gain", "a.y", 2.0, 1.0): 3.0,
        ("gain", "a.y", 3.0, 5.0): 5.0,
        ("stuck", "a.y", None, 1.0): 4.0,
    }
    assert cells == {**expected, ("stuck", "b.y", None, 1.0): np.inf}
    low = fault_campaign(tmp_path / "d", {"above": 4.5}).heat_map("y")
    assert sorted(low.to_numpy()[~np.isnan(low.to_numpy())]) == [-np.inf, 1.0, 2.0, 5.0]


def test_probability_and_influence_of_a_fault_campaign_are_by_fault(tmp_path):
    outcome = fault_campaign(tmp_path / "c", {"below": 4.5})
    assert outcome.failure_probability("y", fault="gain 2").runs == 2
    assert outcome.failure_probability("y", fault="stuck 1").probability == 1
    assert outcome.failure_probability("y", fault="").failures == 1
    with pytest.raises(ConfigurationError, match="needs one fault of the campaign.*found None"):
        outcome.failure_probability("y")
    influence = outcome.influence("y")
    kinds = influence.loc["fault.kind"].set_index("value")["failed"].to_dict()
    assert kinds == {"": 1.0, "gain": 1 / 3, "stuck": 1 / 3}
    with pytest.raises(ConfigurationError, match="has no faults"):
        random_campaign(tmp_path / "d", np.zeros(3), {"below": 1}).heat_map("y")


def test_the_table_has_the_runs_in_order_as_arrow_and_pandas(tmp_path):
    columns = {"p": np.arange(50.0) ** 2, "k": np.array(["x", "y"] * 25, dtype=object)}
    outcome = write(tmp_path / "c", {"method": "grid"}, columns, {"y": -np.arange(50.0)}, parts=7)
    assert (
        len(outcome) == 50
        and list(outcome.table.index) == list(range(50))
        and outcome.table.index.name == "run"
    )
    assert np.array_equal(outcome.table["p"], columns["p"]) and list(outcome.table["k"]) == list(columns["k"])
    assert outcome.to_arrow().column("y").to_pylist() == [-float(i) for i in range(50)]
    assert outcome.read(["k", "y"]).loc[49, "k"] == "y" and outcome.statuses == {"ok": 50}
    assert repr(outcome) == "<Outcome: test, 50 of 50 runs, 0 not finished>"


def test_many_parts_are_the_same_table_and_leave_no_file(tmp_path, monkeypatch):
    columns = {"p": np.arange(500.0), "k": np.array(["x", "y"] * 250, dtype=object)}
    few = write(tmp_path / "few", {"method": "grid"}, columns, {"y": -np.arange(500.0)})
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    many = write(tmp_path / "many", {"method": "grid"}, columns, {"y": -np.arange(500.0)}, parts=250)
    assert many.table.equals(few.table) and many.to_arrow().equals(few.to_arrow())
    assert len(list((tmp_path / "temporary").iterdir())) == 1
    del many
    gc.collect()
    assert not list((tmp_path / "temporary").iterdir())


def test_a_notebook_shows_the_measures_with_names_escaped(tmp_path):
    values = {"<b>y</b>": np.array([1.0, np.inf, 3.0]), "none": np.full(3, np.nan)}
    limits = {"<b>y</b>": {"below": 2.5}}
    page = write(
        tmp_path / "c", {"method": "grid"}, {"p": np.arange(3.0)}, values, limits=limits
    )._repr_html_()
    assert "<b>" not in page and "&lt;b&gt;y" in page and "below 2.5" in page and ">2</td>" in page


@pytest.mark.skipif(os.name == "nt", reason="the command line is for a POSIX shell")
def test_the_command_repeats_a_run_from_a_folder_with_blanks(tmp_path):
    outcome = write(tmp_path / "a b'$c", {"method": "grid"}, {"p": np.arange(3.0)}, {"y": np.arange(3.0)})
    command = outcome.command(2)
    assert command.endswith("> run-2.toml && aso-ftc run run-2.toml")
    # A command aso-ftc that prints its arguments.
    fake = tmp_path / "bin" / "aso-ftc"
    fake.parent.mkdir()
    fake.write_text("#!/bin/sh\nprintf '%s\\n' \"$@\"\n", encoding="utf-8")
    fake.chmod(0o755)
    path = {"PATH": f"{fake.parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, check=True, cwd=tmp_path, env=path
    )
    assert done.stdout.splitlines() == ["run", "run-2.toml"]
    written = (tmp_path / "run-2.toml").read_text(encoding="utf-8")
    assert written.splitlines() == ["campaign", str(outcome.folder), "--show", "2"]
    assert command == "2".join(outcome.command_parts)
    with pytest.raises(ConfigurationError, match="run 3 is not in this campaign; expected 0 to 2"):
        outcome.command(3)


def test_folders_that_are_no_campaigns_are_one_sentence(tmp_path):
    with pytest.raises(ResultsError, match=r"expected the folder of a campaign with manifest\.json"):
        load(tmp_path)
    (tmp_path / "manifest.json").write_text("{", encoding="utf-8")
    with pytest.raises(ResultsError, match="not JSON"):
        load(tmp_path)
    (tmp_path / "manifest.json").write_text('{"name": "c", "runs": 3}', encoding="utf-8")
    with pytest.raises(ResultsError, match="no run of this campaign has ended yet"):
        load(tmp_path)
    outcome = write(tmp_path / "c", {"method": "grid"}, {"p": np.arange(3.0)}, {"y": np.arange(3.0)})
    part = outcome.folder / "runs" / "part-000001.parquet"
    part.with_name("part-000009.parquet").write_bytes(part.read_bytes())
    with pytest.raises(ResultsError, match="is in two files"):
        load(outcome.folder)


def test_a_missing_package_names_the_extra(tmp_path):
    write(
        tmp_path / "c",
        {"method": "random"},
        {"p": np.arange(9.0)},
        {"y": np.arange(9.0)},
        limits={"y": {"below": 1}},
    )
    text = (
        "import sys; sys.modules['scipy.stats'] = None; sys.modules['SALib'] = None\n"
        "from aso_ftc import MissingPackageError; from aso_ftc.campaign import load\n"
        f"outcome = load({str(tmp_path / 'c')!r})\n"
        "try:\n    outcome.failure_probability()\nexcept MissingPackageError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-I", "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == (
        'campaigns need the package scipy: install it, in a clone of this project by `python -m pip install "./python[campaign]"`'
    )
