//! The table `[loop]` of a plant file: the shape of the sensitivities S and T.

use crate::pid::Pid;
use crate::read::{Result, alone, optional, positive, positive_within};
use crate::requirements::{Bandwidth, Request, Requirement};
use crate::signals::Signal;
use control::Domain;
use files::{Place, Table};

const KEYS: [&str; 7] =
    ["bandwidth", "set_point", "peak", "roll_off", "effort", "structure", "pairs"];
/// Entries of the file that are not possible together with `[loop]`.
const OTHERS: [&str; 6] = ["feedback", "observer", "schedule", "family", "estimation", "D"];
/// Smallest |S| required at low frequencies, relative to `peak`; the same for |T| at high frequencies.
pub const FLOOR: f64 = 0.01;
/// Default of `peak`.
const PEAK: f64 = 1.5;
/// Default of `roll_off`, relative to the bandwidth.
const ROLL_OFF: f64 = 10.0;
/// Default of `set_point`, relative to the bandwidth.
const SET_POINT: f64 = 0.3;
/// Starts of the search: bandwidths of feedback and observer, relative to the bandwidth of the loop.
const STARTS: [(f64, f64); 6] =
    [(1.0, 4.0), (0.5, 4.0), (1.0, 8.0), (2.0, 8.0), (0.5, 2.0), (1.0, 1.0)];
/// Largest bandwidth of feedback and observer at a start of the search, in rad per sample.
const START_PER_SAMPLE: f64 = 1.5;
/// Largest bandwidth of the loop in rad per sample.
const PER_SAMPLE: f64 = 0.5;

/// The shape that a loop should have.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopShape {
    /// |S| is below w / `bandwidth` at low frequencies w, both in rad/s.
    pub bandwidth: f64,
    /// The relative control error of a measurement with an integrated reference is below w / `set_point` at low
    /// frequencies w, both in rad/s.
    pub set_point: f64,
    /// |S| and |T| are below `peak` at every frequency.
    pub peak: f64,
    /// |T| is below `peak` x `roll_off` / w at frequencies w above `roll_off`, both in rad/s.
    pub roll_off: f64,
    /// |K S| is below `effort` at every frequency; `None` for the default.
    pub effort: Option<f64>,
    /// PI, PID or other controllers of low order in place of the state feedback, if stated.
    pub pid: Option<Pid>,
    /// Place of the shape in the file.
    pub place: Place,
}

impl LoopShape {
    /// Reads the table, if there is one; `signals` are actuators and measurements.
    pub(crate) fn read(
        file: &Table<'_>,
        signals: [&[Signal]; 2],
        domain: Domain,
    ) -> Result<Option<Self>> {
        let Some(entry) = file.get("loop") else { return Ok(None) };
        alone(&entry, file, &OTHERS)?;
        let table = entry.table()?;
        table.allow(&KEYS)?;
        let stated =
            table.require("bandwidth", "the frequency, in rad/s, below which |S| is small")?;
        let bandwidth = stated.positive()?;
        let usual = Self::with_bandwidth(bandwidth, entry.place);
        if let Domain::Sampled { period } = domain
            && !usual.suits(period)
        {
            let most = PER_SAMPLE / period;
            return Err(stated.error(format!(
                "expected at most {most:.3} rad/s for samples every {period} s, found {bandwidth}"
            )));
        }
        let rule = "expected at least 1, as S is I at high frequencies";
        let peak = optional(&table, "peak", |entry| positive_within(entry, 1.0.., rule))?;
        let peak = peak.unwrap_or(usual.peak);
        let roll_off = positive(&table, "roll_off")?.unwrap_or(usual.roll_off);
        let effort = positive(&table, "effort")?;
        let set_point = positive(&table, "set_point")?.unwrap_or(usual.set_point);
        let pid = Pid::read(file, &table, signals, roll_off)?;
        Ok(Some(Self { set_point, peak, roll_off, effort, pid, ..usual }))
    }

    /// The shape of a table that states only `bandwidth`, in rad/s.
    #[must_use]
    pub fn with_bandwidth(bandwidth: f64, place: Place) -> Self {
        let (set_point, roll_off) = (SET_POINT * bandwidth, ROLL_OFF * bandwidth);
        Self { bandwidth, set_point, peak: PEAK, roll_off, effort: None, pid: None, place }
    }

    /// This shape with another bandwidth, in rad/s; `set_point` and `roll_off` follow if they have their default
    /// values.
    #[must_use]
    pub fn at_bandwidth(&self, bandwidth: f64) -> Self {
        let usual = Self::with_bandwidth(self.bandwidth, self.place.clone());
        let other = Self::with_bandwidth(bandwidth, self.place.clone());
        let follow = |value: f64, usual: f64, other: f64| {
            if value.to_bits() == usual.to_bits() { other } else { value }
        };
        Self {
            bandwidth,
            set_point: follow(self.set_point, usual.set_point, other.set_point),
            roll_off: follow(self.roll_off, usual.roll_off, other.roll_off),
            ..self.clone()
        }
    }

    /// Whether the bandwidth is slow enough for samples every `period` seconds.
    #[must_use]
    pub fn suits(&self, period: f64) -> bool {
        self.bandwidth * period <= PER_SAMPLE
    }

    /// The requests on feedback and observer from which the search starts, in the order of the search.
    #[must_use]
    pub fn starts(&self, domain: Domain) -> [[Request; 2]; STARTS.len()] {
        let most = match domain {
            Domain::Continuous => f64::INFINITY,
            Domain::Sampled { period } => START_PER_SAMPLE / period,
        };
        STARTS.map(|(feedback, observer)| {
            [feedback, observer].map(|factor| self.request((factor * self.bandwidth).min(most)))
        })
    }

    /// A request for a bandwidth of `rate` rad/s.
    fn request(&self, rate: f64) -> Request {
        let bandwidth = Bandwidth { rate: Some(rate), is_stated: true };
        let requirement = Requirement::Bandwidth(bandwidth);
        Request { requirement, place: self.place.clone(), other: None }
    }
}
