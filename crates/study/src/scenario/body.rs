//! The bodies of the kinds: `ramp = { .. }`, `bias = { .. }` and so on.

use serde::{Deserialize, Serialize};
use serde_spanned::Spanned;

use super::Literal;
use master::fault::Window;

/// Declares a table of the file.
macro_rules! body {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name { $($(#[$doc])* pub $field: $kind,)* }
    };
}

/// Declares the table of a fault, with its time.
macro_rules! fault {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)* }) => {
        body! {
            $(#[$meta])*
            $name {
                $($(#[$doc])* $field: $kind,)*
                /// Time in s at which it begins; the start of the simulation where it is not said.
                #[serde(skip_serializing_if = "Option::is_none")]
                from: Option<f64>,
                /// Time in s at which it ends; never where it is not said.
                #[serde(skip_serializing_if = "Option::is_none")]
                until: Option<f64>,
            }
        }

        impl $name {
            /// When it acts, in a simulation that starts at `start`.
            pub(super) fn window(&self, start: f64) -> Window {
                Window { from: self.from.unwrap_or(start), until: self.until }
            }
        }
    };
}

body! {
    /// `ramp`: `begin` up to the time `from`, `end` after the time `until`, a line between.
    Ramp {
        /// Time in s.
        from: f64,
        /// Time in s.
        until: f64,
        /// Value before.
        begin: f64,
        /// Value after.
        end: f64,
    }
}

body! {
    /// `sine`: `offset + amplitude sin(2 pi frequency (t - from) + phase)`, before `from` the offset.
    Sine {
        /// Amplitude.
        amplitude: f64,
        /// Frequency in Hz.
        frequency: f64,
        /// Phase in rad.
        #[serde(default)]
        phase: f64,
        /// Mean.
        #[serde(default)]
        offset: f64,
        /// Time in s; the start of the simulation where it is not said.
        #[serde(skip_serializing_if = "Option::is_none")]
        from: Option<f64>,
    }
}

body! {
    /// `csv`: a column of a file.
    Csv {
        /// The file, seen from the folder of the file that names it.
        file: Spanned<String>,
        /// Name of the column; where it is not said, that of the variable, with its slave or
        /// without.
        #[serde(skip_serializing_if = "Option::is_none")]
        column: Option<Spanned<String>>,
        /// Each value is held until the next one, also for a continuous Real.
        #[serde(default)]
        hold: bool,
    }
}

fault! {
    /// `bias`: `v + value`.
    Bias {
        /// What is added.
        value: f64,
    }
}

fault! {
    /// `gain`: `factor v`.
    Gain {
        /// The factor.
        factor: f64,
    }
}

fault! {
    /// `drift`: `v + rate (t - from)`.
    Drift {
        /// What is added per second.
        rate: f64,
    }
}

fault! {
    /// `stuck`: the value at its begin, or the one given.
    Stuck {
        /// The value, if not the one at its begin.
        #[serde(skip_serializing_if = "Option::is_none")]
        value: Option<Literal>,
    }
}

fault! {
    /// `dropout`: all values are lost, or those in the first `lost` s of each `period`, or each with a
    /// `probability`.
    Dropout {
        /// What stands in for a lost value, if not the last one that was not lost.
        #[serde(skip_serializing_if = "Option::is_none")]
        value: Option<Literal>,
        /// The period in s, which begins with the fault.
        #[serde(skip_serializing_if = "Option::is_none")]
        period: Option<f64>,
        /// Time in s at the begin of each period in which values are lost.
        #[serde(skip_serializing_if = "Option::is_none")]
        lost: Option<f64>,
        /// Probability of losing a sample.
        #[serde(skip_serializing_if = "Option::is_none")]
        probability: Option<f64>,
        /// Time in s between samples; where it is not said, each communication point is one.
        #[serde(skip_serializing_if = "Option::is_none")]
        every: Option<f64>,
        /// Which random series.
        #[serde(skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
    }
}

fault! {
    /// `delay`: the value of so many seconds ago.
    Delay {
        /// The delay in s.
        seconds: f64,
        /// The value of a communication point is held until the next one; else lines between.
        #[serde(default)]
        hold: bool,
        /// Value before there is one, if not the first one.
        #[serde(skip_serializing_if = "Option::is_none")]
        initial: Option<Literal>,
    }
}

fault! {
    /// `quantisation`: the nearest of the levels `offset + k step`.
    Quantisation {
        /// Distance of two levels.
        step: f64,
        /// One of the levels.
        #[serde(default)]
        offset: f64,
    }
}

fault! {
    /// `saturation`: `v` within bounds.
    Saturation {
        /// Lowest value.
        #[serde(skip_serializing_if = "Option::is_none")]
        min: Option<f64>,
        /// Highest value.
        #[serde(skip_serializing_if = "Option::is_none")]
        max: Option<f64>,
    }
}

fault! {
    /// `noise`: `v + e` with random `e`, normal or uniform.
    Noise {
        /// Standard deviation, for the normal distribution.
        #[serde(skip_serializing_if = "Option::is_none")]
        deviation: Option<f64>,
        /// Largest size, for the uniform distribution.
        #[serde(skip_serializing_if = "Option::is_none")]
        amplitude: Option<f64>,
        /// Time in s between samples; where it is not said, each communication point is one.
        #[serde(skip_serializing_if = "Option::is_none")]
        every: Option<f64>,
        /// Which random series.
        #[serde(default)]
        seed: u64,
    }
}

fault! {
    /// `inversion`: true becomes false.
    Inversion {
    }
}
