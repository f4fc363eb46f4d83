#!/usr/bin/env python3
"""Draws docs/figures/campaign_pendulum.svg from the results of docs/how-to/campaigns/pendulum.toml.

    python scripts/campaign_figure.py results/pendulum

Needs the Python package aso-ftc with its extra campaign, and matplotlib.
"""

import sys
from pathlib import Path

import aso_ftc as af
import matplotlib
import numpy as np

OUT = Path(__file__).resolve().parents[1] / "docs" / "figures" / "campaign_pendulum.svg"


def main():
    """Maps of the fraction of runs that keep the cart within 1 mm, over pairs of parameters."""
    matplotlib.use("svg")
    # The same bytes for the same numbers.
    matplotlib.rcParams["svg.hashsalt"] = "aso-ftc"
    from matplotlib import pyplot

    table = af.campaign.load(sys.argv[1]).table
    kept = table["kept"].to_numpy()
    figure, panels = pyplot.subplots(1, 2, figsize=(9, 3.6), layout="constrained", sharey=True)
    pairs = (("plant.F_s", "static friction in N", 1.0), ("noise.deviation", "measurement noise in um, urad", 1e6))
    for panel, (name, label, factor) in zip(panels, pairs, strict=True):
        x, y = table[name].to_numpy() * factor, table["T"].to_numpy() * 1e3
        edges = [np.geomspace(values.min(), values.max(), 19) for values in (x, y)]
        runs, _, _ = np.histogram2d(x, y, bins=edges)
        inside, _, _ = np.histogram2d(x, y, bins=edges, weights=kept)
        with np.errstate(invalid="ignore"):
            mesh = panel.pcolormesh(*edges, (inside / runs).T, vmin=0, vmax=1, cmap="cividis")
        panel.set(xlabel=label, yscale="log", xscale="log" if "noise" in name else "linear")
    panels[0].set_ylabel("sample time in ms")
    ticks = [0.5, 0.7, 1.0, 1.4, 2.0]
    panels[0].set_yticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
    panels[0].minorticks_off()
    figure.colorbar(mesh, ax=panels, label="part of the runs within 1 mm")
    figure.savefig(OUT, metadata={"Date": None})
    print(OUT)


if __name__ == "__main__":
    main()
