//! Model descriptions from derived tables of variables.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Failure, Log, Model, Simulation, Variables};
use fmu_description::{
    Causality, DependencyKind, Initial, Kind, ModelDescription, RealType, Variability,
};

/// Every kind of variable.
#[derive(Clone, Variables, Serialize, Deserialize)]
struct Everything {
    /// Commands
    #[fmu(input, unit = "N", start = [1.0, 2.0])]
    force: [f64; 2],
    /// Positions of the masses,
    /// from left to right
    ///
    /// This paragraph is for readers of the source.
    #[fmu(output, state, reinit, unit = "m", nominal = 0.5)]
    position: [f64; 2],
    /// Velocities
    #[fmu(derivative_of = position, name = "der(position)", depends(force), initially(mass))]
    velocity: [f64; 2],
    /// Gains
    #[fmu(parameter, start = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])]
    gain: [[f64; 2]; 3],
    #[fmu(output, depends())]
    table: [[i32; 1]; 2],
    /// Mass
    #[fmu(parameter, unit = "kg", quantity = "Mass", min = 1e-3, start = 1)]
    mass: f64,
    /// Operating mode
    #[fmu(input, enumeration("Mode", off = 0, "on and off" = 1, r#static = 2), start = 1)]
    mode: i32,
    #[fmu(output, depends())]
    count: i32,
    #[fmu(output)]
    power: f64,
    #[fmu(tunable, start = true)]
    enabled: bool,
    #[fmu(parameter, start = "pump")]
    label: String,
    #[fmu(calculated_parameter)]
    inverse: f64,
    #[fmu(calculated_parameter, initially(mass))]
    double: f64,
    #[fmu(local, discrete, approximate, start = 3)]
    guess: f64,
    #[fmu(constant, display_unit = "deg", unit = "rad", start = 10.0 / 57.0)]
    limit: f64,
    #[fmu(local)]
    r#type: f64,
    #[fmu(skip, start = vec![1, 2])]
    rows: Vec<u8>,
    #[fmu(skip)]
    rest: Option<u8>,
    log: Log,
}

#[fmu::model(stop_time = 4, tolerance = 1e-5)]
impl Model for Everything {
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.velocity = self.force;
        Ok(())
    }
}

fn description() -> ModelDescription {
    crate::describe::<Everything>(Path::new("")).unwrap()
}

fn dependencies(description: &ModelDescription, name: &str) -> Vec<String> {
    let structure = &description.structure;
    let mut rows = structure.outputs.iter().chain(&structure.derivatives);
    let name_of = |index: u32| description.variables[index as usize - 1].name.clone();
    let row = rows.find(|row| name_of(row.index) == name).unwrap();
    row.dependencies.iter().flatten().map(|index| name_of(*index)).collect()
}

#[test]
fn the_fields_are_the_variables_in_their_order() {
    let description = description();
    let names: Vec<_> =
        description.variables.iter().map(|variable| variable.name.as_str()).collect();
    let expected = "time force[1] force[2] position[1] position[2] der(position[1]) \
                    der(position[2]) gain[1,1] gain[1,2] gain[2,1] gain[2,2] gain[3,1] gain[3,2] \
                    table[1,1] table[2,1] mass mode count power enabled label inverse double guess \
                    limit type";
    assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    assert_eq!(description.problems(), []);
    assert_eq!(description.model_name, "Everything");
    let experiment = description.default_experiment.unwrap();
    assert_eq!((experiment.stop_time, experiment.tolerance), (Some(4.0), Some(1e-5)));
}

#[test]
fn roles_types_and_attributes_are_described() {
    let description = description();
    let find = |name: &str| description.variable(name).unwrap();
    let real = |name: &str| match &find(name).kind {
        Kind::Real(real) => real.clone(),
        other => panic!("{name} is {other:?}"),
    };
    assert_eq!(real("force[2]").start, Some(2.0));
    let position = find("position[1]");
    assert_eq!(
        position.description.as_deref(),
        Some("Positions of the masses, from left to right")
    );
    assert_eq!((position.causality, position.initial), (Causality::Output, Some(Initial::Exact)));
    assert_eq!((real("gain[1,2]").start, real("gain[3,1]").start), (Some(2.0), Some(5.0)));
    assert!(real("position[2]").reinit);
    assert_eq!(real("position[2]").nominal, Some(0.5));
    assert_eq!(real("der(position[2])").derivative, Some(5));
    assert_eq!(real("mass").quantity.as_deref(), Some("Mass"));
    assert_eq!((real("mass").min, real("mass").max), (Some(1e-3), None));
    assert!(matches!(&find("mode").kind, Kind::Enumeration(kind) if kind.start == Some(1)));
    assert_eq!(description.types[0].items[1], ("on and off".to_owned(), 1));
    assert_eq!(description.types[0].items[2], ("static".to_owned(), 2));
    assert_eq!(find("count").description, None);
    assert_eq!(find("enabled").kind, Kind::Boolean(Some(true)));
    assert_eq!(find("label").kind, Kind::String(Some("pump".to_owned())));
    assert_eq!(find("inverse").causality, Causality::CalculatedParameter);
    assert_eq!(find("inverse").variability, Variability::Tunable);
    assert_eq!(find("double").variability, Variability::Fixed);
    assert_eq!(find("guess").initial, Some(Initial::Approx));
    assert_eq!(find("guess").variability, Variability::Discrete);
    assert_eq!(find("limit").variability, Variability::Constant);
}

#[test]
fn an_output_depends_on_all_inputs_and_states_unless_it_says_otherwise() {
    let description = description();
    assert_eq!(
        dependencies(&description, "power"),
        ["force[1]", "force[2]", "position[1]", "position[2]", "mode"]
    );
    assert_eq!(dependencies(&description, "position[2]"), ["position[2]"]);
    assert_eq!(dependencies(&description, "count"), <[String; 0]>::default());
    assert_eq!(dependencies(&description, "der(position[1])"), ["force[1]", "force[2]"]);
    let kinds = description.structure.derivatives.iter().map(|row| row.kinds.clone());
    assert!(kinds.flatten().flatten().all(|kind| kind == DependencyKind::Dependent));
}

#[test]
fn fields_without_a_start_value_have_the_default_of_their_type() {
    let model = Everything::default();
    assert_eq!(
        (model.rows, model.rest, model.count, model.velocity),
        (vec![1, 2], None, 0, [0.0; 2])
    );
}

#[test]
fn arrays_of_states_are_integrated() {
    let mut simulation = Simulation::<Everything>::new(Path::new("")).unwrap();
    for _ in 0..4 {
        simulation.step(0.25).unwrap();
    }
    let [left, right] = simulation.model().position;
    assert!((left - 1.0).abs() < 1e-14 && (right - 2.0).abs() < 1e-14);
}

/// A model with variables that importers show in other units.
#[derive(Clone, Default, Variables, Serialize, Deserialize)]
struct Displayed {
    #[fmu(output, unit = "K", display_unit = "degC")]
    temperature: f64,
    #[fmu(output, unit = "K", display_unit = "degC", relative_quantity)]
    rise: f64,
    #[fmu(output, unit = "m/s", display_unit = "km/h")]
    speed: f64,
    #[fmu(output, unit = "m/s", display_unit = "m/min")]
    ascent: f64,
}

#[fmu::model]
impl Model for Displayed {}

#[test]
fn only_a_field_that_says_so_is_relative() {
    let description = crate::describe::<Displayed>(Path::new("")).unwrap();
    let reals = description.variables.iter().map(|variable| (&variable.name, &variable.kind));
    let relative = reals.filter(|(_, kind)| kind.as_real().is_some_and(RealType::is_relative));
    assert_eq!(relative.map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["rise"]);
}

#[test]
fn a_display_unit_has_the_conversion_from_the_unit() {
    assert_eq!(crate::problems::<Displayed>(Path::new("")), Ok(vec![]));
    let units = crate::describe::<Displayed>(Path::new("")).unwrap().units;
    for (unit, display, value, expected) in
        [("K", "degC", 293.15, 20.0), ("m/s", "km/h", 10.0, 36.0), ("m/s", "m/min", 10.0, 600.0)]
    {
        let unit = units.iter().find(|known| known.name == unit).unwrap();
        let display = unit.display_units.iter().find(|known| known.name == display).unwrap();
        let actual = display.factor * value + display.offset;
        assert!((actual - expected).abs() < 1e-11, "{actual} {}", display.name);
    }
}

/// A temperature that is shown as a length.
#[derive(Clone, Default, Variables, Serialize, Deserialize)]
struct Confused {
    #[fmu(output, unit = "K", display_unit = "m")]
    temperature: f64,
}

#[fmu::model]
impl Model for Confused {}

#[test]
fn a_display_unit_of_another_quantity_is_refused() {
    let actual = crate::problems::<Confused>(Path::new("")).unwrap_err().to_string();
    for part in ["variable temperature", "display unit \"m\"", "\"K\"", "section 2.2.2"] {
        assert!(actual.contains(part), "{actual}");
    }
}

/// A model with an unknown unit.
#[derive(Clone, Default, Variables, Serialize, Deserialize)]
struct Misspelt {
    /// Level
    #[fmu(output, unit = "meter")]
    level: f64,
}

#[fmu::model]
impl Model for Misspelt {}

#[test]
fn an_unknown_unit_is_an_error_of_the_first_test_with_its_section() {
    let actual = crate::problems::<Misspelt>(Path::new("")).unwrap_err().to_string();
    for part in ["variable level", "\"meter\"", "column 1", "section 2.2.2"] {
        assert!(actual.contains(part), "{actual}");
    }
}
