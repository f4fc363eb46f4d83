"""Prints the reference errors of the air data sensor case study in crates/control/tests/claims/isolation.rs.

Reads crates/control/tests/data/air_data_sensors.txt. For each model the static generator that is decoupled from states,
commands, winds and the other fault is the left null space of one matrix, by scipy's singular value decomposition; errors
are H-infinity norms by python-control's linfnorm (SLICOT AB13DD). Needs Python with numpy, scipy, control and slycot.
"""

from pathlib import Path

import control
import numpy as np
import scipy.linalg

FILE = Path(__file__).resolve().parents[2] / "crates/control/tests/data/air_data_sensors.txt"
MODELS, NOMINAL, FAULTS, COMMANDS = 11, 6, (1, 3), 3
LINES = [line for line in FILE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def read(name):
    at = next(k for k, line in enumerate(LINES) if line.split()[0] == name)
    rows = int(LINES[at].split()[1])
    return np.array([[float(x) for x in line.split()] for line in LINES[at + 1 : at + 1 + rows]])


def extended(model):
    """From [u; d; f] to [y; u]."""
    a, b, c, d = (read(f"{letter}_{model + 1}") for letter in "ABCD")
    faults = np.eye(len(c))[:, FAULTS]
    inputs = b.shape[1] + len(FAULTS)
    b = np.hstack([b, np.zeros((len(a), len(FAULTS)))])
    d = np.vstack([np.hstack([d, faults]), np.eye(COMMANDS, inputs)])
    return a, b, np.vstack([c, np.zeros((COMMANDS, len(a)))]), d


def exact_gain(model):
    _, _, c, d = extended(model)
    others = d.shape[1] - len(FAULTS)
    rows = []
    for fault in range(len(FAULTS)):
        decoupled = [j for j in range(d.shape[1]) if j != others + fault]
        null = scipy.linalg.null_space(np.hstack([c, d[:, decoupled]]).T, rcond=1e-9).T
        assert len(null) == 1
        rows.append(null[0] / (null[0] @ d[:, others + fault]))
    return np.array(rows)


def error(model, gain):
    a, b, c, d = extended(model)
    target = np.zeros((len(FAULTS), d.shape[1]))
    target[:, -len(FAULTS) :] = np.eye(len(FAULTS))
    return control.linfnorm(control.ss(a, b, gain @ c, gain @ d - target), tol=1e-9)[0]


gains = [exact_gain(model) for model in range(MODELS)]
print("own gain    ", [f"{error(k, gains[k]):.1e}" for k in range(MODELS)])
print("nominal gain", [f"{error(k, gains[NOMINAL]):.6f}" for k in range(MODELS)])
print("mean gain   ", [f"{error(k, sum(gains) / MODELS):.6f}" for k in range(MODELS)])
