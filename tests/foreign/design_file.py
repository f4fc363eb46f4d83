"""Controllers with other designs: the design file as text, and the FMU with this file."""

import json
import shutil
import tomllib

from c_abi import Fmu, describe

MATRICES = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"]
LISTS = ["states", "actuators", "measurements", "faults"]
# Entries that a design may omit.
OPTIONAL = ["filter", "sample_time", "estimator"]


def vector(name, count):
    """Names for the channels of a signal."""
    return [name] if count == 1 else [f"{name}[{k + 1}]" for k in range(count)]


def shipped_design(controller):
    """The design file of the shipped controller, as a dictionary."""
    text = (controller.folder / "resources" / "design.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def table(entries):
    """The lines of one TOML table."""
    return [f"{key} = {json.dumps(value)}" for key, value in entries.items()]


def design_text(design):
    """A design in TOML; a matrix may be an array of numpy."""
    stated = [name for name in [*MATRICES, "A_f"] if name in design]
    rows = {name: [list(map(float, row)) for row in design[name]] for name in stated}
    lines = [f"{name} = {row!r}" for name, row in rows.items()]
    general = {key: design[key] for key in ("description", "t_on", "monitor")}
    general |= {key: design[key] for key in OPTIONAL if key in design}
    lines = [*table(general), *lines, "[experiment]", *table(design["experiment"])]
    for name in LISTS:
        for entry in design[name]:
            lines += [f"[[{name}]]", *table(entry)]
    return "\n".join(lines) + "\n"


def redesigned(controller, text, folder):
    """The FMU that the library of `controller` gives for another design file, unpacked."""
    shutil.copytree(controller.folder, folder)
    (folder / "resources" / "design.toml").write_text(text, encoding="utf-8")
    status, xml = describe(controller.library, folder / "resources")
    assert status == 0, xml
    (folder / "modelDescription.xml").write_text(xml, encoding="utf-8")
    return Fmu(folder, controller.library)
