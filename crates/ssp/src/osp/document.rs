//! Parses `OspSystemStructure.xml`. Nothing here opens a file.

use fmu_description::{Position, xml};

use crate::assembly::Setting;
use crate::error::SspError;
use crate::function::Function as Sum;
use crate::xml::{Node, finite};

/// Default base step in s.
const STEP: f64 = 0.1;
/// Maximum number of inputs, and of components, of a sum.
const COUNT: usize = 100_000;
/// The elements that may occur at most once.
const ONCE: [&str; 7] =
    ["StartTime", "EndTime", "BaseStepSize", "Algorithm", "Simulators", "Functions", "Connections"];

/// The content of the file.
#[derive(Debug, Default)]
pub(super) struct Document {
    pub(super) start: Option<f64>,
    pub(super) stop: Option<f64>,
    pub(super) step: f64,
    pub(super) simulators: Vec<Simulator>,
    pub(super) functions: Vec<Function>,
    pub(super) connections: Vec<Connection>,
}

#[derive(Debug)]
pub(super) struct Simulator {
    pub(super) name: String,
    pub(super) source: String,
    pub(super) step_size: Option<f64>,
    pub(super) settings: Vec<Setting>,
    pub(super) at: Position,
}

/// A named function.
#[derive(Debug)]
pub(super) struct Function {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) at: Position,
}

/// The kind of a function.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    /// `LinearTransformation`.
    Linear { factor: f64, offset: f64 },
    /// `Sum` and `VectorSum`.
    Sum(Sum),
}

/// A connection of two variables, of a variable and a signal of a function, or of two groups of variables or signals.
#[derive(Debug)]
pub(super) struct Connection {
    pub(super) ends: [End; 2],
    /// Whether the ends are groups of variables or signals.
    pub(super) groups: bool,
    pub(super) at: Position,
}

/// An end of a connection.
#[derive(Clone, Debug)]
pub(super) struct End {
    /// Name of the simulator or function.
    pub(super) owner: String,
    pub(super) name: String,
    /// Whether the owner is a function.
    pub(super) is_signal: bool,
}

impl std::fmt::Display for End {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}.{}", self.owner, self.name)
    }
}

/// Parses the file; also returns warnings with positions about unknown content.
pub(super) fn read(bytes: &[u8]) -> Result<(Document, Vec<String>), SspError> {
    let element = xml::read(bytes)?;
    let actual = format!("<{}>", element.name);
    // libcosim uses a single namespace, so that namespaces are ignored.
    let root = Node::from(element);
    if root.name != "OspSystemStructure" {
        return Err(root.wrong("the root element OspSystemStructure", actual));
    }
    for name in ONCE {
        if let Some(second) = root.any_children(name).nth(1) {
            return Err(second.wrong(format!("one element {name}"), "another one"));
        }
    }
    let mut warnings = Vec::new();
    let mut document = Document { step: STEP, ..Document::default() };
    for child in &root.children {
        let children = child.children.iter();
        match child.name.as_str() {
            "StartTime" => document.start = Some(time(child)?),
            "EndTime" => document.stop = Some(time(child)?),
            "BaseStepSize" => document.step = time(child)?,
            "Algorithm" => algorithm(child, &mut warnings)?,
            "Simulators" => {
                document.simulators = children.map(simulator).collect::<Result<_, _>>()?;
            }
            "Functions" => document.functions = children.map(function).collect::<Result<_, _>>()?,
            "Connections" => {
                document.connections = children.map(connection).collect::<Result<_, _>>()?;
            }
            "EccoConfiguration" | "Description" => {}
            other => warnings.push(format!("{}: <{other}> is skipped", child.at)),
        }
    }
    if document.step <= 0.0 {
        return Err(root.wrong("a BaseStepSize above 0", document.step.to_string()));
    }
    Ok((document, warnings))
}

fn algorithm(node: &Node, warnings: &mut Vec<String>) -> Result<(), SspError> {
    match node.content.to_ascii_lowercase().as_str() {
        "" | "fixedstep" => Ok(()),
        "ecco" => {
            let sentence = "the algorithm ecco is not available: all steps are BaseStepSize; \
                            --step-control energy is similar";
            warnings.push(format!("{}: {sentence}", node.at));
            Ok(())
        }
        _ => Err(node.wrong("the algorithm fixedStep or ecco", format!("{:?}", node.content))),
    }
}

fn simulator(node: &Node) -> Result<Simulator, SspError> {
    if node.name != "Simulator" {
        return Err(node.wrong("an element Simulator", &node.name));
    }
    let values = node.any_children("InitialValues").flat_map(|values| &values.children);
    let settings = values.map(|value| {
        let stated = value.children.first();
        let stated =
            stated.ok_or_else(|| value.wrong("Real, Integer, Boolean or String", "none"))?;
        Ok(Setting {
            variable: value.required("variable")?.to_owned(),
            value: stated.required("value")?.to_owned(),
        })
    });
    Ok(Simulator {
        name: node.required("name")?.to_owned(),
        source: node.required("source")?.to_owned(),
        step_size: node.number("stepSize")?,
        settings: settings.collect::<Result<_, SspError>>()?,
        at: node.at,
    })
}

fn function(node: &Node) -> Result<Function, SspError> {
    let kind = match node.name.as_str() {
        "LinearTransformation" => Kind::Linear {
            factor: node.number("factor")?.unwrap_or(1.0),
            offset: node.number("offset")?.unwrap_or(0.0),
        },
        "Sum" => Kind::Sum(Sum::Sum { inputs: count(node, "inputCount")? }),
        "VectorSum" => {
            let (inputs, dimension) = (count(node, "inputCount")?, count(node, "dimension")?);
            if inputs.saturating_mul(dimension) > COUNT {
                let actual = format!("{inputs} x {dimension}");
                return Err(node.wrong(format!("at most {COUNT} inputs"), actual));
            }
            Kind::Sum(Sum::VectorSum { inputs, dimension })
        }
        other => {
            let expected = "LinearTransformation, Sum or VectorSum";
            return Err(node.wrong(expected, format!("the function {other}")));
        }
    };
    Ok(Function { name: node.required("name")?.to_owned(), kind, at: node.at })
}

fn connection(node: &Node) -> Result<Connection, SspError> {
    let groups = match node.name.as_str() {
        "VariableConnection" | "SignalConnection" => false,
        "VariableGroupConnection" | "SignalGroupConnection" => true,
        other => {
            let expected = "VariableConnection, SignalConnection, VariableGroupConnection or \
                 SignalGroupConnection";
            return Err(node.wrong(expected, other));
        }
    };
    let ends = node.children.iter().map(end).collect::<Result<Vec<_>, SspError>>()?;
    let count = ends.len();
    let ends = <[End; 2]>::try_from(ends)
        .map_err(|_| node.wrong("two ends", format!("{count} elements")))?;
    if ends.iter().all(|end| end.is_signal) {
        return Err(node.wrong("a variable at one end", "a signal at both"));
    }
    Ok(Connection { ends, groups, at: node.at })
}

fn end(node: &Node) -> Result<End, SspError> {
    let is_signal = node.name.starts_with("Signal");
    let owner = if is_signal { "function" } else { "simulator" };
    Ok(End {
        owner: node.required(owner)?.to_owned(),
        name: node.required("name")?.to_owned(),
        is_signal,
    })
}

fn count(node: &Node, name: &str) -> Result<usize, SspError> {
    let expected = format!("a whole number from 1 to {COUNT}");
    let count = |text: &str| text.parse().ok().filter(|count| (1..=COUNT).contains(count));
    node.needed(name, |node, name| node.parsed(name, &expected, count))
}

/// Reads the text of an element as a time in s.
fn time(node: &Node) -> Result<f64, SspError> {
    let wrong = || node.wrong("a finite number", format!("{:?}", node.content));
    finite(&node.content).ok_or_else(wrong)
}
