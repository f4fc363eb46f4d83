//! What the page sets before a run: values of variables, eigenvalues of the observer, faults.

use std::collections::BTreeSet;

use control::aso::FaultyPlant;
use control::placement::{place_balanced, real_poles};
use master::fault::{Fault, FaultChain, NoiseDistribution, RandomSeries, Window};
use master::{Scenario, System};

use crate::paper::told;

/// The settings of a run.
#[derive(Default)]
pub(crate) struct Settings {
    /// Variables and their values, as text.
    pub(crate) values: Vec<(String, String)>,
    /// Eigenvalues of the observer in 1/s, if they are not those of the paper.
    eigenvalues: Option<Vec<f64>>,
    /// Inputs and the faults on their connections, in this order.
    faults: Vec<(String, FaultKind, f64)>,
    /// Time in s from which bias and gain act.
    from: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum FaultKind {
    Bias,
    Gain,
    Delay,
    Noise,
}

impl Settings {
    /// Reads lines of these kinds:
    ///
    /// ```text
    /// plant.F_c=20                     a variable
    /// eigenvalues=-900 -1000 -1100 ..  of the observer, real, in 1/s
    /// bias controller.theta=0.01       on the connection to this input, from the time `from` on
    /// gain plant.u=0.5                 the same
    /// delay controller.theta=0.001     in s, always
    /// noise controller.theta=1e-5      standard deviation, always
    /// from=50                          in s
    /// ```
    ///
    /// # Errors
    ///
    /// The reason, as a sentence with the line that is not understood.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let mut settings = Self::default();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            let (name, value) =
                line.split_once('=').ok_or_else(|| format!("{line:?}: expected name=value"))?;
            let (name, value) = (name.trim(), value.trim());
            let kinds = [
                ("bias ", FaultKind::Bias),
                ("gain ", FaultKind::Gain),
                ("delay ", FaultKind::Delay),
                ("noise ", FaultKind::Noise),
            ];
            if let Some((word, kind)) = kinds.iter().find(|(word, _)| name.starts_with(word)) {
                let input = name[word.len()..].trim().to_owned();
                settings.faults.push((input, *kind, number(line, value)?));
            } else if name == "from" {
                settings.from = number(line, value)?;
            } else if name == "eigenvalues" {
                let parts = value.split([' ', ',']).filter(|part| !part.is_empty());
                let parsed: Result<Vec<_>, _> = parts.map(|part| number(line, part)).collect();
                settings.eigenvalues = Some(parsed?);
            } else {
                settings.values.push((name.to_owned(), value.to_owned()));
            }
        }
        Ok(settings)
    }

    /// `L_x` and `L_f` for the eigenvalues, as settings of the controller FMU; none for those of the paper.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: eigenvalues that no observer has, or too many or too few.
    pub(crate) fn gains(&self, plant: &FaultyPlant) -> Result<Vec<(String, String)>, String> {
        let Some(eigenvalues) = &self.eigenvalues else { return Ok(Vec::new()) };
        if let Some(slow) = eigenvalues.iter().find(|value| **value >= 0.0) {
            return Err(format!("eigenvalue {slow} 1/s of the observer: expected below 0"));
        }
        plant.check_observer_exists().map_err(told)?;
        let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
        let poles = real_poles(eigenvalues);
        let placed = place_balanced(&a_0.transpose(), &c_0.transpose(), &poles).map_err(told)?;
        // A_0 - L C_0 has the eigenvalues, L = [L_x; -L_f].
        let l = -placed.gain.transpose();
        let (n, q) = plant.f_a.shape();
        let named = [("L_x", l.rows(0, n).into_owned()), ("L_f", -l.rows(n, q))];
        Ok(named
            .iter()
            .flat_map(|(name, matrix)| {
                let places =
                    (0..matrix.nrows()).flat_map(|i| (0..matrix.ncols()).map(move |j| (i, j)));
                places.map(move |(i, j)| {
                    let variable = format!("controller.{name}[{},{}]", i + 1, j + 1);
                    (variable, format!("{:?}", matrix[(i, j)]))
                })
            })
            .collect())
    }

    /// The faults, each at the connection to its input.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: an unknown input, or a delay of too many steps.
    pub(crate) fn scenario(&self, system: &System, step: f64) -> Result<Scenario, String> {
        let mut scenario = Scenario::default();
        let inputs: BTreeSet<&String> = self.faults.iter().map(|(input, ..)| input).collect();
        for input in inputs {
            let port = system.port(input).map_err(told)?;
            let own = self.faults.iter().filter(|(name, ..)| name == input).enumerate();
            let chain =
                own.map(|(place, (_, kind, value))| self.fault(input, place, *kind, *value));
            let chain = FaultChain::new(chain.collect(), step).map_err(told)?;
            scenario.faults.push((port, chain));
        }
        Ok(scenario)
    }

    fn fault(&self, input: &str, place: usize, kind: FaultKind, value: f64) -> (Window, Fault) {
        let from = if matches!(kind, FaultKind::Bias | FaultKind::Gain) { self.from } else { 0.0 };
        let fault = match kind {
            FaultKind::Bias => Fault::Bias(value),
            FaultKind::Gain => Fault::Gain(value),
            FaultKind::Delay => Fault::Delay { seconds: value, hold: false, initial: None },
            FaultKind::Noise => Fault::Noise {
                spread: NoiseDistribution::Normal(value),
                draw: RandomSeries::new(0, input, place as u64, None),
            },
        };
        (Window { from, until: None }, fault)
    }
}

fn number(line: &str, text: &str) -> Result<f64, String> {
    let parsed = text.parse::<f64>().ok().filter(|value| value.is_finite());
    parsed.ok_or_else(|| format!("{line}: expected a number, found {text:?}"))
}
