//! The statement of one variable, from which description, value references and access follow.

use crate::description::{Causality, Initial, Variability};

/// Reaches one field of a model.
pub(crate) type Field<M, T> = Box<dyn for<'a> Fn(&'a mut M) -> &'a mut T + Send + Sync>;

/// The field behind a variable, by type.
pub(crate) enum Access<M> {
    Real(Field<M, f64>),
    Integer(Field<M, i32>),
    Boolean(Field<M, bool>),
    String(Field<M, String>),
}

/// One variable of a model: name, role and the field that holds its value.
///
/// Made by [`Variable::real`], [`Variable::integer`], [`Variable::boolean`] or
/// [`Variable::string`]; then the role ([`input`](Variable::input), [`output`](Variable::output),
/// [`parameter`](Variable::parameter), [`tunable`](Variable::tunable); a local variable without
/// any), then unit and limits.
pub struct Variable<M> {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    pub(crate) unit: Option<String>,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) direct: Vec<String>,
    pub(crate) initially: Option<Vec<String>>,
    pub(crate) derivatives: Vec<Field<M, f64>>,
    pub(crate) access: Access<M>,
}

impl<M> Variable<M> {
    /// A `Real` variable held in the field that `field` reaches.
    pub fn real<F>(name: impl Into<String>, description: impl Into<String>, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut f64 + Send + Sync + 'static,
    {
        Self::local(name, description, Variability::Continuous, Access::Real(Box::new(field)))
    }

    /// An `Integer` variable.
    pub fn integer<F>(name: impl Into<String>, description: impl Into<String>, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut i32 + Send + Sync + 'static,
    {
        Self::local(name, description, Variability::Discrete, Access::Integer(Box::new(field)))
    }

    /// A `Boolean` variable.
    pub fn boolean<F>(name: impl Into<String>, description: impl Into<String>, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut bool + Send + Sync + 'static,
    {
        Self::local(name, description, Variability::Discrete, Access::Boolean(Box::new(field)))
    }

    /// A `String` variable.
    pub fn string<F>(name: impl Into<String>, description: impl Into<String>, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut String + Send + Sync + 'static,
    {
        Self::local(name, description, Variability::Discrete, Access::String(Box::new(field)))
    }

    fn local(
        name: impl Into<String>,
        description: impl Into<String>,
        variability: Variability,
        access: Access<M>,
    ) -> Self {
        Self {
            name: name.into(),
            description: description.into(),
            causality: Causality::Local,
            variability,
            initial: Some(Initial::Calculated),
            unit: None,
            min: None,
            max: None,
            direct: Vec::new(),
            initially: None,
            derivatives: Vec::new(),
            access,
        }
    }

    /// An input.
    #[must_use]
    pub fn input(self) -> Self {
        Self { causality: Causality::Input, initial: None, ..self }
    }

    /// An output. `direct` names the inputs it depends on without a step in between
    /// (`ModelStructure`, section 2.2.8); none for an output that a step alone changes.
    #[must_use]
    pub fn output(self, direct: &[&str]) -> Self {
        let direct = direct.iter().map(ToString::to_string).collect();
        Self { causality: Causality::Output, direct, ..self }
    }

    /// A parameter that is fixed after initialization.
    #[must_use]
    pub fn parameter(self) -> Self {
        self.any_parameter(Variability::Fixed)
    }

    /// A parameter that may be changed between steps.
    #[must_use]
    pub fn tunable(self) -> Self {
        self.any_parameter(Variability::Tunable)
    }

    fn any_parameter(self, variability: Variability) -> Self {
        let initial = Some(Initial::Exact);
        Self { causality: Causality::Parameter, variability, initial, ..self }
    }

    /// The unit, as [`Unit::parse`](crate::unit::Unit::parse) reads it.
    #[must_use]
    pub fn unit(self, unit: impl Into<String>) -> Self {
        Self { unit: Some(unit.into()), ..self }
    }

    /// The smallest and the largest value that may be set; what lies outside is discarded.
    #[must_use]
    pub fn range(self, min: f64, max: f64) -> Self {
        Self { min: Some(min), max: Some(max), ..self }
    }

    /// The inputs and exact parameters (or `time`) on which the initial value depends.
    /// Without this an importer has to assume all of them.
    #[must_use]
    pub fn initially<S: Into<String>>(self, names: impl IntoIterator<Item = S>) -> Self {
        Self { initially: Some(names.into_iter().map(Into::into).collect()), ..self }
    }

    /// The field of the next derivative with respect to time: first call first order, and so on.
    ///
    /// Of an input: the field that `fmi2SetRealInputDerivatives` sets; the derivatives belong to
    /// the begin of the step and are set back to zero after it. Of an output: the field that
    /// `fmi2GetRealOutputDerivatives` reads.
    #[must_use]
    pub fn derivative<F>(mut self, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut f64 + Send + Sync + 'static,
    {
        self.derivatives.push(Box::new(field));
        self
    }
}
