"""The built command aso-ftc: designs, and columns of results."""

import csv
import json
import subprocess
import tempfile
import tomllib
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
COMMAND = ROOT / "target" / "release" / "aso-ftc"


def design(text, *options):
    """Report and design file for the text of a plant file; a RuntimeError with the message if it is refused."""
    with tempfile.TemporaryDirectory() as folder:
        plant, out = Path(folder, "plant.toml"), Path(folder, "design.toml")
        plant.write_text(text, encoding="utf-8")
        words = [COMMAND, "design", plant, "--out", out, "--json", *options]
        done = subprocess.run(words, capture_output=True, text=True, encoding="utf-8", check=False)
        # Status 1: the verdict on the design is red.
        if done.returncode not in (0, 1):
            raise RuntimeError(done.stderr)
        return json.loads(done.stdout), tomllib.loads(out.read_text(encoding="utf-8"))


def columns(results, names):
    """Columns of a results file as arrays."""
    with results.open(encoding="utf-8") as rows:
        header = next(csv.reader(rows))
        return np.loadtxt(rows, delimiter=",", usecols=[header.index(name) for name in names], unpack=True)
