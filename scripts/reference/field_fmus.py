"""Finds FMUs in folders and reads the entries of their descriptions that scripts/reference/field needs."""

import hashlib
import platform
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

PARAMETERS = 10  # that are set in one FMU
RECORDED = 200  # variables that are compared
FOLDERS = {
    ("Linux", "x86_64"): {"linux64", "x86_64-linux"},
    ("Linux", "aarch64"): {"aarch64-linux"},
    ("Windows", "AMD64"): {"win64", "x86_64-windows"},
    ("Darwin", "x86_64"): {"darwin64", "x86_64-darwin"},
    ("Darwin", "arm64"): {"aarch64-darwin", "darwin64"},
}
HERE = FOLDERS.get((platform.system(), platform.machine()), set())


@dataclass
class Fmu:
    """An FMU and the settings of its runs."""

    path: Path
    start: float = 0.0
    stop: float = 1.0
    step: float = 0.002
    compared: list = field(default_factory=list)  # names of outputs; without any, of Real locals
    real_outputs: list = field(default_factory=list)
    parameters: dict = field(default_factory=dict)  # new values by name


def find(folders, only=""):
    """The FMI 2.0 co-simulation FMUs that this platform can run, and how many others there are, by reason."""
    paths = set()
    for folder in folders:
        paths |= set(folder.rglob("*.fmu")) if folder.is_dir() else {folder}
    fmus, left_out, digests = [], Counter(), set()
    for path in sorted(path.resolve() for path in paths if only in str(path)):
        try:
            fmu, content = read(path), hashlib.sha256(path.read_bytes()).digest()
            if content in digests:
                raise LeftOut("that are copies of another")
            digests.add(content)
            fmus.append(fmu)
        except LeftOut as reason:
            left_out[str(reason)] += 1
    return fmus, left_out


class LeftOut(Exception):
    """The reason why an FMU is not compared."""


def read(path):
    """Reads the description; raises LeftOut if the FMU cannot be compared."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = {plain(name): name for name in archive.namelist()}
            root = ElementTree.fromstring(archive.read(names["modelDescription.xml"]))
    except (OSError, KeyError, zipfile.BadZipFile, ElementTree.ParseError, LookupError, ValueError):
        raise LeftOut("without a readable description") from None
    version = root.get("fmiVersion", "")
    if not version.startswith("2"):
        raise LeftOut(f"of FMI {version.split('-')[0]}")
    if root.find("CoSimulation") is None:
        raise LeftOut("that are for model exchange only")
    files = [name for name in names if not name.endswith("/")]
    if not any(name.startswith(f"binaries/{folder}/") for name in files for folder in HERE):
        raise LeftOut("without a library for this platform")
    fmu = Fmu(path)
    experiment(fmu, root.find("DefaultExperiment"))
    variables(fmu, root)
    return fmu


def plain(name):
    """The name of an archive entry with slashes and without a leading `./`."""
    return name.replace("\\", "/").removeprefix("./")


def number(text):
    """A number, or None."""
    try:
        return float(text)
    except (TypeError, ValueError):
        return None


def experiment(fmu, element):
    """Start, stop and step as FMPy chooses them: 1 s and 500 steps if the FMU states nothing."""
    stated = element.attrib if element is not None else {}
    fmu.start = number(stated.get("startTime")) or 0.0
    stop = number(stated.get("stopTime"))
    fmu.stop = stop if stop is not None and stop > fmu.start else fmu.start + 1.0
    fmu.step = number(stated.get("stepSize")) or (fmu.stop - fmu.start) / 500


def variables(fmu, root):
    """The outputs to compare and to connect, and parameters with a value a thousandth above their start value."""
    outputs, local = [], []
    types = {simple_type.get("name"): simple_type.find("Real") for simple_type in root.iter("SimpleType")}
    for variable in root.iter("ScalarVariable"):
        name, causality, real = variable.get("name", ""), variable.get("causality"), variable.find("Real")
        if causality == "output":
            outputs.append(name)
            if real is not None:
                fmu.real_outputs.append(name)
        if causality in (None, "local") and real is not None:
            local.append(name)
        if causality == "parameter" and real is not None and len(fmu.parameters) < PARAMETERS:
            start = number(real.get("start"))
            if start is None or "=" in name:
                continue
            value = start * 1.001 if start else 0.001
            if within(value, real, types.get(real.get("declaredType"))):
                fmu.parameters[name] = value
    fmu.compared = (outputs or local)[:RECORDED]


def within(value, real, declared):
    """Whether the value is within the range of the variable, or else of its type."""
    bounds = {}
    for key in ("min", "max"):
        stated = real.get(key) if real.get(key) is not None or declared is None else declared.get(key)
        bounds[key] = number(stated)
    low, high = bounds["min"], bounds["max"]
    return (low is None or value >= low) and (high is None or value <= high)
