"""Searches against closed forms: the largest value of a function, the probability of a half space."""

import logging
import math
import subprocess
import sys

import aso_ftc as af
import numpy as np
import pytest
from aso_ftc.campaign._search import _bounds
from distributed import Client, LocalCluster
from scipy.stats import lognorm, norm


def campaign(design, measure, **entries):
    """The paper's loop for one step; the measure is a function of two parameters that the signals do not change."""
    return af.campaign.Campaign(
        "paper",
        experiment={"stop-time": 0.001},
        design=design,
        measures={"y": f"{measure} + 0 * last(plant.x_p)"},
        **entries,
    )


PLACES = {"a": "plant.F_c", "b": "plant.x_p_0"}


def test_the_worst_case_is_the_largest_value_of_the_function(tmp_path):
    # Two hills, of which the lower one is wider: 3 at (27, 0.12), 2 at (21, 0.18).
    a, b = 'parameter("a")', '(100 * parameter("b"))'
    hills = f"3 * exp(-(({a} - 27) ** 2 + ({b} - 12) ** 2) / 4) + 2 * exp(-(({a} - 21) ** 2 + ({b} - 18) ** 2) / 9)"
    ranges = {
        "a": {"from": 20.0, "to": 30.0, "set": PLACES["a"]},
        "b": {"from": 0.1, "to": 0.2, "set": PLACES["b"]},
    }
    study = campaign({"method": "random", "runs": 600}, hills, parameters=ranges, seed=1)
    worst_case = study.worst_case(tmp_path / "search", "y", workers=2)
    assert worst_case.value == pytest.approx(3.0, abs=1e-2) and worst_case.runs <= 600 and worst_case.unfinished == 0
    assert [worst_case.values["a"], 100 * worst_case.values["b"]] == pytest.approx([27.0, 12.0], abs=0.1)
    assert list(worst_case.history) == sorted(worst_case.history) and worst_case.history[-1] == worst_case.value
    assert worst_case.arguments["start_values"]["plant.F_c"] == worst_case.values["a"]
    # All runs are in the folder: the same call does none of them again, also without workers.
    again = study.worst_case(tmp_path / "search", "y", scheduler="tcp://127.0.0.1:9")
    assert again == worst_case


def test_a_folder_in_which_another_process_searches_is_refused(tmp_path):
    parameters = {"a": {"from": 20.0, "to": 30.0, "set": PLACES["a"]}}
    study = campaign({"method": "random", "runs": 40}, 'parameter("a")', parameters=parameters)
    text = (
        "import sys, aso_ftc.campaign._folder as f, pathlib\n"
        "with f.locked(pathlib.Path(sys.argv[1])):\n    print(flush=True)\n    input()\n"
    )
    words = [sys.executable, "-I", "-c", text, str(tmp_path / "search")]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        other.stdout.readline()
        with pytest.raises(af.ConfigurationError, match="another process runs a campaign in the folder"):
            study.worst_case(tmp_path / "search", "y", workers=1)
        other.communicate("\n")
    assert not list((tmp_path / "search").glob("batch-*"))
    assert study.worst_case(tmp_path / "search", "y", workers=1).runs <= 40


def test_a_search_leaves_no_job_on_the_workers_of_a_cluster(tmp_path):
    parameters = {"a": {"from": 20.0, "to": 30.0, "set": PLACES["a"]}}
    study = campaign({"method": "random", "runs": 40}, 'parameter("a")', parameters=parameters)
    options = {"threads_per_worker": 1, "dashboard_address": ":0", "local_directory": tmp_path, "silence_logs": logging.CRITICAL}
    with LocalCluster(n_workers=1, **options) as cluster, Client(cluster) as client:
        study.worst_case(tmp_path / "search", "y", scheduler=cluster.scheduler_address)
        (names,) = client.run(lambda dask_worker: [str(name) for name in dask_worker.plugins]).values()
        assert not [name for name in names if name.startswith("aso-ftc")]


def test_the_arguments_of_the_worst_case_repeat_its_run_with_its_noise(tmp_path):
    study = af.campaign.Campaign(
        "paper",
        experiment={"stop-time": 0.01},
        design={"method": "random", "runs": 40},
        parameters={"a": {"from": 20.0, "to": 30.0, "set": PLACES["a"]}},
        disturbances={"noise": {"connection": "controller.x_p", "noise": {"deviation": 0.01}}},
        measures={"y": "max(controller.x_p)"},
        seed=1,
    )
    worst_case = study.worst_case(tmp_path / "search", "y", workers=1)
    again = study.system.run(record_every="step", **worst_case.arguments)
    assert again["controller.x_p"].max() == worst_case.value


def test_the_probability_of_a_half_space_is_that_of_the_normal_distribution(tmp_path):
    # The sum of two independent standard normal variables has the deviation sqrt(2): P(z > 3.5) = 2.33e-4.
    study = campaign(
        {"method": "random", "runs": 500},
        '(parameter("a") - 25) / 0.5 + (parameter("b") - 0.1) / 0.005',
        parameters={
            "a": {"distribution": "norm", "loc": 25.0, "scale": 0.5, "set": PLACES["a"]},
            "b": {"distribution": "norm", "loc": 0.1, "scale": 0.005, "set": PLACES["b"]},
        },
        limits={"y": {"below": 3.5 * math.sqrt(2)}},
        seed=1,
    )
    estimate = study.rare_event(tmp_path / "rare", "y", workers=2)
    exact = norm.sf(3.5)
    assert estimate.lower < exact < estimate.upper and 0.5 * exact < estimate.probability < 2 * exact
    assert 0 < estimate.variation < 0.5 and estimate.upper / estimate.lower < 10
    # Counting needs 1 / exact runs for one failure.
    assert estimate.runs < 0.6 / exact and estimate.levels[-1] == pytest.approx(0.0)
    assert list(estimate.levels) == sorted(estimate.levels)


def test_the_variation_of_a_frequent_failure_is_that_of_the_rows_of_parameters(tmp_path):
    # A row has two runs, with and without the fault, and fails with the probability P(z > 1) = 0.16: a binomial proportion.
    study = campaign(
        {"method": "random", "runs": 100},
        '(parameter("a") - 25) / 0.5',
        parameters={"a": {"distribution": "norm", "loc": 25.0, "scale": 0.5, "set": PLACES["a"]}},
        faults=[{"connection": "plant.u", "bias": {"value": 0.0}}],
        limits={"y": {"below": 1.0}},
        seed=1,
    )
    estimate = study.rare_event(tmp_path / "rare", "y", workers=1)
    chance = estimate.probability
    assert estimate.runs == 200 and 0.5 * norm.sf(1.0) < chance < 2 * norm.sf(1.0)
    assert estimate.variation == pytest.approx(math.sqrt((1 - chance) / (100 * chance)))


def test_the_bounds_of_a_rare_event_are_quantiles_of_the_log_normal_distribution():
    estimate = lognorm(s=math.sqrt(math.log(1 + 0.3**2)), scale=1e-4)
    assert estimate.std() / estimate.mean() == pytest.approx(0.3)
    assert _bounds(1e-4, 0.3) == pytest.approx(tuple(estimate.ppf([0.025, 0.975])), rel=1e-9)
    assert np.isnan(_bounds(0.0, -1.0)).all() and _bounds(0.9, 1.0)[1] == 1.0


def test_a_search_that_cannot_be_done_says_what_it_needs(tmp_path):
    parameters = {"a": {"from": 20.0, "to": 30.0, "set": PLACES["a"]}}
    few = campaign({"method": "random", "runs": 10}, 'parameter("a")', parameters=parameters)
    with pytest.raises(af.ConfigurationError, match="needs at least 40"):
        few.worst_case(tmp_path / "few", "y")
    with pytest.raises(af.ConfigurationError, match="expected one of y"):
        few.worst_case(tmp_path / "few", "x")
    with pytest.raises(af.ConfigurationError, match="'y' has no limit"):
        few.rare_event(tmp_path / "few", "y")
    grid = campaign({"method": "grid"}, "1", parameters={"a": {"values": [20.0, 25.0], "set": PLACES["a"]}})
    with pytest.raises(af.ConfigurationError, match='method = "random"'):
        grid.worst_case(tmp_path / "grid", "y")
    enough = campaign({"method": "random", "runs": 40}, 'parameter("a")', parameters=parameters)
    with pytest.raises(af.ConfigurationError, match="workers: 0: expected a whole number of at least 1"):
        enough.worst_case(tmp_path / "few", "y", workers=0)
    assert not (tmp_path / "few").exists() and np.isfinite(len(grid))
    limited = campaign({"method": "random", "runs": 10}, 'parameter("a")', parameters=parameters, limits={"y": {"below": 29.0}})
    (tmp_path / "rare" / "batch-00000" / "notes").mkdir(parents=True)
    with pytest.raises(af.ConfigurationError, match="is not empty and has no campaign"):
        limited.rare_event(tmp_path / "rare", "y")
