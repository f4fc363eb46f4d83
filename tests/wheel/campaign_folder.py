"""Folders of campaigns for the tests of their analysis, written without the engine."""

import json

import numpy as np
import pyarrow
import pyarrow.parquet
from aso_ftc.campaign import load


def write(
    folder,
    design,
    columns,
    measures,
    *,
    unit=None,
    limits=None,
    status=None,
    faults=None,
    parts=3,
    changes=None,
    **more,
):
    """Writes the folder of a campaign: columns of parameters and measures, positions of a sample."""
    names = list(columns)
    runs = len(next(iter(columns.values())))
    numeric = {name: np.asarray(column).dtype.kind in "fi" for name, column in columns.items()}
    manifest = {
        "name": "test",
        "runs": runs,
        "design": design,
        "parameters": [{"name": name, "unit": None, "numeric": numeric[name]} for name in names],
        "faults": faults is not None,
        "measures": {name: {"expression": "last(plant.x_p)", "unit": "m"} for name in measures},
        "limits": limits or {},
        "complete": True,
        **more,
        **(changes or {}),
    }
    (folder / "runs").mkdir(parents=True)
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    plan = {"row": np.arange(runs), **columns}
    for at, name in enumerate(names if unit is not None else []):
        plan[f"unit:{name}"] = unit[:, at]
    pyarrow.parquet.write_table(pyarrow.table(plan), folder / "plan.parquet")
    statuses = np.array(["ok"] * runs, dtype=object) if status is None else np.asarray(status, dtype=object)
    reasons = np.where(statuses == "ok", "", "the FMU ended the process")
    table = pyarrow.table(
        {
            "run": np.arange(runs),
            **columns,
            **(faults or {}),
            **measures,
            "status": statuses,
            "reason": reasons,
        }
        | {"seconds": np.full(runs, 0.1)}
    )
    # The order of the parts is not the order of the runs.
    for part, rows in enumerate(np.array_split(np.random.default_rng(3).permutation(runs), parts)):
        pyarrow.parquet.write_table(table.take(rows), folder / "runs" / f"part-{part:06}.parquet")
    return load(folder)


def ishigami(unit, a=7.0, b=0.1):
    x = (2 * unit - 1) * np.pi
    return np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])


def problem(count):
    return {"num_vars": count, "names": [f"plant.p{i}" for i in range(count)], "bounds": [[0.0, 1.0]] * count}


def campaign(folder, design, unit, function, **more):
    """A campaign whose parameters are the positions of the sample scaled to 0 to 10."""
    columns = {name: 10 * column for name, column in zip(problem(unit.shape[1])["names"], unit.T)}
    return write(folder, design, columns, {"y": function(unit)}, unit=unit, **more)


def random_campaign(folder, values, limit, **more):
    columns = {"p": np.random.default_rng(0).random(len(values))}
    design = more.pop("design", {"method": "random", "seed": 1})
    return write(folder, design, columns, {"y": np.asarray(values, float)}, limits={"y": limit}, **more)


def fault_campaign(folder, limit):
    kinds = ["stuck", "stuck", "stuck", "gain", "gain", "gain", None]
    faults = {
        "fault": ["stuck 0", "stuck 0", "stuck 1", "gain 2", "gain 2", "gain 3", ""],
        "fault.connection": ["a.y", "a.y", "b.y", "a.y", "a.y", "a.y", None],
        "fault.kind": kinds,
        "fault.size": pyarrow.array([None, None, None, 2.0, 2.0, 3.0, None], pyarrow.float64()),
        "fault.from": pyarrow.array([1.0, 1.0, 1.0, 1.0, 1.0, 5.0, None], pyarrow.float64()),
    }
    values = {"y": np.array([1.0, 4.0, np.nan, 2.0, 3.0, 5.0, 99.0])}
    status = ["ok", "ok", "crashed", "ok", "ok", "ok", "ok"]
    columns = {"p": np.array([0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])}
    more = {"limits": {"y": limit}, "status": status, "faults": faults}
    return write(folder, {"method": "random"}, columns, values, **more)
