"""`aso-ftc check` on FMUs with one fault each; the references are the schema, FMPy and Python's zipfile."""

import json
import random
import re
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy import read_model_description
from lxml import etree

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
REFUSES = "FMPy refuses what the schema does not allow"


@pytest.fixture
def check(aso_ftc):
    """Checks an FMU; returns exit status and findings as (severity, part, where, what, why, section)."""

    def run(path, *more):
        done = aso_ftc("check", "--json", *more, path)
        assert done.returncode in (0, 1), done
        report = json.loads(done.stdout)
        errors = [finding for finding in report["findings"] if finding["severity"] == "error"]
        assert report["errors"] == len(errors) and done.returncode == (1 if errors else 0)
        return done.returncode, report["findings"]

    return run


@pytest.fixture(scope="session")
def files(packed):
    """Name and content of the files in the plant's FMU."""
    with zipfile.ZipFile(packed["plant"]) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def library(files):
    return next(name for name in files if name.startswith("binaries/"))


@pytest.fixture
def fmu(tmp_path, files):
    """Packs the plant with changed files (None: omitted) into an FMU."""

    def pack(changes, method=zipfile.ZIP_DEFLATED, name="Changed.fmu"):
        path = tmp_path / name
        with zipfile.ZipFile(path, "w") as archive:
            for inner, content in {**files, **changes}.items():
                if content is not None and "licenses/" not in inner:
                    archive.writestr(zipfile.ZipInfo(inner, (1980, 1, 1, 0, 0, 0)), content, method)
        return path

    return pack


def the_one(findings, part, words):
    matches = [finding for finding in findings if finding["part"] == part and words in finding["what"]]
    assert len(matches) == 1, findings
    return matches[0]


@pytest.mark.parametrize("role", ["plant", "controller"])
def test_our_fmus_break_no_rule_and_need_the_glibc_that_is_in_their_symbols(check, packed, files, role):
    status, findings = check(packed[role])
    assert status == 0
    assert {finding["severity"] for finding in findings} <= {"note"}, findings
    with zipfile.ZipFile(packed[role]) as archive:
        code = archive.read(library(dict.fromkeys(archive.namelist())))
    versions = re.findall(rb"GLIBC_([0-9.]+)", code)
    newest = max(versions, key=lambda version: [int(part) for part in version.split(b".")]).decode()
    assert f"glibc {newest} " in the_one(findings, "binaries", "glibc")["what"]


def test_a_file_that_cannot_be_read_as_an_fmu_ends_with_status_2(aso_ftc, fmu, tmp_path):
    (tmp_path / "Text.fmu").write_text("no archive")
    for path in [tmp_path / "Text.fmu", tmp_path / "Nowhere.fmu", fmu({"modelDescription.xml": "<a"})]:
        done = aso_ftc("check", path)
        assert done.returncode == 2 and done.stderr.startswith("error: "), done
    done = aso_ftc("check", tmp_path)
    assert done.returncode == 2 and "found a folder" in done.stderr, done


def mutated(xml, seed):
    """The description with one random change."""
    chance = random.Random(seed)
    root = etree.fromstring(xml)
    element = chance.choice([node for node in root.iter() if isinstance(node.tag, str)])
    operation = chance.randrange(6)
    if operation == 0:
        element.set("colour", "red")
    elif operation == 1 and element.attrib:
        del element.attrib[chance.choice(sorted(element.attrib))]
    elif operation == 2 and element.attrib:
        element.set(chance.choice(sorted(element.attrib)), chance.choice(["?", "", "NaN", "True", "1.0", "-1"]))
    elif operation == 3:
        etree.SubElement(element, chance.choice(["Array", "Unknown", "Real", "Outputs"]))
    elif operation == 4 and len(element) > 1:
        element.append(element[chance.randrange(len(element) - 1)])
    elif len(element):
        element.remove(chance.choice(list(element)))
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8")


def test_what_the_schema_refuses_is_an_error_and_fmpy_refuses_what_check_says(
    aso_ftc, tmp_path, files
):
    schema = etree.XMLSchema(etree.parse(SCHEMA))
    refused, by_fmpy = 0, 0
    for seed in range(150):
        xml = mutated(files["modelDescription.xml"], seed)
        path = tmp_path / "Mutated.fmu"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", xml)
            archive.writestr("sources/all.c", "")
        done = aso_ftc("check", "--json", path)
        if not schema.validate(etree.fromstring(xml)):
            refused += 1
            assert done.returncode in (1, 2), (seed, schema.error_log)
        if done.returncode != 2 and REFUSES in done.stdout:
            by_fmpy += 1
            with pytest.raises(Exception):  # noqa: B017 - any refusal
                read_model_description(str(path), validate=True)
    assert refused > 50 and by_fmpy > 0


def test_compression_that_importers_cannot_read_is_refused(aso_ftc, fmu):
    for method, name in [(zipfile.ZIP_BZIP2, "bzip2"), (zipfile.ZIP_LZMA, "lzma")]:
        done = aso_ftc("check", fmu({}, method))
        assert done.returncode == 2, (name, done)
        assert "expected compression by deflate, or none" in done.stderr, (name, done)


def test_paths_with_backslashes_are_an_error_and_the_fmu_is_still_read(check, fmu, files):
    name = library(files)
    path = fmu({name: None, name.replace("/", "\\"): files[name]})
    status, findings = check(path, "--no-run")
    assert status == 1
    error = the_one(findings, "archive", "backslashes")
    assert error["severity"] == "error" and error["where"] == name.replace("/", "\\")
    # The library is found: only its path is wrong.
    assert not [finding for finding in findings if finding["part"] == "binaries" and finding["severity"] == "error"]


def test_stored_entries_with_data_descriptors_are_an_error(check, tmp_path, files):
    path = tmp_path / "Stream.fmu"

    class Stream:
        def __init__(self, file):
            self.file = file

        def write(self, data):
            return self.file.write(data)

        def flush(self):
            self.file.flush()

    with path.open("wb") as file, zipfile.ZipFile(Stream(file), "w") as archive:  # type: ignore[call-overload]
        archive.writestr("modelDescription.xml", files["modelDescription.xml"])
        archive.writestr("sources/all.c", "")
    status, findings = check(path)
    errors = [finding for finding in findings if "data descriptor" in finding["what"]]
    assert status == 1 and {finding["where"] for finding in errors} == {"modelDescription.xml", "sources/all.c"}


@pytest.mark.parametrize(
    "changes, words, severity",
    [
        ({"readme.txt": "x"}, "expected nothing but", "error"),
        ({"Resources/x": "x"}, "expected resources, with these upper and lower case letters", "error"),
        ({"documentation/index.html": None}, "expected index.html", "warning"),
        ({"model.png": "GIF89a"}, "expected a PNG", "warning"),
        ({"resources/a": "1", "resources/A": "2"}, "in upper and lower case only", "warning"),
        ({"resources/nul.txt": "1"}, "a name that Windows does not allow", "warning"),
        ({"extra/data": "1"}, "reverse domain name", "warning"),
    ],
)
def test_unusual_files_are_reported(check, fmu, changes, words, severity):
    _, findings = check(fmu(changes), "--no-run")
    assert the_one(findings, "archive", words)["severity"] == severity


def test_missing_source_files_are_an_error(check, fmu, files):
    xml = files["modelDescription.xml"].decode()
    with_sources = re.sub(
        r"(<CoSimulation[^>]*)/>", r'\1><SourceFiles><File name="a.c"/></SourceFiles></CoSimulation>', xml
    )
    assert with_sources != xml
    _, findings = check(fmu({"modelDescription.xml": with_sources}), "--no-run")
    assert "sources/a.c" in the_one(findings, "archive", "SourceFiles")["what"]
    _, findings = check(fmu({"modelDescription.xml": with_sources, "sources/a.c": ""}), "--no-run")
    assert not [finding for finding in findings if "SourceFiles" in finding["what"]]


@pytest.mark.parametrize("name", ["./a.c", "sub/a.c", "sub\\a.c", "sources/a.c", "sub/../a.c", "./sub/./a.c"])
def test_source_files_are_found_in_every_notation_of_their_path(check, fmu, files, name):
    xml = files["modelDescription.xml"].decode()
    stated = rf'\1><SourceFiles><File name="{name}"/></SourceFiles></CoSimulation>'.replace("sub\\", "sub\\\\")
    xml = re.sub(r"(<CoSimulation[^>]*)/>", stated, xml)
    path = "sources/" + name.replace("\\", "/").replace("sub/../", "").replace("./", "").removeprefix("sources/")
    _, findings = check(fmu({"modelDescription.xml": xml, path: ""}), "--no-run")
    assert not [finding for finding in findings if "SourceFiles" in finding["what"]], path
    _, findings = check(fmu({"modelDescription.xml": xml, "sources/b.c": ""}), "--no-run")
    assert the_one(findings, "archive", "SourceFiles")["severity"] == "error"


def test_a_source_file_in_another_case_is_a_warning_and_one_outside_of_sources_an_error(check, fmu, files):
    xml = files["modelDescription.xml"].decode()
    for name, severity, words in [("A.c", "warning", "SourceFiles"), ("../../a.c", "error", "a file in sources")]:
        stated = rf'\1><SourceFiles><File name="{name}"/></SourceFiles></CoSimulation>'
        changed = re.sub(r"(<CoSimulation[^>]*)/>", stated, xml)
        _, findings = check(fmu({"modelDescription.xml": changed, "sources/a.c": ""}), "--no-run")
        assert the_one(findings, "archive", words)["severity"] == severity


def test_an_empty_folder_of_a_platform_is_a_note(check, fmu):
    _, findings = check(fmu({"binaries/linux32/": ""}), "--no-run")
    notes = [finding for finding in findings if finding["where"] == "binaries/linux32/"]
    assert [finding["severity"] for finding in notes] == ["note"], findings


def answer(aso_ftc, path, *more):
    done = aso_ftc("check", "--json", *more, path)
    assert done.returncode in (0, 1), done
    report = json.loads(done.stdout)
    return report["here"], {entry["tool"]: entry["reason"] for entry in report["not_in"]}


def test_the_report_starts_with_how_the_fmu_ran(aso_ftc, packed):
    done = aso_ftc("check", packed["plant"])
    first, signals, second, *_ = done.stdout.splitlines()
    assert re.fullmatch(r"runs in this master: yes, 10 steps of \S+ s from t = 0 s .* its own start values", first)
    assert signals.startswith("continuous inputs and outputs: u, f_a, x_p, theta"), signals
    assert second == "no tool is known to refuse it"
    here, tools = answer(aso_ftc, packed["plant"], "--no-run")
    assert here == {"runs": "not-tried", "reason": "--no-run"} and not tools


def test_an_fmu_without_a_library_for_this_platform_is_reported_not_to_run_here(aso_ftc, fmu, files):
    here, _ = answer(aso_ftc, fmu({library(files): None, "binaries/darwin64/a.dylib": ""}))
    assert here["runs"] == "no" and "linux64" in here["reason"]


def validated(path):
    """Whether FMPy's simulate_fmu accepts the description with its default options."""
    try:
        read_model_description(str(path), validate=True)
    except Exception:
        return False
    return True


FMPY = "FMPy with validate=True, its default"
LIBRARY = "FMI Library (libcosim, PyFMI)"


@pytest.mark.parametrize(
    "before, after, tools",
    [
        ("<ModelVariables>", '<ModelVariables colour="red">', {FMPY}),
        (' unit="N"', ' unit="Newton"', {FMPY}),
        ("<ModelVariables>", "<ModelVariables><!-- comment -->", set()),
        (r'generationDateAndTime="[^"]*"', 'generationDateAndTime="2024-01-01T00:00:00+01:00"', set()),
        ("<InitialUnknowns>.*?</InitialUnknowns>", "", set()),
    ],
)
def test_fmpy_refuses_by_default_what_check_says(aso_ftc, fmu, files, before, after, tools):
    xml, count = re.subn(before, after, files["modelDescription.xml"].decode(), flags=re.DOTALL)
    if "generationDate" in before and not count:
        xml, count = re.subn("<fmiModelDescription", f"<fmiModelDescription {after}", xml, count=1)
    assert count
    path = fmu({"modelDescription.xml": xml})
    _, said = answer(aso_ftc, path, "--no-run")
    assert set(said) == tools, said
    assert validated(path) == (FMPY not in tools)


def test_another_fmi_version_is_refused_by_fmpy_with_every_option(aso_ftc, fmu, files):
    xml = files["modelDescription.xml"].decode().replace('fmiVersion="2.0"', 'fmiVersion="2.0.1"')
    path = fmu({"modelDescription.xml": xml})
    _, said = answer(aso_ftc, path, "--no-run")
    assert "FMPy" in said, said
    with pytest.raises(Exception, match="Unsupported FMI version"):
        read_model_description(str(path), validate=False)


def loads_in_libcosim(python, path):
    program = "import sys\nfrom libcosimpy.CosimSlave import CosimLocalSlave\n"
    program += "from libcosimpy.CosimExecution import CosimExecution\n"
    program += "slave = CosimLocalSlave(sys.argv[1], 'x')\n"
    program += "print('index', CosimExecution.from_step_size(10**7).add_local_slave(slave))"
    return "index 0" in python("-c", program, path).stdout


@pytest.mark.parametrize(
    "function, tools", [("fmi2GetDirectionalDerivative", {"FMPy"}), ("fmi2DoStep", {"FMPy", LIBRARY})]
)
def test_a_missing_function_is_reported_for_the_tools_that_need_it(aso_ftc, python, fmu, files, function, tools):
    xml = files["modelDescription.xml"].decode().replace(' providesDirectionalDerivative="true"', "")
    name = library(files)
    other = function[:-1] + "X"
    code = files[name].replace(f"\0{function}\0".encode(), f"\0{other}\0".encode())
    assert code != files[name]
    path = fmu({"modelDescription.xml": xml, name: code})
    _, said = answer(aso_ftc, path, "--no-run")
    assert set(said) == tools, said
    with pytest.raises(Exception):  # noqa: B017 - any refusal
        fmpy.simulate_fmu(str(path), stop_time=0.01, validate=False)
    assert loads_in_libcosim(python, path) == (LIBRARY not in tools)


@pytest.mark.parametrize("display, tools", [("deg", {FMPY}), ("kN", {FMPY, LIBRARY})])
def test_a_display_unit_that_its_unit_does_not_list_is_reported_for_the_tools_that_refuse_it(
    aso_ftc, python, fmu, files, display, tools
):
    xml = files["modelDescription.xml"].decode()
    path = fmu({"modelDescription.xml": xml.replace('<Real unit="N"', f'<Real unit="N" displayUnit="{display}"')})
    _, said = answer(aso_ftc, path, "--no-run")
    assert set(said) == tools, said
    assert not validated(path) and loads_in_libcosim(python, path) == (LIBRARY not in tools)


def test_an_identifier_that_libcosim_and_fmpy_accept_is_reported_for_no_tool(aso_ftc, python, fmu, files):
    xml = files["modelDescription.xml"].decode()
    xml = xml.replace('modelIdentifier="FrictionPendulum"', 'modelIdentifier="1-Pendulum"')
    name = library(files)
    renamed = name.replace("FrictionPendulum", "1-Pendulum")
    path = fmu({"modelDescription.xml": xml, name: None, renamed: files[name]})
    _, said = answer(aso_ftc, path, "--no-run")
    assert not said and validated(path) and loads_in_libcosim(python, path)


def test_equal_findings_are_one_line_with_a_count_and_the_json_lists_all(aso_ftc, check, fmu, files):
    xml = files["modelDescription.xml"].decode()
    xml = re.sub(r' unit="[^"]*"', ' unit="?"', xml)
    path = fmu({"modelDescription.xml": xml})
    _, findings = check(path, "--no-run")
    undefined = [finding for finding in findings if "which is not defined" in finding["what"]]
    assert len(undefined) > 2
    lines = aso_ftc("check", "--no-run", path).stdout.splitlines()
    (line,) = [text for text in lines if text.startswith("error") and "which is not defined" in text]
    assert f"; and {len(undefined) - 1} more variables" in line, line


def test_a_library_for_another_machine_is_an_error(check, fmu, files):
    name = library(files)
    code = bytearray(files[name])
    assert code[18:20] == b"\x3e\x00"  # e_machine: EM_X86_64
    code[18:20] = b"\xb7\x00"  # EM_AARCH64
    status, findings = check(fmu({name: bytes(code)}), "--no-run")
    error = the_one(findings, "binaries", "expected Elf for X86_64, found Elf for Aarch64")
    assert status == 1 and error["section"] == "2.3"


def test_a_library_in_the_folder_of_another_system_is_an_error(check, fmu, files):
    windows = "binaries/win64/FrictionPendulum.dll"
    _, findings = check(fmu({windows: files[library(files)]}), "--no-run")
    assert the_one(findings, "binaries", "expected Pe for X86_64")["where"] == windows
    _, findings = check(fmu({windows: b"not a library"}), "--no-run")
    assert the_one(findings, "binaries", "found a file that is none")["where"] == windows


def test_the_folder_of_a_platform_in_another_case_is_an_error(check, fmu, files):
    name = library(files)
    platform = name.split("/")[1]
    other = name.replace(platform, platform.capitalize())
    status, findings = check(fmu({name: None, other: files[name]}), "--no-run")
    error = the_one(findings, "binaries", f"expected {platform}, with these upper and lower case letters")
    assert status == 1 and error["where"] == f"binaries/{platform.capitalize()}"


def test_a_library_of_another_name_is_an_error(check, fmu, files):
    name = library(files)
    other = name.replace("FrictionPendulum", "libFrictionPendulum")
    _, findings = check(fmu({name: None, other: files[name]}))
    assert other in the_one(findings, "binaries", "expected this library")["what"]


def test_functions_that_are_missing_or_prefixed_are_an_error(check, fmu, files):
    name = library(files)
    code = files[name].replace(b"\0fmi2DoStep\0", b"\0fmi2DoStap\0")
    _, findings = check(fmu({name: code}), "--no-run")
    assert the_one(findings, "binaries", "lacks")["what"] == "lacks fmi2DoStep"
    # The new name has the same length, because the text has a fixed place in the table.
    code = files[name].replace(b"\0fmi2CompletedIntegratorStep\0", b"\0FrictionPendulu_fmi2DoStep\0".replace(b"F", b"FF", 1)[:29])
    code = code.replace(b"\0fmi2DoStep\0", b"\0fmi2DoStap\0")
    _, findings = check(fmu({name: code}), "--no-run")
    assert "_fmi2DoStep" in the_one(findings, "binaries", "without prefix")["what"]


def test_a_start_value_that_the_library_does_not_have_is_an_error(check, fmu, files):
    xml = files["modelDescription.xml"].decode()
    number = re.search(r'name="F_c".*?start="([^"]*)"', xml, re.DOTALL)
    changed = xml[: number.start(1)] + "17.5" + xml[number.end(1) :]
    status, findings = check(fmu({"modelDescription.xml": changed}))
    error = the_one(findings, "behaviour", "17.5")
    assert status == 1 and error["where"] == "variable F_c"
    assert error["what"].startswith(f"the library starts with {float(number.group(1))}")


def test_a_category_that_is_not_declared_is_an_error(check, fmu, files):
    xml = re.sub(r"\s*<LogCategories>.*?</LogCategories>", "", files["modelDescription.xml"].decode(), flags=re.DOTALL)
    _, findings = check(fmu({"modelDescription.xml": xml}))
    assert {finding["section"] for finding in findings if finding["where"] == "logger"} == {"2.2.4"}


def test_the_text_report_has_each_finding_with_its_place_section_and_reason(aso_ftc, fmu, files):
    xml = files["modelDescription.xml"].decode().replace("<ModelVariables>", '<ModelVariables colour="red">')
    done = aso_ftc("check", "--no-run", fmu({"modelDescription.xml": xml}))
    line = xml[: xml.index("<ModelVariables")].count("\n") + 1
    said = f"error: modelDescription.xml, line {line}, column 3: <ModelVariables>, attribute colour: "
    assert done.returncode == 1 and said in done.stdout, done.stdout
    assert "(section 2.2.7)\n    " + REFUSES in done.stdout
    assert "errors 1, warnings 0" in done.stdout
