"""Containers, truth, equality and representation of the public classes."""

import copy
import pickle
from collections.abc import Collection, Mapping

import aso_ftc as af
import numpy as np
import pytest


@pytest.fixture
def pendulum():
    return af.fmus()["FrictionPendulum"]


def is_whole(container):
    """What collections.abc promises: length, iteration and membership agree, and each name has its value."""
    names = list(container)
    assert isinstance(container, Collection) and len(container) == len(names) == len(set(names)) > 0
    assert all(name in container for name in names) and "no such name" not in container and 0 not in container
    assert all(np.array_equal(container[name], container[name]) for name in names)
    with pytest.raises(KeyError, match="no such name"):
        container["no such name"]
    assert bool(container)


def test_descriptions_results_and_simulations_are_whole_containers(paper, pendulum):
    description, results = af.read_model_description(pendulum), paper.run()
    for container in (description, results):
        is_whole(container)
        assert isinstance(container, Mapping) and list(container.keys()) == list(container) == [name for name, _ in container.items()]
        assert container.get("no such name", 3) == 3 and dict(container).keys() == container.keys()
    with paper.simulation() as simulation:
        is_whole(simulation)
        assert list(simulation) == simulation.names()


def test_a_description_is_its_variables_in_order_and_can_be_a_key(pendulum):
    first, second = af.read_model_description(pendulum), af.read_model_description(pendulum)
    assert tuple(first.values()) == first.variables and first["F_c"].name == "F_c"
    assert first == second and first is not second and {first: 1}[second] == 1
    assert first != af.read_model_description(af.fmus()["AsoController"])
    assert first == pickle.loads(pickle.dumps(first)) == copy.deepcopy(first)
    with pytest.raises(KeyError, match="FrictionPendulum has no variable 'f_c'; similar: F_c"):
        first["f_c"]


def test_results_are_equal_by_names_units_and_values(paper):
    one, other = paper.run(), paper.run()
    assert one == other == pickle.loads(pickle.dumps(one)) and one is not other
    assert one != paper.run(start_values={"plant.x_p_0": 0.2}) and one != paper.run(record=["plant.x_p"])
    assert one != dict(one) and one != 3
    with pytest.raises(TypeError, match="unhashable"):
        hash(one)


def test_a_check_is_true_if_it_found_no_error(pendulum, tmp_path):
    import zipfile

    passed = af.check(pendulum, run=False)
    assert passed and passed.ok and {passed: 1}[passed] == 1
    broken = tmp_path / "Broken.fmu"
    with zipfile.ZipFile(pendulum) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            text = source.read(name)
            target.writestr(name, text.replace(b' start="0.0"', b"") if name == "modelDescription.xml" else text)
    failed = af.check(broken, run=False)
    assert not failed and failed.errors > 0 and "severity" in failed.findings[0]
    validation = pytest.importorskip("fmpy.validation")
    assert [bool(validation.validate_fmu(str(fmu))) for fmu in (pendulum, broken)] == [not passed, not failed]


def test_every_representation_is_short_and_every_page_is_a_table(paper, pendulum):
    description, results = af.read_model_description(pendulum), paper.run()
    a, b, c = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    design = af.design(
        (a, b, c), F_a=-b, faults=[{"name": "f", "unit": "N"}],
        feedback={"eigenvalues": [-2.0, -4.0]}, observer={"eigenvalues": [-8.0, -9.0, -10.0]},
    )  # fmt: skip
    campaign = af.campaign.Campaign(
        paper, parameters={"plant.F_c": [20.0, 30.0]}, measures={"peak": "max(plant.x_p)"}
    )
    for item in (description, results, paper, design, campaign, af.check(pendulum, run=False)):
        assert len(repr(item)) < 200 and "\n" not in repr(item), item
        html = item._repr_html_()
        assert html.count("<table>") == html.count("</table>") == 1 and html.count("<tr>") >= 2, item
    name = "<script>"
    assert "<script>" not in af.System().add(name, pendulum)._repr_html_()


def test_the_table_of_a_system_says_how_its_fmus_are_connected(paper, pendulum):
    assert paper._repr_html_().count("by equal names") == 2
    stated = paper.copy().connect("controller.u", "plant.u")._repr_html_()
    assert "by equal names" not in stated and "controller.u to plant.u" in stated
    assert "by equal names" not in af.System().add("plant", pendulum)._repr_html_()


def test_an_overview_has_what_fmpy_dumps(pendulum, capsys):
    fmpy = pytest.importorskip("fmpy")
    text = str(af.read_model_description(pendulum))
    fmpy.dump(str(pendulum), causalities=["input", "output", "parameter"])
    table = capsys.readouterr().out.partition("Variables (")[2].splitlines()[3:]
    names = [line.split()[0] for line in table if line.strip()]
    assert len(names) > 20 and all(f"\n{name} " in text for name in names)
    assert "FMI          2.0: co-simulation, model-exchange" in text


def test_completion_offers_what_the_package_has():
    assert {"campaign", "simulate", "System"} <= set(dir(af)) and "annotations" not in dir(af)
    assert all(hasattr(af, name) for name in dir(af))
    assert dir(af.campaign) == ["Campaign", "Outcome", "Probability", "load"]
