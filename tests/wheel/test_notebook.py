"""The notebook of the examples runs in a kernel that has the installed package, with the numbers of the paper."""

import ast
from pathlib import Path

import aso_ftc as af
import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "python" / "examples" / "pendulum.ipynb"


def test_the_notebook_runs_and_its_paper_observer_keeps_the_cart_within_1_mm(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    shown = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    outputs = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
    assert [len(cell_outputs) for cell_outputs in outputs] == [len(cell_outputs) for cell_outputs in shown]
    texts = [str(output.get("data", {}).get("text/plain", "")) for cell_outputs in outputs for output in cell_outputs]
    swings = next(ast.literal_eval(text) for text in texts if text.startswith("[173"))
    # Patton and Klinkhieo (2009) state 165 mm without and below 1 mm with compensation.
    assert len(swings) == 7 and swings == sorted(swings, reverse=True) and 0.9 < swings[-1] < 1.0


def outputs(folder, *cells):
    """Runs cells in a kernel; returns the outputs of each."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return [cell.outputs for cell in notebook.cells]


def test_a_cell_shows_each_picture_once_in_the_order_of_its_lines(tmp_path):
    pytest.importorskip("matplotlib")
    shown = outputs(
        tmp_path,
        "import aso_ftc as af\nresults = af.paper().run(stop_time=0.1)\nfigure = results.plot('plant.x_p')",
        "figure",
        "results.plot('plant.x_p')\nresults.plot('plant.theta', figsize=(2, 2))",
        "results.plot('plant.x_p');",
        "import matplotlib.pyplot as plt\nresults.plot('plant.x_p', ax=plt.subplots()[1])",
        "for _ in range(2):\n    print('next')\n    display(results.plot('plant.x_p'))",
    )
    kinds = [["image/png" if "image/png" in output.get("data", {}) else output.text for output in cell] for cell in shown]
    assert kinds == [["image/png"], ["image/png"], ["image/png"] * 2, ["image/png"], ["image/png"], ["next\n", "image/png"] * 2]
    assert "200x200" in shown[2][1]["data"]["text/plain"] and "200x200" not in shown[2][0]["data"]["text/plain"]


def test_progress_is_a_line_that_is_drawn_again(tmp_path):
    pytest.importorskip("distributed")
    _, run, campaign = outputs(
        tmp_path,
        "import aso_ftc as af\nsystem = af.paper()\nsystem.experiment['stop-time'] = 0.1",
        "results = system.run(progress=True)",
        "outcome = af.campaign.Campaign(system, measures={'peak': 'max(plant.x_p)'}).run('out', workers=1)",
    )
    for parts, text in ((run, "100 % in "), (campaign, "1 of 1 runs")):
        line = "".join(output.text for output in parts if output.name == "stderr")
        assert line.startswith("\r") and text in line and line.endswith("\n")


def test_tab_completes_the_names_of_variables_in_brackets():
    shell = pytest.importorskip("IPython.core.interactiveshell").InteractiveShell()
    description = af.read_model_description(af.fmus()["FrictionPendulum"])
    with af.paper().simulation(stop_time=0.1) as simulation:
        shell.push({"results": af.paper().run(stop_time=0.1), "simulation": simulation, "description": description})
        for written, expected in {
            "results['controller.x_hat": {f"controller.x_hat{index}" for index in ("", "[1]", "[2]", "[3]", "[4]")},
            "simulation['plant.x_p": {"plant.x_p", "plant.x_p_0"},
            "description['x_p": {"x_p", "x_p_0"},
        }.items():
            assert {match.rpartition("'")[2] for match in shell.complete(written)[1]} == expected
