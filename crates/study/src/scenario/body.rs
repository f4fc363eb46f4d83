//! The inline tables of the kinds of signals and faults: `ramp = { .. }`, `bias = { .. }` and so
//! on.

use serde::{Deserialize, Serialize};
use serde_spanned::Spanned;

use super::Literal;
use master::fault::Window;

/// Declares a struct for an inline table.
macro_rules! body {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name { $($(#[$doc])* pub $field: $kind,)* }
    };
}

/// Declares a struct for the inline table of a fault, with its window.
macro_rules! fault {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)* }) => {
        body! {
            $(#[$meta])*
            $name {
                $($(#[$doc])* $field: $kind,)*
                /// Start time in s; default: the start of the simulation.
                from: Option<f64>,
                /// End time in s; default: the fault stays.
                until: Option<f64>,
            }
        }

        impl $name {
            /// Returns the window of the fault, in a simulation that starts at `start`.
            pub(super) fn window(&self, start: f64) -> Window {
                Window { from: self.from.unwrap_or(start), until: self.until }
            }
        }
    };
}

body! {
    /// `ramp`: `begin` up to the time `from`, `end` from the time `until` on, linear in between.
    Ramp {
        /// Start of the ramp in s.
        from: f64,
        /// End of the ramp in s.
        until: f64,
        /// Value up to the time `from`.
        begin: f64,
        /// Value from the time `until` on.
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
        /// Start of the sine in s; default: the start of the simulation.
        from: Option<f64>,
    }
}

body! {
    /// `csv`: a column of a file.
    Csv {
        /// The file, relative to the folder of the `system.toml`.
        file: Spanned<String>,
        /// Name of the column; default: the name of the variable, with or without its slave.
        column: Option<Spanned<String>>,
        /// Whether each value is held until the next one, also for a continuous Real.
        #[serde(default)]
        hold: bool,
    }
}

fault! {
    /// `bias`: `v + value`.
    Bias {
        /// The value added.
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
        /// The value added per second.
        rate: f64,
    }
}

fault! {
    /// `stuck`: the value at the start of the fault, or a given value.
    Stuck {
        /// The value; default: the value at the start of the fault.
        value: Option<Literal>,
    }
}

fault! {
    /// `dropout`: loses all values, or the values in the first `lost` s of each `period`, or each
    /// value with a `probability`.
    Dropout {
        /// Replacement for a lost value; default: the last value that was not lost.
        value: Option<Literal>,
        /// The period in s; the first one starts with the fault.
        period: Option<f64>,
        /// Length in s of the lost part at the start of each period.
        lost: Option<f64>,
        /// Probability of losing a sample.
        probability: Option<f64>,
        /// Time in s between samples; default: one sample at each communication point.
        every: Option<f64>,
        /// Seed of the random series; default: 0.
        seed: Option<u64>,
    }
}

fault! {
    /// `delay`: the value from `seconds` ago.
    Delay {
        /// The delay in s.
        seconds: f64,
        /// Whether the value of a communication point is held until the next one; otherwise values
        /// are interpolated.
        #[serde(default)]
        hold: bool,
        /// Value before the first delayed value arrives; default: the first value.
        initial: Option<Literal>,
    }
}

fault! {
    /// `quantisation`: the nearest of the levels `offset + k step`.
    Quantisation {
        /// Distance of two levels.
        step: f64,
        /// A level; further levels are whole multiples of `step` away.
        #[serde(default)]
        offset: f64,
    }
}

fault! {
    /// `saturation`: `v`, limited to one or two bounds.
    Saturation {
        /// Lowest value; default: no bound.
        min: Option<f64>,
        /// Highest value; default: no bound.
        max: Option<f64>,
    }
}

fault! {
    /// `noise`: `v + e` with random `e`, normal or uniform.
    Noise {
        /// Standard deviation of the normal distribution; instead of `amplitude`.
        deviation: Option<f64>,
        /// Largest magnitude of the uniform distribution; instead of `deviation`.
        amplitude: Option<f64>,
        /// Time in s between samples; default: one sample at each communication point.
        every: Option<f64>,
        /// Seed of the random series; default: 0.
        #[serde(default)]
        seed: u64,
    }
}

fault! {
    /// `inversion`: exchanges true and false.
    Inversion {
    }
}
