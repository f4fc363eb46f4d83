"""Prints the predicted delays and false alarms of detection.toml beside those of campaign.toml.

    python delays.py REPORT.json FOLDER

REPORT.json is the output of aso-ftc design --json, FOLDER that of aso-ftc campaign. The exit status is 1 if a prediction is
not found again: a mean delay within three standard errors and 3 s, the number of runs up to the 90 % delay and with a false alarm
within their 99.9 % intervals.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow.dataset
from scipy.stats import binom

# From the start of the tests, which is that of the faults, to the end of a run.
DURATION = 500.0


def within(count, runs, probability):
    """Whether a number of runs is in its 99.9 % interval."""
    low, high = binom.interval(0.999, runs, probability)
    return low <= count <= high


def main():
    report, folder = sys.argv[1:]
    report = json.loads(Path(report).read_text(encoding="utf-8"))["detection"]
    runs = pyarrow.dataset.dataset(Path(folder) / "runs").to_table().to_pylist()
    fault_of = {"plant.Q_1": "f_1", "plant.Q_2": "f_2", "controller.y_1": "b_1"}
    names = [fault["fault"] for fault in report["faults"]]
    holds = True
    print("fault  predicted mean  found mean (standard error)  predicted 90 %  runs within  right fault named")
    for connection, name in fault_of.items():
        group = [run for run in runs if run["fault.connection"] == connection]
        delays = np.array([run["delay"] for run in group])
        (fault,) = (fault for fault in report["faults"] if fault["fault"] == name)
        mean, error = delays.mean(), delays.std(ddof=1) / np.sqrt(len(delays))
        soon = int((delays <= fault["delay_90"]).sum())
        right = sum(run["isolated"] == names.index(name) + 1 for run in group)
        holds &= abs(mean - fault["delay"]) < 3 * error + 3 and within(soon, len(group), 0.9)
        print(
            f"{name}  {fault['delay']:.1f} s  {mean:.1f} s ({error:.1f} s)  {fault['delay_90']:.0f} s  {soon} of {len(group)}  "
            f"{right} of {len(group)}"
        )
    group = [run for run in runs if run["fault.connection"] is None]
    alarms = int(sum(run["alarm"] for run in group))
    predicted = 1 - np.exp(-DURATION / report["false_alarm_interval"])
    holds &= within(alarms, len(group), predicted)
    print(f"without a fault: a false alarm within {DURATION:.0f} s in {alarms} of {len(group)} runs, predicted {predicted:.1%}")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
