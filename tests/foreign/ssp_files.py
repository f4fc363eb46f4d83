"""System structures for the tests, each in the style of the tool that it is named after.

All couple the plant and the controller as `held_loop` does, with its settings. `libcosim`: one SSD
with annotations of the Open Simulation Platform, FMUs beside it. `ecos`: parameter sets in
files of their own. `nested`: features that these tools lack, such as nested systems, units and
transformations that cancel, a mapping, bindings that override each other.
"""

import shutil
import zipfile
from pathlib import Path

import fmpy
from lxml import etree

from held_loop import LINKS, SETTINGS, STEP

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
SCHEMA_OF = {
    ".ssd": "SystemStructureDescription.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
    ".ssm": "SystemStructureParameterMapping.xsd",
    ".ssb": "SystemStructureSignalDictionary.xsd",
}
SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
HEAD = f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="loop" version="1.0"
    xmlns:ssd="{SPACE}Description" xmlns:ssc="{SPACE}Common" xmlns:ssv="{SPACE}ParameterValues"
    xmlns:ssm="{SPACE}ParameterMapping"
    xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">
"""
TAIL = "</ssd:SystemStructureDescription>\n"
KINDS = {bool: "Boolean", int: "Integer", float: "Real"}


def problems(text, suffix):
    """The errors of a file by the schema of the standard."""
    schema = etree.XMLSchema(file=str(SCHEMAS / SCHEMA_OF[suffix]))
    schema.validate(etree.fromstring(text))
    return [str(entry) for entry in schema.error_log]


def connectors(role):
    """The connected variables of a role."""
    inputs = [name for _, _, sink, name in LINKS if sink == role]
    outputs = [name for source, name, _, _ in LINKS if source == role]
    kinds = [(name, "input") for name in inputs] + [(name, "output") for name in outputs]
    rows = [
        f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
        for name, kind in kinds
    ]
    return "<ssd:Connectors>" + "".join(rows) + "</ssd:Connectors>"


def parameters(values, name="initialValues", declaration=""):
    """A parameter set of these values."""
    rows = []
    for key, value in values.items():
        text = str(value).lower() if isinstance(value, bool) else repr(value)
        kind = KINDS[type(value)]
        rows.append(f'<ssv:Parameter name="{key}"><ssv:{kind} value="{text}"/></ssv:Parameter>')
    inside = "<ssv:Parameters>" + "".join(rows) + "</ssv:Parameters>"
    head = f'<ssv:ParameterSet version="1.0" name="{name}" {declaration}>'
    return f"{head}{inside}</ssv:ParameterSet>"


def inline(parameter_set, attributes="", mapping=""):
    """A parameter binding with inline parameters."""
    values = f"<ssd:ParameterValues>{parameter_set}</ssd:ParameterValues>"
    return f"<ssd:ParameterBinding {attributes}>{values}{mapping}</ssd:ParameterBinding>"


def bindings(*each):
    """The list of parameter bindings."""
    return "<ssd:ParameterBindings>" + "".join(each) + "</ssd:ParameterBindings>"


def component(role, source, inside):
    """A component that is an FMU."""
    return f'<ssd:Component name="{role}" source="{source}">{inside}</ssd:Component>'


def connections(rows=LINKS):
    """Connections between elements."""
    texts = [
        f'<ssd:Connection startElement="{source}" startConnector="{output}" '
        f'endElement="{sink}" endConnector="{name}"/>'
        for source, output, sink, name in rows
    ]
    return "<ssd:Connections>" + "".join(texts) + "</ssd:Connections>"


def root_system(elements):
    """A root system without connectors."""
    inside = f"<ssd:Elements>{elements}</ssd:Elements>{connections()}"
    return f'<ssd:System name="root">{inside}</ssd:System>'


def osp(space, content):
    """An annotation of the Open Simulation Platform."""
    kind = "com.opensimulationplatform"
    inside = f'<ssc:Annotation type="{kind}">{content}</ssc:Annotation>'
    return f"<{space}:Annotations>{inside}</{space}:Annotations>"


def libcosim_style(packed, folder):
    """A folder with an SSD and, beside it, the FMUs."""
    models = folder / "fmus"
    models.mkdir()
    elements = ""
    for role, path in packed.items():
        shutil.copy(path, models / f"{role}.fmu")
        settings = bindings(inline(parameters(SETTINGS[role])))
        hint = osp("ssd", f'<osp:StepSizeHint value="{STEP}"/>')
        elements += component(
            role, f"../fmus/{role}.fmu", connectors(role) + settings + hint
        )
    algorithm = f'<osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="{STEP}"/></osp:Algorithm>'
    system = root_system(elements)
    experiment = f"<ssd:DefaultExperiment>{osp('ssd', algorithm)}</ssd:DefaultExperiment>"
    target = folder / "demo" / "SystemStructure.ssd"
    target.parent.mkdir()
    target.write_text(HEAD + system + experiment + TAIL, encoding="utf-8")
    return target


def archive(target, ssd, files):
    """Packs an SSP from an SSD and other files: text, or the path of a file."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("SystemStructure.ssd", ssd)
        for name, content in files.items():
            if isinstance(content, Path):
                package.write(content, name)
            else:
                package.writestr(name, content)
    return target


def ecos_style(packed, folder):
    """An SSP with parameter sets of the same name, in files of their own."""
    declaration = f'xmlns:ssv="{SPACE}ParameterValues"'
    elements, files = "", {}
    for role, path in packed.items():
        values = f"ssv/initialValues_{role}.ssv"
        binding = bindings(f'<ssd:ParameterBinding source="{values}"/>')
        elements += component(role, f"resources/{role}.fmu", connectors(role) + binding)
        files[f"resources/{role}.fmu"] = path
        files[values] = parameters(SETTINGS[role], declaration=declaration)
    system = root_system(elements)
    experiment = '<ssd:DefaultExperiment startTime="0"/>'
    return archive(folder / "ecos.ssp", HEAD + system + experiment + TAIL, files)


def nested_style(packed, folder):
    """The plant inside of a system that scales its outputs by powers of two, without rounding errors."""
    outputs = [name for source, name, _, _ in LINKS if source == "plant"]
    settings = {f"{key}.value": value for key, value in SETTINGS["plant"].items()}
    rows = "".join(
        f'<ssm:MappingEntry source="{key}.value" target="{key}"/>' for key in SETTINGS["plant"]
    )
    mapping = f'<ssm:ParameterMapping version="1.0">{rows}</ssm:ParameterMapping>'
    mapping = f"<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping>"
    plant = component(
        "plant",
        "resources/a%20plant.fmu",
        connectors("plant") + bindings(inline(parameters(settings), "", mapping)),
    )
    double = '<ssc:LinearTransformation factor="2"/>'
    half = '<ssc:LinearTransformation factor="0.5"/>'
    kinds = [("u", "input")] + [(name, "output") for name in outputs]
    outside = "".join(f'<ssd:Connector name="{name}" kind="{kind}"/>' for name, kind in kinds)
    inside = '<ssd:Connection startConnector="u" endElement="plant" endConnector="u"/>' + "".join(
        f'<ssd:Connection startElement="plant" startConnector="{name}" endConnector="{name}">'
        f"{double}</ssd:Connection>"
        for name in outputs
    )
    system = (
        f'<ssd:System name="cart"><ssd:Connectors>{outside}</ssd:Connectors><ssd:Elements>{plant}'
        f"</ssd:Elements><ssd:Connections>{inside}</ssd:Connections></ssd:System>"
    )
    wrong = {key: 0.25 for key, value in SETTINGS["controller"].items()}
    inside = connectors("controller") + bindings(inline(parameters(wrong)))
    controller = component("controller", "resources/controller.fmu", inside)
    across = (
        '<ssd:Connection startElement="controller" startConnector="u" endElement="cart" '
        'endConnector="u"/>'
    )
    across += "".join(
        f'<ssd:Connection startElement="controller" startConnector="{name}" endElement="cart" '
        f'endConnector="{name}">{half}</ssd:Connection>'
        for name in outputs
    )
    outer = bindings(inline(parameters(SETTINGS["controller"]), 'prefix="controller."'))
    root = (
        f'<ssd:System name="root">{outer}<ssd:Elements>{system}{controller}</ssd:Elements>'
        f"<ssd:Connections>{across}</ssd:Connections></ssd:System>"
    )
    experiment = '<ssd:DefaultExperiment startTime="0" stopTime="2"/>'
    files = {
        "resources/a plant.fmu": packed["plant"],
        "resources/controller.fmu": packed["controller"],
    }
    return archive(folder / "nested.ssp", HEAD + root + experiment + TAIL, files)


def ssd_of(path):
    """The SSD of an SSP, or the SSD itself."""
    if path.suffix == ".ssd":
        return path.read_bytes()
    with zipfile.ZipFile(path) as package:
        return package.read("SystemStructure.ssd")
