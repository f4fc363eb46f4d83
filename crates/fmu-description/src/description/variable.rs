//! Variables and arrays as data.

use serde::Serialize;

use super::{Causality, Initial, Kind, ModelDescription, RealType, Variability, Version};
use crate::hash_form::{is_default, numbered};

/// `ScalarVariable`, in FMI 3.0 an element named by the type: a scalar or an array.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ScalarVariable {
    /// `name`, unique.
    pub name: String,
    /// `valueReference`, unique except for aliases: per base type in FMI 1.0 and 2.0, over all types in
    /// FMI 3.0.
    pub value_reference: u32,
    /// `description`.
    pub description: Option<String>,
    /// `causality`; `local` if absent.
    pub causality: Causality,
    /// `variability`; if absent, the reader sets it by the standard: in FMI 1.0 and 2.0 `continuous`, in FMI 3.0
    /// `fixed` for parameters, `continuous` for floating-point types and otherwise `discrete`. Types that are not
    /// floating-point are never read as `continuous`, but as `fixed` for parameters and otherwise `discrete`.
    pub variability: Variability,
    /// `initial`; if absent, the default of the table in section 2.2.7 (FMI 3.0.2: 2.4.7.5)
    /// applies.
    pub initial: Option<Initial>,
    /// Type, with its attributes and start value.
    pub kind: Kind,
    /// Dimensions of an array (FMI 3.0), the first one varies slowest; empty for a scalar.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<1, _, _>")]
    pub dimensions: Vec<Dimension>,
    /// The start values of all elements of an array in row-major order, if the file states more than
    /// one. `None` for a scalar, and for an array whose elements all have the `start` of `kind`.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<2, _, _>")]
    pub start_elements: Option<Elements>,
    /// `canHandleMultipleSetPerTimeInstant` (FMI 3.0; not read in FMI 2.0); `Some(false)` forbids to set the
    /// input twice at one time.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<3, _, _>")]
    pub can_handle_multiple_set_per_time_instant: Option<bool>,
    /// `intermediateUpdate` (FMI 3.0): accessible in intermediate update.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<4, _, _>")]
    pub intermediate_update: bool,
    /// `previous` (FMI 3.0): 1-based index of the variable that has the value of this one at the previous tick.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<5, _, _>")]
    pub previous: Option<u32>,
    /// `clocks` (FMI 3.0): 1-based indices of the clocks that determine when the variable changes.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<6, _, _>")]
    pub clocks: Vec<u32>,
    /// Name of the variable of which this one is an alias (FMI 3.0 element `Alias`; attribute `alias` of FMI 1.0).
    /// Variable and alias have the same value reference; an alias of FMI 3.0 has no start value of its own.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<7, _, _>")]
    pub alias_of: Option<String>,
    /// `alias` is `negatedAlias` (FMI 1.0): the value is the value of `alias_of` with the opposite sign, for a Boolean
    /// the opposite value. A String has the same value.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<8, _, _>")]
    pub negated: bool,
}

impl ScalarVariable {
    /// Returns the effective value of `initial`: the attribute, or the default of the table in section
    /// 2.2.7. `None` for an input and the independent variable without the attribute.
    #[must_use]
    pub fn initial_in_force(&self) -> Option<Initial> {
        use Causality::{Independent, Input, Parameter, StructuralParameter};
        self.initial.or(match (self.causality, self.variability) {
            (Input | Independent, _) => None,
            (Parameter | StructuralParameter, _) | (_, Variability::Constant) => {
                Some(Initial::Exact)
            }
            _ => Some(Initial::Calculated),
        })
    }

    /// Returns the reason why nobody may set the variable (FMI 2.0.5, table 4.2.4; FMI 3.0.2, section 2.4.7.5),
    /// as a noun for messages; `None` if it may be set at some time.
    ///
    /// An output or local variable counts as calculated only with the attribute `initial = calculated` and
    /// without a start value.
    #[must_use]
    pub fn never_set(&self) -> Option<&'static str> {
        match self.causality {
            Causality::Independent => Some("the independent variable"),
            Causality::CalculatedParameter => Some("a calculated parameter"),
            _ if self.variability == Variability::Constant => Some("a constant"),
            Causality::Output | Causality::Local
                if self.initial == Some(Initial::Calculated) && !self.kind.has_start() =>
            {
                Some("calculated by the FMU (initial = calculated)")
            }
            _ => None,
        }
    }
}

impl Default for Kind {
    /// A `Real` without attributes.
    fn default() -> Self {
        Kind::Real(RealType::default())
    }
}

/// The extent of one dimension of an array (FMI 3.0.2, section 2.4.7.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Dimension {
    /// `start`: the extent is a number.
    Fixed(u64),
    /// `valueReference`: the extent is the value of a constant or structural parameter.
    Variable(u32),
}

/// Values of the elements of an array, in row-major order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Elements {
    /// Start values of a floating-point type.
    Real(Vec<f64>),
    /// Start values of an integer type or an `Enumeration`.
    Integer(Vec<i128>),
    /// Start values of a `Boolean`.
    Boolean(Vec<bool>),
    /// Start values of a `String`.
    String(Vec<String>),
    /// Start values of a `Binary`.
    Binary(Vec<Vec<u8>>),
}

impl Elements {
    /// Returns the number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Elements::Real(values) => values.len(),
            Elements::Integer(values) => values.len(),
            Elements::Boolean(values) => values.len(),
            Elements::String(values) => values.len(),
            Elements::Binary(values) => values.len(),
        }
    }

    /// Whether there is no value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the start value of `kind`, `count` times; `None` without start value.
    pub(super) fn repeated(kind: &Kind, count: usize) -> Option<Self> {
        Some(match kind {
            Kind::Boolean(start) => Elements::Boolean(vec![(*start)?; count]),
            Kind::String(start) => Elements::String(vec![start.clone()?; count]),
            Kind::Binary(binary) => Elements::Binary(vec![binary.start.clone()?; count]),
            Kind::Clock(_) => return None,
            other => match (other.as_real(), other.as_integer()) {
                (Some(real), _) => Elements::Real(vec![real.start?; count]),
                (_, integer) => Elements::Integer(vec![integer?.start?; count]),
            },
        })
    }
}

impl ScalarVariable {
    /// Whether the variable has a start value: one for a scalar or for all elements, or a list.
    #[must_use]
    pub fn has_start(&self) -> bool {
        self.start_elements.is_some() || self.kind.has_start()
    }

    /// Returns the extents of an array with the start values of structural parameters; empty for a
    /// scalar. An extent is 0 if [`ModelDescription::extent`] has no value for it.
    ///
    /// Cost: linear in the number of variables for each dimension with a value reference.
    #[must_use]
    pub fn extents(&self, description: &ModelDescription) -> Vec<u64> {
        let extent = |dimension: &Dimension| match *dimension {
            Dimension::Fixed(extent) => extent,
            Dimension::Variable(reference) => description.extent(reference).unwrap_or_default(),
        };
        self.dimensions.iter().map(extent).collect()
    }

    /// Returns the number of elements with the start values of structural parameters: 1 for a scalar,
    /// `usize::MAX` if the product of the extents is larger.
    ///
    /// Cost: see [`ScalarVariable::extents`].
    #[must_use]
    pub fn size(&self, description: &ModelDescription) -> usize {
        elements(&self.extents(description))
    }

    /// Returns the start values of all elements in row-major order, one for a scalar: the stated
    /// list, or the common start value for each element. `None` without start value, and if there
    /// are more than `most` elements. An alias of FMI 3.0 without start value has the start values of its
    /// variable.
    ///
    /// Cost: see [`ScalarVariable::extents`]; for an alias also linear in the number of variables.
    #[must_use]
    pub fn start_values(&self, description: &ModelDescription, most: usize) -> Option<Elements> {
        let third = description.version() == Version::V3;
        if let Some(of) = self.alias_of.as_ref().filter(|_| third && !self.has_start()) {
            let variable =
                description.variable(of).filter(|variable| variable.alias_of.is_none())?;
            return variable.start_values(description, most);
        }
        if let Some(elements) = &self.start_elements {
            return Some(elements.clone()).filter(|elements| elements.len() <= most);
        }
        let count = self.size(description);
        if count > most {
            return None;
        }
        Elements::repeated(&self.kind, count)
    }
}

/// Returns the product of the extents, at most `usize::MAX`.
fn elements(extents: &[u64]) -> usize {
    let product = extents.iter().fold(1_u64, |product, extent| product.saturating_mul(*extent));
    usize::try_from(product).unwrap_or(usize::MAX)
}

impl ModelDescription {
    /// Returns the extent that a [`Dimension::Variable`] refers to: the start value of the first variable with that
    /// value reference. `None` without such a variable, or if its start value is not an integer from 0.
    #[must_use]
    pub fn extent(&self, reference: u32) -> Option<u64> {
        let variable =
            self.variables.iter().find(|variable| variable.value_reference == reference)?;
        u64::try_from(variable.kind.as_integer()?.start?).ok()
    }
}
