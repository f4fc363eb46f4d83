"""Controllers of other designs: the design file as text, and the FMU that belongs to it."""

import json
import shutil
import tomllib

from c_abi import Fmu, describe

MATRICES = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"]
LISTS = ["states", "actuators", "measurements", "faults"]


def shipped_design(controller):
    """The design file of the shipped controller, as a dictionary."""
    text = (controller.folder / "resources" / "design.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def table(entries):
    """The lines of one TOML table."""
    return [f"{key} = {json.dumps(value)}" for key, value in entries.items()]


def design_text(design):
    """A design in TOML; a matrix may be an array of numpy."""
    rows = {name: [list(map(float, row)) for row in design[name]] for name in MATRICES}
    lines = [f"{name} = {rows[name]!r}" for name in MATRICES]
    general = {key: design[key] for key in ("description", "t_on", "monitor")}
    lines = [*table(general), *lines, "[experiment]", *table(design["experiment"])]
    for name in LISTS:
        for entry in design[name]:
            lines += [f"[[{name}]]", *table(entry)]
    return "\n".join(lines) + "\n"


def redesigned(controller, text, folder):
    """The FMU that the library of `controller` makes of another design file, unpacked."""
    shutil.copytree(controller.folder, folder)
    (folder / "resources" / "design.toml").write_text(text, encoding="utf-8")
    status, xml = describe(controller.library, folder / "resources")
    assert status == 0, xml
    (folder / "modelDescription.xml").write_text(xml, encoding="utf-8")
    return Fmu(folder, controller.library)
