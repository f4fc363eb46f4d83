"""Runs a command with a time limit and keeps the end of its output."""

import os
import signal
import subprocess
import threading
from dataclasses import dataclass

KEPT = 1 << 16  # bytes


@dataclass
class Ended:
    """How a process ended: its exit status, the negative signal number, or None at the time limit."""

    status: int | None
    text: str

    def silent(self):
        """Whether a signal ended it and it printed no error."""
        return self.status is not None and self.status < 0 and "error:" not in self.text

    def why(self):
        """The reason in one line."""
        lines = [line.strip() for line in self.text.splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith("error:")]
        last = (errors or lines or ["no message"])[-1][:300]
        if self.status is None:
            return f"no end within the time limit; last message: {last}"
        if self.status < 0:
            return f"ended by signal {-self.status} ({signal.Signals(-self.status).name}); last message: {last}"
        return f"exit status {self.status}: {last}"


def run(command, limit, folder):
    """Runs a command in a folder, which also holds its temporary files; ends all its processes with it."""
    process = subprocess.Popen(
        [str(part) for part in command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd=folder,
        env={**os.environ, "TMPDIR": str(folder)},
        start_new_session=True,
        bufsize=0,
    )
    output = bytearray()

    def drain():
        while chunk := process.stdout.read(KEPT):
            output.extend(chunk)
            del output[:-KEPT]

    reader = threading.Thread(target=drain, daemon=True)
    reader.start()
    try:
        status = process.wait(limit)
    except subprocess.TimeoutExpired:
        status = None
    finally:
        end_group(process)
    reader.join(5.0)
    return Ended(status, output.decode("utf-8", "replace"))


def end_group(process):
    """Ends the process and those that it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        pass
    process.wait()
