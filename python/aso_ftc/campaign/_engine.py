"""Does the runs of a campaign with Dask: on processes of this machine, or on any cluster."""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import math
import os
import pickle
import signal
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import numpy as np

from .._core import LiveView
from .._errors import ConfigurationError, Error
from .._progress import draw, has_lines
from ._analysis import MEASURE, NO_VALUE, Outcome, bounds, holds, load, warn_of_measures
from ._campaign import Campaign
from ._folder import Folder, column
from ._packages import package
from ._worker import Job, Row

__all__ = ["Session", "execute"]

# Seconds within which a cluster must have a worker.
_PATIENCE = 60.0
# Tasks that wait for each thread of a worker, so that none waits for the client.
_AHEAD = 2
# Seconds of work that wait for each thread of a cluster, at most so many tasks: an adaptive cluster of Dask starts
# further workers for more than 5 s.
_BACKLOG, _MOST_AHEAD = 10.0, 100
# Seconds after its start before a worker runs anything: Dask does not replace a worker that ends before
# its nanny has noticed its start (Nanny._on_worker_exit, status "starting").
_SETTLING = 1.0
# What a worker without the job says.
_ABSENT = "it has not got the campaign"
# Seconds for which the number of threads of a cluster is taken as known.
_KNOWN = 5.0
_LOGGERS = [
    f"distributed{name}" for name in ("", ".client", ".scheduler", ".nanny", ".worker", ".core", ".batched")
]
# Runs after which a campaign ends, or all of them, if each has failed in a measure.
_TRIED = 10
# Seconds between two looks at the tasks.
_PAUSE = 0.02


def execute(
    campaign: Campaign,
    path: Path,
    *,
    workers: int | None,
    scheduler: str | None,
    progress: bool,
    live: Callable[[str], None] | None = None,
) -> Outcome:
    """Do the runs of a campaign that its folder lacks; see :meth:`Campaign.run`."""

    def perform(work: _Work) -> None:
        with _quiet(), _viewed(work, live), _client(workers, scheduler) as client:
            work.perform(client, scheduler)

    outcome = _outcome(campaign, path, progress, perform)
    warn_of_measures(outcome)
    return outcome


def _outcome(campaign: Campaign, path: Path, progress: bool, perform: Callable[[_Work], None]) -> Outcome:
    """Let ``perform`` do the runs of a campaign that its folder lacks."""
    folder = Folder(path, campaign)
    with folder.locked():
        folder.begin(campaign)
        if not folder.manifest["complete"]:
            work = _Work(campaign, folder, progress)
            if work.open_parts:
                try:
                    perform(work)
                except Error:
                    folder.discard()
                    raise
            work.close()
    return load(folder.path)


class Session:
    """Does several campaigns of one system one after the other, on the same workers.

    They have the job of the first one: they differ in the values of their runs only. The workers start with the
    first run that a folder lacks.
    """

    def __init__(self, workers: int | None, scheduler: str | None) -> None:
        self.workers, self.scheduler = workers, scheduler
        self._open = contextlib.ExitStack()
        self._client: Any = None
        self._name = f"aso-ftc-session-{os.getpid()}-{time.monotonic_ns()}"

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def outcome(self, campaign: Campaign, path: Path) -> Outcome:
        """Do the runs of a campaign that its folder lacks."""
        return _outcome(campaign, path, False, self._perform)

    def _perform(self, work: _Work) -> None:
        if self._client is None:
            self._open.enter_context(_quiet())
            self._client = self._open.enter_context(_client(self.workers, self.scheduler))
            self._open.callback(_forget, self._client, self._name)
            work.prepare(self._client, self._name)
        work.perform(self._client, self.scheduler, self._name)


class _View:
    """The page of a campaign, and what it asks for."""

    def __init__(self, work: _Work) -> None:
        campaign = work.campaign
        self.names = [*campaign.expressions, *campaign.functions]
        self.page = LiveView(campaign.name, work.total, work.progress.count, self.names)
        self.held, self._begin = False, time.monotonic()

    def attend(self) -> None:
        """Do what the page asks for; to stop is the same as Ctrl-C."""
        self.held, stopped = self.page.attend(self.held)
        if stopped:
            raise KeyboardInterrupt

    def show(self, row: Row, finished: int) -> None:
        """Publish a run."""
        values = [float(row.measures.get(name, np.nan)) for name in self.names]
        shown = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.names, values, strict=True))
        line = f"run {row.run}: {row.status}, {row.reason or shown}"
        self.page.publish(finished, time.monotonic() - self._begin, values, row.status, line)


@contextlib.contextmanager
def _viewed(work: _Work, live: Callable[[str], None] | None) -> Iterator[None]:
    """Serve a page while the runs are done; `live` gets its address."""
    if live is None:
        yield
        return
    work.view = view = _View(work)
    live(view.page.address)
    outcome = "The campaign ended early; the same command goes on with it."
    try:
        yield
        outcome = f"All {work.progress.count} runs are done."
    finally:
        view.page.end(outcome)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence Dask's messages: what happens to workers is in the results."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextlib.contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A client of the scheduler at an address, or of local processes."""
    distributed = package("distributed")
    with contextlib.ExitStack() as opened:
        if scheduler is not None:
            if workers is not None:
                raise ConfigurationError("workers are for local processes, a scheduler has its own")
            try:
                client = distributed.Client(scheduler, timeout=10, set_as_default=False)
            except (OSError, ValueError, TimeoutError) as error:
                raise Error(f"no Dask scheduler answers at {scheduler}: {error}", "Scheduler") from None
        else:
            place = opened.enter_context(tempfile.TemporaryDirectory(prefix="aso-ftc-"))
            with _without_interrupts():
                try:
                    cluster = distributed.LocalCluster(
                        n_workers=os.cpu_count() or 1 if workers is None else workers,
                        threads_per_worker=1,
                        processes=True,
                        dashboard_address=":0",
                        local_directory=place,
                        silence_logs=logging.CRITICAL,
                    )
                except RuntimeError:
                    sentence = 'the local workers do not start; a script runs campaigns below `if __name__ == "__main__":`'
                    raise Error(sentence, "Worker") from None
                opened.callback(cluster.close, timeout=10)
            client = distributed.Client(cluster, set_as_default=False)
        try:
            yield client
        finally:
            with contextlib.suppress(Exception):
                client.close(timeout=5)


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let processes that are started here, and by threads that are started here, ignore Ctrl-C.

    A terminal and a notebook send it to all of them, and each worker of Dask would print its traceback. For this
    process it counts at the end of the block.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # It removes the signal from the mask of the thread that starts it.
    resource_tracker.ensure_running()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextlib.contextmanager
def _deferred_interrupt() -> Iterator[None]:
    """Let Ctrl-C count at the end of the block.

    In the middle of a call it may leave a task of Dask half made or half released, which prints a traceback when
    it is deleted.
    """
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        yield
        return
    deferred: list[tuple[int, Any]] = []
    signal.signal(signal.SIGINT, lambda *call: deferred.append(call))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if deferred:
        handler(*deferred[0])


class _Plugin:
    """Keeps the job of a campaign on each worker, also on those that join later.

    Dask calls `setup` once per worker, so that the files travel once.
    """

    def __init__(self, name: str, job: bytes) -> None:
        self.name, self.job = name, job
        self.runner: Any = None
        self.error = ""
        self.ready = 0.0

    def setup(self, worker: Any) -> None:
        self.ready = time.monotonic() + _SETTLING
        # What an FMU says when it fails is in the reason of its run.
        logging.getLogger("aso_ftc").setLevel(logging.CRITICAL)
        try:
            place = Path(worker.local_directory) / "aso-ftc-files"
            self.runner = pickle.loads(self.job).unpack(place)
            self.runner.check()
        except Exception as error:
            self.error = str(error)

    def teardown(self, worker: Any) -> None:
        del worker
        self.runner = None


def _state(name: str, dask_worker: Any) -> str:
    """Runs on a worker: what is wrong with it."""
    plugin = dask_worker.plugins.get(name)
    return _ABSENT if plugin is None else str(plugin.error)


def _do(name: str, *work: Any) -> list[Row]:
    """Runs on a worker: some runs of the campaign."""
    plugin = package("distributed").get_worker().plugins[name]
    if plugin.error:
        raise Error(f"this worker cannot run the campaign: {plugin.error}")
    time.sleep(max(0.0, plugin.ready - time.monotonic()))
    rows: list[Row] = plugin.runner.runs(*work)
    return rows


class _Tasks:
    """The tasks that a cluster has at present, and their runs."""

    def __init__(
        self, client: Any, name: str, work: Callable[[Sequence[int]], tuple[Any, ...]], backlog: float
    ) -> None:
        self.client, self.name, self.work, self.backlog = client, name, work, backlog
        self._futures: dict[Any, list[int]] = {}
        distributed = package("distributed")
        self._waiting = distributed.as_completed(loop=client.loop, with_results=True, raise_errors=False)
        self._threads, self._asked, self._alive = 0, -_KNOWN, time.monotonic()
        # Of the last task that ended.
        self._seconds = _BACKLOG

    def __len__(self) -> int:
        return len(self._futures)

    def _look(self) -> None:
        """Ask for the threads of the cluster, which may grow and shrink."""
        now = time.monotonic()
        if now > self._asked + _KNOWN:
            self._threads, self._asked = sum(self.client.nthreads().values()), now
        if self._threads:
            self._alive = now
        elif now > self._alive + _PATIENCE:
            raise Error(
                f"the scheduler has had no workers for {_PATIENCE:g} s; the same command goes on when there "
                "are some",
                "Scheduler",
            )

    def tasks_to_submit(self) -> int:
        """Return how many tasks keep the cluster busy."""
        self._look()
        ahead = max(_AHEAD, min(_MOST_AHEAD, math.ceil(self.backlog / max(self._seconds, 1e-3))))
        return max(1, self._threads) * (1 + ahead)

    def submit(self, numbers: list[int]) -> None:
        """Hand runs to the cluster as one task."""
        key = f"{self.name}-{numbers[0]}-{len(numbers)}-{time.monotonic_ns()}"
        with _deferred_interrupt():
            future = self.client.submit(_do, self.name, *self.work(numbers), pure=False, key=key)
            self._futures[future] = numbers
            self._waiting.add(future)

    def next(self, attend: Callable[[], None]) -> tuple[list[int], Any]:
        """Wait for a task; return its runs and its rows, its exception, or ``None`` if it was lost."""
        while not self._waiting.has_ready():
            self._look()
            attend()
            time.sleep(_PAUSE)
        with _deferred_interrupt():
            future, result = next(self._waiting)
            numbers, status = self._futures.pop(future), future.status
            future.release()
            del future
        if status == "error":
            return numbers, result[1]
        if not isinstance(result, list):
            return numbers, None
        self._seconds = sum(row.seconds for row in result)
        return numbers, result

    def cancel(self) -> None:
        """Forget all tasks."""
        for future in self._futures:
            future.cancel()


class _Work:
    """The runs of a campaign that are to be done."""

    def __init__(self, campaign: Campaign, folder: Folder, progress: bool) -> None:
        self.campaign, self.folder = campaign, folder
        self.total, self.size = len(campaign), campaign.runs_per_task
        self.done = set(folder.parts())
        self.progress = _Progress(self.total, progress and has_lines())
        for first in self.done:
            self.progress.add(min(self.size, self.total - first), 0)
        # Rows of parts that are not whole yet, by the first run of the part.
        self.rows: dict[int, dict[int, Row]] = {}
        self.last = self.total
        # The tasks so far if each of their runs failed in a measure; `None` if one did not.
        self.unmeasured: list[Sequence[Row]] | None = None if self.done else []
        self.view: _View | None = None
        self._stopper = _Stopper(campaign) if campaign.stop else None
        self._advance()

    @property
    def open_parts(self) -> list[int]:
        """The first runs of the parts that are not done."""
        return [first for first in range(0, self.last, self.size) if first not in self.done]

    def _numbers(self, first: int) -> list[int]:
        return list(range(first, min(first + self.size, self.total)))

    def perform(self, client: Any, scheduler: str | None, prepared: str | None = None) -> None:
        """Do the runs on a cluster, prepared under a name or now, and write each part when it is whole."""
        distributed = package("distributed")
        name = prepared or f"aso-ftc-{self.folder.manifest['identity'][:16]}"
        gone = Error(
            f"the scheduler {scheduler or 'of the local workers'} was lost; finished runs are in "
            f"{self.folder.path}, and the same command goes on",
            "Scheduler",
        )
        try:
            if prepared is None:
                self.prepare(client, name)
            # What waits is done before a pause, so a page keeps it short.
            backlog = _BACKLOG if scheduler is not None and self.view is None else 0.0
            tasks = _Tasks(client, name, self._task, backlog)
            left, suspects = iter(self.open_parts), deque[int]()
            while True:
                self._attend()
                if self._is_held() and not tasks:
                    time.sleep(_PAUSE)
                    continue
                while not self._is_held() and len(tasks) < tasks.tasks_to_submit() and (first := next(left, self.last)) < self.last:
                    tasks.submit(self._numbers(first))
                # One run of a task may have ended its worker. Each runs alone, so that none is blamed for another.
                if not tasks and suspects:
                    tasks.submit([suspects.popleft()])
                if not tasks:
                    break
                numbers, result = tasks.next(self._attend)
                if isinstance(result, distributed.KilledWorker) and len(numbers) > 1:
                    suspects.extend(numbers)
                    continue
                if isinstance(result, distributed.KilledWorker):
                    result = [_lost(numbers[0], self.campaign.unfinished)]
                elif not isinstance(result, list):
                    raise gone if result is None else _of_worker(result)
                for rows in self._with_measures(result):
                    self._accept(rows)
                # The parts before an early end are done.
                if self.last < self.total:
                    tasks.cancel()
                    break
        except (distributed.comm.CommClosedError, OSError, TimeoutError) as error:
            if isinstance(error, Error):
                raise
            raise gone from error
        except RuntimeError as error:
            if client.status in ("closed", "closing", "connecting"):
                raise gone from error
            raise
        finally:
            self.progress.close()
            if prepared is None:
                _forget(client, name)

    def prepare(self, client: Any, name: str) -> None:
        """Give the job to all workers, and ask each whether it can run it."""
        plugin = _plugin(name, package("cloudpickle").dumps(Job.of(self.campaign)))
        try:
            client.register_plugin(plugin, name=name)
        except (package("distributed").comm.CommClosedError, OSError):
            # A worker left while it got the job. The scheduler has it for the others, which may still be getting it.
            if client.status != "running":
                raise
        with _deferred_interrupt():
            # An adaptive cluster starts its first worker for a task.
            first = client.submit(int, pure=False)
        try:
            first.result(timeout=_PATIENCE)
        except TimeoutError:
            raise Error(
                f"the scheduler has no workers within {_PATIENCE:g} s: start some", "Scheduler"
            ) from None
        end = time.monotonic() + _PATIENCE
        while _ABSENT in (states := client.run(_state, name, on_error="ignore")).values() and time.monotonic() < end:
            time.sleep(_PAUSE)
        for worker, wrong in states.items():
            if wrong:
                raise Error(f"worker {worker}: {wrong}", "Worker", {"worker": worker})
        # Dask's page needs the package bokeh.
        if self.progress.shown and importlib.util.find_spec("bokeh"):
            print(f"dashboard: {client.dashboard_link}", file=sys.stderr)

    def _attend(self) -> None:
        if self.view is not None:
            self.view.attend()

    def _is_held(self) -> bool:
        return self.view is not None and self.view.held

    def _task(self, numbers: Sequence[int]) -> tuple[list[int], dict[str, list[Any]], list[int]]:
        rows = [self.campaign.plan.row(number) for number in numbers]
        names = [parameter.name for parameter in self.campaign.parameters]
        return (
            list(numbers),
            {name: [row[0][name] for row in rows] for name in names},
            [row[1] for row in rows],
        )

    def _with_measures(self, rows: Sequence[Row]) -> list[Sequence[Row]]:
        """Return the tasks to accept: none while each run so far has failed in a measure, which ends the campaign soon."""
        if self.unmeasured is None:
            return [rows]
        self.unmeasured.append(rows)
        if not all(row.reason.startswith(MEASURE) for row in rows):
            tasks, self.unmeasured = self.unmeasured, None
            return tasks
        count = sum(map(len, self.unmeasured))
        if count < min(_TRIED, self.total):
            return []
        which = "the only run" if self.total == 1 else f"each of the first {count} runs"
        raise Error(f"{rows[0].reason}, in {which}: correct the measure and start again; {NO_VALUE}", "Measure")

    def _accept(self, rows: Sequence[Row]) -> None:
        first = rows[0].run - rows[0].run % self.size
        part = self.rows.setdefault(first, {})
        before = len(part)
        for row in rows:
            if row.signals is not None:
                self.folder.write_signals(row.run, row.signals)
                row.signals = None
            part[row.run] = row
            if self.view is not None:
                self.view.show(row, self.progress.count + len(part) - before)
        self.progress.add(len(rows), sum(row.status != "ok" for row in rows))
        numbers = self._numbers(first)
        if len(part) == len(numbers):
            self.folder.write_part(first, self._table([part[number] for number in numbers]))
            del self.rows[first]
            self.done.add(first)
            self._advance()

    def _table(self, rows: Sequence[Row]) -> Any:
        arrow = package("pyarrow")
        campaign = self.campaign
        plan_rows = [campaign.plan.row(row.run) for row in rows]
        columns: dict[str, Any] = {"run": arrow.array([row.run for row in rows], arrow.int64())}
        for parameter in campaign.parameters:
            columns[parameter.name] = column(parameter.kind, [plan_row[0][parameter.name] for plan_row in plan_rows])
        if campaign.cases:
            cases = [campaign.plan.faults[plan_row[1]] for plan_row in plan_rows]
            for name, values, kind in (
                ("fault", [case.label for case in cases], arrow.string()),
                ("fault.connection", [case.connection for case in cases], arrow.string()),
                ("fault.kind", [case.kind for case in cases], arrow.string()),
                ("fault.size", [case.size for case in cases], arrow.float64()),
                ("fault.from", [case.start for case in cases], arrow.float64()),
            ):
                columns[name] = arrow.array(values, kind)
        for name in [*campaign.expressions, *campaign.functions]:
            columns[name] = arrow.array([row.measures.get(name, np.nan) for row in rows], arrow.float64())
        columns["status"] = arrow.array([row.status for row in rows], arrow.string())
        columns["reason"] = arrow.array([row.reason for row in rows], arrow.string())
        columns["seconds"] = arrow.array([row.seconds for row in rows], arrow.float64())
        return arrow.table(columns)

    def _advance(self) -> None:
        """End the campaign where its interval is narrow enough: at a part, whatever workers there are."""
        while self._stopper is not None and self._stopper.next in self.done:
            if self._stopper.take(self.folder.part(self._stopper.next)):
                self.last, self._stopper = min(self._stopper.next, self.total), None

    def close(self) -> None:
        """Remove parts behind the end of a campaign that ended early, and state that it is complete."""
        for first in sorted(self.done):
            if first >= self.last:
                self.folder.part(first).unlink(missing_ok=True)
        for path in (self.folder.path / "signals").glob("run-*.parquet"):
            if int(path.stem[4:]) >= self.last:
                path.unlink(missing_ok=True)
        self.folder.finish(min(self.last, self.total))


class _Stopper:
    """Reads parts in their order and says when the interval of a limit is narrow enough."""

    def __init__(self, campaign: Campaign) -> None:
        self.stopping, self.limit = campaign.stop, campaign.limits[campaign.stop["limit"]]
        self.size = campaign.runs_per_task
        # The first run of the next part.
        self.next = self.runs = self.failures = 0

    def take(self, part: Path) -> bool:
        """Count the runs of the next part."""
        table = package("pyarrow.parquet").read_table(part, columns=[self.stopping["limit"], "status"])
        pairs = zip(table[self.stopping["limit"]].to_pylist(), table["status"].to_pylist(), strict=True)
        bad = sum(status != "ok" or not holds(self.limit, value) for value, status in pairs)
        self.runs, self.failures = self.runs + table.num_rows, self.failures + bad
        self.next += self.size
        low, high = bounds(self.failures, self.runs, self.stopping["confidence"])
        return bool(high - low <= self.stopping["width"])


def _plugin(name: str, job: bytes) -> Any:
    """Return the plugin, of the class that Dask expects."""
    base = package("distributed").diagnostics.plugin.WorkerPlugin
    plugin = type("CampaignPlugin", (_Plugin, base), {"idempotent": True})
    return plugin(name, job)


def _forget(client: Any, name: str) -> None:
    """Take the job with this name from all workers and the scheduler."""
    with contextlib.suppress(Exception):
        if client.status == "running":
            client.unregister_worker_plugin(name)


def _of_worker(error: BaseException) -> Error:
    return error if isinstance(error, Error) else Error(f"a worker failed: {error}", "Worker")


def _lost(run: int, measures: Mapping[str, float]) -> Row:
    reason = (
        "its worker ended several times during the run (an FMU crashed, too little memory, or killed): "
        "isolate = true gives each FMU a process of its own"
    )
    return Row(run, dict(measures), "worker lost", reason)


class _Progress:
    """One line on a terminal or in a notebook."""

    def __init__(self, total: int, shown: bool) -> None:
        self.total, self.shown = total, shown
        self.count = self.bad = 0
        self._begin, self._drawn, self._known = time.monotonic(), 0.0, 0

    def add(self, runs: int, bad: int) -> None:
        """Count runs; draws at most five times a second."""
        self.count, self.bad = self.count + runs, self.bad + bad
        now = time.monotonic()
        if not self.shown or (now - self._drawn < 0.2 and self.count < self.total):
            return
        self._drawn = now
        if not self._known:
            self._known, self._begin = self.count, now
        rate = (self.count - self._known) / (now - self._begin) if now > self._begin else 0.0
        left = f", {rate:.1f} runs/s, {(self.total - self.count) / rate:.0f} s left" if rate > 0 else ""
        bad_text = f", {self.bad} did not finish" if self.bad else ""
        draw(f"{self.count} of {self.total} runs{bad_text}{left}")

    def close(self) -> None:
        """End the line."""
        if self.shown:
            print(file=sys.stderr)
