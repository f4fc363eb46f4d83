"""Measures the processor time that the client of a campaign needs, with many simulated workers.

The scheduler and its workers are threads of this process; a worker sleeps for the time of its runs and returns their
rows. The client is another process, whose processor time is printed: plan, tasks, files, and the results at the end.

    python scripts/bench/campaign_client.py [--workers 200] [--runs 40000] [--runs-per-task 40] [--seconds 0.1]

Needs the Python package with its extra `campaign`.
"""

import argparse
import logging
import subprocess
import sys
import tempfile
import time

import dask
from aso_ftc.campaign import _worker
from distributed import LocalCluster

# What each worker does beside its runs, which would keep one process busy for many of them.
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.interval": "1h",
    "distributed.worker.memory.monitor-interval": "1h",
    "distributed.worker.memory.terminate": False,
}
CLIENT = """
import sys, time
from aso_ftc.campaign import Campaign

folder, address, runs, size = sys.argv[1:]
campaign = Campaign(
    "paper",
    parameters={"plant.F_c": {"relative": 0.2}, "plant.M": {"relative": 0.1}},
    design={"method": "latin-hypercube", "runs": int(runs)},
    measures={"peak": "max(abs(plant.x_p))", "last": "last(plant.x_p)"},
    runs_per_task=int(size),
)
begin, wall = time.process_time(), time.perf_counter()
outcome = campaign.run(folder, scheduler=address, progress=False)
assert outcome.statuses == {"ok": int(runs)}
print(time.process_time() - begin, time.perf_counter() - wall)
"""


def main() -> None:
    """Prints processor time of the client for each run and each task, and the time of the campaign."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=200)
    parser.add_argument("--runs", type=int, default=40_000)
    parser.add_argument("--runs-per-task", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=0.1, help="time of a run")
    options = parser.parse_args()

    class Runner:
        """A worker without FMUs."""

        def check(self) -> None:
            """There is nothing to open."""

        def runs(self, numbers, values, cases):
            """Sleep, and return a row for each run."""
            del values, cases
            time.sleep(options.seconds * len(numbers))
            return [_worker.Row(run, {"peak": 0.1, "last": 0.1}, seconds=options.seconds) for run in numbers]

    _worker.Job.unpack = lambda job, folder: Runner()
    with (
        dask.config.set(QUIET),
        tempfile.TemporaryDirectory() as folder,
        LocalCluster(
            n_workers=options.workers, threads_per_worker=1, processes=False, protocol="tcp://", dashboard_address=":0",
            local_directory=folder, silence_logs=logging.CRITICAL,
        ) as cluster,
    ):
        words = [sys.executable, "-c", CLIENT, f"{folder}/out", cluster.scheduler_address, str(options.runs), str(options.runs_per_task)]
        client = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True)
    processor, wall = map(float, client.stdout.split())
    tasks = -(-options.runs // options.runs_per_task)
    print(
        f"{options.workers} workers, {options.runs} runs of {options.seconds} s in {tasks} tasks: {wall:.1f} s; client "
        f"{processor:.2f} s: {1e6 * processor / options.runs:.0f} us for a run, {1e3 * processor / tasks:.1f} ms for a task"
    )


if __name__ == "__main__":
    main()
