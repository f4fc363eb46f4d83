//! The lists of `ModelStructure`, compared with the effects of perturbations.

use aso_controller::{channel, channels};
use std::collections::{BTreeMap, BTreeSet};

use fmu::description::DependencyKind::{self, Constant, Dependent, Discrete, Fixed};

use super::sized::{
    FREE, LIMITED, SAMPLED, Shape, initial_knowns, inputs, sized, states, unknowns, values,
};
use super::*;
use crate::dependencies;

/// Time (`t_on` is 0.5), compensate, monitor, shift of the limits.
type Situation = (f64, bool, bool, f64);

const SITUATIONS: [Situation; 8] = [
    (0.0, true, false, 0.0),
    (0.0, true, true, 0.0),
    (1.0, true, false, 0.0),
    (1.0, false, true, 0.0),
    (1.0, true, false, -20.0),
    (1.0, true, false, 20.0),
    (0.0, true, false, -20.0),
    (0.0, true, false, 20.0),
];

fn in_situation(of: Shape, (_, compensate, monitor, distance): Situation) -> AsoController {
    let mut model = sized(of);
    model.compensate = compensate;
    model.design.monitor = monitor;
    for actuator in &mut model.design.actuators {
        actuator.limits = actuator.limits.map(|[low, high]| [low + distance, high + distance]);
    }
    model
}

fn begin(model: &mut AsoController, time: f64) -> Vec<f64> {
    model.initialize(&Experiment { start_time: time, ..Experiment::default() }).unwrap();
    values(model, &unknowns(model))
}

/// All unknowns, each with the knowns that changed its initial value in some situation.
fn initial_influences(design: Shape) -> BTreeMap<String, BTreeSet<String>> {
    let model = sized(design);
    let names: Vec<_> = unknowns(&model).into_iter().map(|unknown| unknown.name).collect();
    let mut actual: BTreeMap<_, _> =
        names.iter().map(|name| (name.clone(), BTreeSet::new())).collect();
    for situation in SITUATIONS {
        let model = in_situation(design, situation);
        let before = begin(&mut model.clone(), situation.0);
        let mut compare = |known: &str, mut moved: AsoController, time: f64| {
            let after = begin(&mut moved, time);
            for ((name, before), after) in names.iter().zip(&before).zip(after) {
                if before.to_bits() != after.to_bits() {
                    actual.get_mut(name).unwrap().insert(known.to_owned());
                }
            }
        };
        for known in initial_knowns(&model) {
            let mut moved = model.clone();
            *(known.field)(&mut moved) += if known.name == "t_on" { 0.8 } else { 0.03 };
            compare(&known.name, moved, situation.0);
        }
        let mut switched = model.clone();
        switched.compensate = !model.compensate;
        compare("compensate", switched, situation.0);
        let mut switched = model.clone();
        switched.design.monitor = !model.design.monitor;
        compare("monitor", switched, situation.0);
        compare("time", model.clone(), 1.0 - situation.0);
    }
    actual
}

#[test]
fn initial_values_depend_on_what_is_listed_and_on_nothing_else() {
    for of in [&FREE[..], &LIMITED, &SAMPLED].concat() {
        let actual = initial_influences(of);
        let controller = sized(of);
        let design = &controller.design;
        let [_, m, _, q] = of.0;
        let mut listed: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        let mut list = |name: String, on: Vec<String>| {
            listed.insert(name, on.into_iter().collect());
        };
        for j in 0..m {
            list(design.actuators[j].name.clone(), dependencies::of_initial_command(design, j));
        }
        for (k, name) in names::estimates(design).enumerate() {
            if controller.sampler.is_none() {
                list(format!("der({name})"), dependencies::of_initial_slope(design, k));
            }
            list(name, dependencies::of_initial_estimate(design, k));
        }
        for (i, name) in channels("f_hat", controller.deviations.f_hat.len()).enumerate() {
            list(name, dependencies::of_initial_fault(design, i));
        }
        for loss in &controller.losses {
            let name = channel("E_hat", loss.fault, q);
            list(name, dependencies::of_initial_loss(design, loss));
        }
        assert_eq!(actual, listed, "{of:?}");
    }
}

/// For each pair of unknown and known, the change of the unknown divided by that of the known, in every situation.
fn factors(of: Shape) -> BTreeMap<(String, String), Vec<f64>> {
    let mut all: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for situation in SITUATIONS {
        let mut model = in_situation(of, situation);
        begin(&mut model, situation.0);
        model.event(situation.0).unwrap();
        model.update(situation.0).unwrap();
        let unknowns = unknowns(&model);
        let before = values(&model, &unknowns);
        for known in inputs(&model).into_iter().chain(states(&model)) {
            let mut moved = model.clone();
            *(known.field)(&mut moved) += 0.25;
            moved.update(situation.0).unwrap();
            for ((unknown, before), after) in
                unknowns.iter().zip(&before).zip(values(&moved, &unknowns))
            {
                let factor = (after - before) / 0.25;
                all.entry((unknown.name.clone(), known.name.clone())).or_default().push(factor);
            }
        }
    }
    all
}

/// The kind of dependency for these factors; `None` if all are zero.
fn kind(factors: &[f64], limited: bool) -> Option<DependencyKind> {
    let same = factors.iter().all(|factor| (factor - factors[0]).abs() < 1e-12);
    if factors.iter().all(|factor| factor.abs() < 1e-12) {
        None
    } else if same && (factors[0] - 1.0).abs() < 1e-12 {
        Some(Constant)
    } else if same {
        Some(Fixed)
    } else if limited {
        Some(Dependent)
    } else {
        Some(Discrete)
    }
}

/// Whether the unknown depends on its knowns nonlinearly, or through a command with limits.
fn is_bent((sizes, limits, features): Shape, unknown: &str) -> bool {
    match unknown.strip_prefix("actuators") {
        Some(index) => {
            let j: usize = index.parse().unwrap();
            limits.as_bytes()[j - 1] == b'l'
        }
        None if unknown.starts_with("E_hat") => true,
        None => {
            let starts = |state: &&str| unknown.starts_with(state);
            let bent = ["der(x_hat", "der(x_i"].iter().any(starts)
                || features.contains('u') && starts(&"der(y_f");
            limits.contains('l') && sizes[0] > 0 && bent
        }
    }
}

#[test]
fn at_a_point_outputs_and_derivatives_depend_on_what_is_listed_in_the_way_listed() {
    for of in [&FREE[..], &LIMITED].concat() {
        let controller = sized(of);
        let design = &controller.design;
        let mut listed: BTreeMap<(String, String), DependencyKind> = BTreeMap::new();
        let mut list = |unknown: &str, groups: &[(DependencyKind, Vec<String>)]| {
            for (kind, known) in
                groups.iter().flat_map(|(kind, on)| on.iter().map(|on| (*kind, on)))
            {
                let former = listed.insert((unknown.to_owned(), known.clone()), kind);
                assert_eq!(former, None, "{of:?}: {unknown} lists {known} twice");
            }
        };
        for j in 0..of.0[1] {
            list(&design.actuators[j].name, &dependencies::of_command(design, j));
        }
        for (k, state) in names::estimates(design).enumerate() {
            list(&state, &[(Constant, vec![state.clone()])]);
            list(&format!("der({state})"), &dependencies::of_slope(design, k));
        }
        for (i, name) in channels("f_hat", controller.deviations.f_hat.len()).enumerate() {
            list(&name, &dependencies::of_fault(design, i));
        }
        for loss in &controller.losses {
            let name = channel("E_hat", loss.fault, of.0[3]);
            list(&name, &dependencies::of_loss(design, loss));
        }
        let actual: BTreeMap<_, _> = factors(of)
            .into_iter()
            .filter_map(|(pair, factors)| {
                let kind = kind(&factors, is_bent(of, &pair.0))?;
                Some((pair, kind))
            })
            .collect();
        assert_eq!(actual, listed, "{of:?}");
    }
}

#[test]
fn a_sampled_controller_changes_nothing_between_samples() {
    for of in SAMPLED {
        for (pair, factors) in factors(of) {
            assert!(factors.iter().all(|factor| *factor == 0.0), "{of:?}: {pair:?}");
        }
    }
}
