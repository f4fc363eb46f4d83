//! Writes `design.toml`, the input file of the controller FMU.

use control::Domain;
use control::aso::{FaultyPlant, Gains};
use fmu_description::unit::Unit;
use nalgebra::DMatrix;
use serde::Serialize;

use super::designed::{ControllerDesign, fault_names};
use super::detection::Section;
use super::linear_plant::LinearPlant;
use super::plant_file::PlantFile;
use super::reconfiguration::{Combination, Reconfiguration, Reconfigurations};
use super::report::rows;
use super::reporting::estimator;
use super::schedule::Scheduled;
use super::signals::{EntryPoint, Signal};

/// The content of the file except the matrices.
#[derive(Serialize)]
pub(crate) struct DesignFile<'a> {
    pub(crate) description: &'a str,
    pub(crate) t_on: f64,
    pub(crate) monitor: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sample_time: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) estimator: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) filter: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sliding_mode: Option<SlidingMode>,
    pub(crate) experiment: Experiment,
    pub(crate) states: Vec<Entry>,
    pub(crate) actuators: Vec<Entry>,
    pub(crate) measurements: Vec<Entry>,
    pub(crate) faults: Vec<Entry>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) references: Vec<Entry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) detection: Option<&'a Section>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) reconfigurations: Vec<ReconfigurationEntry>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) combinations: Vec<CombinationEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) fallback: Option<FallbackEntry>,
}

/// The controller without several actuators.
#[derive(Serialize)]
pub(crate) struct CombinationEntry {
    pub(crate) gone: Vec<String>,
    #[serde(rename = "K_x")]
    pub(crate) k_x: Vec<Vec<f64>>,
    #[serde(rename = "K_f")]
    pub(crate) k_f: Vec<Vec<f64>>,
    #[serde(rename = "K_s")]
    pub(crate) k_s: Vec<Vec<f64>>,
}

/// The fall-back.
#[derive(Serialize)]
pub(crate) struct FallbackEntry {
    #[serde(rename = "K_x")]
    pub(crate) k_x: Vec<Vec<f64>>,
    #[serde(rename = "K_f", skip_serializing_if = "Option::is_none")]
    pub(crate) k_f: Option<Vec<Vec<f64>>>,
}

/// The controller without an actuator.
#[derive(Serialize)]
pub(crate) struct ReconfigurationEntry {
    pub(crate) gone: String,
    pub(crate) stuck_at: f64,
    #[serde(rename = "K_x", skip_serializing_if = "Option::is_none")]
    pub(crate) k_x: Option<Vec<Vec<f64>>>,
    #[serde(rename = "K_f", skip_serializing_if = "Option::is_none")]
    pub(crate) k_f: Option<Vec<Vec<f64>>>,
    #[serde(rename = "K_s", skip_serializing_if = "Option::is_none")]
    pub(crate) k_s: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) restart: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) loss: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) time: Option<f64>,
}

/// The default experiment of importers, times in s.
#[derive(Serialize)]
pub(crate) struct Experiment {
    pub(crate) stop_time: f64,
    pub(crate) step_size: f64,
}

/// The bounds of a sliding-mode law.
#[derive(Serialize)]
pub(crate) struct SlidingMode {
    pub(crate) rho: Vec<f64>,
    pub(crate) delta: Vec<f64>,
}

/// A signal.
#[derive(Serialize, Default)]
pub(crate) struct Entry {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) unit: Option<String>,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) description: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) limits: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) operating: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) loss_of: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) least_command: Option<f64>,
}

/// The scheduling variable.
#[derive(Serialize)]
struct ScheduleEntry<'a> {
    variable: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<&'a str>,
    #[serde(skip_serializing_if = "str::is_empty")]
    description: &'a str,
}

impl ControllerDesign {
    /// Returns the text of the design file.
    pub(crate) fn file(
        &self,
        file: &PlantFile<'_>,
        description: &str,
        (detection, reconfigurations): (Option<&Section>, &Reconfigurations),
    ) -> Result<String, crate::Error> {
        let linear = &self.linear;
        let at_origin = self.signals().all(|signal| signal.operating.unwrap_or(0.0) == 0.0);
        let entry = |signal: &Signal| Entry {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            description: signal.description.clone(),
            limits: signal.limits,
            operating: signal.operating.filter(|_| !at_origin),
            ..Entry::default()
        };
        let entries = |signals: &[Signal]| signals.iter().map(entry).collect::<Vec<_>>();
        let sampled = match self.domain {
            Domain::Continuous => None,
            Domain::Sampled { period } => Some(period),
        };
        let mut states = entries(&linear.states);
        if self.filter.is_some() {
            states.extend(linear.measurements.iter().map(|signal| Entry {
                name: format!("filtered {}", signal.name),
                ..entry(signal)
            }));
        }
        let head = DesignFile {
            description,
            t_on: file.t_on,
            monitor: file.monitor,
            sample_time: sampled,
            estimator: sampled.map(|_| estimator(self.gains.estimator)),
            filter: self.filter.clone(),
            sliding_mode: self
                .law
                .injection
                .as_ref()
                .map(|own| SlidingMode { rho: own.rho.clone(), delta: own.delta.clone() }),
            experiment: self.experiment(file)?,
            states,
            actuators: entries(&linear.actuators),
            measurements: entries(&linear.measurements),
            faults: self.fault_entries(),
            references: self.tracking.as_ref().map_or(Vec::new(), |own| entries(&own.signals)),
            detection,
            reconfigurations: reconfigurations
                .single
                .iter()
                .map(|own| self.reconfigured(own))
                .collect(),
            combinations: reconfigurations
                .combinations
                .iter()
                .map(|own| self.combined(own))
                .collect(),
            fallback: reconfigurations
                .fallback
                .as_ref()
                .map(|own| FallbackEntry { k_x: rows(&own.k_x), k_f: own.k_f.as_ref().map(rows) }),
        };
        let FaultyPlant { a, b, c, f_a, a_f } = &self.plant;
        let mut matrices = vec![("A", a), ("B", b), ("C", c), ("F_a", f_a)];
        if self.law.a_f.is_some() || self.extended.plant.a_f.amax() > 0.0 {
            matrices.push(("A_f", a_f));
        }
        matrices.extend(linear.has_feedthrough().then_some(("D", &linear.d)));
        let Gains { k_x, k_f, l_x, l_f, p_f, .. } = &self.gains;
        let l_f = self.law.injection.as_ref().map_or(l_f, |own| &own.f);
        matrices.extend([("K_x", k_x), ("K_f", k_f), ("L_x", l_x), ("L_f", l_f)]);
        matrices.extend(p_f.as_ref().map(|p_f| ("P_f", p_f)));
        if let Some(integral) = &self.gains.integral {
            matrices.extend([("H", &integral.h), ("K_i", &integral.gain)]);
            matrices.extend((integral.faults.amax() > 0.0).then_some(("F_i", &integral.faults)));
        }
        if let Some(tracking) = &self.tracking {
            matrices.extend(tracking.windup().map(|l_w| ("L_w", l_w)));
            matrices.extend(tracking.feedforward().map(|n_r| ("N_r", n_r)));
        }
        let mut text = head.render(&matrices)?;
        if let Some(schedule) = &self.schedule {
            text += &self.schedule_text(schedule)?;
        }
        Ok(text)
    }

    /// Returns the table `[schedule]`: the variable, and matrices and operating point at each of its
    /// values.
    fn schedule_text(&self, schedule: &Scheduled) -> Result<String, crate::Error> {
        let Signal { name, unit, description, .. } = &schedule.variable;
        let own = ScheduleEntry { variable: name, unit: unit.as_deref(), description };
        let unwritable = |error: toml::ser::Error| crate::Error::Invalid(error.to_string());
        let mut text = format!("\n[schedule]\n{}", toml::to_string(&own).map_err(unwritable)?);
        for (at, design) in schedule.points(self) {
            text.extend(["\n[[schedule.points]]\nat = ", &format!("{at:?}"), "\n"]);
            let LinearPlant { states, actuators, measurements, .. } = &design.linear;
            let filtered = if design.filter.is_some() { &measurements[..] } else { &[] };
            let x_op: Vec<_> = states.iter().chain(filtered).collect();
            let mut points = vec![
                ("x_op", x_op),
                ("u_op", actuators.iter().collect()),
                ("y_op", measurements.iter().collect()),
            ];
            let references = design.tracking.as_ref().map(|own| own.signals.iter().collect());
            points.extend(references.map(|own| ("r_op", own)));
            for (name, signals) in points {
                let values: Vec<_> = signals
                    .iter()
                    .map(|signal| format!("{:?}", signal.operating.unwrap_or(0.0) + 0.0))
                    .collect();
                text.extend([name, " = [", &values.join(", "), "]\n"]);
            }
            let FaultyPlant { a, b, c, f_a, .. } = &design.plant;
            let Gains { k_x, k_f, l_x, l_f, p_f, .. } = &design.gains;
            let mut matrices = vec![("A", a), ("B", b), ("C", c), ("F_a", f_a)];
            matrices.extend([("K_x", k_x), ("K_f", k_f), ("L_x", l_x), ("L_f", l_f)]);
            matrices.extend(p_f.as_ref().map(|p_f| ("P_f", p_f)));
            matrices.extend(design.gains.integral.as_ref().map(|own| ("K_i", &own.gain)));
            if let Some(tracking) = &design.tracking {
                matrices.extend(tracking.windup().map(|l_w| ("L_w", l_w)));
                matrices.extend(tracking.feedforward().map(|n_r| ("N_r", n_r)));
            }
            for (name, matrix) in matrices {
                write_matrix(&mut text, name, matrix);
            }
        }
        Ok(text)
    }

    fn reconfigured(&self, own: &Reconfiguration) -> ReconfigurationEntry {
        let names = fault_names(&self.linear, &self.extended);
        ReconfigurationEntry {
            gone: self.linear.actuators[own.actuator].name.clone(),
            stuck_at: own.stuck_at,
            k_x: own.gains.as_ref().map(|own| rows(&own.k_x)),
            k_f: own.gains.as_ref().map(|own| rows(&own.k_f)),
            k_s: own.gains.as_ref().map(|own| own.k_s.iter().map(|entry| entry + 0.0).collect()),
            restart: own.restart.iter().map(|fault| names[*fault].clone()).collect(),
            loss: own.decision.map(|(loss, _)| loss),
            time: own.decision.map(|(_, time)| time),
        }
    }

    fn combined(&self, own: &Combination) -> CombinationEntry {
        let name = |at: &usize| self.linear.actuators[*at].name.clone();
        CombinationEntry {
            gone: own.gone.iter().map(name).collect(),
            k_x: rows(&own.gains.k_x),
            k_f: rows(&own.gains.k_f),
            k_s: rows(&own.gains.k_s),
        }
    }

    fn signals(&self) -> impl Iterator<Item = &Signal> {
        let linear = &self.linear;
        linear.states.iter().chain(&linear.actuators).chain(&linear.measurements)
    }

    /// Returns the faults, then the rates of ramps: one entry per column of F_a.
    fn fault_entries(&self) -> Vec<Entry> {
        let mut all: Vec<_> = fault_names(&self.linear, &self.extended)
            .into_iter()
            .map(|name| Entry { name, ..Entry::default() })
            .collect();
        for (fault, channel) in self.linear.faults.iter().zip(&self.extended.channels) {
            let own = &mut all[channel.estimate];
            own.unit.clone_from(&fault.unit);
            own.description.clone_from(&fault.description);
            if let EntryPoint::Loss { actuator, least_command } = fault.entry_point {
                own.loss_of = Some(self.linear.actuators[actuator].name.clone());
                own.least_command = Some(least_command);
            }
            if let Some(rate) = channel.rate {
                all[rate].unit = fault.unit.as_deref().and_then(per_second);
                all[rate].description = format!("rate of {}", fault.name);
            }
        }
        all
    }

    /// Returns the experiment of the plant file. The default covers ten time constants of the
    /// slowest feedback eigenvalue in 2000 steps, or in steps of the sample time.
    fn experiment(&self, file: &PlantFile<'_>) -> Result<Experiment, control::Error> {
        let slowest = self.slowest_rate()?;
        let stop_time = file.stop_time.unwrap_or_else(|| round(10.0 / slowest));
        let step_size = file.step_size.unwrap_or(match self.domain {
            Domain::Continuous => round(stop_time / 2000.0),
            Domain::Sampled { period } => period,
        });
        Ok(Experiment { stop_time, step_size })
    }
}

/// Returns the unit divided by seconds, if it can be written.
fn per_second(unit: &str) -> Option<String> {
    let slope = format!("{unit}/s");
    Unit::parse(&slope).is_ok().then_some(slope)
}

/// Rounds to the nearest 1, 2 or 5 times a power of ten, on the logarithmic scale.
pub(crate) fn round(x: f64) -> f64 {
    let exponent = x.log10().floor();
    let part = x.log10() - exponent;
    let distance = |factor: &f64| (factor.log10() - part).abs();
    let factors = [1.0, 2.0, 5.0, 10.0].into_iter();
    let factor = factors.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(1.0);
    // A division rounds 0.1, 0.01 and so on to the nearest double; a product does not.
    if exponent < 0.0 { factor / 10_f64.powf(-exponent) } else { factor * 10_f64.powf(exponent) }
}

impl DesignFile<'_> {
    /// Returns the text of the file: scalars, `matrices` with one row per line, tables.
    pub(crate) fn render(
        &self,
        matrices: &[(&str, &DMatrix<f64>)],
    ) -> Result<String, crate::Error> {
        let unwritable = |error: toml::ser::Error| crate::Error::Invalid(error.to_string());
        let all = toml::Table::try_from(self).map_err(unwritable)?;
        let is_table = |value: &toml::Value| {
            value.as_array().map_or(value.is_table(), |list| list.iter().any(toml::Value::is_table))
        };
        let (tables, scalars): (toml::Table, toml::Table) =
            all.into_iter().partition(|(_, value)| is_table(value));
        let mut text = String::new();
        text += &toml::to_string(&scalars).map_err(unwritable)?;
        for (name, matrix) in matrices {
            text += "\n";
            write_matrix(&mut text, name, matrix);
        }
        text += "\n";
        text += &toml::to_string(&tables).map_err(unwritable)?;
        Ok(text)
    }
}

/// Writes a matrix, one row per line.
fn write_matrix(text: &mut String, name: &str, matrix: &DMatrix<f64>) {
    text.extend([name, " = [\n"]);
    for row in matrix.row_iter() {
        let entries: Vec<_> = row.iter().map(|entry| format!("{:?}", entry + 0.0)).collect();
        text.extend(["    [", &entries.join(", "), "],\n"]);
    }
    *text += "]\n";
}
