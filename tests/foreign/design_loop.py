"""From a plant file to a run in FMPy: `aso-ftc design --fmu`, then scripts/reference/couple_with_fmpy.py."""

import json
import tomllib
from pathlib import Path

import numpy as np
from fmpy import extract
from fmpy.validation import validate_fmu

from conftest import ROOT

EXAMPLES = {"DcServo": "dc-servo", "ThreeTank": "three-tank"}


def packed_plant(aso_ftc, name):
    """Returns the packed FMU of a plant, at the path that the plant files state."""
    path = ROOT / "dist" / f"{name}.fmu"
    if not path.is_file():
        done = aso_ftc("pack", ROOT / "examples" / EXAMPLES[name])
        assert done.returncode == 0, done.stderr
    return path


def changed(plant_file, folder, *changes):
    """Copies a plant file into `folder` and replaces texts in it."""
    text = (ROOT / plant_file).read_text(encoding="utf-8")
    for old, new in [("../../dist", str(ROOT / "dist")), *changes]:
        assert old in text or old == "../../dist", old
        text = text.replace(old, new)
    path = Path(folder) / "plant.toml"
    path.write_text(text, encoding="utf-8")
    return path


class Designed:
    """Files in `folder` and output of `aso-ftc design PLANT_FILE --fmu`."""

    def __init__(self, aso_ftc, plant_file, folder, options=()):
        self.folder, self.fmu = Path(folder), Path(folder) / "Designed.fmu"
        file = self.folder / "design.toml"
        outputs = ("--out", file, "--report", self.folder / "report.html", "--fmu", self.fmu, "--json")
        done = aso_ftc("design", ROOT / plant_file, *outputs, *options)
        assert done.returncode in (0, 1), done.stderr
        self.report = json.loads(done.stdout)
        assert done.returncode == (self.report["verdict"]["level"] == "red")
        self.plant_file = tomllib.loads((ROOT / plant_file).read_text(encoding="utf-8"))
        self.design = tomllib.loads(file.read_text(encoding="utf-8"))
        self.page = (self.folder / "report.html").read_text(encoding="utf-8")

    def must_be_sound(self):
        """Checks that all checks of the design hold, FMPy accepts the FMU, and the report exists, also in the FMU."""
        assert all(check["holds"] for check in self.report["checks"])
        assert validate_fmu(str(self.fmu)) == []
        unpacked = Path(extract(str(self.fmu), unzipdir=str(self.folder / "unpacked")))
        inside = unpacked / "documentation" / "report.html"
        assert inside.read_text(encoding="utf-8") == self.page
        assert self.page.startswith("<!DOCTYPE html>") and self.report["description"] in self.page
        text = (unpacked / "resources" / "design.toml").read_text(encoding="utf-8")
        assert tomllib.loads(text) == self.design

    def estimate(self, name):
        """The qualified name of the estimate of a fault."""
        names = [fault["name"] for fault in self.design["faults"]]
        return qualified("f_hat", names.index(name), len(names))

    def loss(self, name):
        """The qualified name of the estimate of a loss of effectiveness."""
        names = [fault["name"] for fault in self.design["faults"]]
        return qualified("E_hat", names.index(name), len(names))

    def response(self, fault, name):
        """The report's curve of `name` after a jump of `fault`, and the size of this jump."""
        jumps = [steps for steps in self.report["steps"] if steps["rate"] is None]
        (steps,) = (steps for steps in jumps if steps["fault"] == fault)
        (curve,) = (curve for curve in steps["curves"] if curve["name"] == name)
        return curve, steps["size"]

    def settling_time(self, fault):
        """The time, by the report, after which the estimate of `fault` stays within 2 % of a change."""
        return self.response(fault, f"error of {fault}")[0]["settling_time"]


def qualified(letter, position, count):
    """The name of channel number `position`, from 0, of a signal of the controller."""
    return f"controller.{letter}" if count == 1 else f"controller.{letter}[{position + 1}]"


def coupled(python, designed, plant, settings, *arguments):
    """Runs plant and controller in FMPy; returns columns by name and the summary."""
    out = designed.folder / "results.csv"
    stated = [text for name, value in settings.items() for text in ("--set", f"{name}={value}")]
    done = python(
        ROOT / "scripts" / "reference" / "couple_with_fmpy.py",
        *("--plant", plant, "--controller", designed.fmu, "--out", out, "--record-every", "1e-9"),
        *(*stated, *arguments),
    )
    assert done.returncode == 0, done.stderr
    names = out.read_text(encoding="utf-8").split("\n", 1)[0].split(",")
    table = dict(zip(names, np.loadtxt(out, delimiter=",", skiprows=1).T))
    return table, json.loads(done.stdout)
