"""The fall-back and several actuators gone: the figures of the report by numpy and scipy, and runs of the FMU."""

import json
import tomllib

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model
from scipy.linalg import expm, solve_continuous_lyapunov

from conftest import ROOT
from matrices import zoh
from stepped import Stepped

VEHICLE = ROOT / "examples/plants/actuators/underwater-vehicle.toml"

# Two masses, four forces: any two of them move both masses. The loss of the first one is estimated.
MASSES = """
A = [[0, 0, 1, 0], [0, 0, 0, 1], [-0.5, 0.2, -0.4, 0], [0.2, -0.3, 0, -0.3]]
B = [[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0.7, 0.7], [0, 1, 0.7, -0.7]]
C = [[1, 0, 0, 0], [0, 1, 0, 0]]
actuators = [{ name = "a", operating = 0.2 }, { name = "b" }, { name = "c" }, { name = "d", operating = -0.1 }]
faults = [{ name = "f", loss_of = "a", least_command = 0.1 }]
feedback.Q = [1, 1, 1, 1]
feedback.R = [1, 1, 1, 1]
observer.eigenvalues = [-3, -3.3, -3.6, -4, -4.4]
robustness.cases = 0
experiment = { stop_time = 10, step_size = 0.05 }
[reconfiguration]
actuators = "all"
together = 2
stuck_at = { a = 0.5, c = -0.3 }
[fallback]
actuators = "all"
region.decay = 0.1
"""
SAMPLED = "sample_time = 0.05\n" + MASSES


def designed(aso_ftc, folder, text, *options):
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    return aso_ftc("design", folder / "plant.toml", "--out", folder / "design.toml", "--json", *options)


def with_fmu(aso_ftc, folder, text):
    """Design file, report and FMU."""
    done = designed(aso_ftc, folder, text, "--fmu", folder / "Controller.fmu")
    assert done.returncode == 0, done.stderr
    return tomllib.loads((folder / "design.toml").read_text()), json.loads(done.stdout), folder / "Controller.fmu"


@pytest.fixture(scope="module")
def vehicle(aso_ftc, tmp_path_factory):
    text = VEHICLE.read_text(encoding="utf-8").replace("up_to = 0.6\n", "") + "[robustness]\ncases = 0\n"
    if "[fallback]" not in text:
        text += '[fallback]\nactuators = "all"\n'
    return with_fmu(aso_ftc, tmp_path_factory.mktemp("vehicle"), text)


@pytest.fixture(scope="module")
def masses(aso_ftc, tmp_path_factory):
    return with_fmu(aso_ftc, tmp_path_factory.mktemp("masses"), MASSES)


@pytest.fixture(scope="module")
def sampled(aso_ftc, tmp_path_factory, transfer_time):
    text = SAMPLED if transfer_time is None else f"transfer_time = {transfer_time}\n{SAMPLED}"
    return with_fmu(aso_ftc, tmp_path_factory.mktemp("sampled"), text)


def matrix(design, name):
    return np.array(design[name])


class Equations:
    """Plant and continuous controller as x' and z', deviations from the operating point."""

    def __init__(self, design, gains=None, stuck=()):
        self.a, self.b, self.c, self.f_a = (matrix(design, name) for name in ("A", "B", "C", "F_a"))
        (self.n, self.m), self.q = self.b.shape, self.f_a.shape[1]
        gains = gains or design
        self.gain = np.vstack([matrix(design, "L_x"), matrix(design, "L_f")])
        k_f = matrix(gains, "K_f") if "K_f" in gains else np.zeros((self.m, self.q))
        self.k = np.hstack([matrix(gains, "K_x"), k_f])
        self.k[list(stuck)] = 0
        self.model = np.block([[self.a, self.f_a], [np.zeros((self.q, self.n + self.q))]])

    def whole(self, effectiveness):
        """The matrix of [x; z]' while the actuators have a part of their effect."""
        lossy = self.b * np.asarray(effectiveness)
        b_0 = np.vstack([self.b, np.zeros((self.q, self.m))])
        c_0 = np.hstack([self.c, np.zeros((len(self.c), self.q))])
        z = self.model + b_0 @ self.k - self.gain @ c_0
        return np.block([[self.a, lossy @ self.k], [self.gain @ self.c, z]])


def effects(m):
    """All actuators, then each one gone."""
    return [np.ones(m), *(1 - np.eye(m))]


def test_in_each_case_the_loop_with_the_observer_decays_as_reported(vehicle, masses):
    for design, report, _ in (vehicle, masses):
        loop, fallback = Equations(design, design["fallback"]), report["fallback"]
        assert ("K_f" in design["fallback"]) == fallback["compensates"]
        names = [signal["name"] for signal in report["plant"]["actuators"]]
        assert [case["name"] for case in fallback["cases"]] == ["all actuators", *(f"without {name}" for name in names)]
        for case, effect in zip(fallback["cases"], effects(loop.m)):
            assert -np.linalg.eigvals(loop.whole(effect)).real.max() == pytest.approx(case["decay"], rel=1e-6)
            fed_back = loop.a + loop.b * effect @ matrix(design["fallback"], "K_x")
            assert -np.linalg.eigvals(fed_back).real.max() == pytest.approx(case["feedback_decay"], rel=1e-6)
        assert fallback["decay"] == min(case["decay"] for case in fallback["cases"]) > 0
        intact = Equations(design).whole(np.ones(loop.m))
        assert -np.linalg.eigvals(intact).real.max() == pytest.approx(fallback["intact_decay"], rel=1e-6)


def test_one_lyapunov_matrix_serves_all_losses_whose_sum_is_at_most_one(vehicle, masses):
    random = np.random.default_rng(3)
    for design, report, _ in (vehicle, masses):
        loop = Equations(design, design["fallback"])
        p, whole = np.array(report["fallback"]["feedback"]["p"]), np.array(report["fallback"]["whole"]["p"])
        assert min(np.linalg.eigvalsh(p)) > 0 and min(np.linalg.eigvalsh(whole)) > 0
        mixed = [1 - random.dirichlet(np.ones(loop.m + 1))[:-1] for _ in range(50)]
        for effect in [*effects(loop.m), *mixed]:
            fed_back = loop.a + loop.b * effect @ matrix(design["fallback"], "K_x")
            assert max(np.linalg.eigvalsh(p @ fed_back + fed_back.T @ p)) < 0
            closed = loop.whole(effect)
            assert max(np.linalg.eigvalsh(whole @ closed + closed.T @ whole)) < 0


def test_price_and_rest_are_those_of_the_loop(vehicle, masses):
    for design, report, _ in (vehicle, masses):
        loop, intact = Equations(design, design["fallback"]), Equations(design).whole(np.ones(4))
        b = np.vstack([loop.b, np.zeros((loop.n + loop.q, loop.m))])
        c = np.hstack([loop.c, np.zeros((len(loop.c), loop.n + loop.q))])

        def noise(a):
            return np.sqrt(np.diag(c @ solve_continuous_lyapunov(a, -b @ b.T) @ c.T))

        operating = [signal["operating"] for signal in report["plant"]["actuators"]]
        stuck = {entry["gone"]: entry["stuck_at"] for entry in design["reconfigurations"]}
        names = [signal["name"] for signal in report["plant"]["actuators"]]
        for at, (case, effect) in enumerate(zip(report["fallback"]["cases"], effects(loop.m))):
            closed = loop.whole(effect)
            price = [number["value"] for number in case["price"]]
            assert price == pytest.approx(noise(closed) / noise(intact), rel=1e-5)
            acting = np.zeros(loop.m)
            if at > 0:
                acting[at - 1] = stuck[names[at - 1]] - operating[at - 1]
            rest = -np.linalg.solve(closed, b @ acting)
            measured = [number["value"] for number in case["measurements"]]
            assert measured == pytest.approx(c @ rest, rel=1e-6, abs=1e-12)
            commands = loop.k @ rest[loop.n :] + operating
            if at > 0:
                commands[at - 1] = stuck[names[at - 1]]
            assert [number["value"] for number in case["commands"]] == pytest.approx(commands, rel=1e-6, abs=1e-12)


class Run(Stepped):
    """The controller FMU in co-simulation and the plant by scipy; commands are held over a step."""

    def __init__(self, design, fmu, folder, step):
        super().__init__(fmu, folder)
        self.size, self.time = step, 0.0
        self.actuators = [actuator["name"] for actuator in design["actuators"]]
        self.operating = np.array([actuator.get("operating", 0.0) for actuator in design["actuators"]])
        self.measurements = [measurement["name"] for measurement in design["measurements"]]

    def do(self, y):
        self.set_reals(self.measurements, y)
        self.step(self.time, self.size)
        self.time += self.size


class Plant:
    """The plant of a continuous design, stepped exactly."""

    def __init__(self, design, step):
        a, b = matrix(design, "A"), matrix(design, "B")
        self.phi, self.gamma = zoh(a, b, step)
        self.c, self.x = matrix(design, "C"), np.zeros(len(a))

    def advance(self, u):
        self.x = self.phi @ self.x + self.gamma @ u
        return self.c @ self.x


@pytest.fixture
def coupled(vehicle, tmp_path):
    design, _, fmu = vehicle
    run = Run(design, fmu, tmp_path, 0.01)
    yield run, Plant(design, 0.01)
    run.close()


def drive(run, plant, end, effect):
    while run.time < end - 1e-9:
        u = effect(run.get(*run.actuators))
        run.do(plant.advance(u - run.operating))


@pytest.mark.parametrize("at", range(4))
def test_the_fall_back_keeps_the_vehicle_where_the_report_says_whichever_thruster_is_gone(vehicle, coupled, at):
    run, plant = coupled
    drive(run, plant, 1.0, lambda u: u)
    run.set("fall_back", True)
    gone = np.arange(4) == at
    drive(run, plant, 60.0, lambda u: np.where(gone, 0.0, u))
    assert run.number() == -1
    case = vehicle[1]["fallback"]["cases"][at + 1]
    measured = [number["value"] for number in case["measurements"]]
    # The plant is held over a step of 0.01 s, the equilibrium is the same.
    assert plant.c @ plant.x == pytest.approx(measured, abs=2e-4)
    # Nobody knows which one has failed: no estimate decides it.
    run.set("fall_back", False)
    drive(run, plant, 60.01, lambda u: u)
    assert run.number() == 0


def test_two_thrusters_that_are_gone_have_no_gains_so_that_the_controller_falls_back(vehicle, coupled):
    run, plant = coupled
    run.set("actuator_gone[1]", True)
    drive(run, plant, 0.02, lambda u: u)
    assert run.number() == 1
    run.set("actuator_gone[3]", True)
    drive(run, plant, 0.04, lambda u: u)
    assert run.number() == -1 and list(run.get("T1", "T3")) == [0, 0]
    run.set("actuator_gone[1]", False)
    drive(run, plant, 0.06, lambda u: u)
    assert run.number() == 3
    cases = vehicle[1]["reconfiguration"]["by_fallback"]
    assert [case["actuators"] for case in cases][0] == ["T1", "T2"] and len(cases) == 6


def test_at_the_switch_the_estimates_continue_and_the_commands_change_by_the_gains(masses, tmp_path):
    """From another state, observer, plant and feedback by scipy; `c` is gone, which nobody knows."""
    design, _, fmu = masses
    step, run, plant = 0.01, Run(design, fmu, tmp_path, 0.01), Plant(design, 0.01)
    plant.x[:] = [0.2, -0.1, 0.0, 0.0]
    before, after = Equations(design), Equations(design, design["fallback"])

    def exact(loop):
        """z of the next step; y is held over a step."""
        z = loop.model + np.vstack([loop.b, np.zeros((loop.q, loop.m))]) @ loop.k
        z -= loop.gain @ np.hstack([loop.c, np.zeros((len(loop.c), loop.q))])
        return zoh(z, loop.gain, step)

    z, u = np.zeros(before.n + before.q), np.zeros(4)
    for k in range(300):
        if k == 100:
            run.set("fall_back", True)
        loop = before if k < 100 else after
        y = plant.advance(np.where(np.arange(4) == 2, 0.0, u))
        run.do(y)
        if k in (0, 100):
            phi, gamma = exact(loop)
        z = phi @ z + gamma @ y
        u = loop.k @ z
        assert abs(run.get(*run.actuators) - run.operating - u).max() < 1e-9, k
        assert abs(run.get(*(f"x_hat[{i + 1}]" for i in range(4)), "f_hat") - z).max() < 1e-9, k
    run.close()


@pytest.mark.parametrize("gone", [(0, 2), (1, 3)])
def test_without_two_forces_the_others_have_the_effect_of_all(masses, tmp_path, gone):
    design, report, fmu = masses
    names = [actuator["name"] for actuator in design["actuators"]]
    gains = next(entry for entry in design["combinations"] if entry["gone"] == [names[at] for at in gone])
    b, k_x = matrix(design, "B"), matrix(design, "K_x")
    assert abs(b @ matrix(gains, "K_x") - b @ k_x).max() < 1e-12 and abs(matrix(gains, "K_x")[list(gone)]).max() == 0
    assert len(report["reconfiguration"]["several"]) == 6
    run, plant = Run(design, fmu, tmp_path, 0.01), Plant(design, 0.01)
    stuck = np.array([{"a": 0.5, "c": -0.3}.get(name, 0.0) for name in names])
    for at in gone:
        run.set(f"actuator_gone[{at + 1}]", True)
    drive(run, plant, 25.0, lambda u: np.where(np.isin(np.arange(4), gone), stuck, u))
    assert run.number() == gone[0] + 1
    assert abs(plant.x).max() < 1e-4
    commands = run.operating + matrix(gains, "K_s") @ (stuck - run.operating)[list(gone)]
    commands[list(gone)] = stuck[list(gone)]
    assert run.get(*names) == pytest.approx(commands, abs=1e-3)
    # A third one has no gains: the fall-back.
    rest = next(at for at in range(4) if at not in gone)
    run.set(f"actuator_gone[{rest + 1}]", True)
    drive(run, plant, 25.02, lambda u: u)
    assert run.number() == -1
    run.close()


@pytest.mark.parametrize("case", ["single", "several", "fall-back"])
@pytest.mark.parametrize("transfer_time", [None, 0.4], scope="module")
def test_a_sampled_controller_has_the_gains_of_its_case(sampled, transfer_time, tmp_path, case):
    """u[k] = K_x x_hat + K_f f_hat + K_s u_s with the current estimator of the design file, sample by sample. With a
    transfer the free commands stay at the switch, and their distance from the law decays with its time constant."""
    design, report, fmu = sampled
    said = any("a transfer time of 0.4 s" in text for text in report["assumptions"])
    assert said == (transfer_time is not None)
    run = Run(design, fmu, tmp_path, 0.05)
    a, b, c, f_a = (matrix(design, name) for name in ("A", "B", "C", "F_a"))
    l_x, l_f = matrix(design, "L_x"), matrix(design, "L_f")
    stuck, gains = {"single": ([2], design["reconfigurations"][2]), "several": ([0, 2], design["combinations"][1])}.get(
        case, ([], design["fallback"])
    )
    if case == "several":
        assert gains["gone"] == ["a", "c"]
    held = np.array([0.5, 0, -0.3, 0])[stuck] - run.operating[stuck]
    x, x_hat, f_hat, u = np.array([0.2, -0.1, 0.0, 0.0]), np.zeros(4), np.zeros(1), np.zeros(4)
    last, left = np.zeros(4), np.zeros(4)
    for k in range(120):
        switched = k >= 20
        if k == 20:
            run.set("fall_back", case == "fall-back")
            for at in stuck:
                run.set(f"actuator_gone[{at + 1}]", True)
        y = c @ x
        run.do(y) if k > 0 else None
        if k == 20 and 0 in stuck:
            f_hat[:] = 0
        if k > 0:
            e = y - c @ x_hat
            x_hat, f_hat = x_hat + l_x @ e, f_hat + l_f @ e
        law = gains if switched else design
        k_f = matrix(law, "K_f") if "K_f" in law else np.zeros((4, 1))
        u = matrix(law, "K_x") @ x_hat + k_f @ f_hat
        if switched and stuck:
            u += np.reshape(matrix(law, "K_s"), (4, -1)) @ held
        if transfer_time is not None:
            left = last - u if k == 20 else np.exp(-0.05 / transfer_time) * left
            u, last = u + left, u + left
        if switched and stuck:
            u[stuck] = held
        assert abs(run.get(*run.actuators) - run.operating - u).max() < 1e-9, k
        x = a @ x + b @ u
        x_hat = a @ x_hat + b @ u + f_a @ f_hat
    assert run.number() == {"single": 3, "several": 1, "fall-back": -1}[case]
    run.close()


def test_in_model_exchange_the_fall_back_takes_effect_at_an_event(masses, tmp_path):
    """[x; z]' of plant and FMU by a Runge-Kutta method of fourth order beside the exponential of the loop."""
    design, _, fmu = masses
    description = read_model_description(str(fmu))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    model = FMU2Model(
        guid=description.guid,
        unzipDirectory=extract(str(fmu), unzipdir=str(tmp_path)),
        modelIdentifier=description.modelExchange.modelIdentifier,
        instanceName="controller",
    )
    model.instantiate()
    model.setupExperiment(startTime=0.0)
    model.enterInitializationMode()
    model.exitInitializationMode()
    actuators = [actuator["name"] for actuator in design["actuators"]]
    operating = np.array([actuator.get("operating", 0.0) for actuator in design["actuators"]])
    before, after = Equations(design), Equations(design, design["fallback"])
    effect = np.array([1.0, 0.0, 1.0, 1.0])

    def update():
        more = True
        while more:
            more, finished, *_ = model.newDiscreteStates()
            assert not finished
        model.enterContinuousTimeMode()

    import ctypes

    def slopes(time, state):
        x, z = state[:4], state[4:]
        model.setTime(time)
        values = (ctypes.c_double * 5)(*z)
        model.setContinuousStates(values, 5)
        model.setReal([references[name] for name in ("y1", "y2")], list(before.c @ x))
        u = np.array(model.getReal([references[name] for name in actuators])) - operating
        model.getDerivatives(values, 5)
        return np.concatenate([before.a @ x + before.b @ (effect * u), list(values)])

    update()
    step, state = 0.01, np.concatenate([[0.2, -0.1, 0, 0], np.zeros(5)])
    expected = state.copy()
    for k in range(200):
        if k == 100:
            model.enterEventMode()
            model.setBoolean([references["fall_back"]], [True])
            update()
            assert model.getInteger([references["reconfiguration"]]) == [-1]
        t = k * step
        s1 = slopes(t, state)
        s2 = slopes(t + step / 2, state + step / 2 * s1)
        s3 = slopes(t + step / 2, state + step / 2 * s2)
        s4 = slopes(t + step, state + step * s3)
        state = state + step / 6 * (s1 + 2 * s2 + 2 * s3 + s4)
        loop = before if k < 100 else after
        expected = expm(loop.whole(effect) * step) @ expected
        assert abs(state - expected).max() < 1e-6, k
    model.terminate()
    model.freeInstance()


def test_a_loss_that_is_smaller_may_have_a_feedback_where_an_actuator_that_is_gone_has_none(aso_ftc, tmp_path):
    """The unstable plant needs its only force."""
    one = "A = [[1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\nfeedback.eigenvalues = [-1]\n"
    one += "observer.eigenvalues = [-8, -9]\nrobustness.cases = 0\n[fallback]\nactuators = \"all\"\n"
    done = designed(aso_ftc, tmp_path, one)
    assert done.returncode == 2 and "without its only actuator a plant is not controlled" in done.stderr
    assert "plant.toml:8" in done.stderr
    done = designed(aso_ftc, tmp_path, one + "loss = 0.3\nregion.decay = 0.1\n")
    assert done.returncode == 0, done.stderr
    fallback = json.loads(done.stdout)["fallback"]
    assert fallback["cases"][1]["name"] == "u1 with a loss of 0.3" and fallback["decay"] >= 0.1
    assert fallback["k_x"] == [[pytest.approx(-2)]] and "intact controller" in fallback["method"]
    # The intact gain is too small for a faster decay: one from the inequalities.
    done = designed(aso_ftc, tmp_path, one + "loss = 0.3\nregion.decay = 0.6\n", "--force")
    assert done.returncode in (0, 1), done.stderr
    fallback = json.loads(done.stdout)["fallback"]
    gain = fallback["k_x"][0][0]
    assert "by linear matrix inequalities" in fallback["method"] and fallback["decay"] >= 0.6
    assert 1 + gain < -0.6 and 1 + 0.7 * gain < -0.6


def test_cases_without_a_common_gain_are_named(aso_ftc, tmp_path):
    # One force may lose nearly all of its effect on a fast unstable mode, the other on another one.
    text = "A = [[1, 0], [0, 2]]\nB = [[1, 0.1], [0.1, 1]]\nC = [[1, 0], [0, 1]]\nactuator_faults = \"all\"\n"
    text += "feedback.eigenvalues = [-3, -4]\nobserver.eigenvalues = [-10, -11, -12, -13]\nrobustness.cases = 0\n"
    text += "[fallback]\nactuators = \"all\"\nregion = { disc = { center = -5.0, radius = 4.0 } }\n"
    done = designed(aso_ftc, tmp_path, text)
    assert done.returncode == 2 and "there is no fall-back: no gain with one Lyapunov matrix" in done.stderr
    assert "without u1" in done.stderr and "plant.toml:8" in done.stderr


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("[reconfiguration]", "[reference]\ntrack = [\"y1\"]\n[reconfiguration]", "not possible together with `reference`"),
        ("[fallback]", "[fallback]\nloss = 1.5", "expected a fraction above 0 and at most 1, found 1.5"),
        ("[fallback]\nactuators = \"all\"", "[fallback]\nactuators = [\"e\"]", 'no actuator is named "e"; there are a, b, c, d'),
        ("together = 2", "together = 4", "from 1 to 3, found 4"),
        (
            "robustness.cases = 0",
            "robustness.cases = 0\nestimation.law = \"learning\"",
            "with `reconfiguration` the law is one of augmented",
        ),
        ("region.decay = 0.1", "region.decay = 0.1\nregion.disc = { center = -1, radius = 2 }", "by `decay` only"),
    ],
)
def test_a_bad_entry_is_refused(aso_ftc, tmp_path, old, new, message):
    assert old in SAMPLED
    done = designed(aso_ftc, tmp_path, SAMPLED.replace(old, new))
    assert done.returncode == 2 and message in done.stderr, done.stderr


def test_without_its_only_actuator_a_plant_has_no_fallback_but_with_a_part_of_it(aso_ftc, tmp_path):
    text = 'A = [[-0.5]]\nB = [[1]]\nC = [[1]]\nactuator_faults = "all"\n[fallback]\nactuators = "all"\n'
    done = designed(aso_ftc, tmp_path, text)
    assert done.returncode == 2 and "5:1: fallback: without its only actuator" in done.stderr, done.stderr
    assert "expected a `loss` below 1" in done.stderr
    done = designed(aso_ftc, tmp_path, text + "loss = 0.5\n")
    assert done.returncode == 0, done.stderr


def test_a_family_is_refused(aso_ftc, tmp_path):
    alone = SAMPLED[: SAMPLED.index("[reconfiguration]")] + SAMPLED[SAMPLED.index("[fallback]") :]
    member = '[[family]]\nname = "other"\nA = [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, 0, 0], [0, -1, 0, 0]]\n'
    done = designed(aso_ftc, tmp_path, alone + member)
    assert done.returncode == 2 and "not possible together with `family`" in done.stderr


def test_a_loop_that_the_observer_makes_unstable_is_said_to_grow(aso_ftc, tmp_path):
    """The plant of J. C. Doyle, Guaranteed margins for LQG regulators (1978)."""
    plant = tmp_path / "plant.toml"
    plant.write_text(
        'A = [[1, 1], [0, 1]]\nB = [[0], [1]]\nC = [[1, 0]]\nactuator_faults = "all"\nfeedback.Q = [1, 1]\nfeedback.R = [1]\n'
        'observer.W = [1, 1, 100]\nobserver.V = [0.01]\n[fallback]\nactuators = "all"\nloss = 0.5\n'
    )
    done = aso_ftc("design", plant, "--out", tmp_path / "design.toml")
    assert done.returncode == 2
    assert 'the loop of the case "u1 with a loss of 0.5" is unstable and grows with ' in done.stderr, done.stderr
