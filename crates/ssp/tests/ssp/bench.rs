//! Files for the tests: FMUs that are a description only, and what surrounds them.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use fmu_description::package::{Package, platforms};
use slave::Transformation;
use ssp::{Assembly, Link};
use ssp::{Opened, SspError, open};
use tempfile::TempDir;

/// The root tag of an SSD file and what closes it.
pub(crate) fn ssd(system: &str, rest: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="Test" version="1.0"
 xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
 xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
 xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">
<ssd:System name="Root">{system}</ssd:System>{rest}
</ssd:SystemStructureDescription>"#
    )
}

/// An SSV file.
pub(crate) fn ssv(parameters: &str) -> String {
    format!(
        r#"<ssv:ParameterSet name="set" version="1.0"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
<ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>"#
    )
}

/// A component that is the FMU `source`, with connectors `name kind type`.
pub(crate) fn component(name: &str, source: &str, connectors: &str, rest: &str) -> String {
    let connectors = self::connectors(connectors);
    format!(r#"<ssd:Component name="{name}" source="{source}">{connectors}{rest}</ssd:Component>"#)
}

/// Connectors, one for each line `name kind`, optionally with the XML of the type.
pub(crate) fn connectors(lines: &str) -> String {
    let mut list = String::new();
    for line in lines.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let mut words = line.splitn(3, ' ');
        let (name, kind) = (words.next().unwrap(), words.next().unwrap());
        let kind_of_value = words.next().unwrap_or_default();
        let _ = write!(
            list,
            r#"<ssd:Connector name="{name}" kind="{kind}">{kind_of_value}</ssd:Connector>"#
        );
    }
    if list.is_empty() { list } else { format!("<ssd:Connectors>{list}</ssd:Connectors>") }
}

/// A connection `a.b` to `c.d`; an end without a dot is the system's. The last dot counts.
pub(crate) fn connection(start: &str, end: &str, rest: &str, attributes: &str) -> String {
    let side = |which: &str, text: &str| match text.rsplit_once('.') {
        Some((element, connector)) => {
            format!(r#"{which}Element="{element}" {which}Connector="{connector}""#)
        }
        None => format!(r#"{which}Connector="{text}""#),
    };
    let (start, end) = (side("start", start), side("end", end));
    format!("<ssd:Connection {start} {end} {attributes}>{rest}</ssd:Connection>")
}

/// A nested system.
pub(crate) fn system(name: &str, lines: &str, elements: &str, connections: &str) -> String {
    let connectors = connectors(lines);
    format!(
        r#"<ssd:System name="{name}">{connectors}<ssd:Elements>{elements}</ssd:Elements>
<ssd:Connections>{connections}</ssd:Connections></ssd:System>"#
    )
}

/// The elements and connections of the root system.
pub(crate) fn root(elements: &str, connections: &str) -> String {
    let connections = if connections.is_empty() {
        String::new()
    } else {
        format!("<ssd:Connections>{connections}</ssd:Connections>")
    };
    format!("<ssd:Elements>{elements}</ssd:Elements>{connections}")
}

const UNITS: &str = r#"<UnitDefinitions>
<Unit name="rad"><BaseUnit rad="1"/></Unit>
<Unit name="deg"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit>
<Unit name="m"><BaseUnit m="1"/></Unit>
<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
<Unit name="K"><BaseUnit K="1"/></Unit>
<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
<Unit name="bar"/>
</UnitDefinitions>
<TypeDefinitions>
<SimpleType name="Gear"><Enumeration><Item name="low" value="1"/><Item name="high" value="2"/></Enumeration></SimpleType>
<SimpleType name="Speed"><Enumeration><Item name="slow" value="10"/><Item name="fast" value="20"/></Enumeration></SimpleType>
</TypeDefinitions>"#;

/// The XML of an FMU, one variable for each line `name causality type [attributes of the type]`; the
/// causality `constant` is a local constant.
pub(crate) fn description(model: &str, lines: &str) -> String {
    let (mut variables, mut outputs) = (String::new(), String::new());
    for (reference, line) in lines.lines().map(str::trim).filter(|l| !l.is_empty()).enumerate() {
        let mut words = line.splitn(4, ' ');
        let (name, causality, kind) =
            (words.next().unwrap(), words.next().unwrap(), words.next().unwrap());
        let attributes = words.next().unwrap_or_default();
        if causality == "output" {
            let _ = write!(outputs, r#"<Unknown index="{}"/>"#, reference + 1);
        }
        let variability = match (causality, kind) {
            ("constant", _) => "constant",
            ("parameter" | "calculatedParameter", _) => "fixed",
            (_, "Real") => "continuous",
            _ => "discrete",
        };
        let causality = if causality == "constant" { "local" } else { causality };
        let needs_start = matches!(causality, "input" | "parameter");
        let start = match kind {
            _ if !needs_start => "",
            "String" => r#"start="""#,
            "Boolean" => r#"start="false""#,
            "Enumeration" => r#"start="1""#,
            _ => r#"start="0""#,
        };
        let _ = write!(
            variables,
            r#"<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" variability="{variability}"><{kind} {start} {attributes}/></ScalarVariable>"#
        );
    }
    if !outputs.is_empty() {
        outputs = format!("<Outputs>{outputs}</Outputs>");
    }
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="{model}" guid="g"><CoSimulation modelIdentifier="{model}"/>{UNITS}<ModelVariables>{variables}</ModelVariables><ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"#
    )
}

/// A folder that fills with files.
pub(crate) struct Bench(TempDir);

impl Bench {
    pub(crate) fn new() -> Self {
        Bench(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, content).unwrap();
        path
    }

    /// An FMU that nobody could run.
    pub(crate) fn fmu(&self, name: &str, variables: &str) -> PathBuf {
        let model = Path::new(name).file_stem().unwrap().to_str().unwrap();
        let mut package = Package::new(description(model, variables));
        let library = format!("binaries/{}/{model}.so", platforms()[0]);
        package.add(library, "not a library");
        package.add(
            "resources/inner.ssv",
            ssv(r#"<ssv:Parameter name="p"><ssv:Real value="7"/></ssv:Parameter>"#),
        );
        let path = self.path(name);
        package.write(&path).unwrap();
        path
    }

    /// Opens an SSD made of this system.
    pub(crate) fn open(&self, system: &str, rest: &str) -> Result<Opened, SspError> {
        open(&self.file("System.ssd", ssd(system, rest)))
    }

    /// The sentence that the refusal of this system is, without the name of the file.
    pub(crate) fn refusal(&self, system: &str, rest: &str) -> String {
        let text = self.open(system, rest).unwrap_err().to_string();
        let file = self.path("System.ssd").display().to_string();
        text.strip_prefix(&format!("{file}: ")).unwrap_or(&text).to_owned()
    }
}

/// A link as a short text.
pub(crate) fn spelt(link: &Link) -> String {
    let value = match &link.transformation {
        Transformation::Identity => String::new(),
        Transformation::Linear { factor, offset } => format!(" * {factor:?} + {offset:?}"),
        Transformation::Integer(pairs) => format!(" {pairs:?}"),
        Transformation::Boolean { from_false, from_true } => format!(" {from_false} {from_true}"),
    };
    assert!(link.units_settled);
    format!("{} -> {}{value}", link.from, link.to)
}

pub(crate) fn links(assembly: &Assembly) -> Vec<String> {
    assembly.links.iter().map(spelt).collect()
}

/// `element.variable = value` of all settings.
pub(crate) fn settings(assembly: &Assembly) -> Vec<String> {
    let all = assembly.elements.iter().flat_map(|element| {
        element.settings.iter().map(move |setting| {
            format!("{}.{} = {}", element.name, setting.variable, setting.value)
        })
    });
    all.collect()
}
