"""The experiment of Patton and Klinkhieo (2009), with the FMUs of this package."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from ._errors import Error
from ._results import Results
from ._system import System

__all__ = ["fmus", "paper", "reproduce"]

# L as printed after equation (21), in thousands, row by row, with the signs of L[3,2] and L[4,2]
# reversed: as printed it makes A_0 - L C_0 unstable. The last row is L_f.
_PRINTED_L = (
    (0.0380, -0.0048),
    (-0.0038, 0.0518),
    (0.3792, 0.1690),
    (-0.1297, 0.8841),
    (-3.3432, 0.8941),
)


def fmus() -> dict[str, Path]:
    """Return the FMUs of this package by name: ``FrictionPendulum``, ``AsoController``, ..."""
    paths = sorted((Path(__file__).parent / "fmus").glob("*.fmu"))
    if not paths:
        raise Error("this installation of aso_ftc has no FMUs", "NoFmus")
    return {path.stem: path for path in paths}


def paper(
    scenario: Literal["paper", "paper-literal", "printed-gains"] = "paper",
) -> System:
    """Return the paper's loop of plant and controller: 100 s at 1 ms, a row every 0.01 s.

    Args:
        scenario: ``"paper"``: the nonlinear plant from x(0) = [0.1, -0.1, 0, 0]; ``"paper-literal"``: the
            linearised plant from the paper's x(0) = [1.1, -1.1, 0, 0]; ``"printed-gains"``: the paper's
            printed L with two signs corrected, which loses the nonlinear plant.
    """
    files = fmus()
    system = System().add("plant", files["FrictionPendulum"]).add("controller", files["AsoController"])
    system.algorithm["step"] = 0.001
    system.experiment["stop-time"] = 100.0
    system.results["every"] = 0.01
    if scenario == "paper-literal":
        system.start_values.update({"plant.linearised": True, "plant.x_p_0": 1.1, "plant.theta_0": -1.1})
    elif scenario == "printed-gains":
        for row, entries in enumerate(_PRINTED_L):
            gain = f"L_x[{row + 1}" if row < 4 else "L_f[1"
            for column, entry in enumerate(entries):
                system.start_values[f"controller.{gain},{column + 1}]"] = 1e3 * entry
    elif scenario != "paper":
        raise ValueError(f"scenario {scenario!r}: expected paper, paper-literal or printed-gains")
    return system


def reproduce(
    scenario: Literal["paper", "paper-literal", "printed-gains"] = "paper", **options: Any
) -> Results:
    """Run the paper's experiment; ``reproduce().plot()`` draws its figures 5 and 6.

    Args:
        scenario: as for :func:`paper`.
        options: as for :meth:`System.run`.
    """
    results = paper(scenario).run(**options)
    results._plot = ("plant.x_p", "plant.theta", "plant.f_fric", "controller.f_hat")
    return results
