"""Writes what scipy's place_poles reaches, to crates/control/tests/claims/placement_reference.txt and placement_loops.txt.

placement_reference.txt, each line: kind; n; m; A by rows; B by rows; required eigenvalues (real parts, then imaginary
parts); "continuous" or "sampled"; the lowest condition number of the eigenvectors of length one, the lowest 2-norm of the
gain and the lowest peak of S = (I - K (sI - A)^-1 B)^-1, each over KNV0 and YT with their default settings (without the
peak, "nan", if a required eigenvalue is unstable); the method of the lowest condition number; the largest distance of an
eigenvalue of A - B K from the required one there, relative to the latter (to the largest one for zero). A result of
scipy that misses an eigenvalue by more than 1e-6 does not count, a system without results is left out.

placement_loops.txt, each line: plant; sample time (0 for continuous); "prediction" or "current" estimator; n; m; p; A, B,
C by rows, of the continuous plant; eigenvalues of feedback and observer (real parts, then imaginary parts of each), in
the plane of the domain; the lowest peaks of S at the plant's input and output over loops by KNV0 and by YT. Each actuator
has a constant fault that an augmented observer estimates and the command compensates.

The first lines are the observer of fmu-controller/pendulum.toml (A_0', C_0'; continuous, and sampled with eigenvalues
exp(p Ts)) and the chemical reactor, example 1 of Kautsky, Nichols and Van Dooren (1985); the plants are those of
placement_plants.toml, each in continuous and in sampled time.

Needs Python 3.11 with numpy and scipy; writes to the folder given as the first argument, or to the committed files.
"""

import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
import scipy
from scipy.linalg import block_diag, expm
from scipy.optimize import linear_sum_assignment
from scipy.signal import place_poles

from matrices import CONTROL, ROOT, numbers, zoh

SEED = 1985
CASES = 16
METHODS = ["KNV0", "YT"]
KINDS = ["real", "complex", "repeated", "discrete"]
FASTEST = 4.0  # the largest decay per sample, as in control::sampled::sampled_poles


def poles_of(kind, n, m, random):
    """n eigenvalues, closed under conjugation, none with a multiplicity above m."""
    size = 0.5 + 0.1 * random.choice(60, n, replace=False)
    if kind == "real":
        return -np.sort(size) + 0j
    pairs = random.integers(1, n // 2 + 1)
    angle = random.uniform(0.1, 1.5, pairs)
    complex_ones = np.round(-size[:pairs] * np.exp(1j * angle), 2)
    if kind == "complex":
        return np.concatenate([complex_ones, complex_ones.conj(), -size[2 * pairs :]])
    if kind == "repeated":
        times = random.integers(2, m + 1) if m > 1 else 1
        several = np.repeat(np.arange(1, n + 1), times)[:n] * -1.0
        if n >= 2 * times and times > 1:
            pair = np.repeat(complex(-1.5, 2.0), times)
            several = np.concatenate([pair, pair.conj(), several[: n - 2 * times]])
        return several + 0j
    zeros = np.zeros(random.integers(1, m + 1))[:n]
    inside = np.round(np.sort(random.uniform(0.05, 0.95, n - len(zeros))), 2) + 1e-2 * np.arange(n - len(zeros))
    return np.concatenate([zeros, inside]) + 0j


def distance(reached, required):
    largest = np.abs(required).max() or 1.0
    reference = np.where(required == 0, largest, np.abs(required))
    table = np.abs(reached[None, :] - required[:, None]) / reference[:, None]
    return table[linear_sum_assignment(table)].max()


def peak(a, b, c, sampled):
    """The largest singular value of I + c (s I - a)^-1 b over all frequencies."""
    modes = np.linalg.eigvals(a)
    modes = np.log(modes[np.abs(modes) > 1e-12]) if sampled else modes
    modes = modes if len(modes) else np.ones(1)

    def size(frequencies):
        s = np.exp(1j * frequencies) if sampled else 1j * frequencies
        gain = np.eye(b.shape[1]) + c @ np.linalg.solve(s[:, None, None] * np.eye(len(a)) - a, b[None])
        return np.linalg.norm(gain, 2, axis=(1, 2))

    last = np.pi if sampled else 100 * np.abs(modes).max()
    grid = np.geomspace(1e-2 * np.abs(modes).min(), last, 300)
    resonances = [np.abs(modes), np.abs(modes.imag)]
    grid = np.unique(np.concatenate([[0.0, last], grid, *resonances]))
    grid = grid[grid <= last]
    values = size(grid)
    best = values.max()
    for at in np.argsort(values)[-3:]:
        bounds = (grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)])
        for _ in range(3):
            finer = np.linspace(*bounds, 30)
            near = size(finer)
            best = max(best, near.max())
            bounds = (finer[max(near.argmax() - 1, 0)], finer[min(near.argmax() + 1, 29)])
    return best if sampled else max(best, 1.0)


def placed(a, b, required):
    """The results of scipy: for each method gain, condition number and pole error."""
    placements = {}
    for method in METHODS:
        if method == "KNV0" and np.any(required.imag):
            continue
        try:
            result = place_poles(a, b, required, method=method)
        except (ValueError, np.linalg.LinAlgError):
            continue
        # If B has full row rank, scipy omits X: A - B K is then block diagonal with normal blocks.
        vectors = np.eye(a.shape[0]) if np.linalg.matrix_rank(b) == a.shape[0] else result.X
        condition = np.linalg.cond(vectors / np.linalg.norm(vectors, axis=0))
        error = distance(np.linalg.eigvals(a - b @ result.gain_matrix), required)
        if error < 1e-6:
            placements[method] = result.gain_matrix, condition, error
    return placements


def is_stable(required, sampled):
    return (np.abs(required) < 1).all() if sampled else (required.real < 0).all()


def best(a, b, required, sampled):
    placements = placed(a, b, required)
    if not placements:
        return None
    method = min(placements, key=lambda method: placements[method][1])
    gain = min(np.linalg.norm(k, 2) for k, _, _ in placements.values())
    s_peak = np.nan
    if is_stable(required, sampled):
        s_peak = min(peak(a - b @ k, b, -k, sampled) for k, _, _ in placements.values())
    return placements[method][1], gain, s_peak, method, placements[method][2]


def pendulum():
    """(A_0', C_0') with A_0 = [A, -F_a; 0, 0], C_0 = [C, 0], and the required eigenvalues."""
    plant = tomllib.loads((ROOT / "fmu-controller" / "pendulum.toml").read_text())
    a, c, f = (np.array(plant[name]) for name in ["A", "C", "F_a"])
    a_0 = np.block([[a, -f], [np.zeros((1, 5))]])
    c_0 = np.hstack([c, np.zeros((2, 1))])
    return a_0.T, c_0.T, np.array(plant["observer"]["eigenvalues"]) + 0j


def named():
    a, b, required = pendulum()
    yield "pendulum", a, b, required, False
    for sample_time in [1e-4, 1e-3, 2e-3]:
        yield f"pendulum at {sample_time} s", expm(a * sample_time), b, np.exp(required * sample_time), True
    reactor = [
        [1.38, -0.2077, 6.715, -5.676],
        [-0.5814, -4.29, 0.0, 0.675],
        [1.067, 4.273, -6.654, 5.893],
        [0.048, 4.273, 1.343, -2.104],
    ]
    inputs = [[0.0, 0.0], [5.679, 0.0], [1.136, -3.146], [1.136, 0.0]]
    yield "reactor", np.array(reactor), np.array(inputs), np.array([-0.2, -0.5, -5.0566, -8.6659]) + 0j, False


def random_systems():
    random = np.random.default_rng(SEED)
    for case in range(CASES * len(KINDS)):
        kind = KINDS[case % len(KINDS)]
        n = int(random.integers(2, 11))
        m = int(random.integers(1, min(4, n) + 1))
        a = np.round(random.normal(size=(n, n)) * (0.5 if kind == "discrete" else 1.0), 2)
        b = np.round(random.normal(size=(n, m)), 2)
        yield kind, a, b, poles_of(kind, n, m, random), kind == "discrete"


def sampled_poles(required, sample_time):
    decay = -required.real * sample_time
    exponent = np.log(FASTEST) / np.log(decay.max()) if decay.max() > FASTEST else 1.0
    decay = np.where(decay > 1, np.maximum(decay, 1.0) ** exponent, decay)
    return np.exp(-decay + 1j * required.imag * sample_time)


class Plant:
    """A plant with its augmented observer, in the domain of the sample time."""

    def __init__(self, name, data, sampled):
        def eigenvalues(key):
            for value in data[key]:
                if isinstance(value, dict):
                    yield complex(value["re"], value["im"])
                    yield complex(value["re"], -value["im"])
                else:
                    yield complex(value)

        self.name = name
        self.continuous = [np.array(data[key], dtype=float) for key in ["A", "B", "C"]]
        a, b, c = self.continuous
        (n, m), p = b.shape, len(c)
        self.sample_time = data["sample_time"] if sampled else 0.0
        self.current = sampled and data["current_estimator"]
        self.poles = [np.array(list(eigenvalues(f"{who}_eigenvalues"))) for who in ["controller", "observer"]]
        if sampled:
            self.poles = [sampled_poles(poles, self.sample_time) for poles in self.poles]
            a, b = zoh(a, b, self.sample_time)
        self.a, self.b, self.c = a, b, c
        # The faults add to the commands.
        fault_dynamics = np.eye(m) if sampled else np.zeros((m, m))
        self.a_0 = block_diag(a, fault_dynamics)
        self.a_0[:n, n:] = b
        self.c_0 = np.hstack([c, np.zeros((p, m))])

    def pairs(self):
        output_matrix = self.c_0 @ self.a_0 if self.current else self.c_0
        sampled = self.sample_time > 0
        domain = "sampled" if sampled else "continuous"
        yield f"{self.name}, {domain} feedback", self.a, self.b, self.poles[0], sampled
        yield f"{self.name}, {domain} observer", self.a_0.T, output_matrix.T, self.poles[1], sampled

    def peaks(self):
        """The lowest peaks of S at input and output over loops by one method."""
        (_, *feedback), (_, *observer) = self.pairs()
        gains, observers = placed(*feedback[:3]), placed(*observer[:3])
        peaks = [self.peaks_of(gains[one][0], observers[one][0].T) for one in METHODS if one in gains and one in observers]
        return [min(values) for values in zip(*peaks)] if peaks else None

    def peaks_of(self, k, l):
        """The feedback is -k; the observer a_0 - l output_matrix."""
        (n, m), q = self.b.shape, self.b.shape[1]
        command = -np.hstack([k, np.eye(q)])
        b_0 = np.vstack([self.b, np.zeros((q, m))])
        if self.current:
            rest = np.eye(n + q) - l @ self.c_0
            own_a = (self.a_0 + b_0 @ command) @ rest
            own_b = (self.a_0 + b_0 @ command) @ l
            own_c, own_d = command @ rest, command @ l
        else:
            own_a, own_b = self.a_0 - l @ self.c_0 + b_0 @ command, l
            own_c, own_d = command, np.zeros((m, len(self.c)))
        whole = np.block([[self.a + self.b @ own_d @ self.c, self.b @ own_c], [own_b @ self.c, own_a]])
        sampled = self.sample_time > 0
        enter = np.vstack([self.b, np.zeros((len(own_a), m))])
        at_input = peak(whole, enter, np.hstack([own_d @ self.c, own_c]), sampled)
        leave = np.hstack([self.c, np.zeros((len(self.c), len(own_a)))])
        return at_input, peak(whole, np.vstack([self.b @ own_d, own_b]), leave, sampled)


def plants():
    stated = tomllib.loads((ROOT / "scripts" / "reference" / "placement_plants.toml").read_text())
    return [Plant(name, data, sampled) for name, data in stated.items() for sampled in [False, True]]


def line(kind, a, b, required, sampled, reached):
    condition, gain, s_peak, how, error = reached
    domain = "sampled" if sampled else "continuous"
    fields = [kind, str(a.shape[0]), str(b.shape[1]), numbers(a), numbers(b), numbers(required.real), numbers(required.imag), domain]
    return ";".join([*fields, numbers(condition), numbers(gain), numbers(s_peak), how, f"{error:.1e}"])


def loop_line(plant, peaks):
    a, b, c = plant.continuous
    estimator = "current" if plant.current else "prediction"
    fields = [plant.name, numbers(plant.sample_time), estimator, str(len(a)), str(b.shape[1]), str(len(c))]
    poles = [numbers(part) for poles in plant.poles for part in [poles.real, poles.imag]]
    return ";".join([*fields, numbers(a), numbers(b), numbers(c), *poles, *map(numbers, peaks)])


def main():
    warnings.simplefilter("ignore")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else CONTROL / "claims"
    heading = f"# scripts/reference/reference_placement.py: numpy {np.__version__}, scipy {scipy.__version__} place_poles; seed {SEED}; "
    of_plants = plants()
    pairs = [pair for plant in of_plants for pair in plant.pairs()]
    results = [(*system, best(*system[1:])) for system in [*named(), *random_systems(), *pairs]]
    lines = [line(*system) for system in results if system[-1]]
    missing = ", ".join(system[0] for system in results if not system[-1])
    with (folder / "placement_reference.txt").open("w") as file:
        file.write(heading + f"{len(results) - len(lines)} left out: {missing}\n" + "\n".join(lines) + "\n")
    loops = [(plant, plant.peaks()) for plant in of_plants]
    lines = [loop_line(plant, peaks) for plant, peaks in loops if peaks]
    missing = ", ".join(f"{plant.name} at {plant.sample_time} s" for plant, peaks in loops if not peaks)
    with (folder / "placement_loops.txt").open("w") as file:
        file.write(heading + f"{len(loops) - len(lines)} left out: {missing}\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
