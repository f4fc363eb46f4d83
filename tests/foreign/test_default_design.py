"""Designs without requirements, and new plant files: `aso-ftc design --init`. The peaks of S are computed again in numpy."""

import json
import tomllib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_array

from design_oracle import COLUMN, WITHOUT_PROOFS, design_and_report, says_nothing

# Published plants: the source, A, B, C, and the number of actuators whose faults the measurements can tell apart.
PLANTS = {
    "double integrator": ([[0, 1], [0, 0]], [[0], [1]], [[1, 0]]),
    # B. Wie, D. S. Bernstein, Benchmark problems for robust control design (1992), problem 1.
    "two masses": ([[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, 0, 0], [1, -1, 0, 0]], [[0], [0], [1], [0]], [[0, 1, 0, 0]]),
    "unstable": ([[0, 1], [900, 0]], [[0], [100]], [[1, 0]]),
    "zero in the right half plane": ([[-1, 0], [1, -2]], [[1], [0]], [[1, -3]]),
    "resonance": ([[0, 1], [-100, -0.1]], [[0], [1]], [[1, 0]]),
    # K. H. Johansson, IEEE Trans. Control Syst. Technol. 8 (2000), minimum phase.
    "quadruple tank": (
        [[-1 / 62, 0, 1 / 23, 0], [0, -1 / 90, 0, 1 / 30], [0, 0, -1 / 23, 0], [0, 0, 0, -1 / 30]],
        [[0.08325, 0], [0, 0.0628125], [0, 0.047857], [0.03121875, 0]],
        [[0.5, 0, 0, 0], [0, 0.5, 0, 0]],
    ),
    # K. S. Narendra, S. S. Tripathi, J. Aircraft 10 (1973): a helicopter, with a slow zero.
    "helicopter": (
        [[-0.0366, 0.0271, 0.0188, -0.4555], [0.0482, -1.01, 0.0024, -4.0208], [0.1002, 0.3681, -0.707, 1.42], [0, 0, 1, 0]],
        [[0.4422, 0.1761], [3.5446, -7.5922], [-5.52, 4.49], [0, 0]],
        [[0, 1, 0, 0], [0, 0, 0, 1]],
    ),
}


def peaks(plant, gains):
    """The peaks of S at the commands and at the measurements, with the observer's own equations."""
    a, b, c = (np.array(matrix, float) for matrix in plant)
    (n, m), p = b.shape, c.shape[0]
    k = np.hstack([gains["K_x"], gains["K_f"]])
    gain = np.vstack([gains["L_x"], gains["L_f"]])
    a_0 = np.block([[a, b], [np.zeros((m, n + m))]])
    observer = a_0 + np.vstack([b, np.zeros((m, m))]) @ k - gain @ np.hstack([c, np.zeros((p, m))])
    speeds = np.abs(np.concatenate([np.linalg.eigvals(a), np.linalg.eigvals(observer)]))
    s = 1j * np.geomspace(1e-3 * speeds[speeds > 1e-9].min(), 1e2 * speeds.max(), 3000)[:, None, None]
    response = c @ np.linalg.solve(s * np.eye(n) - a, b)
    controller = k @ np.linalg.solve(s * np.eye(n + m) - observer, gain)
    sensitivities = (np.linalg.inv(np.eye(one.shape[-1]) - one) for one in (controller @ response, response @ controller))
    return np.array([np.linalg.norm(matrices, 2, axis=(1, 2)).max() for matrices in sensitivities])


# The measurements with different units, so that the peak of S is judged in the units that make it least.
MIXED = 'measurements = [{ name = "w", unit = "ft/s" }, { name = "theta", unit = "rad" }]\n'


def written(plant):
    a, b, c = plant
    return f"A = {a}\nB = {b}\nC = {c}\n{MIXED if plant is PLANTS['helicopter'] else ''}"


@pytest.fixture
def designed(aso_ftc, tmp_path):
    """The report of a plant file."""

    def run(text, name="plant"):
        path = tmp_path / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        done = aso_ftc("design", path, "--out", tmp_path / f"{name}-design.toml", "--json", "--force", *WITHOUT_PROOFS)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.mark.parametrize("name", PLANTS)
def test_a_published_plant_without_requirements_has_a_green_design(designed, name):
    report = designed(written(PLANTS[name]) + 'actuator_faults = "all"\nrobustness.tolerance = 0.02\n')
    gains = {gain["name"]: np.array(gain["values"]) for gain in report["gains"]}
    peak = peaks(PLANTS[name], gains)
    stated = [point["s_peak"] for point in report["robustness"]["points"]]
    np.testing.assert_allclose(peak, stated, rtol=0.01)
    judged = [point["judged"] for point in report["robustness"]["points"]]
    assert max(judged) <= 2.0 and report["verdict"]["level"] == "green"
    assert peak.max() <= 2.0 or name == "helicopter"
    assert all("bandwidth" in report[part]["method"] for part in ("feedback", "observer"))


def test_the_chosen_bandwidths_are_lines_of_a_plant_file_that_gives_the_same_gains(designed):
    plant = written(PLANTS["quadruple tank"]) + 'actuator_faults = "all"\n'
    open_ = designed(plant)
    rates = [open_[part]["method"].split("bandwidth of ")[1].split()[0] for part in ("feedback", "observer")]
    stated = designed(f"{plant}feedback.bandwidth = {rates[0]}\nobserver.bandwidth = {rates[1]}\n")
    assert stated["gains"] == open_["gains"]
    assert "chosen" in open_["feedback"]["method"] and "chosen" not in stated["feedback"]["method"]


def test_a_requirement_that_is_stated_stays(designed):
    plant = written(PLANTS["double integrator"]) + 'actuator_faults = "all"\nfeedback.eigenvalues = [-3, -4]\n'
    report = designed(plant)
    assert sorted(value[0] for value in report["feedback"]["eigenvalues"]) == pytest.approx([-4, -3])
    assert "bandwidth" in report["observer"]["method"]


def test_units_of_states_and_measurements_do_not_change_the_loop(designed):
    a, b, c = (np.array(matrix, float) for matrix in PLANTS["two masses"])
    state, output = np.diag([1e3, 0.01, 50, 1]), np.diag([1e4])
    scaled = [(state @ a @ np.linalg.inv(state)).tolist(), (state @ b).tolist(), (output @ c @ np.linalg.inv(state)).tolist()]
    one, other = (designed(written(plant) + 'actuator_faults = "all"\n') for plant in (PLANTS["two masses"], scaled))
    for part in ("feedback", "observer"):
        poles, expected = (np.sort_complex([complex(*value) for value in report[part]["eigenvalues"]]) for report in (one, other))
        np.testing.assert_allclose(poles, expected, rtol=1e-6)


def test_a_sampled_eigenvalue_of_zero_leaves_the_observer_the_same_in_other_units_of_time(designed):
    rates = []
    for period in (1.0, 0.01):
        head = f"sample_time = {period}\nfeedback.sampled_eigenvalues = [0, 0.5]\n"
        report = designed(f'{head}{written(PLANTS["double integrator"])}actuator_faults = "all"\n')
        rates.append(period * float(report["observer"]["method"].split("bandwidth of ")[1].split()[0]))
    assert rates[1] == pytest.approx(rates[0], rel=0.05)


@pytest.mark.parametrize("head", ["", "sample_time = 0.1\n"])
def test_integrators_in_other_coordinates_get_the_loop_of_the_integrators(designed, head):
    """Rounding gives the zero eigenvalues of the second A some 1e-7 1/s, which are no speed of the plant. The tolerances, whose
    entries differ, are too small to decide."""
    a, b, c = (np.array(matrix, float) for matrix in PLANTS["double integrator"])
    turned = np.array([[3.0, -1.9], [5.5, -4.0]])
    other = [(turned @ a @ np.linalg.inv(turned)).tolist(), (turned @ b).tolist(), (c @ np.linalg.inv(turned)).tolist()]
    assert np.abs(np.linalg.eigvals(other[0])).max() > 1e-9
    tail = 'actuator_faults = "all"\nrobustness.cases = 0\nrobustness.tolerance = 1e-6\n'
    one, other = (designed(head + written(plant) + tail) for plant in (PLANTS["double integrator"], other))
    for part in ("feedback", "observer"):
        poles, expected = (np.sort_complex([complex(*value) for value in report[part]["eigenvalues"]]) for report in (one, other))
        np.testing.assert_allclose(poles, expected, rtol=1e-5)


def test_a_sampled_design_without_requirements_is_slower_than_its_samples(designed):
    report = designed(written(PLANTS["unstable"]) + 'actuator_faults = "all"\nsample_time = 0.002\n')
    assert report["verdict"]["level"] == "green"
    rate = float(report["observer"]["method"].split("bandwidth of ")[1].split()[0])
    assert rate * 0.002 < np.pi / 2


TABLE = """,position [m],speed [m/s],force [N]
der(position),0,1,0
speed,0,-0.5,0.5
y [m],1,0,0
"""


def test_a_table_with_names_becomes_a_plant_file_that_is_designed(aso_ftc, tmp_path):
    (tmp_path / "trolley.csv").write_text(TABLE, encoding="utf-8")
    done = aso_ftc("design", "--init", tmp_path / "trolley.csv", "--out", tmp_path / "trolley.toml")
    assert done.returncode == 0 and says_nothing(done), done.stderr
    file = tomllib.loads((tmp_path / "trolley.toml").read_text(encoding="utf-8"))
    assert (file["A"], file["B"], file["C"]) == ([[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0]])
    assert file["states"] == [{"name": "position", "unit": "m"}, {"name": "speed", "unit": "m/s"}]
    assert (file["actuators"], file["measurements"]) == ([{"name": "force", "unit": "N"}], [{"name": "y", "unit": "m"}])
    designed = aso_ftc("design", tmp_path / "trolley.toml", "--out", tmp_path / "design.toml")
    assert designed.returncode == 0 and "verdict: green" in designed.stdout, designed.stderr


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_variables_become_a_plant_file_with_the_same_matrices(aso_ftc, tmp_path, compressed):
    a, b, c = PLANTS["helicopter"]
    savemat(tmp_path / "plant.mat", {"A": a, "B": b, "C": c, "title": "text"}, do_compression=compressed)
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 0 and says_nothing(done), done.stderr
    file = tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8"))
    for name, matrix in (("A", a), ("B", b), ("C", c)):
        np.testing.assert_array_equal(file[name], matrix)
    assert file["actuator_faults"] == "all" and file["observer"]["bandwidth"] > file["feedback"]["bandwidth"] > 0


def test_arrays_of_one_dimension_and_decimal_commas_are_the_same_plant(aso_ftc, tmp_path):
    savemat(tmp_path / "array.mat", {"A": [[0.0, 1.0], [0.0, -0.5]], "B": [0.0, 0.5], "C": [1.0, 0.0]})
    savemat(tmp_path / "column.mat", {"A": [[0.0, 1.0], [0.0, -0.5]], "B": [0.0, 0.5], "C": [1.0, 0.0]}, oned_as="column")
    (tmp_path / "comma.csv").write_text(";x;v;F\nx;0;1;0\nv;0;-0,5;0,5\ny;1;0;0\n", encoding="utf-8")
    for name in ("array.mat", "column.mat", "comma.csv"):
        done = aso_ftc("design", "--init", tmp_path / name, "--out", tmp_path / "plant.toml", "--force")
        assert done.returncode == 0, done.stderr
        file = tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8"))
        assert [file[name] for name in "ABC"] == [[[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0]]]
    savemat(tmp_path / "struct.mat", {"plant": {"A": [[1.0]], "B": [[1.0]], "C": [[1.0]]}})
    done = aso_ftc("design", "--init", tmp_path / "struct.mat", "--out", tmp_path / "other.toml")
    assert done.returncode == 2 and "found none; those in a struct are not read" in done.stderr
    savemat(tmp_path / "sparse.mat", {"A": csc_array([[0.0, 1.0], [0.0, -0.5]]), "B": [0.0, 0.5], "C": [1.0, 0.0]})
    done = aso_ftc("design", "--init", tmp_path / "sparse.mat", "--out", tmp_path / "other.toml")
    assert done.returncode == 2 and "found B, C; sparse matrices are not read" in done.stderr, done.stderr


def test_matlab_variables_that_are_not_read_are_a_warning(aso_ftc, tmp_path):
    a, b, c = PLANTS["double integrator"]
    savemat(tmp_path / "plant.mat", {"A": a, "B": b, "C": c, "E": np.diag([1.0, 2.0]), "dt": 0.1})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    message = "of the file only A, B, C, D, Ts are read, not E, dt"
    assert done.returncode == 0 and f"warning: {message}" in done.stderr, done.stderr
    assert f"# Warning: {message}" in (tmp_path / "plant.toml").read_text(encoding="utf-8")


def test_measurements_that_cannot_tell_all_faults_apart_get_fewer(aso_ftc, tmp_path):
    a, b, c = PLANTS["helicopter"]
    savemat(tmp_path / "plant.mat", {"A": a, "B": b, "C": c[:1]})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 0, done.stderr
    file = tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8"))
    assert file["actuator_faults"] == ["u1"]


@pytest.mark.parametrize("stated, expected", [(0.0, None), ([0.0, 0.5], [[0.0], [0.5]])])
def test_matlab_variables_state_zeros_of_any_size_or_an_array_of_one_dimension_as_d(aso_ftc, tmp_path, stated, expected):
    savemat(tmp_path / "plant.mat", {"A": [[-0.5]], "B": [[0.5]], "C": [[1.0], [-0.5]], "D": stated})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 0, done.stderr
    assert tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8")).get("D") == expected


def test_a_plant_with_feedthrough_gets_a_filter(aso_ftc, tmp_path):
    savemat(tmp_path / "plant.mat", {"A": [[-0.5]], "B": [[0.5]], "C": [[1.0], [-0.5]], "D": [[0.0], [0.5]]})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 0 and says_nothing(done), done.stderr
    assert tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8"))["filter"] > 0


def test_an_fmu_becomes_a_plant_file_with_its_inputs_and_outputs(aso_ftc, tmp_path, examples):
    done = aso_ftc("design", "--init", examples["ThreeTank"], "--out", tmp_path / "tank.toml")
    assert done.returncode == 0 and says_nothing(done), done.stderr
    file = tomllib.loads((tmp_path / "tank.toml").read_text(encoding="utf-8"))
    assert [signal["name"] for signal in file["actuators"]] == ["Q_1", "Q_2"]
    designed = aso_ftc("design", tmp_path / "tank.toml", "--out", tmp_path / "design.toml")
    assert designed.returncode == 0 and "verdict: green" in designed.stdout, designed.stderr


def test_an_fmu_that_its_friction_holds_gets_a_plant_file_with_the_reason(aso_ftc, tmp_path, examples):
    done = aso_ftc("design", "--init", examples["DcServo"], "--out", tmp_path / "servo.toml")
    assert done.returncode == 0 and "no controller was found for this plant yet" in done.stderr
    text = (tmp_path / "servo.toml").read_text(encoding="utf-8")
    assert "#   " in text and "no feedback moves the eigenvalue" in text
    # The remedy that the file names.
    mended = text.replace("operating_point.u = 0\n", "operating_point.u = 0\noperating_point.friction = 0\n")
    assert mended != text
    (tmp_path / "servo.toml").write_text(mended, encoding="utf-8")
    designed = aso_ftc("design", tmp_path / "servo.toml", "--out", tmp_path / "design.toml")
    assert designed.returncode == 0 and "verdict: green" in designed.stdout, designed.stderr


def test_a_file_that_exists_is_not_overwritten(aso_ftc, tmp_path):
    (tmp_path / "trolley.csv").write_text(TABLE, encoding="utf-8")
    (tmp_path / "trolley.toml").write_text("mine", encoding="utf-8")
    done = aso_ftc("design", "--init", tmp_path / "trolley.csv", "--out", tmp_path / "trolley.toml")
    assert done.returncode == 2 and "--force overwrites it" in done.stderr
    assert (tmp_path / "trolley.toml").read_text(encoding="utf-8") == "mine"


REFUSED = {
    "recording.csv": (b"time,x,u\n0,1,2\n1,2,3\n", "expected --inputs and --outputs, names of its columns x, u"),
    "short.csv": (b",x,u\nx,0\n", "line 2: expected 3 cells, found 2"),
    "word.csv": (b",x,u\nx,0,fast\ny,1,0\n", 'line 2, u: expected a number, found "fast"'),
    "no-output.csv": (b",x,u\nx,0,1\n", "found 1 states, 1 commands and 0 measurements"),
    "empty.csv": (b"", "expected a table of the matrices"),
    "damaged.mat": (b"MATLAB 5.0 MAT-file" + bytes(300), "expected"),
    "empty.mat": (b"", "expected a MAT file of version 5 or 7"),
    "damaged.fmu": (b"PK\x03\x04", "damaged.fmu"),
    "plant.toml": (b"A = 1", "expected an FMU (.fmu), a file of MATLAB (.mat), or a table (.csv)"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_source_that_is_no_plant_is_named_with_what_was_expected(aso_ftc, tmp_path, name):
    content, message = REFUSED[name]
    (tmp_path / name).write_bytes(content)
    done = aso_ftc("design", "--init", tmp_path / name, "--out", tmp_path / "new.toml")
    assert done.returncode == 2 and message in done.stderr and name in done.stderr, done.stderr
    assert "panicked" not in done.stderr and not (tmp_path / "new.toml").exists()


def test_every_cut_of_a_mat_file_is_refused_or_read(aso_ftc, tmp_path):
    a, b, c = PLANTS["double integrator"]
    savemat(tmp_path / "whole.mat", {"A": a, "B": b, "C": c}, do_compression=True)
    whole = (tmp_path / "whole.mat").read_bytes()
    for cut in range(1, len(whole), 37):
        (tmp_path / "cut.mat").write_bytes(whole[:cut])
        done = aso_ftc("design", "--init", tmp_path / "cut.mat", "--out", tmp_path / "new.toml", "--force")
        assert done.returncode == 2 and "panicked" not in done.stderr, (cut, done.stderr)


@pytest.mark.parametrize(
    "variables, message",
    [
        ({"A": [[1.0]], "B": [[1.0]]}, "expected the variables A, B and C, found A, B"),
        ({"A": [[1.0, 2.0]], "B": [[1.0]], "C": [[1.0]]}, "A: expected 1 x 1, found 1 x 2"),
        ({"A": [[1j]], "B": [[1.0]], "C": [[1.0]]}, "A: expected finite real numbers"),
    ],
)
def test_matlab_variables_that_are_no_plant_are_refused(aso_ftc, tmp_path, variables, message):
    savemat(tmp_path / "plant.mat", variables)
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 2 and message in done.stderr, done.stderr


# J. Roskam's Boeing 747 at Mach 0.8: a combination of aileron and rudder hardly moves yaw rate and roll angle at rest.
AIRLINER = """A = [[-0.0558, -0.9968, 0.0802, 0.0415], [0.598, -0.115, -0.0318, 0], [-3.05, 0.388, -0.465, 0], [0, 0.0805, 1, 0]]
B = [[0.00729, 0], [-0.475, 0.00775], [0.153, 0.143], [0, 0]]
C = [[0, 1, 0, 0], [0, 0, 0, 1]]
actuators = ["rudder", "aileron"]
actuator_faults = "all"
"""


def test_an_estimate_that_is_much_slower_than_the_feedback_is_a_warning_whose_remedy_works(aso_ftc, tmp_path):
    _, report = design_and_report(aso_ftc, tmp_path, AIRLINER, ())
    slowest = -max(pole[0] for pole in report["observer"]["eigenvalues"])
    (warning,) = report["warnings"]
    time = float(warning.split("settle in ")[1].split(" s")[0])
    assert time == pytest.approx(4 / slowest, rel=1e-3) and "f_rudder, f_aileron" in warning
    # The weak direction of the gain at rest, which the estimate of it is slow for.
    a, b, c = (np.array(tomllib.loads(AIRLINER)[name], float) for name in "ABC")
    assert np.linalg.cond(c @ np.linalg.solve(a, b)) > 1e5
    _, report = design_and_report(aso_ftc, tmp_path, AIRLINER.replace('"all"', '["rudder"]'), ())
    assert [fault["name"] for fault in report["plant"]["faults"]] == ["f_rudder"] and not report["warnings"]
    assert -max(pole[0] for pole in report["observer"]["eigenvalues"]) > 100 * slowest


def test_a_plant_that_no_bandwidth_makes_robust_keeps_the_speed_of_the_plant(aso_ftc, tmp_path):
    """Estimates of both faults act as integrals, so that no loop is stable beyond the plant with a singular stationary gain."""
    _, report = design_and_report(aso_ftc, tmp_path, COLUMN)
    gain = np.array([[0.878, -0.864], [1.082, -1.096]])
    ratio = np.sqrt(gain[0, 0] * gain[1, 1] / (gain[0, 1] * gain[1, 0]))
    assert report["robustness"]["tolerance"]["first_unstable"] == pytest.approx(10 * (ratio - 1) / (ratio + 1), rel=1e-3)
    assert "a bandwidth of 0.013 rad/s" in report["feedback"]["method"]


@pytest.mark.parametrize("cells", [30, 40])
def test_a_rod_that_is_heated_at_one_end_and_measured_at_the_other_has_a_low_peak(aso_ftc, tmp_path, cells):
    """Most eigenvalues are those of neighbouring cells, up to 160 times as fast as the response at the other end."""
    a = 4.0 * cells**2 * (np.eye(cells, k=1) + np.eye(cells, k=-1) - 2 * np.eye(cells))
    plant = (a.tolist(), np.eye(cells)[:, :1].tolist(), np.eye(cells)[-1:].tolist())
    (tmp_path / "rod.toml").write_text(f"{written(plant)}actuator_faults = \"all\"\n", encoding="utf-8")
    done = aso_ftc("design", tmp_path / "rod.toml", "--out", tmp_path / "design.toml", "--json", "--certificate-time", "0")
    assert done.returncode in (0, 1), done.stderr
    assert max(point["judged"] for point in json.loads(done.stdout)["robustness"]["points"]) < 1.5


def test_measurements_without_units_do_not_change_bandwidths_of_a_plant_that_is_green_with_units(aso_ftc, tmp_path):
    a, b, c = PLANTS["quadruple tank"]
    scaled = (a, b, (np.diag([1e3, 1e-3]) @ c).tolist())
    units = 'measurements = [{ name = "h1", unit = "mm" }, { name = "h2", unit = "km" }]\n'
    texts = [f"{written(plant)}actuator_faults = \"all\"\n{more}" for plant, more in ((scaled, ""), (scaled, units), ((a, b, c), ""))]
    reports = [design_and_report(aso_ftc, tmp_path, text)[1] for text in texts]
    chosen = [[report[loop]["method"].split(";")[0] for loop in ("feedback", "observer")] for report in reports]
    assert chosen[0] == chosen[1] == chosen[2], chosen
    assert [report["verdict"]["level"] for report in reports] == ["red", "green", "green"]
    (remedy,) = reports[0]["verdict"]["remedies"]
    assert remedy["change"].startswith("state the unit of each measurement")
