//! The settings of a run that the page makes: values of variables, and faults.

use files::sentence;
use master::fault::{Fault, FaultChain, NoiseDistribution, RandomSeries, Window};
use master::{Scenario, System};

use crate::text;

/// The settings of a run.
#[derive(Default)]
pub(crate) struct Settings {
    /// Variables and their values, as text.
    pub(crate) values: Vec<(String, String)>,
    /// Inputs, each with the kind and the number of the fault on its connection.
    faults: Vec<(String, FaultKind, f64)>,
    /// Time in s from which the faults act.
    from: f64,
}

#[derive(Clone, Copy)]
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
    /// bias controller.theta=0.01       on the connection to this input, from the time `from` on
    /// gain plant.u=0.5                 the same
    /// delay controller.theta=0.001     the same, in s
    /// noise controller.theta=1e-5      the same, standard deviation
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
            } else {
                settings.values.push((name.to_owned(), value.to_owned()));
            }
        }
        Ok(settings)
    }

    /// Returns a scenario with the faults, each on the connection to its input.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: an unknown input, or a delay of too many steps.
    pub(crate) fn scenario(&self, system: &System, step: f64) -> Result<Scenario, String> {
        let mut scenario = Scenario::default();
        let mut inputs: Vec<&String> = self.faults.iter().map(|(input, ..)| input).collect();
        inputs.sort_unstable();
        inputs.dedup();
        for input in inputs {
            let port = system.port(input).map_err(told)?;
            let faults = self.faults.iter().filter(|(name, ..)| name == input).enumerate();
            let chain =
                faults.map(|(place, (_, kind, value))| self.fault(input, place, *kind, *value));
            let chain = FaultChain::new(chain.collect(), step).map_err(told)?;
            scenario.faults.push((port, chain));
        }
        Ok(scenario)
    }

    fn fault(&self, input: &str, place: usize, kind: FaultKind, value: f64) -> (Window, Fault) {
        let fault = match kind {
            FaultKind::Bias => Fault::Bias(value),
            FaultKind::Gain => Fault::Gain(value),
            FaultKind::Delay => Fault::Delay { seconds: value, hold: false, initial: None },
            FaultKind::Noise => Fault::Noise {
                spread: NoiseDistribution::Normal(value),
                draw: RandomSeries::new(0, input, place as u64, None),
            },
        };
        (Window { from: self.from, until: None }, fault)
    }
}

fn number(line: &str, word: &str) -> Result<f64, String> {
    text::number(word).ok_or_else(|| format!("{line}: expected a number, found {word:?}"))
}

/// Formats an error and its causes as a sentence.
pub(crate) fn told(error: impl std::error::Error) -> String {
    sentence(&error)
}
