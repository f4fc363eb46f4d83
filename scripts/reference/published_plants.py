"""Compares designs for published plants with those by scipy's place_poles, as a table in Markdown.

    python scripts/reference/published_plants.py [PLANT.toml ...]

The plants are those of examples/plants; the same eigenvalues are placed by `aso-ftc design` and by scipy (KNV0 and YT;
feedback and augmented observer by the same method, of which the lower figure counts). The gain is the 2-norm of K_x, the conditions
are those of the eigenvectors of length one of feedback and observer, and the peaks of S are largest singular values at the commands and the
measurements, in the units of the plant file. All figures of both designs are computed here, from the gains. Sampled designs have
the sample times below. For the plants of examples/plants a second table has the designs without requirements. Needs
target/release/aso-ftc and Python 3.11 with numpy and scipy.
"""

import json
import re
import subprocess
import sys
import tempfile
import tomllib
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reference_placement import METHODS, ROOT, Plant, placed

SAMPLE_TIMES = {
    "airc": 0.3,
    "distillation": 0.5,
    "f16": 0.02,
    "quadrotor": 0.01,
    "quadruple-tank": 0.5,
    "quadruple-tank-nonminimum-phase": 2.0,
    "two-mass-drive": 0.001,
    "unstable-reactor": 0.02,
}
SAMPLE_TIME = 0.05  # of other plants


@dataclass(frozen=True)
class Figures:
    """What a design is compared by: gain of the feedback, conditions, peaks of S."""

    gain: float
    feedback: float
    observer: float
    input: float
    output: float


def condition(matrix):
    """The condition of the eigenvectors of length one."""
    return np.linalg.cond(np.linalg.eig(matrix)[1])


def figures(plant, k, l):
    """Those of the gains of `u = -k x_hat - f_hat` and of the observer with the correction `l`."""
    (_, a, b, *_), (_, a_0, c_0, *_) = plant.pairs()
    return Figures(
        np.linalg.norm(k, 2), condition(a - b @ k), condition(a_0 - c_0 @ l.T), *plant.peaks_of(k, l)
    )


def by_scipy(plant):
    """The lowest of each figure over the methods that reach the eigenvalues, or None."""
    (_, *feedback), (_, *observer) = plant.pairs()
    gains, observers = placed(*feedback[:3]), placed(*observer[:3])
    candidates = [figures(plant, gains[one][0], observers[one][0].T) for one in METHODS if one in gains and one in observers]
    return Figures(*(min(values) for values in zip(*(vars(one).values() for one in candidates)))) if candidates else None


def designed(file, sample_time, requirements=True):
    """The report of the command, for a sampled design if `sample_time` is not zero."""
    with tempfile.TemporaryDirectory() as folder:
        stated = file.read_text(encoding="utf-8")
        if not requirements:
            stated = re.sub(r"^(feedback|observer)\.eigenvalues = \[.*?\]$", "", stated, flags=re.MULTILINE | re.DOTALL)
        if sample_time:
            stated = f"sample_time = {sample_time}\n" + stated
        copy = Path(folder, file.name)
        copy.write_text(stated, encoding="utf-8")
        command = [ROOT / "target" / "release" / "aso-ftc", "design", copy, "--out", Path(folder, "design.toml"), "--json"]
        command += ["--certificate-time", "0"]  # The tables have no proofs.
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):
            sys.exit(done.stderr)
        return json.loads(done.stdout)


def compared(file, sampled):
    """The report of our design, its figures, and those by scipy."""
    stated = tomllib.loads(file.read_text(encoding="utf-8"))
    data = {
        **stated,
        "controller_eigenvalues": stated["feedback"]["eigenvalues"],
        "observer_eigenvalues": stated["observer"]["eigenvalues"],
        "sample_time": SAMPLE_TIMES.get(file.stem, SAMPLE_TIME),
        "current_estimator": True,
    }
    plant = Plant(file.stem, data, sampled)
    report = designed(file, plant.sample_time)
    matrix = {one["name"]: np.array(one["values"]) for one in report["gains"]}
    design = figures(plant, -matrix["K_x"], np.vstack([matrix["L_x"], matrix["L_f"]]))
    return report, design, by_scipy(plant)


def pair(value, scipy):
    return f"{value:.3g} / {scipy:.3g}" if scipy is not None else f"{value:.3g} / -"


def stable(report):
    part = report["robustness"]["tolerance"]["stable"]
    return "-" if part is None else f"{100 * part:.0f} %"


def row(file, sampled):
    report, design, scipy = compared(file, sampled)
    values = [pair(value, getattr(scipy, name, None)) for name, value in vars(design).items()]
    disks = [point["together"]["alpha"] for point in report["robustness"]["points"]]
    name = file.stem + (f", {SAMPLE_TIMES.get(file.stem, SAMPLE_TIME)} s" if sampled else "")
    return [name, *values, f"{min(disks):.2g}", stable(report), report["verdict"]["level"]]


def chosen(file, sampled):
    """The design without requirements: the bandwidths in rad/s, and how it is judged."""
    sample_time = SAMPLE_TIMES.get(file.stem, SAMPLE_TIME) if sampled else 0
    report = designed(file, sample_time, requirements=False)
    methods = [report[part]["method"] for part in ("feedback", "observer")]
    rates = [re.search(r"bandwidth of (\S+)", method)[1] for method in methods]
    peaks = [f"{point['judged']:.3g}" for point in report["robustness"]["points"]]
    name = file.stem + (f", {sample_time} s" if sampled else "")
    return [name, *rates, *peaks, stable(report), report["verdict"]["level"]]


def table(heads, rows):
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for cells in rows:
        print("| " + " | ".join(cells) + " |", flush=True)


def main():
    warnings.simplefilter("ignore")
    files = [Path(name) for name in sys.argv[1:]] or sorted((ROOT / "examples" / "plants").glob("*.toml"))
    heads = ["plant", "gain", "condition, feedback", "condition, observer", "peak of S, commands", "peak of S, measurements"]
    heads += ["disk margin", "stable within ±10 %", "verdict"]
    table(heads, (row(file, sampled) for file in files for sampled in [False, True]))
    if sys.argv[1:]:
        return
    heads = ["plant", "bandwidth, feedback", "bandwidth, observer", "peak of S, commands", "peak of S, measurements"]
    heads += ["stable within ±10 %", "verdict"]
    print()
    table(heads, (chosen(file, sampled) for file in files for sampled in [False, True]))


if __name__ == "__main__":
    main()
