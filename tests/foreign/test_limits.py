"""`run` warns about values that variables do not allow and steps that time does not resolve; limits on files can be lifted."""

import os
import subprocess
import zipfile

import pytest

from conftest import ROOT

COMMAND = ROOT / "target" / "release" / "aso-ftc"
VARIABLES = """
<ScalarVariable name="u" valueReference="0" causality="input"><Real declaredType="Level" start="1" max="10"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="mode" valueReference="2" causality="input" variability="discrete"><Enumeration declaredType="Mode"
 start="1"/></ScalarVariable>
<ScalarVariable name="n" valueReference="3" causality="output" variability="discrete"><Integer/></ScalarVariable>
<ScalarVariable name="k" valueReference="4" causality="parameter" variability="tunable"><Real start="START" max="5"/>
</ScalarVariable>"""
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="5"><CoSimulation modelIdentifier="many"
 canHandleVariableCommunicationStepSize="true"/><TypeDefinitions><SimpleType name="Level"><Real min="0"/></SimpleType>
<SimpleType name="Mode"><Enumeration><Item name="low" value="1"/><Item name="high" value="3"/></Enumeration></SimpleType>
</TypeDefinitions><ModelVariables>VARIABLES</ModelVariables><ModelStructure><Outputs><Unknown index="2" dependencies=""/>
<Unknown index="4" dependencies=""/></Outputs></ModelStructure></fmiModelDescription>"""


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """`tests/c/many.c` as a shared library."""
    path = tmp_path_factory.mktemp("library") / "many.so"
    flags = ["-std=c11", "-shared", "-fPIC", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["cc", *flags, "-o", path, ROOT / "tests/c/many.c"], check=True)
    return path


def written(folder, library, start="1", more=()):
    """The FMU with this start value of `k` and these further files."""
    path = folder / "m.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        text = DESCRIPTION.replace("VARIABLES", VARIABLES).replace("START", start)
        archive.writestr("modelDescription.xml", text)
        archive.write(library, "binaries/linux64/many.so")
        for name, size in more:
            archive.writestr(name, bytes(size))
    return path


def run(folder, *arguments, trusted=False):
    """Exit status and warnings or the error of a run of one second."""
    command = [COMMAND, "run", *arguments, "--out", folder / "out"]
    environment = os.environ | ({"ASO_FTC_TRUST_FILES": "1"} if trusted else {})
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    usual = ("nothing is connected", "replaces the file of this name")
    said = [line for line in done.stderr.splitlines() if not any(part in line for part in usual)]
    return done.returncode, said


SECOND = ["--stop-time", "1", "--step", "0.25"]


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        (["m.u=12"], "m.u = 12 is above its max, 10"),
        (["m.u=-0.5"], "m.u = -0.5 is below its min, 0"),
        (["m.mode=2"], "m.mode = 2 is no item of its enumeration, low = 1, high = 3"),
        (["m.k=5.5", "m.u=11"], "m.u = 11 is above its max, 10; m.k = 5.5 is above its max, 5"),
        (["m.u=10", "m.mode=high", "m.k=5.000000001"], None),
    ],
)
def test_a_setting_that_its_variable_does_not_allow_is_a_warning(tmp_path, library, settings, why):
    """Limits of the variable or of its declared type; a limit itself, or rounding, is allowed."""
    sets = [word for setting in settings for word in ("--set", setting)]
    status, said = run(tmp_path, written(tmp_path, library), *SECOND, *sets)
    warning = f"warning: settings that their variables do not allow: {why}"
    assert (status, said) == (0, [warning] if why else [])


def test_a_start_value_beyond_a_limit_is_a_warning_unless_another_is_set(tmp_path, library):
    """The FMU of somebody else, whose description contradicts itself."""
    fmu = written(tmp_path, library, start="7")
    warning = "warning: start values in the model descriptions that their variables do not allow: m.k = 7 is above its max, 5"
    assert run(tmp_path, fmu, *SECOND) == (0, [warning])
    assert run(tmp_path, fmu, *SECOND, "--set", "m.k=4") == (0, [])


def test_a_connected_input_beyond_a_limit_is_one_warning_with_its_time(tmp_path, library):
    """Reals after unit and transformation, and an enumeration that gets an Integer."""
    fmu = written(tmp_path, library)
    system = f"""fmus = {{ a = "{fmu}", b = "{fmu}" }}
    [[connections]]
    from = "a.y"
    to = "b.u"
    factor = 2
    [[connections]]
    from = "a.n"
    to = "b.mode"
    """
    (tmp_path / "system.toml").write_text(system)
    sets = ["--set", "a.u=8", "--set", "a.mode=3"]
    status, said = run(tmp_path, "system.toml", *SECOND, *sets)
    assert status == 0
    assert said == [
        "warning: b.mode gets 0 at t = 0 s by its connection, which is no item of its enumeration, low = 1, high = 3",
        "warning: b.u gets 16 at t = 0.25 s by its connection, which is above its max, 10",
    ]


def test_a_step_that_times_do_not_resolve_is_a_warning(tmp_path, library):
    """At 1e9 s, two numbers differ by 1.2e-7."""
    fmu = written(tmp_path, library)
    times = ["--start-time", "1e9", "--stop-time", "1000000000.00001"]
    _, said = run(tmp_path, fmu, *times, "--step", "1e-8")
    warning = "warning: the step of 1e-8 s is near or below the resolution of time: at t = 1000000000 s, times differ"
    assert said[0].startswith(warning), said
    status, said = run(tmp_path, fmu, "--start-time", "1e9", "--stop-time", "1000000001", "--step", "0.1")
    assert (status, said) == (0, [])


def test_a_legal_file_beyond_a_limit_runs_if_it_is_trusted(tmp_path, library):
    """A table of zeros, which is as small in an archive as an attack; a configuration that is too long."""
    fmu = written(tmp_path, library, more=[("resources/table.bin", 100 << 20)])
    long = tmp_path / "system.toml"
    long.write_text(f'fmus = {{ m = "{fmu}" }}\n# {" " * (64 << 20)}')
    for file, expected in [(fmu, "unpacked bytes"), (long, "67108864 bytes")]:
        status, said = run(tmp_path, file, *SECOND)
        assert status == 2 and expected in said[0], said
        assert "protects memory and disk" in said[0] and "ASO_FTC_TRUST_FILES=1 lifts it" in said[0]
        assert run(tmp_path, file, *SECOND, trusted=True) == (0, [])
