//! Kinds and types of connectors and values of parameters (SSP 1.0.1 and 2.0, sections 4.5.1, 5.2.1
//! and 6).

/// `kind` of a connector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConnectorKind {
    /// `input`.
    Input,
    /// `output`.
    Output,
    /// `parameter`.
    Parameter,
    /// `calculatedParameter`.
    CalculatedParameter,
    /// `inout`, of references to signal dictionaries.
    Inout,
    /// `structuralParameter` (SSP 2.0), of FMI 3.0.
    StructuralParameter,
    /// `constant` (SSP 2.0).
    Constant,
    /// `local` (SSP 2.0).
    Local,
    /// `unspecified` (SSP 2.0): the variable of the FMU determines the kind, otherwise the connection.
    Unspecified,
}

impl ConnectorKind {
    /// All kinds, in the order of the declaration.
    pub const ALL: [ConnectorKind; 9] = [
        ConnectorKind::Input,
        ConnectorKind::Output,
        ConnectorKind::Parameter,
        ConnectorKind::CalculatedParameter,
        ConnectorKind::Inout,
        ConnectorKind::StructuralParameter,
        ConnectorKind::Constant,
        ConnectorKind::Local,
        ConnectorKind::Unspecified,
    ];

    /// Returns the attribute value of the standard.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            ConnectorKind::Input => "input",
            ConnectorKind::Output => "output",
            ConnectorKind::Parameter => "parameter",
            ConnectorKind::CalculatedParameter => "calculatedParameter",
            ConnectorKind::Inout => "inout",
            ConnectorKind::StructuralParameter => "structuralParameter",
            ConnectorKind::Constant => "constant",
            ConnectorKind::Local => "local",
            ConnectorKind::Unspecified => "unspecified",
        }
    }
}

/// Type of a connector or of an entry of a signal dictionary (section 4.5.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    /// `Real` with its `unit`; of SSP 2.0 also `Float64` and `Float32`.
    Real(Option<String>),
    /// `Integer`; of SSP 2.0 also `Int8` to `UInt64`.
    Integer,
    /// `Boolean`.
    Boolean,
    /// `String`.
    String,
    /// `Enumeration` with its `name`.
    Enumeration(String),
    /// `Binary`, which FMI 2.0 does not have.
    Binary,
    /// `Clock` (SSP 2.0), which FMI 2.0 does not have.
    Clock,
    /// An array with these dimensions (SSP 2.0), of any element type.
    Array(Vec<Dimension>),
    /// A value of any type that belongs to the clock of this name (SSP 2.0).
    Clocked(String),
}

/// `Dimension` of an array (SSP 2.0).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// `size`.
    Size(u64),
    /// `sizeConnector`: the connector that states the size.
    Connector(String),
    /// Neither `size` nor `sizeConnector`.
    Open,
}

impl Type {
    /// Describes a type that FMI 2.0 does not have; `None` for the types of FMI 2.0.
    #[must_use]
    pub fn beyond_fmi2(&self) -> Option<String> {
        Some(match self {
            Type::Binary => "a binary value".to_owned(),
            Type::Clock => "a clock".to_owned(),
            Type::Clocked(clock) => format!("a value of the clock {clock}"),
            Type::Array(dimensions) => {
                let sizes = dimensions.iter().map(|dimension| match dimension {
                    Dimension::Size(size) => size.to_string(),
                    Dimension::Connector(name) => name.clone(),
                    Dimension::Open => "any number".to_owned(),
                });
                format!("an array of {} elements", sizes.collect::<Vec<_>>().join(" x "))
            }
            _ => return None,
        })
    }
}

/// Value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// `Real` with its `unit`; of SSP 2.0 also `Float64` and `Float32`.
    Real(f64, Option<String>),
    /// `Integer`; of SSP 2.0 also `Int8` to `UInt64` with a value that fits.
    Integer(i32),
    /// `Boolean`.
    Boolean(bool),
    /// `String`.
    String(String),
    /// `Enumeration`: name of an item, and `name` of the enumeration.
    Enumeration(String, Option<String>),
    /// `Binary`, which FMI 2.0 does not have, in hexadecimal digits.
    Binary(String),
    /// `Int8` to `UInt64` (SSP 2.0) with a value beyond `i32`, which FMI 2.0 does not have.
    Long(i128),
    /// An array (SSP 2.0), which FMI 2.0 does not have: the name of the element that states the
    /// type, and the values as text.
    Array(String, Vec<String>),
}
