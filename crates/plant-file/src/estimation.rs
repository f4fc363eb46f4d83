//! The table `[estimation]` of a plant file: the law that estimates the faults.

use crate::read::{Result, each, not_negative, optional, positive, positive_within};
use files::{Entry, Place, Table};

/// The tables of a plant file that exclude some laws.
pub(crate) const EXCLUDING: [&str; 5] =
    ["loop", "family", "schedule", "reconfiguration", "fallback"];

/// A law that estimates the faults; parameters that the file does not state are `None`.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// The augmented state observer (Patton and Klinkhieo 2009).
    Augmented,
    /// A proportional and an integral part.
    ProportionalIntegral {
        /// The proportional part, relative to the default one.
        proportional: Option<f64>,
    },
    /// Fast adaptive estimation.
    FastAdaptive {
        /// The decay rate of the directly measured error, 1/s.
        sigma: Option<f64>,
        /// The rates at which the estimates follow, 1/s, one for each fault.
        gamma: Option<Vec<f64>>,
    },
    /// A bounded injection.
    SlidingMode {
        /// The largest estimates, one for each fault.
        rho: Option<Vec<f64>>,
        /// The half-widths of the boundary layers, one for each fault.
        delta: Option<Vec<f64>>,
    },
    /// Iterative learning.
    Learning {
        /// `K_1`, the fraction of the last estimate that remains.
        kept: Option<f64>,
    },
}

/// The requested law and its place in the file.
#[derive(Clone, Debug)]
pub struct EstimationRequest {
    /// The law.
    pub law: Law,
    /// Place of the law in the file.
    pub place: Place,
}

impl Law {
    /// All laws, without stated parameters.
    pub const ALL: [Self; 5] = [
        Self::Augmented,
        Self::ProportionalIntegral { proportional: None },
        Self::FastAdaptive { sigma: None, gamma: None },
        Self::SlidingMode { rho: None, delta: None },
        Self::Learning { kept: None },
    ];

    /// The name in the plant file.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Augmented => "augmented",
            Self::ProportionalIntegral { .. } => "proportional-integral",
            Self::FastAdaptive { .. } => "fast-adaptive",
            Self::SlidingMode { .. } => "sliding-mode",
            Self::Learning { .. } => "learning",
        }
    }

    /// The parameters in the plant file.
    fn keys(&self) -> &'static [&'static str] {
        match self {
            Self::Augmented => &[],
            Self::ProportionalIntegral { .. } => &["proportional"],
            Self::FastAdaptive { .. } => &["sigma", "gamma"],
            Self::SlidingMode { .. } => &["rho", "delta"],
            Self::Learning { .. } => &["K_1"],
        }
    }

    /// The authors of the law.
    #[must_use]
    pub fn sources(&self) -> &'static str {
        match self {
            Self::Augmented => "Patton and Klinkhieo (2009), (4), (5)",
            Self::ProportionalIntegral { .. } => {
                "Wojciechowski (1978); Söffker, Yu and Müller (1995); Busawon and Kabore (2001)"
            }
            Self::FastAdaptive { .. } => "Zhang, Jiang and Cocquempot (2008), theorem 1",
            Self::SlidingMode { .. } => "Edwards, Spurgeon and Patton (2000)",
            Self::Learning { .. } => "Chen and Saif (2001, 2006); Jia, Chen, Zhang and Li (2015)",
        }
    }

    /// The equations of the law, for a sampled controller or one in continuous time.
    #[must_use]
    pub fn equations(&self, sampled: bool) -> &'static [&'static str] {
        match (self, sampled) {
            (Self::Augmented, false) => &["f_hat' = A_f f_hat + L_f (y - C x_hat)"],
            (Self::Augmented, true) => &["f_hat[k+1] = A_f (f_hat[k] + L_f (y[k] - C x_hat[k]))"],
            (Self::ProportionalIntegral { .. }, false) => &[
                "f_hat = f_hat_i + P_f (y - C x_hat)",
                "f_hat_i' = A_f f_hat_i + L_f (y - C x_hat)",
                "x_hat' = A x_hat + B u + F_a f_hat_i + L_x (y - C x_hat)",
            ],
            (Self::FastAdaptive { .. }, false) => &[
                "f_hat = f_hat_i + P_f (y - C x_hat), P_f = Gamma F",
                "f_hat_i' = L_f (y - C x_hat), L_f = sigma Gamma F",
                "x_hat' = A x_hat + B u + F_a f_hat_i + L_x (y - C x_hat)",
            ],
            (Self::ProportionalIntegral { .. } | Self::FastAdaptive { .. }, true) => &[
                "f_hat[k] = f_hat_i[k|k] + P_f (y[k] - C x_hat[k|k])",
                "f_hat_i[k|k] = f_hat_i[k|k-1] + L_f (y[k] - C x_hat[k|k-1])",
                "x_hat[k+1|k] = A x_hat[k|k] + B u[k] + F_a f_hat_i[k|k]",
            ],
            (Self::SlidingMode { .. }, _) => &[
                "f_hat[k] = rho s / (|s| + delta), s = F (y[k] - C x_hat[k|k-1]), for each fault",
                "x_hat[k+1|k] = A x_hat[k|k] + B u[k] + F_a f_hat[k]",
            ],
            (Self::Learning { .. }, _) => &[
                "f_hat[k] = K_1 f_hat[k-1] + K_2 (y[k] - C x_hat[k|k-1])",
                "x_hat[k+1|k] = A x_hat[k|k] + B u[k] + F_a f_hat[k]",
            ],
        }
    }

    /// Whether a plant file with this law may have `key`: loop, family, schedule, reconfiguration or fallback.
    #[must_use]
    pub fn allows(&self, key: &str) -> bool {
        match self {
            Self::Augmented => true,
            // Stability between the points of a schedule is proven for linear equations; a sliding-mode law is not
            // linear.
            Self::SlidingMode { .. } => false,
            Self::ProportionalIntegral { .. }
            | Self::FastAdaptive { .. }
            | Self::Learning { .. } => key == "schedule",
        }
    }
}

impl EstimationRequest {
    /// Reads the table; without a table the law is the augmented observer. `faults`: the number of faults.
    pub(crate) fn read(file: &Table<'_>, faults: usize) -> Result<Self> {
        let Some(entry) = file.get("estimation") else {
            return Ok(Self { law: Law::Augmented, place: file.place.clone() });
        };
        let table = entry.table()?;
        let names = Law::ALL.map(|law| law.name());
        let stated = table.require("law", &format!("one of {}", names.join(", ")))?;
        let text = stated.text()?;
        let Some(law) = Law::ALL.into_iter().find(|law| law.name() == text) else {
            let message = format!("expected one of {}, found {text:?}", names.join(", "));
            return Err(stated.error(message));
        };
        for key in EXCLUDING {
            if !law.allows(key) && file.get(key).is_some() {
                let all = Law::ALL.iter().filter(|law| law.allows(key)).map(Law::name);
                let all = all.collect::<Vec<_>>().join(", ");
                let message = format!("with `{key}` the law is one of {all}; found {text:?}");
                return Err(stated.error(message));
            }
        }
        let known: Vec<_> = ["law"].iter().chain(law.keys()).copied().collect();
        for (key, parameter) in table.entries() {
            let owner = Law::ALL.into_iter().find(|law| law.keys().contains(&key));
            if let Some(owner) = owner.filter(|_| !known.contains(&key)) {
                let message =
                    format!("it belongs to the law {}, not to {}", owner.name(), law.name());
                return Err(parameter.error(message));
            }
        }
        table.allow(&known)?;
        let numbers = |key: &str| {
            let what = "numbers, one for each fault";
            optional(&table, key, |entry| each(entry, faults, what, Entry::positive))
        };
        let law = match law {
            Law::Augmented => law,
            Law::ProportionalIntegral { .. } => Law::ProportionalIntegral {
                proportional: optional(&table, "proportional", not_negative)?,
            },
            Law::FastAdaptive { .. } => {
                Law::FastAdaptive { sigma: positive(&table, "sigma")?, gamma: numbers("gamma")? }
            }
            Law::SlidingMode { .. } => {
                Law::SlidingMode { rho: numbers("rho")?, delta: numbers("delta")? }
            }
            Law::Learning { .. } => {
                let share =
                    |entry: &Entry<'_>| positive_within(entry, ..=1.0, "expected at most 1");
                Law::Learning { kept: optional(&table, "K_1", share)? }
            }
        };
        Ok(Self { law, place: stated.place })
    }
}
