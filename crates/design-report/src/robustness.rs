//! The part of a design report on robustness.

use schemars::JsonSchema;
use serde::Serialize;

use crate::number::rounded;
use crate::{Frequency, Matrix, OrReason, or_reason};

/// How a design is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// All checks hold and all limits are met.
    Green,
    /// A peak of S is above the lower limit, something is not proven or could not be computed, or a controller for lost
    /// actuators is missing or needs commands beyond limits.
    Amber,
    /// A check does not hold, a peak of S is above the upper limit, or the loop is or may become unstable: with a
    /// member of a family, a point of a schedule, parameters within their tolerances, stated losses, or exact delays.
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
    /// Changes of the plant file that lower peaks of S or remove instability within tolerances; computed for slower and
    /// faster gains.
    pub remedies: Vec<Remedy>,
    /// The limits that the levels follow from.
    pub limits: Limits,
}

/// A change of the plant file that removes a reason of the verdict, or the one that comes nearest.
#[derive(Serialize, JsonSchema)]
pub struct Remedy {
    /// The reason, as in `reasons`.
    pub reason: String,
    /// What the change gives, in a sentence.
    pub change: String,
    /// The lines of the plant file that replace those of the same name; empty if no requirement helps.
    pub lines: Vec<String>,
}

impl Verdict {
    /// Adds a reason; the level of the verdict becomes the worse one of the present level and `level`.
    pub fn add(&mut self, level: Level, reason: String) {
        self.level = self.level.max(level);
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
    /// Relative tolerances of the entries of A, B, C and D that are neither 0 nor structural.
    pub tolerance: [f64; 4],
}

/// The robustness of the loop of plant and controller. A number without a limit is infinite, in
/// JSON `null`.
#[derive(Serialize, JsonSchema)]
pub struct Robustness {
    /// The loop opened at the commands and at the measurements.
    pub points: Vec<LoopPoint>,
    /// Largest delay, s, common to all commands, on top of those of the plant file.
    #[schemars(with = "Option<f64>")]
    pub delay_margin: f64,
    /// The longest time, s, over which the signals may be held; for a sampled design the longest
    /// sample time with the same matrices of the controller, not a number if the plant is known in its samples only.
    #[schemars(with = "Option<f64>")]
    pub longest_hold: f64,
    /// The noise of each measurement that `noise` assumes, in the order of its columns.
    pub noise_of_measurements: Vec<f64>,
    /// Root-mean-square value of each command and each estimated fault under the noise of each
    /// measurement.
    pub noise: Matrix,
    /// Root-mean-square values of the commands, then of the estimated faults, under all noises together.
    pub noise_together: Vec<Number>,
    /// The 2-norms of the gains, and peaks of S, beside those of the linear-quadratic design of the
    /// same speed.
    pub comparison: Vec<Compared>,
    /// Stability while the parameters vary.
    pub tolerance: ToleranceResult,
    /// The fraction of the tolerances within which every plant is stable, proven; or the reason why nothing is proven.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<ToleranceProof>")]
    pub tolerance_proof: Result<ToleranceProof, String>,
    /// How the judged peak of S depends on the parameters, one entry for each point.
    pub sensitivity: Vec<PeakSensitivity>,
    /// Singular values of S and T over frequency.
    pub curves: Vec<Frequency>,
    /// The loop with exact delays; none for a plant without delays.
    pub delays: Option<ExactDelays>,
}

/// A loop with exact delays, compared with the loop with approximated delays.
#[derive(Serialize, JsonSchema)]
pub struct ExactDelays {
    /// Number of states that approximate each delay in the observer.
    pub observer_order: u32,
    /// Number of states that approximate each delay in the plant with which all other figures are computed.
    pub judged_order: u32,
    /// Peaks of the largest singular value of S with exact delays, in the units of the plant file: at the commands, at
    /// the measurements.
    pub s_peaks: [f64; 2],
    /// The largest spectral radius of K (G - H) S over the frequencies, with the controller K, the plant G with exact
    /// delays and the plant H with approximated ones. Below 1 the loop is stable with exact delays.
    pub difference: f64,
    /// The frequency of `difference`, rad/s.
    pub frequency: f64,
    /// Number of frequencies that were examined.
    pub frequencies: u32,
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
    /// The disk margin if all channels change at the same time and independently.
    pub together: Disk,
    /// The margins of each channel alone, with the others exact.
    pub channels: Vec<Channel>,
}

/// The derivatives of the judged peak of S with respect to the entries of the plant.
#[derive(Serialize, JsonSchema)]
pub struct PeakSensitivity {
    /// `input` (commands) or `output` (measurements).
    pub point: String,
    /// For A, B and C, and D if the plant has one: each entry that is not structural, times the derivative with
    /// respect to it; 0 for structural entries. A change of the entry by 1 % changes the peak by 0.01 times this
    /// number.
    pub matrices: Vec<Matrix>,
}

/// A symmetric disk margin.
#[derive(Serialize, JsonSchema)]
pub struct Disk {
    /// Size alpha of the disk.
    pub alpha: f64,
    /// The size for which stability is certain.
    pub certified: f64,
    /// The frequency that determines `alpha`, rad/s.
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
    /// The number of the design.
    pub design: f64,
    /// The number of the linear-quadratic design, if there is one.
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

/// Entries of the plant that vary by the same factor.
#[derive(Serialize, JsonSchema)]
pub struct VaryingEntries {
    /// The entries, such as `A[2][1]`: matrix, row and column, counted from 1.
    pub entries: Vec<String>,
    /// Their relative tolerance.
    pub tolerance: f64,
}

/// Stability while the parameters of the plant vary within their tolerances.
#[derive(Default, Serialize, JsonSchema)]
pub struct ToleranceResult {
    /// Number of entries that vary; 0 if `parameters` vary.
    pub entries: u32,
    /// The entries that vary; those of one item vary by the same factor.
    pub varying: Vec<VaryingEntries>,
    /// The parameters of the FMU that vary; empty if the entries vary.
    pub parameters: Vec<Parameter>,
    /// Number of random cases.
    pub cases: u32,
    /// Seed of the random cases.
    pub seed: u32,
    /// The fraction of the random cases that is stable; none if nothing varies or there are no cases.
    pub stable: Option<f64>,
    /// Largest real part of the eigenvalues, 1/s, or largest modulus less 1, with the worst plant
    /// found.
    pub worst_instability: f64,
    /// The multiple of the tolerances, in the direction of the worst plant, below which the loop is stable. The search
    /// ends at 1, the limits, for parameters, and at 16 for entries.
    #[schemars(with = "Option<f64>")]
    pub first_unstable: f64,
    /// A, B and C of the worst plant, and D if the plant has one.
    pub worst: Vec<Matrix>,
}

/// A proof that the loop is stable while the entries of the plant vary, by the structured singular value.
#[derive(Serialize, JsonSchema)]
pub struct ToleranceProof {
    /// The loop is stable for every constant plant whose entries deviate by less than this multiple of their
    /// tolerances.
    pub fraction: f64,
    /// The largest multiple that was examined: `first_unstable` of the worst plant, or 16.
    pub most: f64,
    /// The frequency that limits `fraction`, rad/s.
    #[schemars(with = "Option<f64>")]
    pub frequency: f64,
    /// Number of independent deviations.
    pub deviations: u32,
    /// Number of channels through which they act.
    pub channels: u32,
    /// Number of intervals of the frequency, each with its own scales, that cover the axis.
    pub intervals: u32,
}

/// The most entries that are named one by one.
const NAMED: usize = 12;

impl ToleranceResult {
    /// Whether an entry or a parameter varies.
    #[must_use]
    pub fn is_examined(&self) -> bool {
        self.entries > 0 || !self.parameters.is_empty()
    }

    /// Whether the worst plant or a random case within the tolerances is unstable.
    #[must_use]
    pub fn is_unstable(&self) -> bool {
        self.is_examined()
            && (self.worst_instability >= 0.0 || self.stable.is_some_and(|part| part < 1.0))
    }

    /// The entries and parameters that vary, and how far: `±10 % of A[2][1], B[2][1]`, `m from 0.9 to 1.1`. More than
    /// 12 entries with one tolerance are counted for each matrix.
    #[must_use]
    pub fn range(&self) -> String {
        let limits = |parameter: &Parameter| {
            let [low, high] = parameter.limits.map(rounded);
            format!("{} from {low} to {high}", parameter.name)
        };
        let mut parts: Vec<_> = self.parameters.iter().map(limits).collect();
        let (single, common): (Vec<_>, Vec<_>) =
            self.varying.iter().partition(|item| item.entries.len() == 1);
        let mut sizes: Vec<f64> = single.iter().map(|item| item.tolerance).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.dedup();
        for size in sizes {
            let names = single.iter().filter(|item| item.tolerance.total_cmp(&size).is_eq());
            let names: Vec<_> = names.flat_map(|item| &item.entries).map(String::as_str).collect();
            parts.push(format!("±{} % of {}", rounded(100.0 * size), name_or_count(&names)));
        }
        for item in common {
            let names: Vec<_> = item.entries.iter().map(String::as_str).collect();
            let size = rounded(100.0 * item.tolerance);
            parts.push(format!("±{size} % of {} together", name_or_count(&names)));
        }
        parts.join("; ")
    }
}

/// The names of entries; of more than [`NAMED`] entries the number in each matrix.
fn name_or_count(names: &[&str]) -> String {
    if names.len() <= NAMED {
        return names.join(", ");
    }
    let of = |matrix: &&str| names.iter().filter(|name| name.starts_with(*matrix)).count();
    let counts = ["A", "B", "C", "D"].into_iter().filter(|matrix| of(matrix) > 0);
    counts
        .map(|matrix| format!("{} entries of {matrix}", of(&matrix)))
        .collect::<Vec<_>>()
        .join(", ")
}
