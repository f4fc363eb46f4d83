"""Plants that `aso-ftc design --init` identifies from logs; the logs are simulated by scipy."""

import tomllib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.signal import cont2discrete

from design_oracle import WITHOUT_PROOFS, Matrices, says_nothing

PERIOD = 0.05
# A motor with a flexible shaft: angle and speed of both ends; a torque; both angles are measured.
SHAFT = (
    np.array([[0, 1, 0, 0], [-40, -0.4, 40, 0.1], [0, 0, 0, 1], [20, 0.05, -20, -0.3]]),
    np.array([[0], [5], [0], [0]]),
    np.array([[1, 0, 0, 0], [0, 0, 1, 0]]),
)
# Two tanks with heat exchange, and a third state that is not measured.
TANKS = (
    np.array([[-1, 0.4, 0], [0, -0.5, 0.3], [0.2, 0, -0.8]]),
    np.array([[1, 0], [0, 0.5], [0.3, 0]]),
    np.array([[1, 0, 0], [0, 1, 0]]),
)
UNSTABLE = (np.array([[0, 1], [1, -0.2]]), np.array([[0], [1]]), np.array([[1, 0]]))


def sampled(plant):
    """A and B of the plant whose command is held over a sample."""
    a, b, c = plant
    return cont2discrete((a, b, c, np.zeros((len(c), b.shape[1]))), PERIOD)[:2]


def steps(random, rows, commands):
    """Steps of random size and length in each command."""
    lengths = [[np.full(random.integers(3, 30), random.uniform(-1, 1)) for _ in range(rows // 3)] for _ in range(commands)]
    return np.array([np.concatenate(parts)[:rows] for parts in lengths]).T


def log(plant, *, rows=1600, noise=0.0, seed=1, feedback=None, point=0.0):
    """Times, commands and measurements; `feedback` adds -K x to the commands, `point` shifts all signals."""
    random = np.random.default_rng(seed)
    a, b = sampled(plant)
    u, places, x = steps(random, rows, b.shape[1]), [], np.zeros(len(a))
    for row in u:
        if feedback is not None:
            row -= feedback @ x
        places.append(plant[2] @ x)
        x = a @ x + b @ row
    y = np.array(places)
    return PERIOD * np.arange(rows), u + point, y + noise * random.standard_normal(y.shape) + point


def columns(times, u, y):
    """The signals of a log by name."""
    named = {f"u{k + 1}": column for k, column in enumerate(u.T)} | {f"y{k + 1}": column for k, column in enumerate(y.T)}
    return {"time": times} | named


def write(path, signals, separator=",", point="."):
    """A CSV file with 17 digits."""
    rows = zip(*signals.values(), strict=True)
    lines = [separator.join(signals), *(separator.join(f"{value:.17g}".replace(".", point) for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def identify(aso_ftc, tmp_path):
    """Identifies the plant of logs; returns the plant file and the run."""

    def run(*arguments):
        done = aso_ftc("design", "--init", *arguments, "--out", tmp_path / "plant.toml", "--force")
        assert done.returncode == 0, done.stderr
        return tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8")), done

    return run


def response(plant, frequency):
    """C (j w I - A)^-1 B."""
    a, b, c = (np.array(matrix, float) for matrix in plant)
    return c @ np.linalg.solve(1j * frequency * np.eye(len(a)) - a, b)


def distance(plant, other):
    """The largest chordal distance of the frequency responses."""
    pairs = [(response(plant, w), response(other, w)) for w in np.geomspace(0.05, 50, 60)]
    norm = np.linalg.norm
    return max(norm(g - h) / np.sqrt((1 + norm(g) ** 2) * (1 + norm(h) ** 2)) for g, h in pairs)


def matrices(file):
    """A, B and C of a plant file."""
    return tuple(np.array(file[name], float) for name in "ABC")


@pytest.mark.parametrize("plant", [SHAFT, TANKS], ids=["shaft", "tanks"])
def test_a_log_without_noise_gives_the_plant(identify, tmp_path, plant):
    file, done = identify(write(tmp_path / "log.csv", columns(*log(plant, point=3.0))))
    assert says_nothing(done), done.stderr
    assert distance(matrices(file), plant) < 1e-5
    eigenvalues, expected = (np.sort_complex(np.linalg.eigvals(np.array(a, float))) for a in (file["A"], plant[0]))
    np.testing.assert_allclose(eigenvalues, expected, atol=2e-4)
    assert file["sample_time"] == PERIOD
    assert "simulated 100.0 %" in (tmp_path / "plant.toml").read_text(encoding="utf-8")


def test_positions_and_their_rates_are_the_states_of_a_mechanical_plant(identify, tmp_path):
    signals = columns(*log(SHAFT, noise=1e-4))
    names = {"time": "time [s]", "u1": "torque [N m]", "y1": "motor [rad]", "y2": "load [rad]"}
    path = write(tmp_path / "log.csv", {names[name]: column for name, column in signals.items()})
    file, _ = identify(path, "--inputs", "torque")
    assert [state["name"] for state in file["states"]] == ["motor", "load", "motor_rate", "load_rate"]
    assert [state["unit"] for state in file["states"]] == ["rad", "rad", "rad/s", "rad/s"]
    assert (file["actuators"][0]["name"], file["actuators"][0]["unit"]) == ("torque", "N m")
    order = [0, 2, 1, 3]  # motor, load, and their speeds
    np.testing.assert_allclose(file["A"], SHAFT[0][np.ix_(order, order)], atol=0.02)
    np.testing.assert_allclose(file["B"], SHAFT[1][order], atol=0.01)


def loop(plant, design):
    """A of the loop of the plant and the sampled controller of a design for another plant."""
    (a, b), c, controller = sampled(plant), plant[2], Matrices(design)
    n, n_hat, q = len(a), controller.n, controller.q
    x, x_hat, f_hat = np.split(np.eye(n + n_hat + q), [n, n + n_hat])
    innovation = c @ x - controller.C @ x_hat
    present = controller.current
    command = controller.K_x @ (x_hat + present * controller.L_x @ innovation) + controller.K_f @ (
        f_hat + present * controller.L_f @ innovation
    )
    x_now, f_now = x_hat + present * controller.L_x @ innovation, f_hat + present * controller.L_f @ innovation
    rest = (1 - present) * innovation
    estimate = controller.A @ x_now + controller.B @ command + controller.F_a @ f_now + controller.L_x @ rest
    return np.vstack([a @ x + b @ command, estimate, controller.A_f @ f_now + controller.L_f @ rest])


@pytest.mark.parametrize("plant, noise", [(SHAFT, 0.01), (TANKS, 0.02), (UNSTABLE, 0.01)], ids=["shaft", "tanks", "unstable"])
def test_the_design_for_a_noisy_log_is_green_and_stabilises_the_true_plant(identify, aso_ftc, tmp_path, plant, noise):
    feedback = np.array([[3.0, 2.0]]) if plant is UNSTABLE else None
    file, _ = identify(write(tmp_path / "log.csv", columns(*log(plant, noise=noise, feedback=feedback, seed=5))))
    assert len(file["A"]) == len(plant[0])
    assert 0.001 <= file["robustness"]["tolerance"] < 0.1
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", *WITHOUT_PROOFS)
    assert done.returncode == 0 and "verdict: green" in done.stdout, done.stdout + done.stderr
    design = tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8"))
    assert np.abs(np.linalg.eigvals(loop(plant, design))).max() < 1 - 1e-4


def test_the_fit_is_that_of_a_simulation_of_the_last_quarter(identify, tmp_path):
    times, u, y = log(TANKS, noise=0.05, seed=2, point=2.0)
    file, _ = identify(write(tmp_path / "log.csv", columns(times, u, y)))
    a, b, c = matrices(file)
    a, b = sampled((a, b, c))
    start = len(times) * 3 // 4
    x, simulated = np.zeros(len(a)), []
    for row in u - u[:start].mean(axis=0):
        simulated.append(c @ x)
        x = a @ x + b @ row
    errors = (y - y[:start].mean(axis=0) - simulated)[start:]
    rest = errors.std(axis=0) / y[start:].std(axis=0)
    text = (tmp_path / "plant.toml").read_text(encoding="utf-8")
    stated = [float(line.split("simulated ")[1].split(" %")[0]) for line in text.splitlines() if "simulated " in line]
    np.testing.assert_allclose(stated, 100 * (1 - rest), atol=0.5)
    np.testing.assert_allclose([signal["operating"] for signal in file["measurements"]], y[:start].mean(axis=0), atol=0.1)


def test_several_logs_are_one_estimate_that_is_more_precise(identify, tmp_path):
    paths = [write(tmp_path / f"log{k}.csv", columns(*log(TANKS, rows=600, noise=0.05, seed=k))) for k in range(4)]
    one, several = identify(paths[0])[0], identify(*paths)[0]
    assert several["robustness"]["tolerance"] < one["robustness"]["tolerance"]
    assert distance(matrices(several), TANKS) < distance(matrices(one), TANKS)


def test_semicolons_with_decimal_commas_and_parquet_are_the_same_log(identify, tmp_path):
    signals = columns(*log(TANKS, noise=0.02))
    pq.write_table(pa.table(signals), tmp_path / "log.parquet")
    paths = [
        write(tmp_path / "log.csv", signals),
        write(tmp_path / "semicolons.csv", signals, ";", ","),
        tmp_path / "log.parquet",
    ]
    first, *others = (identify(path)[0] for path in paths)
    assert others == [first, first]


def test_times_in_another_unit_are_the_same_times(identify, tmp_path):
    signals = columns(*log(TANKS, noise=0.02))
    first, _ = identify(write(tmp_path / "log.csv", signals))
    for unit, seconds in (("ms", 1e-3), ("min", 60)):
        other = {f"time [{unit}]": signals["time"] / seconds} | {name: signals[name] for name in signals if name != "time"}
        assert identify(write(tmp_path / f"{unit}.csv", other))[0] == first


def test_a_stated_order_is_used(identify, tmp_path):
    path = write(tmp_path / "log.csv", columns(*log(SHAFT, noise=0.01)))
    assert len(identify(path, "--order", 3)[0]["A"]) == 3


def spoilt(change):
    """Signals of the tanks with a change."""
    signals = columns(*log(TANKS, rows=400, noise=0.02))
    return change(signals) or signals


def gap(signals):
    return {name: np.delete(column, slice(100, 120)) for name, column in signals.items()}


def hole(signals):
    signals["y2"][41] = np.nan


def constant(name):
    def change(signals):
        signals[name] = np.full(400, 2.5)

    return change


def late(signals):
    signals["u2"] = np.where(np.arange(400) < 300, 2.5, 3.0)


REFUSED = {
    "gap": (gap, [], "row 101 (6 s): expected the next sample after 0.05"),
    "hole": (hole, [], "row 42 (2.05 s), y2: expected a number, found NaN"),
    "command": (constant("u2"), [], "command u2 is 2.5 throughout"),
    "late command": (late, [], "command u2 is 2.5 throughout the first three quarters of the log"),
    "measurement": (constant("y1"), [], "measurement y1 is 2.5 throughout"),
    "short": (lambda signals: {name: column[:60] for name, column in signals.items()}, [], "at least 100 rows, found 60"),
    "unknown": (lambda signals: None, ["--inputs", "u1,v"], "there is no column v; expected one of u1, u2, y1, y2"),
    "twice": (lambda signals: None, ["--inputs", "u1,u1"], "--inputs: the column u1 is stated twice"),
    "twice measured": (lambda signals: None, ["--outputs", "y1,y2,y1"], "--outputs: the column y1 is stated twice"),
    "alone": (
        lambda signals: {name: signals[name] for name in ("time", "u1")},
        ["--inputs", "u1"],
        "--inputs names all columns but the time, u1, so that none is left for the measurements",
    ),
    "both": (lambda signals: None, ["--inputs", "u1", "--outputs", "y1,u1"], "u1 is among --inputs and --outputs"),
    "names": (
        lambda signals: {name.replace("u", "valve"): column for name, column in signals.items()},
        [],
        "expected --inputs and --outputs, names of its columns valve1, valve2, y1, y2",
    ),
    "order": (lambda signals: None, ["--order", "0"], "order is 0"),
    "unit": (
        lambda signals: {name.replace("time", "time [K]"): column for name, column in signals.items()},
        [],
        "the time is in K, expected s, ms, min, h or d",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_log_that_shows_no_plant_is_refused_with_the_reason(aso_ftc, tmp_path, name):
    change, options, message = REFUSED[name]
    path = write(tmp_path / "log.csv", spoilt(change))
    done = aso_ftc("design", "--init", path, *options, "--out", tmp_path / "plant.toml")
    assert done.returncode == 2 and message in done.stderr and "log.csv" in done.stderr, done.stderr
    assert not (tmp_path / "plant.toml").exists()


def test_logs_of_different_columns_are_refused(aso_ftc, tmp_path):
    times, u, y = log(TANKS, rows=400, noise=0.02)
    first = write(tmp_path / "one.csv", columns(times, u, y))
    for k, (signals, names) in enumerate([
        (columns(times, u[:, :1], y), "u1, y1, y2"),
        ({"time": times, "u2": u[:, 1], "u1": u[:, 0], "y1": y[:, 0], "y2": y[:, 1]}, "u2, u1, y1, y2"),
    ]):
        other = write(tmp_path / f"other{k}.csv", signals)
        done = aso_ftc("design", "--init", first, other, "--out", tmp_path / "plant.toml")
        message = f"expected the columns u1, u2, y1, y2 as in the first log, found {names}"
        assert done.returncode == 2 and message in done.stderr, done.stderr


def test_logs_in_different_units_are_refused(aso_ftc, tmp_path):
    signals = columns(*log(TANKS, rows=400, noise=0.02))

    def drafted(*units):
        paths = [
            write(tmp_path / f"{k}.csv", {f"y2 [{unit}]" if name == "y2" else name: signals[name] for name in signals})
            for k, unit in enumerate(units)
        ]
        return aso_ftc("design", "--init", *paths, "--out", tmp_path / "plant.toml", "--force")

    # FMI does not know counts.
    for unit, other in [("m", "mm"), ("m", "counts")]:
        done = drafted(unit, other)
        message = f"1.csv: expected y2 in {unit} as in the first log, found {other}"
        assert done.returncode == 2 and message in done.stderr, done.stderr
    # One unit in two notations.
    done = drafted("N.m", "m*N")
    assert done.returncode != 2, done.stderr


def test_logs_of_different_sample_times_are_refused(aso_ftc, tmp_path):
    times, u, y = log(TANKS, rows=400, noise=0.02)
    paths = [write(tmp_path / "one.csv", columns(times, u, y)), write(tmp_path / "two.csv", columns(2 * times, u, y))]
    done = aso_ftc("design", "--init", *paths, "--out", tmp_path / "plant.toml")
    assert done.returncode == 2 and "samples every 0.05 s as in the first log, found every 0.1 s" in done.stderr


@pytest.mark.parametrize(
    "signals, message",
    [
        (lambda: columns(*log(TANKS, rows=600, noise=0.5)), "has a fit of"),
        (
            lambda: (
                columns(*log(TANKS, rows=400, noise=0.02))
                | {"u1": np.sin(PERIOD * np.arange(400)), "u2": np.sin(0.5 * PERIOD * np.arange(400))}
            ),
            "the commands excite",
        ),
    ],
    ids=["noise", "sines"],
)
def test_a_doubtful_model_has_a_warning_on_the_terminal_and_in_the_file(identify, tmp_path, signals, message):
    _, done = identify(write(tmp_path / "log.csv", signals()))
    assert message in done.stderr
    assert "# Warning: " in (text := (tmp_path / "plant.toml").read_text(encoding="utf-8")) and message in text
