#!/usr/bin/env python3
"""Draws docs/figures/campaign_pendulum.svg from the results of docs/how-to/campaigns/pendulum.toml.

    python scripts/study/campaign_figure.py results/pendulum

Needs the Python package aso-ftc with its extra campaign, and matplotlib.
"""

import sys
from pathlib import Path

import aso_ftc as af
import matplotlib
import numpy as np

OUT = Path(__file__).resolve().parents[2] / "docs" / "figures" / "campaign_pendulum.svg"


def main():
    """Maps of the fraction of runs in which the cart stays within 1 mm, and in which nothing falls."""
    matplotlib.use("svg")
    # The same bytes for the same numbers.
    matplotlib.rcParams["svg.hashsalt"] = "aso-ftc"
    from matplotlib import pyplot

    table = af.campaign.load(sys.argv[1]).table
    finished = (table["status"] == "ok").to_numpy().astype(float)
    figure, panels = pyplot.subplots(1, 2, figsize=(9, 3.6), layout="constrained", sharey=True)
    views = (
        ("plant.F_s", "static friction in N", "cart within 1 mm", table["kept"].to_numpy()),
        ("plant.m", "mass of the pendulum in kg", "pendulum does not fall", finished),
    )
    for panel, (name, label, title, weights) in zip(panels, views, strict=True):
        x, y = table[name].to_numpy(), table["T"].to_numpy() * 1e3
        edges = [np.geomspace(values.min(), values.max(), 15) for values in (x, y)]
        runs, _, _ = np.histogram2d(x, y, bins=edges)
        inside, _, _ = np.histogram2d(x, y, bins=edges, weights=weights)
        with np.errstate(invalid="ignore"):
            mesh = panel.pcolormesh(*edges, (inside / runs).T, vmin=0, vmax=1, cmap="cividis")
        panel.set(xlabel=label, title=title, yscale="log")
    panels[0].set_ylabel("sample time in ms")
    ticks = [0.5, 0.7, 0.9, 1.2, 1.6]
    panels[0].set_yticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
    panels[0].minorticks_off()
    figure.colorbar(mesh, ax=panels, label="part of the runs")
    figure.savefig(OUT, metadata={"Date": None})
    print(OUT)


if __name__ == "__main__":
    main()
