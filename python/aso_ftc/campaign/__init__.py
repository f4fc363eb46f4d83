"""Campaigns: many runs of one system, on the processors of this machine or on a cluster.

>>> import aso_ftc as af
>>> campaign = af.campaign.Campaign(
...     "paper",
...     experiment={"stop-time": 1.0},
...     parameters={"plant.F_c": {"from": 20.0, "to": 30.0, "steps": 3}},
...     measures={"peak": "max(abs(plant.x_p))"},
... )
>>> len(campaign)
3

``campaign.run(folder)`` does the runs, ``load(folder)`` reads their results.
"""

from __future__ import annotations

from ._analysis import Outcome, Probability, load
from ._campaign import Campaign

__all__ = ["Campaign", "Outcome", "Probability", "load"]


def __dir__() -> list[str]:
    return sorted(__all__)
