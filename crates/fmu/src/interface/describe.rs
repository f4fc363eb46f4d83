//! The description of the variables, by functions that are not generic over the model.

use super::structure::{self, Variables};
use crate::model::Failure;
use crate::variable::{Base, Declaration, Enumeration};
use fmu_description::unit::{DisplayUnit, Unit};
use fmu_description::{
    Causality, Initial, IntegerType, Kind, ModelDescription, RealType, ScalarVariable, SimpleType,
    Variability,
};

/// Makes the calculated parameters tunable that depend on a tunable parameter, as FMI 2.0.5, section 2.2.7 demands.
pub(super) fn tune_calculated_parameters(variables: &mut [Declaration]) {
    let is_tunable = |variable: &&Declaration| {
        variable.causality == Causality::Parameter && variable.variability == Variability::Tunable
    };
    let tunable: Vec<String> =
        variables.iter().filter(is_tunable).map(|variable| variable.name.clone()).collect();
    for variable in variables {
        let depends = match &variable.initially {
            Some(names) => names.iter().any(|name| tunable.contains(name)),
            None => !tunable.is_empty(),
        };
        if variable.causality == Causality::CalculatedParameter && depends {
            variable.variability = Variability::Tunable;
        }
    }
}

/// Describes time and the variables, with their units, types and dependencies. Types and value references of
/// the variables are set later.
pub(super) fn describe_variables(
    variables: &Variables,
    description: &mut ModelDescription,
) -> Result<(), Failure> {
    description.structure = structure::structure(variables)?;
    description.variables.push(time());
    for variable in variables.declarations {
        define_unit(&mut description.units, variable)?;
        define_type(&mut description.types, variable)?;
        description.variables.push(describe_variable(variables, variable)?);
    }
    Ok(())
}

/// Describes the variable; type and value reference are set later.
fn describe_variable(
    variables: &Variables,
    variable: &Declaration,
) -> Result<ScalarVariable, Failure> {
    let (mut variability, mut initial) = (variable.variability, variable.initial);
    if let Base::Alias(of) = &variable.base {
        let target = variables.find(&variable.name, of)?;
        if let Base::Alias(_) = variables.declarations[target].base {
            let name = &variable.name;
            return Err(Failure::Error(format!("{name} is an alias of {of}, itself an alias")));
        }
        variability = variables.declarations[target].variability;
        if variability == Variability::Constant {
            initial = Some(Initial::Exact);
        }
    }
    let state = variable.derivative_of.as_ref();
    let state = state.map(|of| variables.find(&variable.name, of)).transpose()?;
    Ok(ScalarVariable {
        name: variable.name.clone(),
        value_reference: 0,
        description: Some(variable.description.clone()).filter(|text| !text.is_empty()),
        causality: variable.causality,
        variability,
        initial,
        kind: Kind::Real(RealType {
            derivative: state.map(structure::index),
            ..RealType::default()
        }),
        ..ScalarVariable::default()
    })
}

/// Returns the independent variable, time, the Real with value reference 0.
fn time() -> ScalarVariable {
    ScalarVariable {
        name: "time".to_owned(),
        value_reference: 0,
        description: Some("Simulation time".to_owned()),
        causality: Causality::Independent,
        variability: Variability::Continuous,
        initial: None,
        kind: Kind::Real(RealType { unit: Some("s".to_owned()), ..RealType::default() }),
        ..ScalarVariable::default()
    }
}

/// Adds the unit of the variable to `units`, and its display unit to the unit, unless they are listed. An error for a
/// display unit with other base units.
fn define_unit(units: &mut Vec<Unit>, variable: &Declaration) -> Result<(), Failure> {
    let Some(name) = &variable.number.unit else { return Ok(()) };
    let wrong = |reason: String| {
        let name = &variable.name;
        Failure::Error(format!("variable {name}: {reason} (FMI 2.0.5, section 2.2.2)"))
    };
    let parse = |name: &str| Unit::parse(name).map_err(|error| wrong(error.to_string()));
    if units.iter().all(|unit| unit.name != *name) {
        units.push(parse(name)?);
    }
    let unit = units.iter_mut().find(|unit| unit.name == *name);
    let Some((unit, display)) = unit.zip(variable.number.display_unit.as_ref()) else {
        return Ok(());
    };
    if unit.display_units.iter().all(|known| known.name != *display) {
        let bases = unit.base.zip(parse(display)?.base);
        let conversion = bases.and_then(|(base, shown)| base.conversion(&shown));
        let (factor, offset) = conversion.ok_or_else(|| {
            wrong(format!("display unit {display:?}, expected a unit of the quantity of {name:?}"))
        })?;
        let name = display.clone();
        unit.display_units.push(DisplayUnit { name, factor, offset, inverse: false });
    }
    Ok(())
}

/// Adds the enumeration of the variable to `types`, unless it is listed; an error if it is listed with other items.
fn define_type(types: &mut Vec<SimpleType>, variable: &Declaration) -> Result<(), Failure> {
    let Some(Enumeration { name, items }) = &variable.enumeration else { return Ok(()) };
    match types.iter().find(|known| known.name == *name) {
        Some(known) if known.items == wide(items) => {}
        Some(_) => {
            return Err(Failure::Error(format!(
                "variable {}: its enumeration {name} has other items elsewhere \
                 (FMI 2.0.5, section 2.2.3)",
                variable.name
            )));
        }
        None => types.push(SimpleType {
            name: name.clone(),
            description: None,
            kind: Kind::Enumeration(IntegerType::default()),
            items: wide(items),
        }),
    }
    Ok(())
}

fn wide(items: &[(String, i32)]) -> Vec<(String, i64)> {
    items.iter().map(|(name, value)| (name.clone(), (*value).into())).collect()
}

/// Gives each alias the value reference and the type of its variable. A pair is the index of an alias and the name of
/// its variable.
pub(super) fn describe_aliases(aliases: Vec<(usize, String)>, description: &mut ModelDescription) {
    for (index, of) in aliases {
        let target =
            description.variable(&of).map(|target| (target.kind.clone(), target.value_reference));
        let Some((mut kind, value_reference)) = target else { continue };
        let alias = &mut description.variables[index];
        if alias.variability != Variability::Constant {
            kind.clear_start();
        }
        replace_type(&mut alias.kind, kind);
        alias.value_reference = value_reference;
    }
}

/// Replaces the type but keeps the attribute `derivative`, which is set before the type.
pub(super) fn replace_type(current: &mut Kind, mut kind: Kind) {
    if let (Kind::Real(RealType { derivative, .. }), Kind::Real(new)) = (&*current, &mut kind) {
        new.derivative = *derivative;
    }
    *current = kind;
}
