"""FMUs that PythonFMU exported, coupled by our master.

Their libraries expect Python in the process: that of the python3 in PATH is loaded, or that of --preload.
Where there is none, the error says so.
"""

import os
import sys

import numpy as np
import pytest
from pythonfmu import FmuBuilder

from any_fmu import numbers, run
from lqr_controller import GAINS, STATES
from test_swap import foreign, preload  # noqa: F401

# An embedded Python searches its modules beside the first python3 in PATH.
ENVIRONMENT = {**os.environ, "PYTHONHOME": sys.base_prefix}
STEP, COUNT = 2.0**-8, 512  # s; two seconds
EVERY_TYPE = '''
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Integer, Real, String


class EveryType(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.count, self.even, self.half, self.text = 0, True, 0.0, "0 steps"
        for variable in (Integer("count", causality=Fmi2Causality.output),
                         Boolean("even", causality=Fmi2Causality.output),
                         Real("half", causality=Fmi2Causality.output),
                         String("text", causality=Fmi2Causality.output)):
            self.register_variable(variable)

    def do_step(self, current_time, step_size):
        self.count += 1
        self.even = not self.even
        self.half += step_size / 2
        self.text = f"{self.count} steps"
        return True
'''


@pytest.fixture
def loop(foreign, packed):  # noqa: F811
    """Our plant and the regulator of PythonFMU, connected both ways."""
    links = [f"plant.{name}=controller.{name}" for name in STATES] + ["controller.u=plant.u"]
    return {"plant": packed["plant"], "controller": foreign / "LqrController.fmu"}, links


def test_a_regulator_of_pythonfmu_uses_the_outputs_of_the_previous_step(
    aso_ftc, loop, preload, tmp_path  # noqa: F811
):
    fmus, links = loop
    table = run(
        aso_ftc, tmp_path, fmus, STEP, STEP * COUNT, *preload, links=links, env=ENVIRONMENT
    )
    states = np.array([numbers(table, f"plant.{name}") for name in STATES]).T
    force = numbers(table, "controller.u")
    assert len(force) == COUNT + 1 and abs(force).max() > 1
    # The law of lqr_controller.py, with the same order of summation.
    expected = np.array([-sum(k * x for k, x in zip(GAINS, row)) for row in states.tolist()])
    assert np.array_equal(force[2:], expected[1:-1]), "each from the begin of its step"


def test_a_regulator_of_pythonfmu_gives_the_same_results_in_a_process_of_its_own(
    aso_ftc, loop, preload, tmp_path  # noqa: F811
):
    fmus, links = loop
    tables = [
        run(aso_ftc, tmp_path, fmus, STEP, 1, *preload, *more, links=links, env=ENVIRONMENT)
        for more in ([], ["--isolate"])
    ]
    assert tables[0] == tables[1]


def test_variables_of_every_type_of_pythonfmu_are_recorded(
    aso_ftc, preload, tmp_path  # noqa: F811
):
    script = tmp_path / "every_type.py"
    script.write_text(EVERY_TYPE, encoding="utf-8")
    fmu = FmuBuilder.build_FMU(script, dest=tmp_path)
    table = run(aso_ftc, tmp_path, {"e": fmu}, 0.25, 2, *preload, env=ENVIRONMENT)
    assert table["e.count"] == tuple(str(k) for k in range(9))
    assert table["e.text"] == tuple(f"{k} steps" for k in range(9))
    assert numbers(table, "e.half").tolist() == [k / 8 for k in range(9)]
    even = [value.lower() in ("1", "true") for value in table["e.even"]]
    assert even == [k % 2 == 0 for k in range(9)]


@pytest.mark.parametrize("more", [[], ["--isolate"]])
def test_the_library_of_the_python3_in_path_is_loaded_without_an_option(
    aso_ftc, loop, preload, tmp_path, more  # noqa: F811
):
    fmus, links = loop
    path = f"{os.path.dirname(sys.executable)}{os.pathsep}{os.environ['PATH']}"
    environment = {**ENVIRONMENT, "PATH": path}
    table = run(aso_ftc, tmp_path, fmus, STEP, 1, *more, links=links, env=environment)
    assert table == run(aso_ftc, tmp_path, fmus, STEP, 1, *preload, links=links, env=ENVIRONMENT)


def test_without_a_python_the_last_line_of_the_error_is_the_cause(aso_ftc, loop, tmp_path):
    fmus, links = loop
    nowhere = {**os.environ, "PATH": str(tmp_path)}
    message = run(aso_ftc, tmp_path, fmus, STEP, 1, links=links, status=2, env=nowhere)
    last = message.strip().splitlines()[-1]
    assert "undefined symbol" in last and "python3" in last, "what the loader said"
    assert "--preload" in last and "needsExecutionTool" not in last
