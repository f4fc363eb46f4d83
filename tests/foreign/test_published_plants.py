"""The published plants of examples/plants: the report's figures computed again with numpy, and the placement beside scipy's."""

import warnings

import pytest

import published_plants
from conftest import ROOT

PLANTS = sorted((ROOT / "examples" / "plants").glob("*.toml"))


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("file", PLANTS, ids=lambda file: file.stem)
def test_figures_of_a_report_are_those_of_its_gains_and_at_most_a_tenth_above_scipys(file, sampled):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # place_poles warns of slow convergence
        report, figures, scipy = published_plants.compared(file, sampled)
    peaks = [point["s_peak"] for point in report["robustness"]["points"]]
    assert peaks == pytest.approx([figures.input, figures.output], rel=1e-3)
    assert report["feedback"]["condition"] == pytest.approx(figures.feedback, rel=1e-3)
    assert report["observer"]["condition"] == pytest.approx(figures.observer, rel=1e-3)
    for name, value in vars(figures).items():
        assert value <= 1.1 * getattr(scipy, name), name


def test_every_published_plant_has_a_sample_time():
    assert {file.stem for file in PLANTS} == set(published_plants.SAMPLE_TIMES)
