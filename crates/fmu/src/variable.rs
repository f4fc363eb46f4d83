//! Declaration of a variable: the source of its description, value reference and field access.

mod declaration;
mod typed;

use fmu_description::unit::Unit;
use fmu_description::{Causality, DependencyKind, Initial, IntervalVariability, Variability};

pub(crate) use declaration::{Base, Declaration};
pub(crate) use typed::{TypedField, for_types};

/// A function that borrows one field of a model.
pub(crate) type Field<M, T> = Box<dyn for<'a> Fn(&'a mut M) -> &'a mut T + Send + Sync>;

/// The field of a variable, by base type.
pub(crate) enum Access<M> {
    Real(Field<M, f64>),
    Integer(Field<M, i32>),
    Boolean(Field<M, bool>),
    String(Field<M, String>),
    /// A type that FMI 2.0 does not have.
    Typed(TypedField<M>),
    /// An alias has no field of its own; see [`Base::Alias`].
    Alias,
}

impl<M> From<TypedField<M>> for Access<M> {
    fn from(field: TypedField<M>) -> Self {
        Access::Typed(field)
    }
}

impl<M> Access<M> {
    fn base(&self) -> Base {
        match self {
            Access::Real(_) => Base::Real,
            Access::Typed(TypedField::Clock(_)) => Base::Clock,
            _ => Base::Other,
        }
    }
}

/// An enumeration type: its name and its items.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Enumeration {
    pub(crate) name: String,
    pub(crate) items: Vec<(String, i32)>,
}

impl Enumeration {
    /// Creates the type `name` with the `items`, pairs of name and value.
    pub fn new<S: Into<String>>(
        name: impl Into<String>,
        items: impl IntoIterator<Item = (S, i32)>,
    ) -> Self {
        let items = items.into_iter().map(|(name, value)| (name.into(), value)).collect();
        Self { name: name.into(), items }
    }
}

/// The attributes of a variable that only some types have.
#[derive(Clone, Default)]
pub(crate) struct Number {
    pub(crate) unit: Option<String>,
    pub(crate) display_unit: Option<String>,
    pub(crate) relative_quantity: bool,
    pub(crate) quantity: Option<String>,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) nominal: Option<f64>,
    /// Interval of a periodic clock in s.
    pub(crate) interval: Option<f64>,
    /// How the model determines the intervals; `None` unless the variable is a timed clock.
    pub(crate) interval_variability: Option<IntervalVariability>,
    /// The media type of a Binary.
    pub(crate) mime_type: Option<String>,
}

/// A variable of a model: name, role, attributes and the field that holds its value.
///
/// Create it by [`Variable::real`], [`Variable::integer`], [`Variable::boolean`],
/// [`Variable::string`], [`Variable::enumeration`] or [`Variable::alias`]. Then set the role
/// ([`input`](Variable::input), [`output`](Variable::output), [`parameter`](Variable::parameter),
/// [`tunable`](Variable::tunable), [`calculated_parameter`](Variable::calculated_parameter); the
/// default is a local variable), then unit, limits and dependencies.
pub struct Variable<M> {
    pub(crate) declaration: Declaration,
    pub(crate) fields: Fields<M>,
}

/// The fields of the model that belong to a variable.
pub(crate) struct Fields<M> {
    pub(crate) access: Access<M>,
    pub(crate) derivatives: Vec<Field<M, f64>>,
}

/// Defines constructors of local variables. `field` borrows the field with the value.
macro_rules! constructors {
    ($($(#[$documentation:meta])*
        $constructor:ident($access:ident::$variant:ident($native:ty), $variability:ident);)*) => {
        $($(#[$documentation])*
        pub fn $constructor<F>(
            name: impl Into<String>,
            description: impl Into<String>,
            field: F,
        ) -> Self
        where
            F: for<'a> Fn(&'a mut M) -> &'a mut $native + Send + Sync + 'static,
        {
            let access = $access::$variant(Box::new(field)).into();
            Self::local(name, description, Variability::$variability, access)
        })*
    };
}

/// Defines functions that set entries of the [`Declaration`]: name and arguments, then entries with their values.
macro_rules! setters {
    ($($(#[$documentation:meta])*
        $name:ident($($argument:ident: $type:ty),*) $($($entry:ident).+ = $value:expr),+;)*) => {
        $($(#[$documentation])*
        #[must_use]
        pub fn $name(mut self, $($argument: $type),*) -> Self {
            $(self.declaration.$($entry).+ = $value;)+
            self
        })*
    };
}

impl<M> Variable<M> {
    constructors! {
        /// Creates a `Real` variable with the value in the field that `field` borrows.
        real(Access::Real(f64), Continuous);
        /// Creates an `Integer` variable.
        integer(Access::Integer(i32), Discrete);
        /// Creates a `Boolean` variable.
        boolean(Access::Boolean(bool), Discrete);
        /// Creates a `String` variable.
        string(Access::String(String), Discrete);
    }

    /// Creates the elements of a vector or matrix as Real variables, in row-major order: `name[1,1]`,
    /// `name[1,2]` and so on; `der(x)` as `name` gives `der(x[1])`. `extents` are the extents of the
    /// dimensions, `field` borrows all elements.
    ///
    /// FMI 2.0 has no arrays: each element is a variable there. In FMI 3.0 the elements are one array if the author
    /// gives all of them the same attributes.
    ///
    /// ```
    /// # use fmu::Variable;
    /// struct Filter { gains: [f64; 6] }
    /// let gains = Variable::real_array("K", "Gain", &[2, 3], |filter: &mut Filter| &mut filter.gains[..]);
    /// let variables: Vec<_> = gains.map(Variable::parameter).collect();
    /// assert_eq!(variables.len(), 6);
    /// ```
    pub fn real_array<F>(
        name: &str,
        description: &str,
        extents: &[usize],
        field: F,
    ) -> impl Iterator<Item = Self> + use<F, M>
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut [f64] + Send + Sync + 'static,
    {
        let field = std::sync::Arc::new(field);
        let (name, description) = (name.to_owned(), description.to_owned());
        let extents = extents.to_vec();
        (0..extents.iter().product()).map(move |position| {
            let field = std::sync::Arc::clone(&field);
            let name = element_name(&name, &extents, position);
            Self::real(name, description.clone(), move |model: &mut M| &mut field(model)[position])
        })
    }

    /// Creates an `Enumeration` variable. The field holds the value of an item.
    pub fn enumeration<F>(
        name: impl Into<String>,
        description: impl Into<String>,
        enumeration: Enumeration,
        field: F,
    ) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut i32 + Send + Sync + 'static,
    {
        let mut variable = Self::integer(name, description, field);
        variable.declaration.enumeration = Some(enumeration);
        variable
    }

    /// Creates a structural parameter: an extent of arrays ([`Variable::sized_by`]), at least 1, which the importer may
    /// change in configuration mode (FMI 3.0.2, sections 2.3.6 and 2.4.4); a [`tunable`](Variable::tunable) one in
    /// reconfiguration mode as well. After that [`Model::resize`](crate::Model::resize) runs. State the largest value
    /// with [`Variable::max`].
    ///
    /// FMI 2.0 has no structural parameters: its description leaves them out, and the arrays have the extents that they
    /// have after [`Model::new`](crate::Model::new).
    pub fn structural<F>(name: impl Into<String>, description: impl Into<String>, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut u64 + Send + Sync + 'static,
    {
        let mut variable = Self::uint64(name, description, field).any_parameter(Variability::Fixed);
        variable.declaration.causality = Causality::StructuralParameter;
        variable.min(1.0)
    }

    /// Creates an input clock that ticks every `interval` s from the start time on (FMI 3.0.2, section
    /// 2.2.8; `intervalVariability = constant`). The importer ticks it in event mode: the field is true in the
    /// next call of [`Model::event`](crate::Model::event), and false afterwards.
    ///
    /// FMI 2.0 has no clocks: its description leaves them out, and an importer without event mode ticks none. For
    /// such importers the model also states its ticks by [`Event::next_event_time`](crate::Event::next_event_time).
    pub fn periodic_clock<F>(
        name: impl Into<String>,
        description: impl Into<String>,
        interval: f64,
        field: F,
    ) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut bool + Send + Sync + 'static,
    {
        let mut clock = Self::triggered_clock(name, description, field).input();
        clock.declaration.number.interval = Some(interval);
        clock
    }

    /// Creates an input clock whose intervals the model determines (FMI 3.0.2, section 2.2.8): `interval` is the field
    /// with an interval in s. In all other respects the clock is like a [`Variable::periodic_clock`].
    ///
    /// * `Fixed` and `Tunable`: the clock is periodic, with an interval that depends on parameters; for `Tunable` these
    ///   may change during the run, and the next tick starts the new interval.
    /// * `Changing` and `Countdown`: [`Model::event`](crate::Model::event) sets the field to the time from now to the
    ///   next tick. After the importer has read the field, the field is infinite again. A `Changing` clock gets an
    ///   interval in [`Model::new`](crate::Model::new) and at each tick; a `Countdown` ticks once for each interval.
    pub fn timed_clock<F, G>(
        name: impl Into<String>,
        description: impl Into<String>,
        variability: IntervalVariability,
        field: F,
        interval: G,
    ) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut bool + Send + Sync + 'static,
        G: for<'a> Fn(&'a mut M) -> &'a mut f64 + Send + Sync + 'static,
    {
        let mut clock = Self::triggered_clock(name, description, field).input();
        clock.declaration.number.interval_variability = Some(variability);
        clock.fields.derivatives.push(Box::new(interval));
        clock
    }

    /// Creates a triggered clock (FMI 3.0.2, section 2.2.8), local unless it becomes an
    /// [`input`](Variable::input) or an [`output`](Variable::output).
    ///
    /// The importer ticks an input clock in event mode: the field is true in the next call of
    /// [`Model::event`](crate::Model::event), and false afterwards. [`Model::tick`](crate::Model::tick) sets the field
    /// of a clock that is no input when this clock ticks. FMI 2.0 has no clocks: its description leaves them out.
    pub fn triggered_clock<F>(
        name: impl Into<String>,
        description: impl Into<String>,
        field: F,
    ) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut bool + Send + Sync + 'static,
    {
        let access = TypedField::Clock(Box::new(field)).into();
        let mut clock = Self::local(name, description, Variability::Discrete, access);
        clock.declaration.initial = None;
        clock
    }

    /// Creates an alias of the variable `of`, with the same type, unit and value reference. An alias has
    /// no start value and cannot be set.
    pub fn alias(
        name: impl Into<String>,
        description: impl Into<String>,
        of: impl Into<String>,
    ) -> Self {
        let mut alias = Self::local(name, description, Variability::Continuous, Access::Alias);
        alias.declaration.base = Base::Alias(of.into());
        alias
    }

    fn local(
        name: impl Into<String>,
        description: impl Into<String>,
        variability: Variability,
        access: Access<M>,
    ) -> Self {
        let base = access.base();
        let declaration = Declaration::local(name.into(), description.into(), variability, base);
        Self { declaration, fields: Fields { access, derivatives: Vec::new() } }
    }

    setters! {
        /// Makes the variable an input.
        input() causality = Causality::Input, initial = None;
        /// Makes the variable a parameter that [`Model::initialize`](crate::Model::initialize) computes from
        /// other parameters. If one of these is tunable, so is the variable, and [`Model::update`](crate::Model::update)
        /// computes it: this function also runs after a tunable parameter has changed. A calculated parameter depends
        /// on all others unless it states them by [`Variable::initially`].
        calculated_parameter() causality = Causality::CalculatedParameter, variability = Variability::Fixed;
        /// Makes a local variable or output constant.
        constant() variability = Variability::Constant, initial = Some(Initial::Exact);
        /// Makes a Real discrete: the value changes at events or communication points only.
        discrete() variability = Variability::Discrete;
        /// Sets `initial = exact` for a local variable or output: the variable starts with the value of its field after
        /// [`Model::new`](crate::Model::new), unless the importer sets another value before the first step.
        exact() initial = Some(Initial::Exact);
        /// Sets `initial = approx` for a local variable or output: an iteration computes the initial value
        /// from the value of its field, a guess that the importer may set before initialization mode.
        approximate() initial = Some(Initial::Approx);
        /// Sets the unit, an expression for [`Unit::parse`](fmu_description::unit::Unit::parse).
        unit(unit: impl Into<String>) number.unit = Some(unit.into());
        /// Sets the display unit, in which importers show the value: another unit of the same quantity, such as `degC`
        /// for `K`. The text is an expression for [`Unit::parse`](fmu_description::unit::Unit::parse), like the unit.
        display_unit(unit: impl Into<String>) number.display_unit = Some(unit.into());
        /// Makes a Real a difference, such as a rise of temperature, which has no offset in another unit: 5 K are shown
        /// as 5 degC (`relativeQuantity`).
        relative_quantity() number.relative_quantity = true;
        /// Sets `quantity`, the physical quantity, such as `Force`.
        quantity(quantity: impl Into<String>) number.quantity = Some(quantity.into());
        /// Sets the media type of a [`Variable::binary`], such as `image/png` (`mimeType`).
        mime_type(mime_type: impl Into<String>) number.mime_type = Some(mime_type.into());
        /// Sets the smallest and the largest allowed value. Setting a value outside the range returns
        /// `fmi2Discard`.
        range(min: f64, max: f64) number.min = Some(min), number.max = Some(max);
        /// Sets the smallest allowed value. See [`Variable::range`].
        min(min: f64) number.min = Some(min);
        /// Sets the largest allowed value. See [`Variable::range`].
        max(max: f64) number.max = Some(max);
        /// Sets the nominal value, greater than zero: the typical magnitude. Integrators scale the error of a
        /// state with it.
        nominal(nominal: f64) number.nominal = Some(nominal);
        /// Declares the variable as the time derivative of the continuous state called `state`.
        ///
        /// In model exchange the importer integrates it.
        derivative_of(state: impl Into<String>) derivative_of = Some(state.into());
        /// Sets `reinit`: an event may change this continuous state.
        reinit() reinit = true;
        /// States the clocks of a discrete variable: the variable changes when one of these clocks ticks (FMI 3.0.2,
        /// section 2.2.8.3).
        clocked_by(clocks: &[&str]) clocks = clocks.iter().map(|&name| name.to_owned()).collect();
        /// States the structural parameters that are the extents of the array with this element, one
        /// name for each dimension. All elements of the array state the same names.
        ///
        /// ```
        /// # use fmu::Variable;
        /// struct Filter { n: u64, gains: Vec<f64> }
        /// # impl Filter {
        /// fn variables(&self) -> Vec<Variable<Self>> {
        ///     let mut all = vec![Variable::structural("n", "Order", |model: &mut Self| &mut model.n).max(9.0)];
        ///     let gains = Variable::real_array("K", "Gain", &[self.gains.len()], |model: &mut Self| &mut model.gains[..]);
        ///     all.extend(gains.map(|element| element.parameter().sized_by(&["n"])));
        ///     all
        /// }
        /// # }
        /// # let count = Filter { n: 2, gains: vec![0.0; 2] }.variables().len();
        /// # assert_eq!(count, 3);
        /// ```
        sized_by(names: &[&str]) sized_by = names.iter().map(|&name| name.to_owned()).collect();
    }

    /// Makes the variable an output. `direct` names the inputs (and, in a model with continuous states,
    /// states or `time`) on which it depends directly (direct feedthrough; `ModelStructure`, section
    /// 2.2.8). It is empty if only a step changes the output.
    #[must_use]
    pub fn output(mut self, direct: &[&str]) -> Self {
        self.declaration.causality = Causality::Output;
        self.depends(DependencyKind::Dependent, direct.iter().copied())
    }

    /// Makes the variable a parameter that is fixed after initialization.
    #[must_use]
    pub fn parameter(self) -> Self {
        self.any_parameter(Variability::Fixed)
    }

    /// Makes the variable a parameter that the importer may change between steps.
    #[must_use]
    pub fn tunable(self) -> Self {
        self.any_parameter(Variability::Tunable)
    }

    /// Makes a Real with a unit of temperature a [relative quantity](Variable::relative_quantity). Other units have no
    /// offset, so a difference needs no mark. Call it after [`Variable::unit`].
    #[must_use]
    pub fn difference(self) -> Self {
        let unit = self.declaration.number.unit.as_deref().map(Unit::parse);
        if unit.is_some_and(|unit| unit.is_ok_and(|unit| unit.is_temperature())) {
            self.relative_quantity()
        } else {
            self
        }
    }

    /// Makes the variable a parameter of this variability; a structural parameter remains a structural one.
    fn any_parameter(mut self, variability: Variability) -> Self {
        let declaration = &mut self.declaration;
        if declaration.causality != Causality::StructuralParameter {
            declaration.causality = Causality::Parameter;
        }
        (declaration.variability, declaration.initial) = (variability, Some(Initial::Exact));
        self
    }

    /// Adds the inputs, states or `time` on which an output or the derivative of a state depends at a
    /// communication point, with the kind of the dependency (`dependenciesKind`, section 2.2.8).
    #[must_use]
    pub fn depends<S: Into<String>>(
        mut self,
        kind: DependencyKind,
        on: impl IntoIterator<Item = S>,
    ) -> Self {
        self.declaration.direct.extend(on.into_iter().map(|name| (name.into(), kind)));
        self
    }

    /// Sets the inputs and variables with exact start values (or `time`) on which the initial value depends. By default
    /// an importer must assume that the initial value depends on all of them.
    #[must_use]
    pub fn initially<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.declaration.initially = Some(names.into_iter().map(Into::into).collect());
        self
    }

    /// Adds the field of the next time derivative: the first call adds the first derivative, the second
    /// call the second derivative, and so on.
    ///
    /// For an input, `fmi2SetRealInputDerivatives` sets this field; the value holds at the start of the step and is
    /// reset to zero after the step. For an output this is the field that `fmi2GetRealOutputDerivatives` reads.
    #[must_use]
    pub fn derivative<F>(mut self, field: F) -> Self
    where
        F: for<'a> Fn(&'a mut M) -> &'a mut f64 + Send + Sync + 'static,
    {
        self.fields.derivatives.push(Box::new(field));
        self
    }
}

/// Variables of the types that FMI 2.0 does not have. A model with one of them can be exported for FMI 3.0
/// only: `aso-ftc pack --fmi 3`.
impl<M> Variable<M> {
    constructors! {
        /// Creates a `Float32` variable (FMI 3.0 only).
        float32(TypedField::Float32(f32), Continuous);
        /// Creates an `Int8` variable (FMI 3.0 only).
        int8(TypedField::Int8(i8), Discrete);
        /// Creates a `UInt8` variable (FMI 3.0 only).
        uint8(TypedField::UInt8(u8), Discrete);
        /// Creates an `Int16` variable (FMI 3.0 only).
        int16(TypedField::Int16(i16), Discrete);
        /// Creates a `UInt16` variable (FMI 3.0 only).
        uint16(TypedField::UInt16(u16), Discrete);
        /// Creates a `UInt32` variable (FMI 3.0 only).
        uint32(TypedField::UInt32(u32), Discrete);
        /// Creates an `Int64` variable (FMI 3.0 only).
        int64(TypedField::Int64(i64), Discrete);
        /// Creates a `UInt64` variable (FMI 3.0 only).
        uint64(TypedField::UInt64(u64), Discrete);
        /// Creates a `Binary` variable, which may be empty (FMI 3.0 only).
        binary(TypedField::Binary(Vec<u8>), Discrete);
    }
}

/// Returns the name of the element of an array at a position in row-major order: `name[1,2]`, or `der(x[1,2])` of
/// `der(x)`.
pub(crate) fn element_name(name: &str, extents: &[usize], position: usize) -> String {
    let mut left = position;
    let mut indices: Vec<_> = extents
        .iter()
        .rev()
        .map(|extent| {
            let index = left % extent + 1;
            left /= extent;
            index.to_string()
        })
        .collect();
    indices.reverse();
    let indices = indices.join(",");
    match name.strip_prefix("der(").and_then(|state| state.strip_suffix(')')) {
        Some(state) => format!("der({state}[{indices}])"),
        None => format!("{name}[{indices}]"),
    }
}
