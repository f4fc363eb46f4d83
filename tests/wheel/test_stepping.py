"""Simulations that Python advances."""

import logging
import threading

import aso_ftc as af
import numpy as np
import pytest


def test_steps_one_by_one_are_the_steps_of_a_run(paper):
    expected = paper.run(record_every="step")
    with paper.simulation() as simulation:
        rows = [(simulation.time, simulation["plant.x_p"])]
        while not simulation.finished:
            assert simulation.step() == 1
            rows.append((simulation.time, simulation["plant.x_p"]))
        assert simulation.step() == 0
    times, values = zip(*rows)
    assert np.array_equal(times, expected.time) and np.array_equal(values, expected["plant.x_p"])


def test_several_steps_and_a_time_are_reached(paper):
    with paper.simulation(stop_time=1.0) as simulation:
        assert simulation.step(10) == 10 and simulation.time == pytest.approx(0.01)
        assert simulation.run_until(0.03) == 20 and simulation.time == pytest.approx(0.03)
        assert simulation.run_until(0.01) == 0
        assert simulation.run_until(7.0) == 970 and simulation.finished
        values = simulation.get(["plant.x_p", "plant.regime", "controller.compensate"])
        assert [type(value) for value in values] == [float, int, bool]
        assert "plant.x_p" in simulation.names()


class Clock:
    """Its output is the time."""

    outputs = ("t",)

    def step(self, t, dt, inputs):
        return {"t": t + dt}


def test_a_time_in_seconds_since_1970_is_reached_by_its_own_steps():
    # A relative difference of 1e-9 is 1.7 s there.
    start = 1.7e9
    with af.System().add("clock", Clock()).simulation(start_time=start, stop_time=start + 10, step=0.25) as simulation:
        assert simulation.run_until(start + 1) == 4 and simulation["clock.t"] == start + 1
        assert simulation.run_until(start + 1.25) == 1


ALGORITHMS = [
    {},
    {"method": "jacobi", "extrapolation": "quadratic"},
    {"coupling": "anderson"},
    {"step-control": "doubling", "coupling": "newton"},
]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_restored_simulation_repeats_its_steps_bit_for_bit(paper, algorithm):
    paper.add_fault("controller.x_p", "noise", amplitude=1e-6, seed=1)
    paper.add_fault("controller.theta", "delay", seconds=0.004)
    paper.add_signal("plant.f_a", sine={"amplitude": 3.0, "frequency": 40.0})
    with paper.simulation(stop_time=1.0, algorithm=algorithm) as simulation:
        names = ["plant.x_p", "plant.theta", "controller.f_hat", "controller.u"]
        simulation.step(20)
        state, time = simulation.save(), simulation.time
        first = []
        for _ in range(30):
            simulation.step()
            first.append(simulation.get(names))
        for _ in range(2):
            simulation.restore(state)
            assert simulation.time == time
            again = []
            for _ in range(30):
                simulation.step()
                again.append(simulation.get(names))
            assert again == first
    with paper.simulation(stop_time=1.0, algorithm=algorithm) as other:
        other.restore(state)
        other.step()
        assert other.get(names) == first[0]
        with pytest.raises(ValueError, match="no state"):
            other.restore(b"nothing")


def test_one_run_is_the_start_of_several_with_a_fault_each(paper):
    with paper.simulation(stop_time=1.0) as nominal:
        nominal.run_until(0.02)
        state = nominal.save()
    for start in (0.05, 0.06):
        late = [af.fault("controller.x_p", "bias", value=0.01, start=start)]
        with paper.simulation(stop_time=1.0, faults=late) as whole, paper.simulation(stop_time=1.0, faults=late) as branch:
            branch.restore(state)
            assert whole.run_until(0.1) > branch.run_until(0.1)
            assert branch["plant.x_p"] == whole["plant.x_p"]
    with paper.simulation(stop_time=1.0, faults=[af.fault("controller.x_p", "bias", value=0.01)]) as other:
        with pytest.raises(af.ConfigurationError, match="only faults that begin later may differ"):
            other.restore(state)


def test_a_set_input_acts_from_the_next_step_on():
    system = af.System().add("p", af.fmus()["FrictionPendulum"])
    with system.simulation(stop_time=1.0, step=0.01) as simulation:
        simulation.set("p.u", 50.0)
        before = simulation["p.x_p"]
        simulation.step()
        assert simulation["p.u"] == 50.0 and simulation["p.x_p"] != before
        for name, text in [("p.x_p", "causality output"), ("p.none", "no variable")]:
            with pytest.raises(af.ConfigurationError, match=text):
                simulation.set(name, 1.0)
        with pytest.raises(af.ConfigurationError, match="cannot be set to big"):
            simulation.set("p.u", "big")
        with pytest.raises(KeyError):
            simulation["p.none"]
        simulation.set("p.u", np.float32(1.5))
        assert simulation["p.u"] == 1.5


def test_only_a_boolean_or_a_number_is_a_boolean(paper):
    with paper.simulation() as simulation:
        for value in (False, True, np.bool_(False), 0.0, np.float64(2.0), 0, 1):
            simulation.set("controller.compensate", value)
            assert simulation["controller.compensate"] is bool(value)
        for value in ("false", None, [], b""):
            with pytest.raises(af.ConfigurationError, match="controller.compensate cannot be set to") as caught:
                simulation.set("controller.compensate", value)
            assert isinstance(caught.value.__cause__, TypeError) and simulation["controller.compensate"] is True


def test_a_message_arrives_at_the_end_of_the_call_that_caused_it(caplog):
    system = af.System().add("p", af.fmus()["FrictionPendulum"])
    with system.simulation(stop_time=1.0, step=0.01) as simulation, caplog.at_level(logging.WARNING, "aso_ftc"):
        with pytest.raises(af.RunError):
            simulation.set("p.u", float("nan"))
        assert "expected a finite number" in caplog.text


def test_a_connected_input_cannot_be_set(paper):
    with paper.simulation() as simulation:
        with pytest.raises(af.ConfigurationError, match="is connected to controller.u"):
            simulation.set("plant.u", 1.0)


def test_a_closed_simulation_says_so(paper):
    simulation = paper.simulation()
    simulation.close()
    simulation.close()
    for call in (simulation.step, simulation.save, lambda: simulation["plant.x_p"], lambda: simulation.time):
        with pytest.raises(RuntimeError, match="closed"):
            call()


def test_threads_may_share_a_simulation(paper):
    with paper.simulation(stop_time=10.0) as simulation:
        threads = [threading.Thread(target=simulation.step, args=(500,)) for _ in range(4)]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            simulation["plant.x_p"]
        assert simulation.time == pytest.approx(2.0)
