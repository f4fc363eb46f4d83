"""Measures the time of a step in one master: a child process of scripts/bench/benchmark-peers.

    python peers.py MASTER SYSTEM STEPS [CSV]

SYSTEM is a JSON file: step in s; fmus, each with name, path, set (Reals by name) and outputs (names);
links, each [FMU, output, FMU, input]. The MASTER makes STEPS steps by Jacobi's method with held
inputs, and writes every output at every step to CSV, if given. Prints the same as tests/speed/loop.c: processor
time in ns of the start (from the archives to the end of initialisation) and of one step, peak memory
in KiB, and the sum of all outputs at the end.
"""

import ctypes
import json
import logging
import os
import sys
import tempfile
import time
import uuid
from importlib import metadata
from pathlib import Path

NANOSECONDS = 1_000_000_000


def peak():
    """Peak memory in KiB, if the system is Linux."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return 0
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def measured(start, steps, outputs):
    """Times `start`, which returns a function that makes a number of steps, and that function."""
    begin = time.process_time_ns()
    run = start()
    started = time.process_time_ns()
    run(steps)
    stepped = time.process_time_ns()
    return {
        "start_ns": started - begin,
        "step_ns": (stepped - started) / max(steps, 1),
        "peak_kib": peak(),
        "sum": sum(outputs()),
    }


def names(system):
    """FMU and name of every output."""
    return [(fmu["name"], output) for fmu in system["fmus"] for output in fmu["outputs"]]


def libcosim(system, steps, csv):
    """libcosim by libcosimpy, with its fixed-step algorithm; with CSV its file observer,
    which writes all variables, a file for each FMU."""
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    step = round(system["step"] * NANOSECONDS)
    assert step == system["step"] * NANOSECONDS, "libcosim counts ns"
    execution = CosimExecution.from_step_size(step)
    last, index, references = CosimObserver.create_last_value(), {}, {}

    def start():
        for fmu in system["fmus"]:
            name = fmu["name"]
            index[name] = execution.add_local_slave(CosimLocalSlave(fmu["path"], name))
            listed = execution.slave_variables(index[name])
            references[name] = {v.name.decode(): v.reference for v in listed}
            for variable, value in fmu["set"].items():
                assert execution.real_initial_value(index[name], references[name][variable], value)
        for source, output, sink, name in system["links"]:
            ends = (index[source], references[source][output], index[sink], references[sink][name])
            assert execution.connect_real_variables(*ends) == 0
        if csv:
            folder = Path(csv).with_suffix("")
            folder.mkdir()
            assert execution.add_observer(CosimObserver.create_to_dir(str(folder)))
        execution.step(0)
        # The last step follows below, with its outputs observed.
        return lambda count: execution.step(count - 1) or sys.exit("libcosim fails")

    def outputs():
        assert execution.add_observer(last) and execution.step()
        ends = [(name, references[name][output]) for name, output in names(system)]
        return [last.last_real_values(index[name], [each])[0] for name, each in ends]

    assert CosimVariableType.REAL.value == 0
    return measured(start, steps, outputs)


def ecos(system, steps, csv):
    """Ecos by ecospy, with its fixed-step algorithm; with CSV its CSV writer."""
    (tbb,) = (file for file in metadata.files("tbb") if file.name == "libtbb.so.12")
    ctypes.CDLL(str(tbb.locate()))
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure

    EcosLib.set_log_level("err")
    texts = [f"{name}::{output}" for name, output in names(system)]
    running = []

    def start():
        with EcosSimulationStructure() as structure:
            for fmu in system["fmus"]:
                structure.add_model(fmu["name"], fmu["path"])
            for source, output, sink, name in system["links"]:
                structure.make_real_connection(f"{source}::{output}", f"{sink}::{name}")
            pairs = {
                f"{fmu['name']}::{name}": float(value)
                for fmu in system["fmus"]
                for name, value in fmu["set"].items()
            }
            if pairs:
                structure.add_parameter_set("settings", pairs)
            simulation = EcosSimulation(system["step"], structure=structure)
        if csv:
            simulation.add_csv_writer(csv, identifiers=texts)
        running.append(simulation)
        assert simulation.init(parameter_set="settings" if pairs else None)
        return simulation.step

    result = measured(start, steps, lambda: [running[0].get_real(text) for text in texts])
    running[0].terminate()
    running[0].free()
    return result


def fmpy_loop(system, steps, csv):
    """A loop in Python over FMPy's FMU2Slave, with batched calls; with CSV a row of repr of each value."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    slaves, wires, last = {}, {}, {}

    def begin(fmu):
        folder = extract(fmu["path"])
        description = read_model_description(folder)
        references = {v.name: v.valueReference for v in description.modelVariables}
        slave = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=folder,
            instanceName=fmu["name"],
        )
        slave.instantiate()
        if fmu["set"]:
            slave.setReal([references[name] for name in fmu["set"]], list(fmu["set"].values()))
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        connected = {output for name, output, _, _ in system["links"] if name == fmu["name"]}
        read = [name for name in fmu["outputs"] if csv or name in connected]
        slaves[fmu["name"]] = slave, [references[name] for name in read]
        wires[fmu["name"]] = read, references

    def exchange():
        for name, (slave, read) in slaves.items():
            last[name] = slave.getReal(read)
        for name, (references, sources) in inputs.items():
            slaves[name][0].setReal(references, [last[source][k] for source, k in sources])

    inputs = {}

    def start():
        for fmu in system["fmus"]:
            begin(fmu)
        for source, output, sink, name in system["links"]:
            references, sources = inputs.setdefault(sink, ([], []))
            references.append(wires[sink][1][name])
            sources.append((source, wires[source][0].index(output)))
        for _ in range(min(len(slaves), 2) + 1):
            exchange()
        for slave, _ in slaves.values():
            slave.exitInitializationMode()
        exchange()
        return run

    def run(count):
        size = system["step"]
        for k in range(count):
            for slave, _ in slaves.values():
                slave.doStep(k * size, size)
            exchange()
            if file:
                row = [value for values in last.values() for value in values]
                file.write(",".join(map(repr, [(k + 1) * size, *row])) + "\n")

    file = open(csv, "w", encoding="utf-8") if csv else None
    def outputs():
        return [
            slaves[name][0].getReal([wires[name][1][output]])[0] for name, output in names(system)
        ]

    return measured(start, steps, outputs)


def fmpy_container(system, folder):
    """Packs the system as FMPy's FMU container; returns its path."""
    from fmpy import read_model_description
    from fmpy.container_fmu.cli import create_container_fmu
    from fmpy.container_fmu.config import Component, Configuration, Connection
    from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable, Unknown

    components, variables, mapped, grouped = {}, {}, {}, {}
    for fmu in system["fmus"]:
        description = read_model_description(fmu["path"])
        components[fmu["name"]] = Component(fmu["name"], Path(fmu["path"]), description)
        variables[fmu["name"]] = {v.name: v for v in description.modelVariables}
        for variable in description.modelVariables:
            # The runtime knows the types of FMI 3 only. FMPy 0.3.32 renames the types of the
            # container's own variables, but not those of connections.
            variable.type = {"Real": "Float64"}.get(variable.type, variable.type)
        for name, value in fmu["set"].items():
            variable = ModelVariable(f"{fmu['name']}.{name}", 0, start=str(value))
            variable.type, variable.causality, variable.variability = "Real", "parameter", "tunable"
            mapped[variable] = [(components[fmu["name"]], variables[fmu["name"]][name])]
        for name in fmu["outputs"]:
            variable = ModelVariable(f"{fmu['name']}.{name}", 0)
            variable.type, variable.causality = "Real", "output"
            mapped[variable] = [(components[fmu["name"]], variables[fmu["name"]][name])]
    for source, output, sink, name in system["links"]:
        grouped.setdefault((source, sink), []).append(
            (variables[source][output], variables[sink][name])
        )
    container = ModelDescription(
        fmiVersion="2.0", modelName="container", instantiationToken=str(uuid.uuid4())
    )
    container.coSimulation = CoSimulation(
        modelIdentifier="container_fmu", fixedInternalStepSize=system["step"]
    )
    container.coSimulation.canHandleVariableCommunicationStepSize = True
    # In the runtime, the time has value reference 0.
    clock = ModelVariable("time", 0, causality="independent", variability="continuous")
    clock.type = "Real"
    container.modelVariables = [clock, *mapped]
    outputs = [variable for variable in mapped if variable.causality == "output"]
    container.outputs = [Unknown(variable=variable) for variable in outputs]
    container.initialUnknowns = [Unknown(variable=variable) for variable in outputs]
    connections = [
        Connection(
            components[source], [a for a, _ in pairs], components[sink], [b for _, b in pairs]
        )
        for (source, sink), pairs in grouped.items()
    ]
    path = Path(folder) / "fmpy_container.fmu"
    configuration = Configuration(
        parallelDoStep=False,
        modelDescription=container,
        components=list(components.values()),
        connections=connections,
        variableMappings=mapped,
    )
    with tempfile.TemporaryDirectory() as unzipped:
        inner = Path(unzipped) / "inner"
        inner.mkdir()
        create_container_fmu(configuration, inner, path)
    return path


def toolbox_container(system, folder):
    """Packs the system as a container of Renault's fmu-manipulation-toolbox; returns its path."""
    from fmu_manipulation_toolbox.container import FMUContainer

    logging.getLogger("fmu_manipulation_toolbox").setLevel(logging.CRITICAL)
    container = FMUContainer("container", Path(system["fmus"][0]["path"]).parent)
    file = {fmu["name"]: Path(fmu["path"]).name for fmu in system["fmus"]}
    assert len(set(file.values())) == len(file), "a file for each FMU"
    for fmu in system["fmus"]:
        container.get_fmu(file[fmu["name"]])
        for name, value in fmu["set"].items():
            container.add_start_value(file[fmu["name"]], name, str(value))
        for name in fmu["outputs"]:
            container.add_output(file[fmu["name"]], name, f"{fmu['name']}.{name}")
    for source, output, sink, name in system["links"]:
        container.add_link(file[source], output, file[sink], name)
    container.add_implicit_rule(auto_input=False, auto_output=False, auto_link=False)
    path = Path(folder) / "toolbox_container.fmu"
    container.make_fmu(path, step_size=system["step"])
    return path


MASTERS = {"libcosim": libcosim, "ecos": ecos, "fmpy": fmpy_loop}


def main():
    """Measures one master and prints the figures."""
    if len(sys.argv) not in (4, 5) or sys.argv[1] not in MASTERS:
        sys.exit(__doc__)
    system = json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))
    result = MASTERS[sys.argv[1]](system, int(sys.argv[3]), sys.argv[4] if sys.argv[4:] else None)
    # Libraries print to stdout too.
    sys.stdout.flush()
    print("\n" + json.dumps(result), flush=True)
    # Some libraries fail in their destructors.
    os._exit(0)


if __name__ == "__main__":
    main()
