"""Arguments that fmi2Instantiate accepts and refuses, always with one clear message."""

import ctypes
import re
import shutil
from pathlib import Path
from urllib.parse import quote

import pytest

from c_abi import ERROR, OK, Instance, describe
from design_file import design_text, redesigned, shipped_design


def refusal(fmu, **options):
    """The single message with which an instantiation is refused."""
    instance = Instance(fmu, **options)
    assert not instance.component
    assert len(instance.messages) == 1, instance.messages
    message = instance.messages[0]
    assert (message.status, message.category) == (ERROR, "logStatusError")
    assert message.text.startswith("fmi2Instantiate: ")
    return instance.last_message()


def test_the_logger_gets_environment_name_category_and_a_safe_format(fmu):
    with Instance(fmu, name=b"tank #3 %s%n") as instance:
        instance.call("DoStep", 0.0, 0.1, 1)
        message = instance.messages[0]
        assert message.environment == 0x5EED and message.instance == "tank #3 %s%n"
        assert message.form == "%s" and message.status == ERROR


def test_a_message_with_percent_and_hash_survives_printf(fmu):
    guid = "{%s%n%100000d #r1# ## %}"
    instance = Instance(fmu, guid=guid.encode())
    message = instance.messages[0]
    printed = ctypes.create_string_buffer(4096)
    ctypes.CDLL(None).snprintf(printed, 4096, message.form.encode(), message.text.encode())
    assert guid.replace("#", "##") in printed.value.decode()
    assert not re.search("#", message.text.replace("##", ""))


def test_without_a_logger_refusals_are_silent(fmu):
    assert not Instance(fmu, guid=b"wrong", log=False).component
    with Instance(fmu, log=False) as instance:
        assert instance.call("DoStep", 0.0, 0.1, 1) == ERROR
        instance.must("Reset")
        instance.start()
        instance.step(0.0, 0.001)


def test_without_callbacks_there_is_no_instance(fmu):
    guid, resources = fmu.description.guid.encode(), fmu.resources.encode()
    assert not fmu.library.fmi2Instantiate(b"one", 1, guid, resources, None, 0, 0)


@pytest.mark.parametrize("guid", [b"", b"{0}", b"{8c4e810f-3df3-4a00-8276-176fa3c9f000}", b"\xff"])
def test_a_wrong_guid_is_refused_with_both_guids(fmu, guid):
    message = refusal(fmu, guid=guid)
    assert "GUID" in message
    if guid != b"\xff":
        assert guid.decode() in message and fmu.description.guid in message


def test_missing_names_and_other_kinds_are_refused(fmu):
    assert "instanceName" in refusal(fmu, name=b"")
    for kind in (-1, 2, 7):
        assert f"fmuType is {kind}" in refusal(fmu, kind=kind)
    bare = Instance(fmu, name=None)
    assert not bare.component and "instanceName" in bare.last_message()


def test_null_arguments_are_refused(fmu):
    with Instance(fmu) as instance:
        for name, guid in ((None, fmu.description.guid.encode()), (b"two", None)):
            before = len(instance.messages)
            assert not fmu.library.fmi2Instantiate(
                name, 1, guid, fmu.resources.encode(), instance.callbacks, 0, 0
            )
            assert len(instance.messages) == before + 1


def starts(fmu, resources):
    """Whether an instance can be created and initialised with these resources."""
    with Instance(fmu, resources=resources) as instance:
        return instance.start().outputs() is not None


def test_every_form_of_a_resource_location_is_accepted(controller, tmp_path):
    folder = tmp_path / "a model, 50% größer #2 +&"
    shutil.copytree(controller.folder / "resources", folder)
    path, plain = quote(str(folder)), str(folder)
    for uri in (
        f"file://{path}",
        f"file:{path}",
        f"file://localhost{path}",
        f"file://{path}/",
        f"file:{path}/",
        f"FILE://{path}",
        folder.as_uri(),
        f"file://{path}//",
    ):
        assert starts(controller, uri), uri
    unencoded = plain.replace("%", "%25")
    assert starts(controller, f"file://{unencoded}")


@pytest.mark.parametrize(
    "uri",
    [
        "http://example.com/resources",
        "/tmp",
        "file://server/share",
        "file:resources",
        "nonsense",
    ],
)
def test_a_location_that_is_not_a_local_file_is_refused(controller, uri):
    assert "fmuResourceLocation" in refusal(controller, resources=uri)


def test_without_a_location_a_model_that_needs_resources_reports_it_and_reads_no_other_folder(
    controller, monkeypatch
):
    monkeypatch.chdir(controller.folder / "resources")
    assert Path("design.toml").is_file()
    said = refusal(controller, resources="")
    assert "fmuResourceLocation is null or empty" in said and "file:///" in said
    guid = controller.description.guid.encode()
    with Instance(controller) as instance:
        for location in (None, b""):
            before = len(instance.messages)
            arguments = (b"one", 1, guid, location, instance.callbacks, 0, 0)
            assert not controller.library.fmi2Instantiate(*arguments)
            assert len(instance.messages) == before + 1
            message = instance.messages[-1]
            assert message.status == ERROR
            assert "fmuResourceLocation is null or empty" in message.text
    status, said = describe(controller.library, "")
    assert status == 1 and "fmuResourceLocation is null or empty" in said and "\0" not in said


def test_a_model_without_resources_needs_no_location(plant):
    for uri in ("", "file:///nowhere"):
        assert starts(plant, uri)
    arguments = (b"one", 1, plant.description.guid.encode(), None)
    with Instance(plant) as instance:
        other = plant.library.fmi2Instantiate(*arguments, instance.callbacks, 0, 0)
        assert other
        plant.library.fmi2FreeInstance(other)


def test_missing_resources_are_refused_with_the_path_of_the_design(controller, tmp_path):
    message = refusal(controller, resources=(tmp_path / "gone").as_uri())
    assert str(tmp_path / "gone" / "design.toml") in message


DAMAGE = [
    (lambda text: text.replace("A = [", "A = [[", 1), ["TOML", "line"]),
    (lambda text: text[: len(text) // 2], ["TOML"]),
    (lambda text: "", ["missing field"]),
    (lambda text: text.replace("t_on", "t_onn", 1), ["unknown field", "t_onn"]),
    (lambda text: "colour = 3\n" + text, ["unknown field", "colour"]),
    (lambda text: text.replace("t_on = 40.0", "t_on = nan", 1), ["t_on"]),
    (lambda text: text.replace("t_on = 40.0", 't_on = "late"', 1), ["t_on"]),
    (lambda text: text.replace("0.3205166739122713", "nan", 1), ["B[3,1]", "NaN", "finite"]),
    (lambda text: text.replace("0.3205166739122713", "inf", 1), ["B[3,1]", "inf", "finite"]),
    (lambda text: text.replace("0.3205166739122713", "1.0, 2.0", 1), ["row 3"]),
    (
        lambda text: re.sub(r"K_f = \[\n.*?\n\]", "K_f = [[1.0, 2.0]]", text, flags=re.S),
        ["K_f", "1 x 2", "1 x 1"],
    ),
    (
        lambda text: re.sub(r"L_f = \[\n.*?\n\]", "L_f = [[1.0], [2.0]]", text, flags=re.S),
        ["L_f", "2 x 1", "1 x 2"],
    ),
    (lambda text: re.sub(r"C = \[\n.*?\n\]", "C = []", text, flags=re.S), ["matrix"]),
    (lambda text: text.replace("step_size = 0.001", "step_size = -0.001"), ["step_size", "-0.001"]),
    (lambda text: text.replace('unit = "N"', 'unit = "furlong"', 1), ["furlong"]),
]


@pytest.mark.parametrize(("damage", "words"), DAMAGE, ids=[" ".join(words) for _, words in DAMAGE])
def test_a_broken_design_is_refused_and_the_message_states_the_fault(controller, tmp_path, damage, words):
    text = (controller.folder / "resources" / "design.toml").read_text(encoding="utf-8")
    broken = damage(text)
    assert broken != text
    (tmp_path / "design.toml").write_text(broken, encoding="utf-8")
    message = refusal(controller, resources=tmp_path.as_uri())
    status, said = describe(controller.library, tmp_path)
    assert status == 1
    assert all(word in message and word in said for word in words), message


def test_the_message_about_a_broken_design_does_not_end_in_a_line_break(controller, tmp_path):
    (tmp_path / "design.toml").write_text("A = [[", encoding="utf-8")
    assert refusal(controller, resources=tmp_path.as_uri()).splitlines()[-1].strip()
    assert not refusal(controller, resources=tmp_path.as_uri()).endswith("\n")


@pytest.mark.parametrize("name", ["u", "time", "t_on", "f_hat", "A[1,1]", "compensate", "theta"])
def test_measurements_named_like_another_variable_are_refused(controller, tmp_path, name):
    design = shipped_design(controller)
    design["measurements"][0]["name"] = name
    (tmp_path / "design.toml").write_text(design_text(design), encoding="utf-8")
    status, said = describe(controller.library, tmp_path)
    assert status == 1 and name in said


@pytest.mark.parametrize("name", ["", "two words", "1st", "x-p", "x[1"])
def test_measurements_without_a_structured_name_are_refused(controller, tmp_path, name):
    design = shipped_design(controller)
    design["measurements"][0]["name"] = name
    (tmp_path / "design.toml").write_text(design_text(design), encoding="utf-8")
    status, said = describe(controller.library, tmp_path)
    assert status == 1 and name in said


def test_another_design_has_another_guid_and_does_not_match_the_old_description(controller, tmp_path):
    design = shipped_design(controller)
    design["t_on"] = 41.0
    other = redesigned(controller, design_text(design), tmp_path / "other")
    assert other.description.guid != controller.description.guid
    assert starts(other, other.resources)
    message = refusal(controller, resources=other.resources)
    assert other.description.guid in message and controller.description.guid in message


def test_the_same_design_in_another_notation_has_the_same_guid(controller, tmp_path):
    text = "# a comment\n" + design_text(shipped_design(controller))
    same = redesigned(controller, text, tmp_path / "same")
    assert same.description.guid == controller.description.guid


def test_categories_that_the_fmu_does_not_have_are_refused(fmu):
    with Instance(fmu) as instance:
        declared = [category.name for category in fmu.description.logCategories]
        for name in declared:
            place = (ctypes.c_char_p * 1)(name.encode())
            assert instance.call("SetDebugLogging", 1, 1, place) == OK
        instance.must("SetDebugLogging", 1, 0, None)
        unknown = (ctypes.c_char_p * 2)(declared[0].encode(), b"logNothing")
        assert instance.call("SetDebugLogging", 1, 2, unknown) == ERROR
        assert "logNothing" in instance.last_message() and declared[0] in instance.last_message()


def test_every_category_in_use_is_declared(fmu):
    declared = {category.name for category in fmu.description.logCategories}
    with Instance(fmu) as instance:
        instance.start()
        name = fmu.names(causality="input", type="Real")[0]
        instance.set_one(name, float("nan"))
        instance.call("GetStatus", 0, (ctypes.c_int * 1)())
        instance.call("DoStep", 0.0, 0.0, 1)
        used = {message.category for message in instance.messages}
    used |= {message.category for message in Instance(fmu, guid=b"no").messages}
    assert used == {"logStatusDiscard", "logStatusError"} and used <= declared


def test_only_messages_of_the_chosen_categories_are_logged(fmu):
    with Instance(fmu) as instance:
        instance.start()
        chosen = (ctypes.c_char_p * 1)(b"logStatusError")
        instance.must("SetDebugLogging", 1, 1, chosen)
        instance.set_one(fmu.names(causality="input", type="Real")[0], float("nan"))
        assert not instance.messages
        instance.call("DoStep", 0.0, 0.0, 1)
        assert [message.category for message in instance.messages] == ["logStatusError"]
