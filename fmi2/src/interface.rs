//! The variables of one model by value reference, and the description rendered from them.

use crate::description::{
    Causality, CoSimulation, Initial, IntegerType, Kind, LogCategory, ModelDescription,
    ModelStructure, RealType, ScalarVariable, Unknown, Variability,
};
use crate::model::{Failure, Model};
use crate::unit::Unit;
use crate::variable::{Access, Field, Variable};

/// Log categories of every exported FMU: the standardized names of section 2.2.4.
const CATEGORIES: [(&str, &str); 3] = [
    ("logStatusDiscard", "Calls that were refused without harm"),
    ("logStatusError", "Calls that failed; the instance has to be reset or restored"),
    ("logStatusFatal", "Calls after which the instance is lost"),
];

/// One variable of base type `T`; its position in [`Interface`] is its value reference.
pub(crate) struct Slot<M, T> {
    pub(crate) name: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    pub(crate) range: (f64, f64),
    pub(crate) field: Field<M, T>,
    pub(crate) derivatives: Vec<Field<M, f64>>,
}

/// The variables of a model, by base type and value reference.
pub(crate) struct Interface<M> {
    /// Value reference 0 is time and has no slot: the Real with reference `r` is `reals[r - 1]`.
    pub(crate) reals: Vec<Slot<M, f64>>,
    pub(crate) integers: Vec<Slot<M, i32>>,
    pub(crate) booleans: Vec<Slot<M, bool>>,
    pub(crate) strings: Vec<Slot<M, String>>,
    pub(crate) max_output_derivative_order: u32,
}

impl<M: Model> Interface<M> {
    /// Sorts the variables of `model` by type and describes them, start values included.
    pub(crate) fn new(model: &mut M) -> Result<(Self, ModelDescription), Failure> {
        let variables = model.variables();
        let mut description = general::<M>(model);
        description.structure = structure(&variables)?;
        let mut interface = Self {
            reals: Vec::new(),
            integers: Vec::new(),
            booleans: Vec::new(),
            strings: Vec::new(),
            max_output_derivative_order: 0,
        };
        description.variables.push(time());
        for variable in variables {
            define_unit(&mut description.units, &variable)?;
            description.variables.push(interface.add(model, variable));
        }
        if let Some(co_simulation) = &mut description.co_simulation {
            co_simulation.max_output_derivative_order = interface.max_output_derivative_order;
            co_simulation.can_interpolate_inputs = interface
                .reals
                .iter()
                .any(|slot| slot.causality == Causality::Input && !slot.derivatives.is_empty());
        }
        description.guid = description.content_guid();
        Ok((interface, description))
    }

    /// Files the variable under the next value reference of its type and describes it.
    fn add(&mut self, model: &mut M, variable: Variable<M>) -> ScalarVariable {
        let start_given = variable.initial != Some(Initial::Calculated);
        let real = RealType {
            unit: variable.unit,
            min: variable.min,
            max: variable.max,
            ..RealType::default()
        };
        let blank = Blank {
            name: variable.name.clone(),
            causality: variable.causality,
            variability: variable.variability,
            range: (
                variable.min.unwrap_or(f64::NEG_INFINITY),
                variable.max.unwrap_or(f64::INFINITY),
            ),
            derivatives: variable.derivatives,
        };
        if blank.causality == Causality::Output {
            let order = u32::try_from(blank.derivatives.len()).unwrap_or(u32::MAX);
            self.max_output_derivative_order = self.max_output_derivative_order.max(order);
        }
        let (kind, value_reference) = self.file(model, variable.access, blank, real, start_given);
        ScalarVariable {
            name: variable.name,
            value_reference,
            description: Some(variable.description),
            causality: variable.causality,
            variability: variable.variability,
            initial: variable.initial,
            kind,
        }
    }

    /// The type as described, with the field's value as start where one is given, and the value
    /// reference.
    fn file(
        &mut self,
        model: &mut M,
        access: Access<M>,
        blank: Blank<M>,
        real: RealType,
        start_given: bool,
    ) -> (Kind, u32) {
        match access {
            Access::Real(field) => {
                let start = start_given.then(|| *field(model));
                (Kind::Real(RealType { start, ..real }), blank.fill(&mut self.reals, field) + 1)
            }
            Access::Integer(field) => {
                let start = start_given.then(|| *field(model));
                let integer = IntegerType { start, ..IntegerType::default() };
                (Kind::Integer(integer), blank.fill(&mut self.integers, field))
            }
            Access::Boolean(field) => {
                let start = start_given.then(|| *field(model));
                (Kind::Boolean(start), blank.fill(&mut self.booleans, field))
            }
            Access::String(field) => {
                let start = start_given.then(|| field(model).clone());
                (Kind::String(start), blank.fill(&mut self.strings, field))
            }
        }
    }
}

/// A slot whose field is still to come.
struct Blank<M> {
    name: String,
    causality: Causality,
    variability: Variability,
    range: (f64, f64),
    derivatives: Vec<Field<M, f64>>,
}

impl<M> Blank<M> {
    /// Appends the slot and returns its position.
    fn fill<T>(self, slots: &mut Vec<Slot<M, T>>, field: Field<M, T>) -> u32 {
        slots.push(Slot {
            name: self.name,
            causality: self.causality,
            variability: self.variability,
            range: self.range,
            field,
            derivatives: self.derivatives,
        });
        u32::try_from(slots.len() - 1).unwrap_or(u32::MAX)
    }
}

/// The independent variable, value reference 0 of the Reals.
fn time() -> ScalarVariable {
    ScalarVariable {
        name: "time".to_owned(),
        value_reference: 0,
        description: Some("Simulation time".to_owned()),
        causality: Causality::Independent,
        variability: Variability::Continuous,
        initial: None,
        kind: Kind::Real(RealType { unit: Some("s".to_owned()), ..RealType::default() }),
    }
}

fn general<M: Model>(model: &M) -> ModelDescription {
    let about = model.about();
    let text = |text: String| (!text.is_empty()).then_some(text);
    ModelDescription {
        fmi_version: "2.0".to_owned(),
        model_name: M::IDENTIFIER.to_owned(),
        description: text(about.description),
        author: text(about.author),
        version: text(about.version),
        license: text(about.license),
        generation_tool: Some(concat!("fmi2 ", env!("CARGO_PKG_VERSION")).to_owned()),
        structured_names: true,
        co_simulation: Some(CoSimulation {
            model_identifier: M::IDENTIFIER.to_owned(),
            can_handle_variable_communication_step_size: true,
            can_not_use_memory_management_functions: true,
            can_get_and_set_fmu_state: true,
            can_serialize_fmu_state: true,
            ..CoSimulation::default()
        }),
        log_categories: CATEGORIES
            .map(|(name, description)| LogCategory {
                name: name.to_owned(),
                description: Some(description.to_owned()),
            })
            .to_vec(),
        units: Unit::parse("s").into_iter().collect(),
        default_experiment: Some(about.default_experiment),
        ..ModelDescription::default()
    }
}

fn define_unit<M>(units: &mut Vec<Unit>, variable: &Variable<M>) -> Result<(), Failure> {
    let Some(name) = &variable.unit else { return Ok(()) };
    if units.iter().all(|unit| unit.name != *name) {
        let unit = Unit::parse(name)
            .map_err(|error| Failure::Error(format!("variable {}: {error}", variable.name)))?;
        units.push(unit);
    }
    Ok(())
}

/// `ModelStructure`: `Outputs`, and as `InitialUnknowns` the outputs that are calculated.
fn structure<M>(variables: &[Variable<M>]) -> Result<ModelStructure, Failure> {
    let mut structure = ModelStructure::default();
    for (position, variable) in variables.iter().enumerate() {
        if variable.causality != Causality::Output {
            continue;
        }
        let unknown = |names: Option<&Vec<String>>| -> Result<Unknown, Failure> {
            let dependencies =
                names.map(|names| indices(variables, variable, names)).transpose()?;
            Ok(Unknown { index: index(position), dependencies, kinds: None })
        };
        structure.outputs.push(unknown(Some(&variable.direct))?);
        structure.initial_unknowns.push(unknown(variable.initially.as_ref())?);
    }
    Ok(structure)
}

/// The 1-based index of the variable at `position`: `time` is the first.
fn index(position: usize) -> u32 {
    u32::try_from(position + 2).unwrap_or(u32::MAX)
}

/// Ascending indices of the variables called `names`, on which `of` depends.
fn indices<M>(
    variables: &[Variable<M>],
    of: &Variable<M>,
    names: &[String],
) -> Result<Vec<u32>, Failure> {
    let mut found = Vec::with_capacity(names.len());
    for name in names {
        if name == "time" {
            found.push(1);
            continue;
        }
        let position =
            variables.iter().position(|variable| variable.name == *name).ok_or_else(|| {
                let of = &of.name;
                Failure::Error(format!("{of} depends on {name}, which is no variable"))
            })?;
        found.push(index(position));
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}
