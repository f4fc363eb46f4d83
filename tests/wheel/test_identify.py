"""Plants from logs, beside the command and the plant that the log is of."""

import tomllib
from pathlib import Path

import aso_ftc as af
import numpy as np
import pandas as pd
import pytest

LOG = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "log" / "trolley.csv"


@pytest.fixture(scope="module")
def frame():
    """The log of the book, its units in `attrs`."""
    frame = pd.read_csv(LOG)
    units = {name.partition(" [")[0]: name.partition(" [")[2].rstrip("]") for name in frame.columns}
    frame.columns = list(units)
    frame.attrs["units"] = units
    return frame


def test_a_frame_gives_the_plant_file_of_the_command(command, frame, tmp_path):
    file = tmp_path / "plant.toml"
    command("design", "--init", LOG, "--inputs", "force", "--out", file)
    plant = af.identify(frame, inputs=["force"])
    assert dict(plant) == tomllib.loads(file.read_text(encoding="utf-8"))
    assert plant["measurements"][0]["unit"] == "m" and "simulated 99.9 %" in plant.text
    assert af.identify(LOG, inputs=["force"]) == plant


def test_the_plant_is_that_of_the_trolley_and_is_designed(frame):
    plant = af.identify(frame, inputs=["force"], order=2)
    np.testing.assert_allclose(plant["A"], [[0, 1], [0, -0.5]], atol=0.01)
    np.testing.assert_allclose(plant["B"], [[0], [0.5]], atol=0.01)
    assert plant.refusal is None and repr(plant).startswith("<Plant: 2 states, 1 commands, 1 measurements")
    assert af.design(plant).verdict == "green"


def test_several_logs_are_one_estimate_and_results_are_a_log(frame, paper):
    half = len(frame) // 2
    plant = af.identify(frame[:half], {name: frame[name][half:] for name in frame}, inputs=["force"])
    np.testing.assert_allclose(plant["A"][1][1], -0.5, atol=0.02)
    paper.experiment["stop-time"] = 2.0
    results = paper.run()
    pendulum = af.identify(results, inputs=["controller.u"], outputs=["plant.x_p", "plant.theta"])
    assert np.shape(pendulum["C"])[0] == 2
    with pytest.raises(af.DesignError, match="log 1: `inputs`: there is no column F_c; expected one of plant.u, "):
        af.identify(results, inputs=["F_c"])


def test_the_index_of_an_element_is_no_unit(frame):
    columns = {"time": frame["time"], "force[1]": frame["force"], "position[1]": frame["position"]}
    plant = af.identify(columns, inputs=["force[1]"], outputs=["position[1]"], order=2)
    (command,), (measurement,) = plant["actuators"], plant["measurements"]
    assert (command["name"], measurement["name"]) == ("force[1]", "position[1]") and "unit" not in {**command, **measurement}
    np.testing.assert_allclose(plant["A"], [[0, 1], [0, -0.5]], atol=0.01)


@pytest.mark.parametrize(
    "log, sentence",
    [
        ({"u": [1.0], "y": [2.0]}, 'log 1: expected a column "time", found u, y'),
        ([[1.0, 2.0]], "log 1: expected a table with the column time"),
        ({"time": [0.0, 0.1], "u": [0.0, 1.0], "y": [0.0, 1.0]}, "log 1: "),
    ],
)
def test_a_wrong_log_is_named_and_no_file_that_nobody_wrote(log, sentence):
    with pytest.raises(af.DesignError) as raised:
        af.identify(log)
    assert str(raised.value).startswith(sentence) and "tmp" not in str(raised.value), raised.value


def test_one_name_is_no_sequence_of_names(frame):
    with pytest.raises(TypeError, match="inputs: expected a sequence of names, found the name 'force'"):
        af.identify(frame, inputs="force")
