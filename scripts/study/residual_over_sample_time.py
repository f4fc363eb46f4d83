"""The cart's residual over the sample time of the controller: figure and tables of docs/explanation/sampled.md.

Usage: python scripts/study/residual_over_sample_time.py

Needs dist/ and target/release/aso-ftc (`cargo run --release -- pack`), and numpy; takes two minutes. For
each sample time and choice of the design it derives a plant file from fmu-controller/pendulum.toml, makes
the controller FMU by `aso-ftc design --fmu`, couples it with dist/FrictionPendulum.fmu by `aso-ftc run`
and measures. Writes docs/figures/residual_over_sample_time.csv and .svg; prints the tables of docs/explanation/sampled.md.
"""

import csv
import math
import subprocess
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from command import COMMAND, ROOT, columns
from log_plot import Curve, log_plot

STEM = ROOT / "docs" / "figures" / "residual_over_sample_time"

SAMPLE_TIMES = [0.1, 0.2, 0.5, 1, 2, 3, 5, 7, 10]  # ms
SETTLED = 60.0  # s: compensation starts at 40 s
RECORDED = 1e-3  # s: the cart turns so slowly that smaller steps change no digit of the tables
# Bandwidth of the observer designed by weights: in 1/s, and its maximum in 1/sample time.
BANDWIDTH, OF_A_SAMPLE = 300.0, 0.5
# Method, communication step in sample times.
COUPLINGS = [
    ("gauss-seidel", 1.0),
    ("gauss-seidel", 1 / 3),
    ("gauss-seidel", 1 / 2.7),
    ("gauss-seidel", 0.7),
    ("gauss-seidel", 2.5),
    ("jacobi", 1 / 10),
    ("jacobi", 1.0),
]
TRUE_START = {"controller.x_hat_0[1]": 0.1, "controller.x_hat_0[2]": -0.1}


@dataclass(frozen=True)
class Choice:
    """The choices in a plant file."""

    kind: str
    estimator: str
    weighted: bool = False

    @property
    def label(self):
        """The name in tables and figure."""
        return f"{self.kind}, {self.estimator}" + (", weights" if self.weighted else "")


CONSTANT_PREDICTION = Choice("constant", "prediction")
CONSTANT = Choice("constant", "current")
RAMP = Choice("ramp", "current")
WEIGHTED = Choice("ramp", "current", weighted=True)
CHOICES = [CONSTANT_PREDICTION, CONSTANT, RAMP, WEIGHTED]


def plant_file(choice, sample_time):
    """The text of fmu-controller/pendulum.toml with these changes; `sample_time` in s."""
    text = (ROOT / "fmu-controller" / "pendulum.toml").read_text(encoding="utf-8")
    before, after = text.split("observer.eigenvalues = ")
    observer, after = after.split("\n", 1)
    observer = "observer.eigenvalues = " + observer
    if choice.kind == "ramp":
        observer = observer.replace("]", ", -2500.0]")
    if choice.weighted:
        rate = min(OF_A_SAMPLE / sample_time, BANDWIDTH)
        observer = f"observer.W = [0, 0, 0, 0, 0, {rate**8!r}]\nobserver.V = [1, 1]"
    sampled = f'sample_time = {sample_time!r}\nestimator = "{choice.estimator}"\n'
    return f'{before}{observer}\n{sampled}{after}kind = "{choice.kind}"\n'


def design(choice, sample_time, folder):
    """Makes the controller FMU in `folder` and returns its path. The design file is beside it."""
    plant, fmu = folder / "plant.toml", folder / "Controller.fmu"
    plant.write_text(plant_file(choice, sample_time), encoding="utf-8")
    options = ["--out", folder / "design.toml", "--fmu", fmu, "--force", "--certificate-time", "0"]
    command = [COMMAND, "design", plant, *options, "--from", ROOT / "dist" / "AsoController.fmu"]
    # Status 1: the verdict on the design is red.
    status = subprocess.run(command, check=False, stdout=subprocess.DEVNULL).returncode
    assert status in (0, 1), command
    return fmu


def couple(fmu, step, method="gauss-seidel", settings=None):
    """The residual of the pendulum coupled with `fmu` in communication steps of `step` s.

    Half of peak to peak of the cart for t > 60 s, in mm; None where the pendulum falls.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [COMMAND, "run", "--plant", ROOT / "dist" / "FrictionPendulum.fmu"]
        command += ["--controller", fmu, "--method", method, "--step", str(step), "--out", folder]
        command += ["--record-every", str(max(step, RECORDED))]
        for name, value in (settings or {}).items():
            command += ["--set", f"{name}={value}"]
        ended = subprocess.run(command, check=False, capture_output=True, text=True)
        if "the run ended early" in ended.stderr:
            return None
        ended.check_returncode()
        time, cart, angle = columns(Path(folder, "results.csv"), ("time", "plant.x_p", "plant.theta"))
    if np.abs(angle).max() > math.pi / 2:
        return None
    return 5e2 * np.ptp(cart[time > SETTLED])


def noise_gain(design_file):
    """Standard deviation of u in N for white noise of 1 um, of 1 urad on the samples.

    From the equations of the sampled controller and the sampled linear plant, its covariance by
    doubling: the sum of W^k N N' W'^k.
    """
    values = tomllib.loads(design_file.read_text(encoding="utf-8"))
    matrix = lambda name: np.array(values[name])
    a, b, c, f_a, l_x = map(matrix, ("A", "B", "C", "F_a", "L_x"))
    n, q = f_a.shape
    a_f = np.array(values.get("A_f", np.eye(q)))
    output_matrix, fault = np.hstack([c, np.zeros((len(c), q))]), np.zeros((q, n))
    free, enters = np.block([[a, f_a], [fault, a_f]]), np.vstack([b, np.zeros((q, 1))])
    gain, feedback = np.vstack([l_x, matrix("L_f")]), np.hstack([matrix("K_x"), matrix("K_f")])
    if values["estimator"] == "current":
        correction = np.eye(n + q) - gain @ output_matrix
        out, direct, loop = feedback @ correction, feedback @ gain, free + enters @ feedback
        observer, entry = loop @ correction, loop @ gain
    else:
        out, direct = feedback, np.zeros((1, len(c)))
        observer, entry = free + enters @ feedback - gain @ output_matrix, gain
    whole = np.block([[a + b @ direct @ c, b @ out], [entry @ c, observer]])
    noise, command = np.vstack([b @ direct, entry]), np.hstack([direct @ c, out])
    return [
        1e-6 * math.hypot(direct[0, k], *(command @ root(whole, noise[:, [k]])).flat)
        for k in range(len(c))
    ]


def root(a, column):
    """R with R R' = sum of a^k column column' a'^k."""
    while np.linalg.norm(a) > 1e-12:
        column = np.transpose(np.linalg.qr(np.hstack([column, a @ column]).T, mode="r"))
        a = a @ a
    return column


def over_sample_time():
    """Rows of the main table: sample time in ms, choice, residual, gains of noise."""
    for choice in CHOICES:
        for milliseconds in SAMPLE_TIMES:
            with tempfile.TemporaryDirectory() as folder:
                fmu = design(choice, 1e-3 * milliseconds, Path(folder))
                residual = couple(fmu, 1e-3 * milliseconds)
                yield milliseconds, choice, residual, noise_gain(Path(folder) / "design.toml")


def over_communication_step(milliseconds):
    """The residuals of each choice at `milliseconds` for all of `COUPLINGS`."""
    for choice in (CONSTANT, RAMP, WEIGHTED):
        with tempfile.TemporaryDirectory() as folder:
            period = 1e-3 * milliseconds
            fmu = design(choice, period, Path(folder))
            yield choice, [couple(fmu, part * period, how, TRUE_START) for how, part in COUPLINGS]


def shown(residual):
    """The cart's residual in mm."""
    return "falls" if residual is None else f"{residual:.3g}"


def print_rows(rows, head):
    """Prints a table in Markdown."""
    for row in [head, ["---"] * len(head), *rows]:
        print("|", " | ".join(map(str, row)), "|")
    print()


def main():
    """Measures, writes, prints."""
    rows = list(over_sample_time())
    with STEM.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["T_s in ms", "choice", "cart in mm", "N per um", "N per urad"])
        for milliseconds, choice, residual, noise in rows:
            numbers = [f"{number:.6g}" for number in (residual, *noise)]
            table.writerow([milliseconds, choice.label, *numbers])
    of = {choice: [row for row in rows if row[1] == choice] for choice in CHOICES}
    print_rows([[c.label, *(shown(row[2]) for row in of[c])] for c in CHOICES], ["T_s in ms", *SAMPLE_TIMES])
    noises = [[c.label, *("{:.2g} / {:.2g}".format(*row[3]) for row in of[c])] for c in CHOICES]
    print_rows(noises, ["T_s in ms", *SAMPLE_TIMES])
    curves = [Curve(c.label, [(row[0], row[2]) for row in of[c]]) for c in CHOICES]
    STEM.with_suffix(".svg").write_text(log_plot(curves), encoding="utf-8")
    head = ["T_s, choice", *(f"{method} {part:.3g}" for method, part in COUPLINGS)]
    print_rows(
        [
            [f"{milliseconds} ms: {choice.label}", *map(shown, residuals)]
            for milliseconds in (1, 5, 10)
            for choice, residuals in over_communication_step(milliseconds)
        ],
        head,
    )


if __name__ == "__main__":
    main()
