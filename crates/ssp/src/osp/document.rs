//! Parses `OspSystemStructure.xml`. Nothing here opens a file.

use std::str::FromStr;

use fmu_description::Position;
use fmu_description::xml::{self, Element};

use crate::assembly::Setting;
use crate::error::SspError;
use crate::function::Function as Sum;

/// Default base step in s.
const STEP: f64 = 0.1;
/// Maximum number of inputs and of components of a sum.
const COUNT: usize = 100_000;
/// The elements that may occur once.
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

/// `Simulator`.
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

/// A connection of two variables, of a variable and a signal of a function, or of two groups of them.
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
    let root = xml::read(bytes)?;
    if local(&root) != "OspSystemStructure" {
        let actual = format!("<{}>", root.name);
        return Err(wrong(&root, "the root element OspSystemStructure", actual));
    }
    for name in ONCE {
        if let Some(second) = root.children.iter().filter(|child| local(child) == name).nth(1) {
            return Err(wrong(second, format!("one element {name}"), "another one"));
        }
    }
    let mut warnings = Vec::new();
    let mut document = Document { step: STEP, ..Document::default() };
    for child in &root.children {
        match local(child) {
            "StartTime" => document.start = Some(time(child)?),
            "EndTime" => document.stop = Some(time(child)?),
            "BaseStepSize" => document.step = time(child)?,
            "Algorithm" => algorithm(child, &mut warnings)?,
            "Simulators" => document.simulators = all(child, "Simulator", simulator)?,
            "Functions" => {
                document.functions =
                    child.children.iter().map(function).collect::<Result<_, _>>()?;
            }
            "Connections" => {
                let connections = child.children.iter().map(connection);
                document.connections = connections.collect::<Result<_, _>>()?;
            }
            "EccoConfiguration" | "Description" => {}
            other => warnings.push(format!("{}: <{other}> is skipped", child.at)),
        }
    }
    if document.step <= 0.0 {
        return Err(wrong(&root, "a BaseStepSize above 0", document.step.to_string()));
    }
    Ok((document, warnings))
}

fn algorithm(element: &Element, warnings: &mut Vec<String>) -> Result<(), SspError> {
    match element.text.to_ascii_lowercase().as_str() {
        "" | "fixedstep" => Ok(()),
        "ecco" => {
            let sentence = "the algorithm ecco is not available: all steps are BaseStepSize; \
                            --step-control energy is similar";
            warnings.push(format!("{}: {sentence}", element.at));
            Ok(())
        }
        _ => Err(wrong(element, "the algorithm fixedStep or ecco", format!("{:?}", element.text))),
    }
}

fn simulator(element: &Element) -> Result<Simulator, SspError> {
    let values = element.children.iter().filter(|child| local(child) == "InitialValues");
    let values = values.flat_map(|values| &values.children).map(|value| {
        let stated = value.children.first();
        let stated =
            stated.ok_or_else(|| wrong(value, "Real, Integer, Boolean or String", "none"))?;
        Ok(Setting {
            variable: required(value, "variable")?.to_owned(),
            value: required(stated, "value")?.to_owned(),
        })
    });
    Ok(Simulator {
        name: required(element, "name")?.to_owned(),
        source: required(element, "source")?.to_owned(),
        step_size: number(element, "stepSize")?,
        settings: values.collect::<Result<_, SspError>>()?,
        at: element.at,
    })
}

fn function(element: &Element) -> Result<Function, SspError> {
    let kind = match local(element) {
        "LinearTransformation" => Kind::Linear {
            factor: number(element, "factor")?.unwrap_or(1.0),
            offset: number(element, "offset")?.unwrap_or(0.0),
        },
        "Sum" => Kind::Sum(Sum::Sum { inputs: count(element, "inputCount")? }),
        "VectorSum" => {
            let (inputs, dimension) = (count(element, "inputCount")?, count(element, "dimension")?);
            if inputs.saturating_mul(dimension) > COUNT {
                let actual = format!("{inputs} x {dimension}");
                return Err(wrong(element, format!("at most {COUNT} inputs"), actual));
            }
            Kind::Sum(Sum::VectorSum { inputs, dimension })
        }
        other => {
            let expected = "LinearTransformation, Sum or VectorSum";
            return Err(wrong(element, expected, format!("the function {other}")));
        }
    };
    Ok(Function { name: required(element, "name")?.to_owned(), kind, at: element.at })
}

fn connection(element: &Element) -> Result<Connection, SspError> {
    let groups = match local(element) {
        "VariableConnection" | "SignalConnection" => false,
        "VariableGroupConnection" | "SignalGroupConnection" => true,
        other => {
            let expected = "VariableConnection, SignalConnection, VariableGroupConnection or \
                 SignalGroupConnection";
            return Err(wrong(element, expected, other));
        }
    };
    let ends = element.children.iter().map(end).collect::<Result<Vec<_>, SspError>>()?;
    let count = ends.len();
    let ends = <[End; 2]>::try_from(ends)
        .map_err(|_| wrong(element, "two ends", format!("{count} elements")))?;
    if ends.iter().all(|end| end.is_signal) {
        return Err(wrong(element, "a variable at one end", "a signal at both"));
    }
    Ok(Connection { ends, groups, at: element.at })
}

fn end(element: &Element) -> Result<End, SspError> {
    let is_signal = local(element).starts_with("Signal");
    let owner = if is_signal { "function" } else { "simulator" };
    Ok(End {
        owner: required(element, owner)?.to_owned(),
        name: required(element, "name")?.to_owned(),
        is_signal,
    })
}

/// Reads each child with `read`; a child that is not called `name` is an error.
fn all<T>(
    element: &Element,
    name: &str,
    read: impl Fn(&Element) -> Result<T, SspError>,
) -> Result<Vec<T>, SspError> {
    let members = element.children.iter().map(|child| match local(child) {
        local_name if local_name == name => read(child),
        local_name => Err(wrong(child, format!("an element {name}"), local_name)),
    });
    members.collect()
}

/// Returns the name without prefix, because libcosim uses one namespace.
pub(super) fn local(element: &Element) -> &str {
    element.name.rsplit(':').next().unwrap_or_default()
}

pub(super) fn attribute<'a>(element: &'a Element, name: &str) -> Option<&'a str> {
    let attribute = element.attributes.iter().find(|(known, _)| known == name);
    attribute.map(|(_, value)| value.as_str())
}

fn required<'a>(element: &'a Element, name: &str) -> Result<&'a str, SspError> {
    let value = attribute(element, name);
    value.ok_or_else(|| wrong(element, format!("the attribute {name}"), "none"))
}

fn finite(text: &str) -> Option<f64> {
    f64::from_str(text.trim()).ok().filter(|value| value.is_finite())
}

fn number(element: &Element, name: &str) -> Result<Option<f64>, SspError> {
    let Some(text) = attribute(element, name) else { return Ok(None) };
    let expected = || format!("a finite number in the attribute {name}");
    finite(text).map(Some).ok_or_else(|| wrong(element, expected(), format!("{text:?}")))
}

fn count(element: &Element, name: &str) -> Result<usize, SspError> {
    let text = required(element, name)?;
    let count = text.trim().parse().ok().filter(|count| (1..=COUNT).contains(count));
    let expected = || format!("a whole number from 1 to {COUNT} in the attribute {name}");
    count.ok_or_else(|| wrong(element, expected(), format!("{text:?}")))
}

/// Reads the text of an element as a time in s.
fn time(element: &Element) -> Result<f64, SspError> {
    let wrong = || wrong(element, "a finite number", format!("{:?}", element.text));
    finite(&element.text).ok_or_else(wrong)
}

fn wrong(element: &Element, expected: impl Into<String>, actual: impl Into<String>) -> SspError {
    SspError::Content {
        at: element.at,
        element: local(element).to_owned(),
        expected: expected.into(),
        actual: actual.into(),
    }
}
