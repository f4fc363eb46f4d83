//! Warns about values that a variable does not allow: beyond min and max, or no item of its enumeration.

use std::collections::HashMap;

use fmu_description::number::{rounded, seconds};
use fmu_description::{IntegerType, Kind, ModelDescription, RealType, ScalarVariable, SimpleType};

use crate::system::{Port, System};
use slave::{Transformation, Value};

/// Default of [`Limits::rounding`] for a floating-point type; a type with a coarser precision has a larger value.
const ROUNDING: f64 = 1e-9;
/// Largest number of variables, of items of an enumeration, and of connected inputs that warnings name.
const NAMED: usize = 5;
/// Digits of a value in a message.
const DIGITS: usize = 6;

/// The values that a variable allows.
#[derive(Clone, Debug)]
struct Limits {
    min: f64,
    max: f64,
    nominal: f64,
    /// Tolerated excess over a limit, relative to the larger one of limit and nominal value.
    rounding: f64,
    /// The items of an enumeration; empty for another type.
    items: Vec<(String, i64)>,
}

/// The types of an FMU by name.
type Types<'a> = HashMap<&'a str, &'a SimpleType>;

fn types(description: &ModelDescription) -> Types<'_> {
    description.types.iter().map(|declared| (declared.name.as_str(), declared)).collect()
}

impl Limits {
    /// Returns the limits that the variable or its declared type states; `None` if every value is allowed, or if the
    /// variable is no number.
    fn of(variable: &ScalarVariable, types: &Types<'_>) -> Option<Self> {
        let declared = variable.kind.declared_type().and_then(|name| types.get(name));
        let (min, max, nominal) = match (variable.kind.as_real(), variable.kind.as_integer()) {
            (Some(kind), _) => {
                let declared = declared.and_then(|declared| declared.kind.as_real());
                let stated = |of: fn(&RealType) -> Option<f64>| of(kind).or_else(|| of(declared?));
                (stated(|kind| kind.min), stated(|kind| kind.max), stated(|kind| kind.nominal))
            }
            (_, Some(kind)) => {
                let declared = declared.and_then(|declared| declared.kind.as_integer());
                let stated = |of: fn(&IntegerType) -> Option<i128>| {
                    #[expect(clippy::cast_precision_loss, reason = "rounds to the nearest number")]
                    of(kind).or_else(|| of(declared?)).map(|limit| limit as f64)
                };
                (stated(|kind| kind.min), stated(|kind| kind.max), None)
            }
            _ => return None,
        };
        let is_enumeration = matches!(variable.kind, Kind::Enumeration(_));
        let items = declared.filter(|_| is_enumeration).map(|declared| declared.items.clone());
        let items = items.unwrap_or_default();
        if min.is_none() && max.is_none() && items.is_empty() {
            return None;
        }
        let (min, max) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
        let rounding = match variable.kind {
            Kind::Real(_) => ROUNDING,
            Kind::Float32(_) => f32::EPSILON.into(),
            // Integers have no rounding errors.
            _ => 0.0,
        };
        Some(Self { min, max, nominal: nominal.unwrap_or(1.0).abs(), rounding, items })
    }

    /// Returns the reason why `value` is not allowed; `None` if `value` is allowed.
    fn refuse(&self, value: f64) -> Option<String> {
        let rounding = |limit: f64| self.rounding * self.nominal.max(limit.abs());
        let is_item =
            |(_, number): &(String, i64)| slave::to_real(*number).total_cmp(&value).is_eq();
        if !self.items.is_empty() && !self.items.iter().any(is_item) {
            let items = self.items.iter().map(|(name, number)| format!("{name} = {number}"));
            let mut items: Vec<_> = items.take(NAMED).collect();
            if items.len() < self.items.len() {
                items.push("...".to_owned());
            }
            return Some(format!("no item of its enumeration, {}", items.join(", ")));
        }
        if value < self.min - rounding(self.min) {
            return Some(format!("below its min, {}", rounded(self.min, DIGITS)));
        }
        let above = value > self.max + rounding(self.max);
        above.then(|| format!("above its max, {}", rounded(self.max, DIGITS)))
    }
}

/// Returns a Real or an Integer as a number; `None` for another type.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Real(value) => Some(*value),
        Value::Integer(value) => Some(slave::to_real(*value)),
        _ => None,
    }
}

/// Warns about settings, and about start values in the descriptions, that their variables do not allow.
pub(crate) fn check_start(system: &System) {
    let (mut settings, mut start_values) = (Vec::new(), Vec::new());
    for (slave, (_, instance)) in system.slaves.iter().enumerate() {
        let description = instance.description();
        let types = types(description);
        for (variable, declaration) in description.variables.iter().enumerate() {
            let port = Port { slave, variable };
            if declaration.alias_of.is_some() || system.source(port).is_some() {
                continue;
            }
            let Some(limits) = Limits::of(declaration, &types) else { continue };
            let setting = system.setting(port);
            let value = setting.cloned().or_else(|| Value::start(&declaration.kind));
            let Some(value) = value.as_ref().and_then(number) else { continue };
            if let Some(why) = limits.refuse(value) {
                let list = if setting.is_some() { &mut settings } else { &mut start_values };
                list.push((port, value, why));
            }
        }
    }
    for (list, what) in
        [(settings, "settings"), (start_values, "start values in the model descriptions")]
    {
        let named = list.iter().take(NAMED).map(|(port, value, why)| {
            format!("{} = {} is {why}", system.name(*port), rounded(*value, DIGITS))
        });
        let named: Vec<_> = named.collect();
        if !named.is_empty() {
            let rest = list.len() - named.len();
            let more = if rest > 0 { format!("; and {rest} more") } else { String::new() };
            tracing::warn!("{what} that their variables do not allow: {}{more}", named.join("; "));
        }
    }
}

/// A connected input with limits.
struct Watched {
    name: String,
    source: Source,
    transformation: Transformation,
    limits: Limits,
}

/// The output that an input is connected to.
enum Source {
    /// A Real output, at this position of the connected Reals.
    Real(usize),
    Integer(Port),
}

impl Watched {
    /// Returns the value of the input, without faults on its connection; `None` for a discrete Real that is set in
    /// event mode.
    fn value(&self, reals: &[f64], integer: impl Fn(Port) -> Option<i64>) -> Option<f64> {
        let value = match self.source {
            Source::Real(position) => *reals.get(position)?,
            Source::Integer(port) => slave::to_real(match &self.transformation {
                Transformation::Integer(pairs) => slave::mapped_integer(pairs, integer(port)?),
                _ => integer(port)?,
            }),
        };
        match self.transformation {
            Transformation::Linear { factor, offset } => Some(factor * value + offset),
            _ => Some(value),
        }
    }
}

/// The connected inputs with limits that have not been reported yet; empty after [`NAMED`] reports.
#[derive(Default)]
pub(crate) struct Watch {
    watched: Vec<Watched>,
    reported: usize,
}

impl Watch {
    /// Watches the connected inputs of `system` that state limits. `position` is the position of an output among the
    /// connected Reals.
    pub(crate) fn new(system: &System, position: impl Fn(Port) -> Option<usize>) -> Self {
        let types: Vec<_> =
            system.slaves.iter().map(|(_, instance)| types(instance.description())).collect();
        let watched = system.connections.iter().filter_map(|connection| {
            let (from, to) = (connection.from, connection.to);
            let mut limits = Limits::of(system.variable(to), &types[to.slave])?;
            if matches!(system.variable(from).kind, Kind::Float32(_)) {
                limits.rounding = f32::EPSILON.into();
            }
            let source = position(from).map_or(Source::Integer(from), Source::Real);
            let (name, transformation) = (system.name(to), connection.transformation.clone());
            Some(Watched { name, source, transformation, limits })
        });
        Self { watched: watched.collect(), reported: 0 }
    }

    /// Whether no input is to be checked any more.
    pub(crate) fn is_empty(&self) -> bool {
        self.watched.is_empty()
    }

    /// Warns once about each input that gets a value outside its limits at the communication point `time`, in s.
    /// `reals` are the connected Reals; `integer` returns the value of an Integer output.
    pub(crate) fn check(
        &mut self,
        time: f64,
        reals: &[f64],
        integer: impl Fn(Port) -> Option<i64>,
    ) {
        let reported = &mut self.reported;
        self.watched.retain(|input| {
            if *reported == NAMED {
                return false;
            }
            let Some(value) = input.value(reals, &integer) else { return true };
            let Some(why) = input.limits.refuse(value) else { return true };
            *reported += 1;
            let last = if *reported == NAMED { "; further inputs are not reported" } else { "" };
            tracing::warn!(
                "{} gets {} at t = {} s by its connection, which is {why}{last}",
                input.name,
                rounded(value, DIGITS),
                seconds(time)
            );
            false
        });
        if *reported >= NAMED {
            self.watched.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slave::{CallError, Slave, StepResult};

    /// The largest `f32` below 1234567.8 is 1234567.75, the one next to 0.1 is 1.5e-9 larger.
    #[test]
    fn a_value_that_a_float32_rounds_to_its_limit_is_allowed() {
        let xml = r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
            <CoSimulation modelIdentifier="m"/><ModelVariables><Float32 name="u" valueReference="1"
            causality="input" start="1" min="0.1" max="1234567.8"/></ModelVariables><ModelStructure/>
            </fmiModelDescription>"#;
        let description = ModelDescription::parse(xml).unwrap();
        let variable = description.variable("u").unwrap();
        let limits = Limits::of(variable, &types(&description)).unwrap();
        assert_eq!([0.1, 1_234_567.8].map(|value| limits.refuse(value)), [None, None]);
        assert!([0.09999, 1_234_569.0].iter().all(|value| limits.refuse(*value).is_some()));
    }

    /// A slave without a model.
    struct Stub(ModelDescription);

    impl Slave for Stub {
        fn description(&self) -> &ModelDescription {
            &self.0
        }
        fn get_real(&mut self, _: &[u32], _: &mut [f64]) -> Result<(), CallError> {
            Ok(())
        }
        fn set_real(&mut self, _: &[u32], _: &[f64]) -> Result<(), CallError> {
            Ok(())
        }
        fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
            Ok(StepResult::Whole)
        }
    }

    /// The `f32` next to 0.1 is larger.
    #[test]
    fn a_float32_may_be_at_the_limit_of_the_float64_that_it_is_connected_to() {
        let xml = r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
            <CoSimulation modelIdentifier="m"/><ModelVariables><Float32 name="y" valueReference="1"
            causality="output"/><Float64 name="u" valueReference="2" causality="input" start="0"
            max="0.1"/></ModelVariables><ModelStructure/></fmiModelDescription>"#;
        let mut system = System::default();
        let stub = Stub(ModelDescription::parse(xml).unwrap());
        system.add("a", Box::new(stub)).unwrap();
        system.connect("a.y", "a.u").unwrap();
        let watch = Watch::new(&system, |_| Some(0));
        let is_refused = |y: f32| watch.watched[0].limits.refuse(y.into()).is_some();
        assert_eq!([0.1, 0.1001].map(is_refused), [false, true]);
    }

    #[test]
    fn five_inputs_are_reported_if_more_leave_their_limits_at_once() {
        let limits = Limits { min: 0.0, max: 1.0, nominal: 1.0, rounding: 0.0, items: Vec::new() };
        let watched = |number: usize| Watched {
            name: format!("a.u{number}"),
            source: Source::Real(number),
            transformation: Transformation::Identity,
            limits: limits.clone(),
        };
        let mut watch = Watch { watched: (0..9).map(watched).collect(), reported: 0 };
        // The first one is within its limits.
        let reals = [0.5, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0];
        watch.check(0.0, &reals, |_| None);
        assert_eq!(watch.reported, 5);
        assert!(watch.is_empty());
    }
}
