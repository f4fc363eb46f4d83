//! Attributes whose values are words.

use serde::Serialize;

/// Declares an enumeration with the spelling of its values in the XML.
macro_rules! spelt {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
        pub enum $name { $($(#[$doc])* $variant,)* }

        impl $name {
            /// The spellings of the standard, in the order of the declaration.
            pub const WORDS: &[&str] = &[$($text),*];

            /// Returns the spelling of the standard.
            #[must_use]
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::str::FromStr for $name {
            type Err = ();

            fn from_str(text: &str) -> Result<Self, ()> {
                match text { $($text => Ok(Self::$variant),)* _ => Err(()) }
            }
        }
    };
}

pub(super) use spelt;

spelt! {
    /// `causality` (FMI 2.0.5, section 2.2.7; FMI 3.0.2, section 2.4.7.4).
    #[derive(Default)]
    Causality {
        /// A parameter that the importer's environment may set.
        Parameter = "parameter",
        /// Computed from parameters.
        CalculatedParameter = "calculatedParameter",
        /// Set by the importer's environment.
        Input = "input",
        /// Read by the importer's environment.
        Output = "output",
        /// Internal.
        #[default]
        Local = "local",
        /// The independent variable, usually time.
        Independent = "independent",
        /// Determines the sizes of arrays (FMI 3.0).
        StructuralParameter = "structuralParameter",
    }
}

spelt! {
    /// `variability` (FMI 2.0.5, section 2.2.7; FMI 3.0.2, section 2.4.7.4).
    #[derive(Default)]
    Variability {
        /// Never changes.
        Constant = "constant",
        /// Fixed after initialization.
        Fixed = "fixed",
        /// Constant between events and between communication points, where the importer's environment may change it.
        Tunable = "tunable",
        /// Changes at events or communication points only.
        Discrete = "discrete",
        /// Changes at any time; only for a floating-point type.
        #[default]
        Continuous = "continuous",
    }
}

spelt! {
    /// `initial` (FMI 2.0.5, section 2.2.7; FMI 3.0.2, section 2.4.7.5).
    Initial {
        /// Initialised with its start value.
        Exact = "exact",
        /// Start value is a guess.
        Approx = "approx",
        /// Computed; has no start value.
        Calculated = "calculated",
    }
}

spelt! {
    /// `dependenciesKind` (FMI 2.0.5, section 2.2.8; FMI 3.0.2, section 2.4.8).
    DependencyKind {
        /// No particular structure.
        Dependent = "dependent",
        /// Linear with a constant factor.
        Constant = "constant",
        /// Linear with a factor fixed after initialization.
        Fixed = "fixed",
        /// Linear with a tunable factor.
        Tunable = "tunable",
        /// Linear with a discrete factor.
        Discrete = "discrete",
    }
}
