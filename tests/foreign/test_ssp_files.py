"""The SSP files that we write, and those written for the tests, checked by the schemas of the standard."""

import zipfile

import pytest

from ssp_files import ecos_style, libcosim_style, nested_style, problems, ssd_of

SAMPLES = ["sample.ssd", "sample.ssv", "sample.ssm", "sample.ssb"]


def test_the_packed_system_structure_follows_the_schema(package):
    assert problems(ssd_of(package), ".ssd") == []


@pytest.mark.parametrize("name", SAMPLES)
def test_files_with_everything_that_can_be_written_follow_the_schemas(root, name):
    """crates/ssp/tests/ssp/writing.rs contains these files and writes the same content."""
    path = root / "crates" / "ssp" / "tests" / "ssp" / "data" / name
    assert problems(path.read_bytes(), path.suffix) == []


def test_the_schemas_detect_errors(package):
    wrong = ssd_of(package).replace(b'kind="output"', b'kind="outlet"', 1)
    assert any("outlet" in problem for problem in problems(wrong, ".ssd"))


def test_the_archive_satisfies_section_3(package):
    with zipfile.ZipFile(package) as archive:
        entries = archive.infolist()
        assert archive.testzip() is None
    names = [entry.filename for entry in entries]
    assert names == [
        "SystemStructure.ssd",
        "resources/AsoController.fmu",
        "resources/FrictionPendulum.fmu",
    ]
    for entry in entries:
        assert entry.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
        assert entry.extract_version <= 20 and entry.flag_bits == 0


@pytest.mark.parametrize("style", [libcosim_style, ecos_style, nested_style])
def test_the_structures_written_for_the_tests_follow_the_schema(packed, tmp_path, style):
    assert problems(ssd_of(style(packed, tmp_path)), ".ssd") == []
