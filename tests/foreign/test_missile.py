"""The missile of examples/plants/schedule: its points, its certificate, and the nonlinear missile flown by the FMU and by scipy."""

import json
import tomllib

import numpy as np
import pytest
from fmpy import extract
from scipy.integrate import solve_ivp

import missile
from c_abi import Fmu
from continuous_schedule import Exchanged, Schedule, check_certificate

PLANT = "examples/plants/schedule/missile.toml"


@pytest.fixture(scope="module")
def airframe(aso_ftc, root, packed, tmp_path_factory):
    """Schedule, report and FMU of the missile."""
    folder = tmp_path_factory.mktemp("missile")
    out = folder / "design.toml"
    done = aso_ftc("design", root / PLANT, "--out", out, "--fmu", folder / "Missile.fmu", "--json")
    assert done.returncode in (0, 1), done.stderr
    fmu = Fmu(extract(str(folder / "Missile.fmu"), str(folder / "unpacked")))
    return Schedule(out.read_text(encoding="utf-8")), json.loads(done.stdout), fmu


def test_the_points_of_the_missile_are_the_linearisations_of_its_equations(root):
    plant = tomllib.loads((root / PLANT).read_text(encoding="utf-8"))
    assert tuple(point["at"] for point in plant["schedule"]["points"]) == missile.MACH
    operating = lambda name: [signal.get("operating", 0) for signal in plant[name]]
    for point in plant["schedule"]["points"]:
        a, b, c, x, u, y = missile.linearised(point["at"])
        for name, matrix in (("A", a), ("B", b), ("C", c)):
            stated = np.array(point.get(name, plant[name]), float)
            assert stated == pytest.approx(matrix, rel=1e-8, abs=1e-6)
        for name, signals, values in (("x_op", "states", x), ("u_op", "actuators", [u]), ("y_op", "measurements", y)):
            assert point.get(name, operating(signals)) == pytest.approx(list(values), rel=1e-8, abs=1e-12)
        assert missile.derivatives(x, u, point["at"]) == pytest.approx(np.zeros(4), abs=1e-10)
    # The standard atmosphere at 20,000 ft: 465.6 hPa, and a speed of sound of 614.3 kn.
    assert missile.PRESSURE == pytest.approx(46560, abs=10)
    assert missile.SOUND == pytest.approx(614.3 * 1852 / 3600, rel=1e-4)


def test_the_missile_flown_by_the_fmu_is_the_missile_flown_by_the_interpolated_equations(airframe):
    """The nonlinear missile slows down from Mach 3.9 to 2.4 while the acceleration follows steps."""
    schedule, _, fmu = airframe
    mach = lambda t: 3.9 - 0.5 * t
    rest = lambda t: np.interp(mach(t), schedule.at, [point["r_op"][0] for point in schedule.points])
    reference = lambda t: rest(t) + (0 if t < 0.5 else 60 if t < 1.6 else -40)
    x_0, u_0 = missile.rest(mach(0))
    y_0 = missile.outputs(x_0, mach(0))
    z_0 = np.concatenate([x_0, [0.0, 0.0]])
    start = {"eta": y_0[0], "rate": y_0[1], "r_eta": reference(0), "mach": mach(0)}
    model = Exchanged(fmu, start | {f"x_hat_0[{i + 1}]": value for i, value in enumerate(x_0)})
    size = len(x_0)

    def by_numpy(t, state):
        x, z = np.split(state, [size])
        slope, u = schedule.equations(z, missile.outputs(x, mach(t)), np.array([reference(t)]), mach(t))
        return np.concatenate([missile.derivatives(x, u[0], mach(t)), slope])

    def by_fmu(t, state):
        x, z = np.split(state, [size])
        y = missile.outputs(x, mach(t))
        slope = model.at(t, z, {"eta": y[0], "rate": y[1], "r_eta": reference(t), "mach": mach(t)})
        return np.concatenate([missile.derivatives(x, model.instance.get("fin")[0], mach(t)), slope])

    runs = []
    for right in (by_numpy, by_fmu):
        state, rows = np.concatenate([x_0, z_0]), []
        for a, b in ((0, 0.5), (0.5, 1.6), (1.6, 3.0)):
            times = np.linspace(a, b, 101)
            if right is by_fmu:
                right(a, state)
                model.event(a)
            done = solve_ivp(right, (a, b - 1e-12), state, t_eval=np.minimum(times, b - 1e-12), rtol=1e-9, atol=1e-11)
            state, rows = done.y[:, -1], [*rows, *done.y.T]
        runs.append(np.array(rows))
    difference = abs(runs[0] - runs[1]).max(axis=0)
    assert (difference < 1e-6 * (1 + abs(runs[0]).max(axis=0))).all(), difference
    # The command is within its limits, and the acceleration follows: at the end of each part within 2 m/s^2.
    for part, b in enumerate((0.5, 1.6, 3.0)):
        x = runs[1][101 * part + 100][:size]
        assert missile.outputs(x, mach(b))[0] == pytest.approx(reference(b - 1e-12), abs=2.0), part
    assert abs(runs[1][:, 2]).max() < 0.5


def test_the_certificate_of_the_missile_holds_at_any_rate_of_the_mach_number(airframe):
    schedule, report, _ = airframe
    assert check_certificate(schedule, report["schedule"]) == 0
    assert report["verdict"]["level"] == "amber", "the peaks of S"


def test_the_command_line_says_what_is_proven(aso_ftc, root, tmp_path):
    done = aso_ftc("design", root / PLANT, "--out", tmp_path / "design.toml", "--report", tmp_path / "report.html")
    assert done.returncode in (0, 1), done.stderr
    assert "schedule: proven between the points" in done.stdout
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "At each instant plant model, gains and operating point are interpolated" in " ".join(page.split())
    assert "largest real part of the eigenvalues" in " ".join(page.split())
