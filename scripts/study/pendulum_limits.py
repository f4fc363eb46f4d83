"""The paper's pendulum with masses 20 % off: margins, noise and stability of four designs, as a table in Markdown.

    python scripts/study/pendulum_limits.py

The designs are those of fmu-controller/pendulum-masses.toml with the changes below. The figures are those of `aso-ftc design`; those of
`Figures` are computed here again, from the gains and the equations of the pendulum. Needs target/release/aso-ftc, dist/FrictionPendulum.fmu
and Python 3.11 with numpy and scipy.
"""

import re
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from command import ROOT, design
from split_mix import uniform

FILE = ROOT / "fmu-controller" / "pendulum-masses.toml"
NOMINAL = {"M": 3.2, "m": 0.535}
TOLERANCE = 0.2
THREE = {"measurements": '["x_p", "theta", "v_p"]', "robustness.noise": "[3.16e-7, 3.16e-7, 3.16e-7]"}
# By name: the entries that differ from those of the file.
VARIANTS = {
    "the paper's": {},
    "cart velocity measured, least norm": THREE
    | {"observer": '{ h_infinity = "least", region = { disc = { center = -2100.0, radius = 900.0 } } }'},
    "observer ten times slower": {"observer": "{ eigenvalues = [-120.0, -150.0, -180.0, -210.0, -300.0] }"},
    "weights": {
        "feedback": "{ Q = [1.0, 1.0, 0.1, 0.1], R = [0.1] }",
        "observer": "{ W = [1e-4, 1e-4, 1e-2, 1e-2, 1e2], V = [1e-6, 1e-6] }",
    },
}


def plant_file(changes):
    """The text of the plant file with other entries."""
    text = FILE.read_text(encoding="utf-8").replace("../dist", str(ROOT / "dist"))
    for entry, value in changes.items():
        key = entry.removeprefix("robustness.")
        text, count = re.subn(rf"^{key}(\.\w+)? = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1, entry
    return text


def designed(changes):
    """Report and design file."""
    return design(plant_file(changes), "--certificate-time", "0")


def pendulum(M=3.2, m=0.535, J=0.062, l=0.365, F_x=6.2, F_theta=0.009, g=9.807):
    """A and B of the pendulum about the upright position; states x_p, theta, v_p, omega."""
    mass = np.array([[M + m, m * l], [m * l, J]])
    force = np.array([[0, 0, -F_x, 0, 1], [0, m * l * g, 0, -F_theta, 0]])
    rows = np.linalg.solve(mass, force)
    return np.vstack([[0, 0, 1, 0], [0, 0, 0, 1], rows[:, :4]]), np.vstack([[0], [0], rows[:, 4:]])


class Loop:
    """Plant and controller, [x; x_hat; f_hat]; the controller is that of a design file."""

    def __init__(self, file):
        names = ("A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f")
        matrices = {name: np.array(file[name], dtype=float) for name in names}
        self.c, self.k = matrices["C"], np.hstack([matrices["K_x"], matrices["K_f"]])
        a_0 = np.block([[matrices["A"], matrices["F_a"]], [np.zeros((1, 5))]]) + np.vstack([matrices["B"], [[0]]]) @ self.k
        self.l = np.vstack([matrices["L_x"], matrices["L_f"]])
        self.observer = a_0 - self.l @ np.hstack([self.c, np.zeros((len(self.c), 1))])

    def dynamics(self, **parameters):
        """The dynamics of the loop with another pendulum."""
        a, b = pendulum(**parameters)
        return np.block([[a, b @ self.k], [self.l @ self.c, self.observer]])

    def instability(self, **parameters):
        """The largest real part of its eigenvalues."""
        return np.linalg.eigvals(self.dynamics(**parameters)).real.max()

    def noise(self):
        """Root mean square of u and f_hat under white noise of intensity 1 of all measurements."""
        entering = np.vstack([np.zeros((4, self.l.shape[1])), self.l])
        scale = np.array([1, 1, 10, 10, 1, 1, 1e3, 1e3, 1e4])
        a, b = self.dynamics() * scale / scale[:, None], entering / scale[:, None]
        covariance = solve_continuous_lyapunov(a, -b @ b.T) * np.outer(scale, scale)
        of = np.vstack([np.hstack([np.zeros((1, 4)), self.k]), np.eye(9)[[8]]])
        return np.sqrt(np.diag(of @ covariance @ of.T))

    def peaks(self):
        """The largest singular values of S at the command and at the measurements, over a grid of frequencies."""
        a, b = pendulum()
        points = 1j * np.geomspace(0.05, 2e4, 6000)
        inverse = lambda m: np.linalg.inv(points[:, None, None] * np.eye(len(m)) - m)
        plant, controller = self.c @ inverse(a) @ b, self.k @ inverse(self.observer) @ self.l
        sensitivities = (np.linalg.inv(np.eye(len(one[0])) - one) for one in (controller @ plant, plant @ controller))
        return [np.linalg.norm(s, 2, axis=(1, 2)).max() for s in sensitivities]


@dataclass(frozen=True)
class Figures:
    """What is computed again: peaks of S, noise, the stable fraction, the worst corner, the first unstable masses."""

    peaks: list
    noise: np.ndarray
    stable: float
    worst: float
    lightest: float
    heaviest: float


def figures(file, cases, seed=1):
    """Those of a design file."""
    loop, random = Loop(file), uniform(seed)
    value = lambda nominal: nominal * (1 + TOLERANCE * (2 * next(random) - 1))
    drawn = [{name: value(nominal) for name, nominal in NOMINAL.items()} for _ in range(cases)]
    corners = [{"M": 3.2 * (1 + i * TOLERANCE), "m": 0.535 * (1 + j * TOLERANCE)} for i in (-1, 1) for j in (-1, 1)]
    return Figures(
        loop.peaks(),
        loop.noise(),
        np.mean([loop.instability(**case) < 0 for case in drawn]),
        max(loop.instability(**corner) for corner in corners),
        first_unstable(loop, np.linspace(0.535, 0.005, 400)),
        first_unstable(loop, np.linspace(0.535, 1.25, 400)),
    )


def first_unstable(loop, masses):
    """The first mass of the pendulum with which the loop is unstable; NaN if there is none."""
    return next((mass for mass in masses if loop.instability(m=mass) >= 0), np.nan)


def row(name, changes):
    """A row of the table."""
    report, file = designed(changes)
    masses, robustness = figures(file, 1000), report["robustness"]
    point = robustness["points"][1]
    noise = [one["value"] for one in robustness["noise_together"]]
    limits = " and ".join(f"{mass:.2f} kg" for mass in (masses.lightest, masses.heaviest) if np.isfinite(mass))
    return (
        f"| {name} | {point['judged']:.2f} | {point['together']['alpha']:.2f} | {1e3 * robustness['delay_margin']:.1f} ms | "
        f"{1e3 * robustness['longest_hold']:.1f} ms | {noise[0]:.3g} N | {noise[1]:.3g} N | {robustness['tolerance']['stable']:.0%} | "
        f"{robustness['tolerance']['worst_instability']:.2f} | {limits} | "
        f"{report['verdict']['level']} |"
    )


if __name__ == "__main__":
    print("| design | peak of S | disk margin | delay | hold | noise in u | in f_hat | stable | worst | first unstable m | verdict |")
    print("|---" * 11 + "|")
    for name, changes in VARIANTS.items():
        print(row(name, changes))
