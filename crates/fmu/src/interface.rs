//! The variables of a model by value reference, and the model description made from them.

mod clocks;
mod describe;
pub(crate) mod fmi3;
mod general;
mod sizes;
mod slot;
mod states;
mod structure;
mod typed;

use std::collections::HashSet;

use crate::model::{Failure, Model};
use crate::variable::{Access, Base, Declaration, Enumeration, Fields, Number, Variable};
use describe::{describe_aliases, describe_variables, replace_type, tune_calculated_parameters};
use fmu_description::call_order::{InterfaceType, settable};
use fmu_description::call_order3;
use fmu_description::location::NO_FOLDER;
use fmu_description::{
    Causality, Guid, Initial, IntegerType, Kind, ModelDescription, Problem, RealType,
    ScalarVariable, Unknown,
};
use typed::{Slots, integer};

pub(crate) use general::WARNING;
pub(crate) use slot::Slot;
use slot::SlotBuilder;
pub(crate) use typed::Native;

/// A continuous state: the positions of state and derivative in [`Interface::reals`], and the nominal value.
pub(crate) struct ContinuousState {
    pub(crate) state: usize,
    pub(crate) derivative: usize,
    pub(crate) nominal: f64,
}

/// The variables of a model by base type and value reference.
pub(crate) struct Interface<M> {
    /// Value reference 0 is time and has no slot: the Real with reference `r` is `reals[r - 1]`.
    pub(crate) reals: Vec<Slot<M, f64>>,
    pub(crate) integers: Vec<Slot<M, i32>>,
    pub(crate) booleans: Vec<Slot<M, bool>>,
    pub(crate) strings: Vec<Slot<M, String>>,
    /// The variables of types that FMI 2.0 does not have.
    pub(crate) typed: Slots<M>,
    pub(crate) states: Vec<ContinuousState>,
    /// Number of event indicators; `None` without model exchange.
    pub(crate) event_indicators: Option<usize>,
    pub(crate) max_output_derivative_order: u32,
    /// Positions in `reals` of the inputs with derivatives.
    pub(crate) interpolated: Vec<usize>,
    /// The names of the log categories.
    pub(crate) log_categories: Vec<String>,
    pub(crate) guid: Guid,
    /// The structural parameters that are the extents of arrays.
    sizes: sizes::Sizes,
    /// The clocks of clocked variables.
    pub(crate) clocks: clocks::Clocks,
}

/// Type and value reference of a variable.
type TypedReference = (Kind, u32);

impl<M: Model> Interface<M> {
    /// Assigns slots and value references to the variables of `model` and makes the model description with start
    /// values. The description has the variables of both versions of FMI until [`Interface::restrict`] or
    /// [`Interface::convert`].
    pub(crate) fn new(model: &mut M) -> Result<(Self, ModelDescription), Failure> {
        let (mut variables, fields) = split(model.variables());
        tune_calculated_parameters(&mut variables);
        let mut description = general::general::<M>(model);
        description.log_categories = general::categories(model.log().is_some(), M::LOG_CATEGORIES);
        let named = structure::Variables::new(&variables);
        describe_variables(&named, &mut description)?;
        let states = structure::states(&named)?;
        let names = description.log_categories.iter().map(|category| category.name.clone());
        let mut interface = Self {
            reals: Vec::new(),
            integers: Vec::new(),
            booleans: Vec::new(),
            strings: Vec::new(),
            typed: Slots::default(),
            states: Vec::new(),
            event_indicators: model.model_exchange().map(|interface| interface.event_indicators),
            max_output_derivative_order: 0,
            interpolated: Vec::new(),
            log_categories: names.collect(),
            guid: Guid([0; 16]),
            sizes: sizes::Sizes::of(&variables),
            clocks: clocks::Clocks::of(&variables),
        };
        interface.assign_references(model, variables.into_iter().zip(fields), &mut description)?;
        interface.states = states
            .into_iter()
            .map(|(state, derivative)| continuous_state(&description, state, derivative))
            .collect::<Result<_, _>>()?;
        interface.mark(&description);
        if let Some(co_simulation) = &mut description.co_simulation {
            co_simulation.max_output_derivative_order = interface.max_output_derivative_order;
            co_simulation.can_interpolate_inputs = !interface.interpolated.is_empty();
        }
        interface.guid = Guid::of(&description);
        description.guid = interface.guid.to_string();
        Ok((interface, description))
    }

    /// Marks the slots of the states and of the unknowns of `ModelStructure`, and lists the inputs with
    /// derivatives.
    fn mark(&mut self, description: &ModelDescription) {
        for state in &self.states {
            let slot = &mut self.reals[state.state];
            slot.is_state = true;
            slot.settable = settable(slot.causality, slot.variability, slot.initial, true);
        }
        let real = |row: &Unknown| {
            let variable = &description.variables[row.index as usize - 1];
            matches!(variable.kind, Kind::Real(_)).then(|| variable.value_reference as usize - 1)
        };
        for (position, slot) in self.reals.iter().enumerate() {
            if slot.causality == Causality::Input && !slot.derivatives.is_empty() {
                self.interpolated.push(position);
            }
        }
        let structure = &description.structure;
        for position in structure.outputs.iter().chain(&structure.derivatives).filter_map(real) {
            self.reals[position].is_unknown = true;
        }
        for position in structure.initial_unknowns.iter().filter_map(real) {
            self.reals[position].is_initial_unknown = true;
        }
    }

    /// Assigns slot, value reference and type to each variable. An alias gets no slot; it gets the value
    /// reference and the type of its variable.
    fn assign_references(
        &mut self,
        model: &mut M,
        variables: impl Iterator<Item = (Declaration, Fields<M>)>,
        description: &mut ModelDescription,
    ) -> Result<(), Failure> {
        let mut aliases = Vec::new();
        for (position, (variable, fields)) in variables.enumerate() {
            if let Base::Alias(of) = variable.base {
                aliases.push((position + 1, of));
                continue;
            }
            let name = variable.name.clone();
            let (kind, value_reference) = self
                .assign_reference(model, variable, fields)
                .map_err(|reason| Failure::Error(format!("variable {name}: {reason}")))?;
            let variable = &mut description.variables[position + 1];
            replace_type(&mut variable.kind, kind);
            variable.value_reference = value_reference;
        }
        describe_aliases(aliases, description);
        Ok(())
    }

    /// Assigns the next value reference of its type to the variable. Returns the value reference and the type, whose
    /// start value is the value of the field, unless the variable has `initial = calculated`.
    fn assign_reference(
        &mut self,
        model: &mut M,
        variable: Declaration,
        Fields { access, derivatives }: Fields<M>,
    ) -> Result<TypedReference, String> {
        let start_given = variable.initial != Some(Initial::Calculated);
        if variable.causality == Causality::Output {
            let order = u32::try_from(derivatives.len()).unwrap_or(u32::MAX);
            self.max_output_derivative_order = self.max_output_derivative_order.max(order);
        }
        let (number, reinit) = (variable.number.clone(), variable.reinit);
        let enumeration = variable.enumeration.clone();
        let builder = SlotBuilder::new(variable, derivatives);
        Ok(match access {
            Access::Real(field) => {
                let start = start_given.then(|| *field(model));
                let real = RealType { start, reinit, ..real(number) };
                (Kind::Real(real), builder.build(&mut self.reals, field) + 1)
            }
            Access::Integer(field) => {
                let start = start_given.then(|| i128::from(*field(model)));
                let kind = if let Some(Enumeration { name, .. }) = enumeration {
                    let declared_type = Some(name);
                    Kind::Enumeration(IntegerType {
                        declared_type,
                        start,
                        ..IntegerType::default()
                    })
                } else {
                    let limits = integer(number, &(i32::MIN.into()..=i32::MAX.into()))?;
                    Kind::Integer(IntegerType { start, ..limits })
                };
                (kind, builder.build(&mut self.integers, field))
            }
            Access::Boolean(field) => {
                let start = start_given.then(|| *field(model));
                (Kind::Boolean(start), builder.build(&mut self.booleans, field))
            }
            Access::String(field) => {
                let start = start_given.then(|| field(model).clone());
                (Kind::String(start), builder.build(&mut self.strings, field))
            }
            Access::Typed(field) => self.typed.add(model, field, number, start_given, builder)?,
            Access::Alias => return Err("it is an alias".to_owned()),
        })
    }
}

/// Splits the variables into their declarations and their fields. Variables that descriptions of FMI 2.0 leave out come
/// last, followed by their aliases, so that leaving them out changes no index of another variable.
fn split<M>(variables: Vec<Variable<M>>) -> (Vec<Declaration>, Vec<Fields<M>>) {
    let (last, first): (Vec<_>, Vec<_>) =
        variables.into_iter().partition(|variable| variable.declaration.is_left_out_of_2());
    let is_alias_of_last = |variable: &Variable<M>| {
        matches!(&variable.declaration.base, Base::Alias(of)
            if last.iter().any(|target| target.declaration.name == *of))
    };
    let (aliases, first): (Vec<_>, Vec<_>) = first.into_iter().partition(is_alias_of_last);
    let all = first.into_iter().chain(last).chain(aliases);
    all.map(|variable| (variable.declaration, variable.fields)).unzip()
}

pub(crate) fn real(number: Number) -> RealType {
    RealType {
        quantity: number.quantity,
        unit: number.unit,
        display_unit: number.display_unit,
        min: number.min,
        max: number.max,
        nominal: number.nominal,
        relative_quantity: number.relative_quantity.then_some(true),
        ..RealType::default()
    }
}

/// Returns the continuous state at position `state` of the variables, with the derivative at position `derivative`; an
/// error if one of them is no Real.
fn continuous_state(
    description: &ModelDescription,
    state: usize,
    derivative: usize,
) -> Result<ContinuousState, Failure> {
    let slot = |position: usize| {
        let variable = &description.variables[position + 1];
        match &variable.kind {
            Kind::Real(real) => Ok((variable.value_reference as usize - 1, real.nominal)),
            _ => Err(Failure::Error(format!(
                "{} is no Real, but a state or its derivative",
                variable.name
            ))),
        }
    };
    let ((state, nominal), (derivative, _)) = (slot(state)?, slot(derivative)?);
    Ok(ContinuousState { state, derivative, nominal: nominal.unwrap_or(1.0) })
}

/// Makes the model description of FMI 2.0 of `M`, with the folder `resources`, as packing writes it to
/// `modelDescription.xml`.
///
/// # Errors
///
/// [`Failure::Error`] for an unknown unit, a reference to an unknown variable or another declaration
/// that cannot be described, such as a type that FMI 2.0 does not have (clocks and structural parameters are left out);
/// the failure of [`Model::new`].
pub fn describe<M: Model>(resources: &std::path::Path) -> Result<ModelDescription, Failure> {
    let (mut interface, mut description) = Interface::new(&mut new_model::<M>(resources)?)?;
    interface.restrict(&mut description)?;
    Ok(description)
}

/// Checks that every variable has a type of FMI 2.0.
fn expressible_in_2(description: &ModelDescription) -> Result<(), Failure> {
    match description.variables.iter().find(|variable| is_of_3(variable)) {
        None => Ok(()),
        Some(variable) => Err(Failure::Error(format!(
            "variable {} is a {}, a type that FMI 2.0 does not have: this model is for FMI 3.0 only \
             (aso-ftc pack --fmi 3)",
            variable.name,
            variable.kind.element()
        ))),
    }
}

/// Whether the variable has a type that FMI 2.0 does not have.
fn is_of_3(variable: &ScalarVariable) -> bool {
    !matches!(
        variable.kind,
        Kind::Real(_)
            | Kind::Integer(_)
            | Kind::Enumeration(_)
            | Kind::Boolean(_)
            | Kind::String(_)
    )
}

/// Makes the model description of FMI 3.0 of `M`; its `guid` is the `instantiationToken`.
///
/// Scalars named `A[1,1]`, `A[1,2]` and so on ([`Variable::real_array`] declares such) are one array if
/// their attributes agree. Event indicators are local variables.
///
/// # Errors
///
/// [`Failure::Error`] for an unknown unit, a reference to an unknown variable or another declaration that cannot be
/// described, for an array whose extents are not the values of its structural parameters, and for a name in the clocks of
/// a variable that is not the name of a clock; the failure of [`Model::new`].
pub fn describe_3<M: Model>(resources: &std::path::Path) -> Result<ModelDescription, Failure> {
    let (mut interface, description) = Interface::new(&mut new_model::<M>(resources)?)?;
    Ok(interface.convert(&description, InterfaceType::CoSimulation)?.1)
}

impl<M> Interface<M> {
    /// Removes clocks and structural parameters, which FMI 2.0 does not have, and dependencies on them from the
    /// description, and sets the GUID of what remains. Arrays have their present extents. An error for a variable of
    /// another type that FMI 2.0 does not have.
    pub(crate) fn restrict(&mut self, description: &mut ModelDescription) -> Result<(), Failure> {
        let left_out = |variable: &ScalarVariable| {
            variable.causality == Causality::StructuralParameter
                || matches!(variable.kind, Kind::Clock(_))
        };
        if description.variables.iter().any(left_out) {
            description.variables.retain(|variable| !left_out(variable));
            // The variables that are left out are the last ones, and dependencies are in ascending order.
            let count = description.variables.len();
            let structure = &mut description.structure;
            let (outputs, derivatives) = (&mut structure.outputs, &mut structure.derivatives);
            for rows in [outputs, derivatives, &mut structure.initial_unknowns] {
                rows.retain(|row| row.index as usize <= count);
                for row in rows {
                    let Some(known) = &mut row.dependencies else { continue };
                    known.retain(|index| *index as usize <= count);
                    if let Some(kinds) = &mut row.kinds {
                        kinds.truncate(known.len());
                    }
                }
            }
            description.guid = String::new();
            self.guid = Guid::of(description);
            description.guid = self.guid.to_string();
        }
        expressible_in_2(description)
    }

    /// Converts the description to FMI 3.0, and sets when each Real may be set in an instance of `interface_type`. The
    /// GUID becomes the `instantiationToken`. In model exchange continuous states may be set in event mode unless an
    /// event changes them (section 2.3.5). An error if the extents of an array are not the values of its structural
    /// parameters, or if a name in the clocks of a variable is not the name of a clock.
    pub(crate) fn convert(
        &mut self,
        description: &ModelDescription,
        interface_type: InterfaceType,
    ) -> Result<(fmi3::Table, ModelDescription), Failure> {
        let indicators = self.event_indicators.unwrap_or_default();
        // Set before elements become arrays, because the elements of an array must have equal attributes.
        let mut scalars = description.clone();
        self.clocks.enter(&mut scalars)?;
        let interpolated = self.interpolated.iter().map(|&position| &self.reals[position].name);
        let interpolated: HashSet<&String> = interpolated.collect();
        for variable in &mut scalars.variables {
            variable.intermediate_update = interpolated.contains(&variable.name);
        }
        let (table, mut converted) = fmi3::describe(&scalars, indicators);
        self.sizes.enter(&mut converted)?;
        let intermediate = converted.variables.iter().any(|variable| variable.intermediate_update);
        if let Some(co_simulation) = &mut converted.co_simulation {
            co_simulation.provides_intermediate_update = intermediate;
        }
        self.guid = Guid::of(&converted);
        converted.guid = self.guid.to_string();
        for variable in &description.variables {
            if let Kind::Real(RealType { reinit: true, .. }) = variable.kind {
                self.reals[variable.value_reference as usize - 1].is_reinitialised = true;
            }
        }
        for slot in &mut self.reals {
            let is_state = slot.is_state && interface_type == InterfaceType::ModelExchange;
            let is_state = is_state.then_some(slot.is_reinitialised);
            slot.settable =
                call_order3::settable(slot.causality, slot.variability, slot.initial, is_state);
        }
        Ok((table, converted))
    }
}

/// Calls [`Model::new`]. If this fails and the importer named no folder, the message says so.
pub(crate) fn new_model<M: Model>(resources: &std::path::Path) -> Result<M, Failure> {
    M::new(resources).map_err(|failure| {
        if resources != std::path::Path::new(NO_FOLDER) {
            return failure;
        }
        let reason = failure.to_string().replace('\0', "");
        Failure::Error(format!(
            "fmuResourceLocation is null or empty, and this model needs its resources: expected \
             the URI of their folder, such as file:///tmp/fmu/resources ({reason})"
        ))
    })
}

/// Returns the static rules of FMI 2.0.5 that the description of `M` breaks; those of FMI 3.0.2 if a
/// variable has a type that FMI 2.0 does not have, or is a clock or a structural parameter.
///
/// Use it as the first test of a model: `aso-ftc pack` rejects a model with problems.
///
/// # Errors
///
/// Same as [`describe_3`].
pub fn problems<M: Model>(resources: &std::path::Path) -> Result<Vec<Problem>, Failure> {
    let (mut interface, description) = Interface::new(&mut new_model::<M>(resources)?)?;
    if description.variables.iter().any(is_of_3) {
        let (_, converted) = interface.convert(&description, InterfaceType::CoSimulation)?;
        return Ok(converted.problems());
    }
    Ok(description.problems())
}
