//! The choice of the gains by the actuators that are gone, and the commands of stuck ones.

use super::Source;
use crate::code::symbols::Matrix;

/// The name of a matrix in the set of gains in force.
pub(super) fn chosen(matrix: Matrix) -> String {
    format!("{}_of_set", matrix.name().to_ascii_lowercase())
}

impl Source<'_> {
    /// The structure of what is known about the actuators in a sample.
    pub(super) fn actuators_structure(&self, lines: &mut Vec<String>) {
        if self.controller.reconfiguration.is_none() {
            return;
        }
        let fields = self.fields.switches(self.controller);
        let count = fields.len();
        lines.push(format!(
            "
/// Number of [`Actuators`].
pub const SWITCHES: usize = {count};

/// What is known about the actuators in a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Actuators {{"
        ));
        for field in &fields {
            let text = match field.strip_prefix("gone_") {
                Some(actuator) => format!("Whether `{actuator}` is gone"),
                None => {
                    "Whether an unknown actuator has failed: the gains are those of the fall-back"
                        .to_owned()
                }
            };
            lines.push(format!("    /// {text}.\n    pub {field}: bool,"));
        }
        let values: Vec<_> = (1..=count).map(|k| format!("v{k}")).collect();
        let pairs: Vec<_> =
            fields.iter().zip(&values).map(|(field, value)| format!("{field}: {value}")).collect();
        let reads: Vec<_> = fields.iter().map(|field| format!("own.{field}")).collect();
        lines.push(format!(
            "}}

impl From<[bool; SWITCHES]> for Actuators {{
    fn from([{}]: [bool; SWITCHES]) -> Self {{
        Self {{ {} }}
    }}
}}

impl From<Actuators> for [bool; SWITCHES] {{
    fn from(own: Actuators) -> Self {{
        [{}]
    }}
}}",
            values.join(", "),
            pairs.join(", "),
            reads.join(", ")
        ));
    }

    /// The fields of an instance with their types and start values.
    fn reconfiguration_fields(&self) -> Vec<(&'static str, String, &'static str)> {
        let Some(own) = &self.controller.reconfiguration else { return Vec::new() };
        let mut all = vec![
            ("gone", "[bool; ACTUATORS]".to_owned(), "[false; ACTUATORS]"),
            ("set", "u32".to_owned(), "0"),
            ("reconfiguration", "i32".to_owned(), "0"),
        ];
        if !own.cases.is_empty() {
            all.extend([
                ("lost", format!("[{}; CASES]", self.real), "[0.0; CASES]"),
                ("above", "[bool; CASES]".to_owned(), "[false; CASES]"),
                ("above_since", "[u32; CASES]".to_owned(), "[0; CASES]"),
                ("decided", "[bool; CASES]".to_owned(), "[false; CASES]"),
            ]);
        }
        all
    }

    /// The declarations of these fields.
    pub(super) fn reconfiguration_state(&self, lines: &mut Vec<String>) {
        let fields = self.reconfiguration_fields().into_iter();
        lines.extend(fields.map(|(field, kind, _)| format!("    {field}: {kind},")));
    }

    /// Their start values.
    pub(super) fn reconfiguration_start(&self, lines: &mut Vec<String>) {
        let fields = self.reconfiguration_fields().into_iter();
        lines.extend(fields.map(|(field, _, start)| format!("            {field}: {start},")));
    }

    /// The constants that are no real numbers.
    pub(super) fn reconfiguration_tables(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        let mut table = |head: &str, rows: Vec<String>| {
            lines.push(format!("\nstatic {head} = [\n    {},\n];", rows.join(",\n    ")));
        };
        let row = |row: &[bool]| {
            format!("[{}]", row.iter().map(bool::to_string).collect::<Vec<_>>().join(", "))
        };
        let sets = own.sets.iter().map(|own| row(&own.gone)).collect();
        table("SET_GONE: [[bool; ACTUATORS]; GAIN_SETS]", sets);
        if own.cases.is_empty() {
            return;
        }
        if own.fallback.is_none() {
            let singles = own.single_sets(self.controller.actuators.len());
            table("SINGLE_SET: [u32; ACTUATORS]", singles.iter().map(usize::to_string).collect());
        }
        let samples = own.cases.iter().map(|own| own.decision.map_or(0, |own| own.2).to_string());
        table("CASE_SAMPLES: [u32; CASES]", samples.collect());
        let places = own.cases.iter().map(|own| own.actuator.to_string());
        table("CASE_ACTUATOR: [u32; CASES]", places.collect());
        let restarts = own.cases.iter().map(|own| row(&own.restarts)).collect();
        table("CASE_RESTARTS: [[bool; FAULTS]; CASES]", restarts);
    }

    /// The methods that decide which actuators are gone and choose the gains.
    pub(super) fn reconfiguration_methods(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        lines.push("\nimpl Controller {".to_owned());
        if !own.cases.is_empty() {
            lines.push(
                "    /// Decides which actuators are gone; the estimates of the faults of those that are gone or back
    /// since the last sample restart at 0.
    fn find_gone(&mut self, reported: &[bool; SWITCHES], asked: bool) {
        let losses = self.lost.iter().zip(&MOST_LOST).zip(&CASE_SAMPLES);
        let flags = self.above.iter_mut().zip(&mut self.above_since).zip(&mut self.decided).zip(reported);
        let cases = losses.zip(flags).zip(CASE_ACTUATOR.iter().zip(&CASE_RESTARTS));
        for ((((lost, most), samples), (((above, since), decided), reported)), (actuator, restarts)) in cases {
            if !asked && lost > most {
                if !*above {
                    (*above, *since) = (true, self.sample);
                }
                *decided |= self.sample.wrapping_sub(*since) >= *samples;
            } else {
                *above = false;
            }
            let now = *reported || *decided;
            for (place, gone) in (0..).zip(&mut self.gone) {
                if place != *actuator {
                    continue;
                }
                if now != *gone {
                    for (f_hat, restarted) in self.f_hat.iter_mut().zip(restarts) {
                        if *restarted {
                            *f_hat = 0.0;
                        }
                    }
                }
                *gone = now;
            }
        }
    }
"
                .to_owned(),
            );
        }
        let (regular, last) = (own.regular_sets(), own.sets.len() - 1);
        let parameter = if own.fallback.is_some() { ", fall_back: bool" } else { "" };
        let otherwise = match own.fallback {
            None if own.cases.is_empty() => String::new(),
            None => "
        if self.set == 0 {
            let mut sets = SINGLE_SET.iter().zip(&self.gone).filter_map(|(set, gone)| gone.then_some(*set));
            self.set = sets.next().unwrap_or(0);
        }"
            .to_owned(),
            Some(_) => format!(
                "
        if fall_back || (self.reconfiguration > 0 && self.set == 0) {{
            (self.set, self.reconfiguration) = ({last}, -1);
        }}"
            ),
        };
        lines.push(format!(
            "    /// Chooses the set of gains for the actuators that are gone.
    fn choose_gains(&mut self{parameter}) {{
        let numbered = (1..).zip(&self.gone).find(|(_, gone)| **gone);
        self.reconfiguration = numbered.map_or(0, |(number, _)| number);
        let sets = (0..{regular}).zip(&SET_GONE);
        self.set = sets.fold(0, |set, (own, gone)| if *gone == self.gone {{ own }} else {{ set }});{otherwise}
    }}
}}

/// An entry of a table of the sets of gains.
fn of_set<T>(table: &[T; GAIN_SETS], set: u32) -> &T {{
    let [intact, ..] = table;
    table.get(set as usize).unwrap_or(intact)
}}"
        ));
    }

    /// The choice of the gains at the start of a sample.
    pub(super) fn reconfigure(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        let last = own.sets.len() - 1;
        let has_fallback = own.fallback.is_some();
        lines.push("        if self.sample > 0 {".to_owned());
        if !own.cases.is_empty() {
            let asked = if has_fallback { "actuators.fall_back" } else { "false" };
            lines.push(format!("            self.find_gone(&(*actuators).into(), {asked});"));
        }
        let fall_back = if has_fallback { "actuators.fall_back" } else { "" };
        lines.push(format!("            self.choose_gains({fall_back});\n        }}"));
        if has_fallback && !self.controller.monitor {
            lines.push(format!("        let estimating = compensating || self.set == {last};"));
        }
        if own.fallback == Some(false) {
            lines.push(format!("        let compensating = compensating && self.set != {last};"));
        }
        for matrix in [Matrix::KX, Matrix::KF] {
            let table = matrix.name().to_ascii_uppercase();
            lines.push(format!("        let {} = of_set(&{table}, self.set);", chosen(matrix)));
        }
    }

    /// The commands with and of stuck actuators.
    pub(super) fn stuck_commands(&self, lines: &mut Vec<String>) {
        if self.controller.reconfiguration.is_none() {
            return;
        }
        lines.push(
            "        // u = u + K_s u_stuck
        let without = of_set(&SET_GONE, self.set);
        let stuck = self.gone.iter().zip(&U_STUCK).zip(&STUCK_AT).zip(of_set(&K_S, self.set)).zip(&U_OP);
        for ((u, command), ((((gone, u_stuck), stuck_at), row), u_op)) in u.iter_mut().zip(&mut command).zip(stuck) {
            let mut sum = -0.0;
            for ((gain, u_stuck), gone) in row.iter().zip(&U_STUCK).zip(without) {
                if *gone {
                    sum += *gain * *u_stuck;
                }
            }
            *u = if *gone { *u_stuck } else { *u + sum };
            *command = if *gone { *stuck_at } else { *u + *u_op };
        }"
            .to_owned(),
        );
    }
}
