"""The JSON of `aso-ftc design --json` is what docs/reference/design.schema.json describes."""

import json

import pytest
from jsonschema import Draft202012Validator

from conftest import ROOT
from design_loop import packed_plant

SCHEMA = json.loads((ROOT / "docs/reference/design.schema.json").read_text(encoding="utf-8"))
EXAMPLES = [
    "fmu-controller/pendulum.toml",
    "examples/dc-servo/ramp.toml",
    "examples/three-tank/plant.toml",
    "examples/three-tank/loss-of-effectiveness.toml",
    "examples/three-tank/sensor-fault.toml",
    "examples/three-tank/reference.toml",
]
# A lag: no margin has a limit but those of the disk. Then a region; then a loop that is not stable with its commands.
SMALL = """A = [[-1.5]]
B = [[1]]
C = [[1]]
F_a = [[1]]
faults = [{ name = "f", bound = 2, rate_bound = 3 }]
feedback.region = { disc = { center = -3, radius = 1 } }
observer.h_infinity = "least"
observer.region = { disc = { center = -6, radius = 4 }, decay = 1, sector = 60 }
"""


def report(aso_ftc, file, folder, *options):
    """The JSON of a design."""
    done = aso_ftc("design", file, "--out", folder / "design.toml", "--json", *options)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def reports(aso_ftc, tmp_path_factory):
    """Reports of all kinds of designs, by name."""
    folder = tmp_path_factory.mktemp("reports")
    for plant in ("DcServo", "ThreeTank"):
        packed_plant(aso_ftc, plant)
    table = {file: report(aso_ftc, ROOT / file, folder / str(k)) for k, file in enumerate(EXAMPLES)}
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    table["small"] = report(aso_ftc, folder / "small.toml", folder / "small", "--fmu", folder / "Small.fmu")
    return table


def test_the_schema_is_a_schema():
    Draft202012Validator.check_schema(SCHEMA)


def test_reports_of_all_kinds_are_valid(reports):
    validator = Draft202012Validator(SCHEMA)
    for name, document in reports.items():
        problems = [f"{name}: {error.json_path}: {error.message}" for error in validator.iter_errors(document)]
        assert not problems, problems[:5]
    assert reports["small"]["interface"] and reports["examples/three-tank/plant.toml"]["sampling"]


def test_a_report_with_a_missing_or_another_property_is_not_valid(reports):
    validator = Draft202012Validator(SCHEMA)
    for path in ([], ["verdict"], ["robustness"], ["robustness", "points", 0], ["steps", 0, "curves", 0]):
        whole = json.loads(json.dumps(reports["small"]))
        inner = whole
        for key in path:
            inner = inner[key]
        name, value = next(iter(inner.items()))
        inner["other"] = value
        assert not validator.is_valid(whole)
        del inner["other"], inner[name]
        assert not validator.is_valid(whole)


def test_every_property_has_a_description():
    definitions = [SCHEMA, *SCHEMA["$defs"].values()]
    for definition in definitions:
        for name, entry in definition.get("properties", {}).items():
            assert entry.get("description"), name
