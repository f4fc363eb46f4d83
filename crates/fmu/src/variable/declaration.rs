//! The declaration of a variable, without the fields of the model.

use super::{Enumeration, Number};
use fmu_description::{Causality, DependencyKind, Initial, Variability};

/// The base type of a variable, as far as the model description needs it.
pub(crate) enum Base {
    Real,
    Clock,
    Other,
    /// An alias of the variable with this name.
    Alias(String),
}

/// A variable without its fields: the same type for all models, so that the code that describes variables
/// exists once in a program with several models.
pub(crate) struct Declaration {
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
    /// The structural parameters that are the extents of the array with this element.
    pub(crate) sized_by: Vec<String>,
    /// The clocks of a clocked variable.
    pub(crate) clocks: Vec<String>,
    pub(crate) base: Base,
}

impl Declaration {
    /// Returns a local variable with `initial = calculated`.
    pub(super) fn local(
        name: String,
        description: String,
        variability: Variability,
        base: Base,
    ) -> Self {
        Self {
            name,
            description,
            causality: Causality::Local,
            variability,
            initial: Some(Initial::Calculated),
            number: Number::default(),
            reinit: false,
            enumeration: None,
            derivative_of: None,
            direct: Vec::new(),
            initially: None,
            sized_by: Vec::new(),
            clocks: Vec::new(),
            base,
        }
    }

    /// Whether descriptions of FMI 2.0 leave the variable out; an alias is left out with its variable.
    pub(crate) fn is_left_out_of_2(&self) -> bool {
        self.causality == Causality::StructuralParameter || matches!(self.base, Base::Clock)
    }
}
