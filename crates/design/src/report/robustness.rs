//! The part of a design report on robustness.

use schemars::JsonSchema;
use serde::Serialize;

use crate::report::{Frequency, Matrix};

/// How a design is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// All checks hold and all limits are met.
    Green,
    /// The peak of S is above the lower limit.
    Amber,
    /// A check does not hold, the peak of S is above the upper limit, or parameters within their
    /// tolerances make the loop unstable.
    Red,
}

impl Level {
    /// Returns the word: `green`, `amber`, `red`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Green => "green",
            Self::Amber => "amber",
            Self::Red => "red",
        }
    }
}

/// The verdict on a design.
#[derive(Serialize, JsonSchema)]
pub struct Verdict {
    /// The level.
    pub level: Level,
    /// The reasons for a level other than green, in sentences.
    pub reasons: Vec<String>,
    /// The limits that the levels follow from.
    pub limits: Limits,
}

impl Verdict {
    /// Adds a reason; the level is the worse one.
    pub(crate) fn add(&mut self, level: Level, reason: String) {
        if self.level != Level::Red && level != Level::Green {
            self.level = level;
        }
        self.reasons.push(reason);
    }
}

/// The limits of the verdict, as stated in the plant file or by default.
#[derive(Serialize, JsonSchema)]
pub struct Limits {
    /// Peak of S above which a design is amber.
    pub amber: f64,
    /// Peak of S above which it is red.
    pub red: f64,
    /// Relative tolerances of the entries of A, B, C and D that are not 0, 1 or -1.
    pub tolerance: [f64; 4],
}

impl Limits {
    /// The tolerances of A, B, C and D, as far as they are among `matrices`.
    pub(crate) fn of_matrices<'a>(
        &self,
        matrices: &'a [Matrix],
    ) -> impl Iterator<Item = (&'static str, f64)> + use<'a> {
        let all = ["A", "B", "C", "D"].into_iter().zip(self.tolerance);
        all.filter(|(name, _)| matrices.iter().any(|own| own.name == *name))
    }

    /// The same in words.
    pub(crate) fn stated_tolerances(&self, matrices: &[Matrix]) -> String {
        let one = |(name, part): (&str, f64)| format!("±{} % of {name}", 100.0 * part);
        self.of_matrices(matrices).map(one).collect::<Vec<_>>().join(", ")
    }
}

/// The robustness of the loop of plant and controller. A number without a limit is infinite, in
/// JSON `null`.
#[derive(Serialize, JsonSchema)]
pub struct Robustness {
    /// The loop opened at the commands and at the measurements.
    pub points: Vec<LoopPoint>,
    /// Largest delay, s, common to all commands.
    #[schemars(with = "Option<f64>")]
    pub delay_margin: f64,
    /// The longest time, s, over which the signals may be held; for a sampled design the longest
    /// sample time with the same matrices of the controller.
    #[schemars(with = "Option<f64>")]
    pub longest_hold: f64,
    /// The noise of each measurement that `noise` assumes, in the order of its columns.
    pub noise_of_measurements: Vec<f64>,
    /// Root-mean-square value of each command and each estimated fault under the noise of each
    /// measurement.
    pub noise: Matrix,
    /// The same under all noises together: the commands, the estimated faults.
    pub noise_together: Vec<Number>,
    /// The 2-norms of the gains, and peaks of S, beside those of the linear-quadratic design of the
    /// same speed.
    pub comparison: Vec<Compared>,
    /// Stability while the parameters vary.
    pub tolerance: ToleranceResult,
    /// How the judged peak of S depends on the parameters, one entry for each point.
    pub sensitivity: Vec<PeakSensitivity>,
    /// Singular values of S and T over frequency.
    pub curves: Vec<Frequency>,
}

/// The margins of the loop opened at one place.
#[derive(Serialize, JsonSchema)]
pub struct LoopPoint {
    /// `input` (commands) or `output` (measurements).
    pub point: String,
    /// Peak of the largest singular value of S, in the units of the plant file.
    pub s_peak: f64,
    /// Its frequency, rad/s.
    #[schemars(with = "Option<f64>")]
    pub s_frequency: f64,
    /// Peak of the largest singular value of T, in the units of the plant file.
    pub t_peak: f64,
    /// Its frequency, rad/s.
    #[schemars(with = "Option<f64>")]
    pub t_frequency: f64,
    /// Peak of the structured singular value of S: the peak in the units that make it least.
    pub s_peak_scaled: f64,
    /// The peak that is judged: `s_peak`, or `s_peak_scaled` if the channels have different units.
    pub judged: f64,
    /// Its frequency, rad/s.
    #[schemars(with = "Option<f64>")]
    pub judged_frequency: f64,
    /// All channels change at the same time and independently.
    pub together: Disk,
    /// Each channel alone, the others exact.
    pub channels: Vec<Channel>,
}

/// The derivatives of the judged peak of S with respect to the entries of the plant.
#[derive(Serialize, JsonSchema)]
pub struct PeakSensitivity {
    /// `input` (commands) or `output` (measurements).
    pub point: String,
    /// A, B and C: each entry that is not 0, 1 or -1, times the derivative with respect to it. A
    /// change of the entry by 1 % changes the peak by 0.01 times this number.
    pub matrices: Vec<Matrix>,
}

/// A symmetric disk margin.
#[derive(Serialize, JsonSchema)]
pub struct Disk {
    /// Size alpha of the disk.
    pub alpha: f64,
    /// The size for which stability is certain.
    pub certified: f64,
    /// Its frequency, rad/s.
    #[schemars(with = "Option<f64>")]
    pub frequency: f64,
    /// Gain factors within the disk.
    #[schemars(with = "[Option<f64>; 2]")]
    pub gain: [f64; 2],
    /// Angle within the disk, degrees.
    #[schemars(with = "Option<f64>")]
    pub phase: f64,
}

/// The margins of one channel.
#[derive(Serialize, JsonSchema)]
pub struct Channel {
    /// The command or the measurement.
    pub name: String,
    /// Gain factors between which the loop is stable.
    #[schemars(with = "[Option<f64>; 2]")]
    pub gain: [f64; 2],
    /// Phase margin, degrees.
    #[schemars(with = "Option<f64>")]
    pub phase: f64,
    /// Delay margin, s.
    #[schemars(with = "Option<f64>")]
    pub delay: f64,
    /// The disk margin.
    pub disk: Disk,
}

/// A named number.
#[derive(Clone, Serialize, JsonSchema)]
pub struct Number {
    /// Its name.
    pub name: String,
    /// Its unit, if known.
    pub unit: Option<String>,
    /// Its value.
    #[schemars(with = "Option<f64>")]
    pub value: f64,
}

/// A number of the design and of the linear-quadratic design of the same speed.
#[derive(Serialize, JsonSchema)]
pub struct Compared {
    /// What is compared.
    pub name: String,
    /// Of the design.
    pub design: f64,
    /// Of the linear-quadratic design, if there is one.
    pub linear_quadratic: Option<f64>,
}

/// A parameter of the plant's FMU that varies.
#[derive(Serialize, JsonSchema)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Its value in the design.
    pub value: f64,
    /// Its lowest and highest value.
    pub limits: [f64; 2],
    /// Its value in the worst plant.
    pub worst: f64,
    /// The change of the judged peak of S at the commands and at the measurements when it moves from
    /// its value to a limit, to first order, averaged over both limits.
    pub effects: Vec<f64>,
}

/// Stability while the parameters of the plant vary within their tolerances.
#[derive(Serialize, JsonSchema)]
pub struct ToleranceResult {
    /// Number of entries that vary; 0 if `parameters` vary.
    pub entries: u32,
    /// The parameters of the FMU that vary; empty if the entries vary.
    pub parameters: Vec<Parameter>,
    /// Number of random cases.
    pub cases: u32,
    /// Seed of the random cases.
    pub seed: u32,
    /// The fraction of the random cases that is stable.
    pub stable: f64,
    /// Largest real part of the eigenvalues, 1/s, or largest modulus less 1, with the worst plant
    /// found.
    pub worst_instability: f64,
    /// The multiple of the tolerances, in the direction of the worst plant, below which the loop is
    /// stable. Parameters are followed to their limits, 1; entries to 16.
    #[schemars(with = "Option<f64>")]
    pub first_unstable: f64,
    /// A, B and C of the worst plant.
    pub worst: Vec<Matrix>,
}
