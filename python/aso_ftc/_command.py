"""The command aso-ftc inside of the package."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from ._errors import Error

__all__ = ["command", "main"]


def _path() -> Path:
    name = "aso-ftc.exe" if os.name == "nt" else "aso-ftc"
    return Path(__file__).parent / "bin" / name


def command() -> Path:
    """Return the path of the command ``aso-ftc``, which is also the process of an isolated FMU."""
    path = _path()
    if not path.is_file():
        raise Error(f"this installation of aso_ftc has no command {path}", "NoCommand")
    return path


def main() -> int:
    """Run the command with the arguments of this process; campaigns are done by this package."""
    if sys.argv[1:2] == ["campaign"]:
        from .campaign._command import main as campaign

        return campaign(sys.argv[2:])
    arguments = [str(command()), *sys.argv[1:]]
    if os.name == "nt":
        return subprocess.run(arguments, check=False).returncode
    os.execv(arguments[0], arguments)
