//! The statement of one variable, from which description, value references and access follow.

use fmu_description::{Causality, DependencyKind, Initial, Variability};

/// Reaches one field of a model.
pub(crate) type Field<M, T> = Box<dyn for<'a> Fn(&'a mut M) -> &'a mut T + Send + Sync>;

/// The field behind a variable, by type.
pub(crate) enum Access<M> {
    Real(Field<M, f64>),
    Integer(Field<M, i32>),
    Boolean(Field<M, bool>),
    String(Field<M, String>),
    /// The field of the variable with this name.
    Alias(String),
}

/// `Enumeration`: the name of the type and of its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Enumeration {
    pub(crate) name: String,
    pub(crate) items: Vec<(String, i32)>,
}

impl Enumeration {
    /// The type `name` with the `items`, each a name and its value.
    pub fn new<S: Into<String>>(
        name: impl Into<String>,
        items: impl IntoIterator<Item = (S, i32)>,
    ) -> Self {
        let items = items.into_iter().map(|(name, value)| (name.into(), value)).collect();
        Self { name: name.into(), items }
    }
}

/// Attributes of a number.
#[derive(Clone, Default)]
pub(crate) struct Number {
    pub(crate) unit: Option<String>,
    pub(crate) display_unit: Option<String>,
    pub(crate) quantity: Option<String>,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) nominal: Option<f64>,
}

/// One variable of a model: name, role and the field that holds its value.
///
/// Made by [`Variable::real`], [`Variable::integer`], [`Variable::boolean`], [`Variable::string`],
/// [`Variable::enumeration`] or [`Variable::alias`]; then the role ([`input`](Variable::input),
/// [`output`](Variable::output), [`parameter`](Variable::parameter),
/// [`tunable`](Variable::tunable), [`calculated_parameter`](Variable::calculated_parameter); a
/// local variable without any), then unit, limits and dependencies.
pub struct Variable<M> {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    pub(crate) number: Number,
    pub(crate) reinit: bool,
    pub(crate) enumeration: Option<Enumeration>,
    pub(crate) derivative_of: Option<String>,
    pub(crate) direct: Vec<(String, DependencyKind)>,
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

    /// An `Enumeration` variable: its value is that of one of the items.
    pub fn enumeration<F>(
        name: impl Into<String>,
        description: impl Into<String>,
        enumeration: Enumeration,
        field: F,
    ) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut i32 + Send + Sync + 'static,
    {
        Self { enumeration: Some(enumeration), ..Self::integer(name, description, field) }
    }

    /// Another name for the variable `of`: same type, unit and value reference. It has no start
    /// value of its own and cannot be set.
    pub fn alias(
        name: impl Into<String>,
        description: impl Into<String>,
        of: impl Into<String>,
    ) -> Self {
        Self::local(name, description, Variability::Continuous, Access::Alias(of.into()))
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
            number: Number::default(),
            reinit: false,
            enumeration: None,
            derivative_of: None,
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

    /// An output. `direct` names what it depends on without a step in between: inputs and, in a
    /// model with continuous states, states or `time` (`ModelStructure`, section 2.2.8); none for
    /// an output that a step alone changes.
    #[must_use]
    pub fn output(self, direct: &[&str]) -> Self {
        let output = Self { causality: Causality::Output, ..self };
        output.depends(DependencyKind::Dependent, direct.iter().copied())
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

    /// A parameter that [`Model::initialize`](crate::Model::initialize) computes from others.
    #[must_use]
    pub fn calculated_parameter(self) -> Self {
        let variability = Variability::Fixed;
        Self { causality: Causality::CalculatedParameter, variability, ..self }
    }

    /// A local variable or output that never changes.
    #[must_use]
    pub fn constant(self) -> Self {
        Self { variability: Variability::Constant, initial: Some(Initial::Exact), ..self }
    }

    /// A Real that changes at events or communication points only.
    #[must_use]
    pub fn discrete(self) -> Self {
        Self { variability: Variability::Discrete, ..self }
    }

    /// A local variable or output that starts with the value of its field in the fresh model; the
    /// importer may set another one before the first step.
    #[must_use]
    pub fn exact(self) -> Self {
        Self { initial: Some(Initial::Exact), ..self }
    }

    /// A local variable or output whose initial value is computed, by an iteration that starts with
    /// the value of its field; the importer may set another one before initialization mode.
    #[must_use]
    pub fn approximate(self) -> Self {
        Self { initial: Some(Initial::Approx), ..self }
    }

    /// The unit, as [`Unit::parse`](fmu_description::unit::Unit::parse) reads it.
    #[must_use]
    pub fn unit(mut self, unit: impl Into<String>) -> Self {
        self.number.unit = Some(unit.into());
        self
    }

    /// The unit to display the value in: one of the display units of the variable's unit.
    #[must_use]
    pub fn display_unit(mut self, unit: impl Into<String>) -> Self {
        self.number.display_unit = Some(unit.into());
        self
    }

    /// `quantity`: the physical quantity, such as `Force`.
    #[must_use]
    pub fn quantity(mut self, quantity: impl Into<String>) -> Self {
        self.number.quantity = Some(quantity.into());
        self
    }

    /// The smallest and the largest value that may be set; what lies outside is discarded.
    #[must_use]
    pub fn range(mut self, min: f64, max: f64) -> Self {
        (self.number.min, self.number.max) = (Some(min), Some(max));
        self
    }

    /// The typical magnitude, greater than zero; of a state, what an integrator scales its error with.
    #[must_use]
    pub fn nominal(mut self, nominal: f64) -> Self {
        self.number.nominal = Some(nominal);
        self
    }

    /// The derivative with respect to time of the continuous state called `state`.
    ///
    /// In model exchange this is what the importer integrates.
    #[must_use]
    pub fn derivative_of(self, state: impl Into<String>) -> Self {
        Self { derivative_of: Some(state.into()), ..self }
    }

    /// A continuous state that an event may change (`reinit`).
    #[must_use]
    pub fn reinit(self) -> Self {
        Self { reinit: true, ..self }
    }

    /// What an output or the derivative of a state depends on at a communication point: inputs,
    /// states, `time`, with the kind of the dependency (`dependenciesKind`, section 2.2.8).
    #[must_use]
    pub fn depends<S: Into<String>>(
        mut self,
        kind: DependencyKind,
        on: impl IntoIterator<Item = S>,
    ) -> Self {
        self.direct.extend(on.into_iter().map(|name| (name.into(), kind)));
        self
    }

    /// The inputs and variables with exact start values (or `time`) on which the initial value
    /// depends. Without this an importer has to assume all of them.
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
