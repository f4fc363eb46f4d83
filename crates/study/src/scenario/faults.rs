//! Resolves `[[scenario.fault]]`.

use fmu_description::{Causality, Kind};
use serde_spanned::Spanned;

use super::convert::Conversion;
use super::resolve::{Resolver, Target, at, finite, kinds, only, positive, require};
use super::signals::{conversion, unfit};
use super::{Delay, Dropout, FaultEntry, Literal, Noise, Reason, Saturation, ScenarioError};
use master::Port;
use master::fault::{Fault, FaultChain, LossPattern, NoiseDistribution, RandomSeries, Window};

/// All kinds of faults.
const KINDS: &str = "bias, gain, drift, stuck, dropout, delay, quantisation, saturation, noise, \
                     inversion";
/// Kinds of faults by the type of the input.
const OF_INTEGERS: &str = "bias, stuck, dropout, delay or saturation";
const OF_BOOLEANS: &str = "stuck, dropout, delay or inversion";
const OF_ENUMERATIONS: &str = "stuck, dropout or delay";
const OF_REALS: &str = "any kind but inversion";

impl<'a> Resolver<'a> {
    /// Resolves `[[scenario.fault]]`. Adds the faults of driven variables to their drives and
    /// returns the others.
    pub(super) fn faults(
        &mut self,
        entries: &[Spanned<FaultEntry>],
    ) -> Result<Vec<(Port, FaultChain)>, ScenarioError> {
        let mut inputs: Vec<(Port, FaultChain)> = Vec::new();
        for (index, entry) in entries.iter().enumerate() {
            let path = format!("scenario.fault[{}]", index + 1);
            let stated = &entry.get_ref().connection;
            let target = self.faulty_input(stated.get_ref()).map_err(at(stated, &path))?;
            let port = target.port;
            let position = inputs.iter().position(|(input, _)| *input == port);
            let position = position.unwrap_or_else(|| {
                inputs.push((port, FaultChain::default()));
                inputs.len() - 1
            });
            let chain = &mut inputs[position].1;
            let (name, index) = (target.name.clone(), chain.len() as u64);
            let converter = EntryConverter { target, start: self.setup.start, index };
            let fault = converter.fault(entry.get_ref());
            let (window, fault) = fault.map_err(at(entry, &path))?;
            let added = chain.push(window, fault, self.setup.step);
            added.map_err(|error| at(entry, &path)(error.into()))?;
            self.windows.push((name, window));
        }
        let mut chains = Vec::new();
        for (port, chain) in inputs {
            match self.drives.iter_mut().find(|(drive, _)| drive.port() == port) {
                Some((drive, _)) => drive.set_faults(chain),
                None => chains.push((port, chain)),
            }
        }
        Ok(chains)
    }

    /// Returns the input that `stated` names as `slave.variable` or as `slave.output=slave.input`. Returns an error if
    /// the input has neither a connection nor a signal, or if its source is not the stated output.
    fn faulty_input(&self, stated: &str) -> Result<Target<'a>, Reason> {
        let (source, input) = match stated.split_once('=') {
            Some((source, input)) => (Some(source.trim()), input.trim()),
            None => (None, stated.trim()),
        };
        let target = self.target(input)?;
        let source_port = self.system.source(target.port).map(|connection| connection.from);
        if source_port.is_none() && self.driver(target.port).is_none() {
            let description = match target.variable.causality {
                Causality::Input => "an input without a source",
                Causality::Output => "an output",
                _ => "no input",
            };
            return Err(Reason::NoConnection { name: target.name, actual: description });
        }
        if let Some(source) = source {
            let stated_source = self.system.port(source)?;
            let holder = |port| self.system.holder(port);
            if source_port.map(holder) != Some(holder(stated_source)) {
                let description = source_port
                    .map_or_else(|| "a signal".to_owned(), |port| self.system.name(port));
                let (target, stated) = (target.name, self.system.name(stated_source));
                return Err(Reason::OtherSource { target, actual: description, stated });
            }
        }
        Ok(target)
    }
}

/// Converts an entry of `[[scenario.fault]]` to a fault of the master.
struct EntryConverter<'a> {
    target: Target<'a>,
    /// Start of the simulation in s.
    start: f64,
    /// Position among the faults of the input, which gives each of these faults a different random series.
    index: u64,
}

impl EntryConverter<'_> {
    fn fault(&self, entry: &FaultEntry) -> Result<(Window, Fault), Reason> {
        let kinds = kinds!(entry: bias, gain, drift, stuck, dropout, delay, quantisation, saturation,
            noise, inversion);
        self.expect_fit(only(&kinds, KINDS)?)?;
        let unit = conversion(entry.unit.as_ref(), &self.target)?;
        let (window, fault) = self.body(entry, unit)?;
        finite("from", window.from)?;
        if let Some(until) = window.until {
            let is_later = until.is_finite() && until > window.from;
            require("until", until, is_later, "a time after from")?;
        }
        Ok((window, fault))
    }

    fn body(&self, entry: &FaultEntry, unit: Conversion) -> Result<(Window, Fault), Reason> {
        /// Returns the window and the fault if the entry is of this kind.
        macro_rules! of {
            ($kind:ident => $fault:expr) => {
                if let Some($kind) = entry.$kind.as_ref().map(Spanned::get_ref) {
                    return Ok(($kind.window(self.start), $fault));
                }
            };
        }
        of!(bias => {
            let value = unit.relative(finite("value", bias.value)?);
            Fault::Bias(self.whole("value", value)?)
        });
        of!(gain => {
            if unit.offset != 0.0 {
                let expected = "no unit with an offset, as the factor acts in the unit of the input";
                return Err(Reason::Members { what: "gain", expected });
            }
            Fault::Gain(finite("factor", gain.factor)?)
        });
        of!(drift => Fault::Drift(unit.relative(finite("rate", drift.rate)?)));
        of!(stuck => Fault::Stuck(self.value(stuck.value.as_ref(), unit)?));
        of!(dropout => self.dropout(dropout, unit)?);
        of!(delay => self.delay(delay, unit)?);
        of!(quantisation => Fault::Quantisation {
            step: unit.relative(positive("step", quantisation.step)?).abs(),
            offset: unit.absolute(finite("offset", quantisation.offset)?),
        });
        of!(saturation => self.saturation(saturation, unit)?);
        of!(noise => self.noise(noise, unit)?);
        of!(inversion => Fault::Inversion);
        Err(Reason::Kinds { actual: Vec::new(), expected: KINDS })
    }

    /// Checks that the kind of fault `what` fits the type of the input.
    fn expect_fit(&self, what: &'static str) -> Result<(), Reason> {
        let fits_all = ["stuck", "dropout", "delay"].contains(&what);
        let (fits, expected) = match &self.target.variable.kind {
            Kind::Real(_) | Kind::Float32(_) => (what != "inversion", OF_REALS),
            Kind::Boolean(_) => (fits_all || what == "inversion", OF_BOOLEANS),
            Kind::Enumeration(_) => (fits_all, OF_ENUMERATIONS),
            other if other.as_integer().is_some() => {
                (fits_all || ["bias", "saturation"].contains(&what), OF_INTEGERS)
            }
            _ => (false, "an input of another type"),
        };
        if fits {
            return Ok(());
        }
        Err(unfit(what, &self.target, expected))
    }

    /// Returns `number`; an error if the input is not of a floating-point type and `number` is not whole or may be
    /// rounded. `number` may be beyond the range of the input, because the faulty value is limited to this range.
    fn whole(&self, what: &'static str, number: f64) -> Result<f64, Reason> {
        let is_real = self.target.is_real();
        let is_exact = is_real || number.abs() < 2_f64.powi(53);
        require(what, number, is_exact, "a magnitude below 2^53, as larger integers are rounded")?;
        let fits = is_real || number.fract() == 0.0;
        require(what, number, fits, "a whole number, as the input is an Integer")
    }

    /// Converts a value, if stated, to the type and unit of the input; returns an error for a value that does not fit.
    fn value(&self, value: Option<&Literal>, unit: Conversion) -> Result<Option<f64>, Reason> {
        let Some(value) = value else { return Ok(None) };
        let number = value.number(self.target.variable, self.target.description);
        let number = number.map_err(|expected| self.target.value_error(value, expected))?;
        Ok(Some(unit.absolute(number)))
    }

    fn random_series(&self, seed: u64, every: Option<f64>) -> Result<RandomSeries, Reason> {
        let every = every.map(|every| positive("every", every)).transpose()?;
        Ok(RandomSeries::new(seed, &self.target.name, self.index, every))
    }

    fn dropout(&self, dropout: &Dropout, unit: Conversion) -> Result<Fault, Reason> {
        let Dropout { period, lost, probability, every, seed, .. } = *dropout;
        let members = |expected| Reason::Members { what: "dropout", expected };
        let lost = match (period, lost, probability) {
            (None, None, None) => LossPattern::All,
            (Some(period), Some(part), None) => {
                positive("period", period)?;
                let fits = part > 0.0 && part < period;
                require("lost", part, fits, "a time above 0 and below the period")?;
                LossPattern::Periodic { period, part }
            }
            (None, None, Some(probability)) => {
                let fits = (0.0..=1.0).contains(&probability);
                require("probability", probability, fits, "a number from 0 to 1")?;
                let draw = self.random_series(seed.unwrap_or(0), every)?;
                LossPattern::Random { probability, draw }
            }
            _ => return Err(members("period and lost, or probability, or none of them")),
        };
        if probability.is_none() && (every.is_some() || seed.is_some()) {
            return Err(members("every and seed only with probability"));
        }
        Ok(Fault::Dropout { lost, instead: self.value(dropout.value.as_ref(), unit)? })
    }

    fn delay(&self, delay: &Delay, unit: Conversion) -> Result<Fault, Reason> {
        let seconds = positive("seconds", delay.seconds)?;
        let initial = self.value(delay.initial.as_ref(), unit)?;
        Ok(Fault::Delay { seconds, hold: delay.hold || !self.target.is_real(), initial })
    }

    fn saturation(&self, saturation: &Saturation, unit: Conversion) -> Result<Fault, Reason> {
        let bound = |what, bound: Option<f64>| {
            let bound = bound.map(|bound| finite(what, bound)).transpose()?;
            bound.map(|bound| self.whole(what, unit.absolute(bound))).transpose()
        };
        let (min, max) = (bound("min", saturation.min)?, bound("max", saturation.max)?);
        // A unit with a negative factor exchanges the bounds.
        let (lowest, highest) = if unit.factor < 0.0 { (max, min) } else { (min, max) };
        match (saturation.min, saturation.max) {
            (None, None) => {
                Err(Reason::Members { what: "saturation", expected: "min or max or both" })
            }
            (Some(min), Some(max)) if min > max => {
                Err(Reason::Number { what: "max", actual: max, expected: "a number not below min" })
            }
            _ => Ok(Fault::Saturation { lowest, highest }),
        }
    }

    fn noise(&self, noise: &Noise, unit: Conversion) -> Result<Fault, Reason> {
        let spread = match (noise.deviation, noise.amplitude) {
            (Some(deviation), None) => {
                NoiseDistribution::Normal(unit.relative(positive("deviation", deviation)?).abs())
            }
            (None, Some(amplitude)) => {
                NoiseDistribution::Uniform(unit.relative(positive("amplitude", amplitude)?).abs())
            }
            _ => {
                let expected = "deviation (normal) or amplitude (uniform)";
                return Err(Reason::Members { what: "noise", expected });
            }
        };
        Ok(Fault::Noise { spread, draw: self.random_series(noise.seed, noise.every)? })
    }
}
