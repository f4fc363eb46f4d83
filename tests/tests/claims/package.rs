//! The packed FMUs and the committed files that describe them.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use fmu_description::package::Unpacked;
use fmu_description::{Causality, ModelDescription};
use tests::{dist, root, run};

const MODELS: [&str; 2] = ["FrictionPendulum", "AsoController"];

fn unpacked(model: &str) -> Unpacked {
    Unpacked::open_whole(&dist().join(format!("{model}.fmu"))).unwrap()
}

#[test]
fn the_committed_model_descriptions_are_those_of_the_libraries() {
    for model in MODELS {
        let packed =
            fs::read_to_string(unpacked(model).folder().join("modelDescription.xml")).unwrap();
        let committed =
            fs::read_to_string(root().join(format!("modelDescription/{model}.xml"))).unwrap();
        assert_eq!(packed, committed, "run: aso-ftc pack --update-descriptions");
    }
}

#[test]
fn the_model_descriptions_break_no_rule_of_the_standard() {
    for model in MODELS {
        assert_eq!(unpacked(model).description.problems(), [], "{model}");
    }
}

#[test]
fn every_variable_is_described_and_every_signal_of_the_plant_has_a_unit() {
    for model in MODELS {
        for variable in &unpacked(model).description.variables {
            assert!(variable.description.as_ref().is_some_and(|text| !text.is_empty()));
        }
    }
    let plant = unpacked("FrictionPendulum").description;
    for variable in &plant.variables {
        if let fmu_description::Kind::Real(real) = &variable.kind {
            assert!(real.unit.is_some(), "{}", variable.name);
        }
    }
}

/// Names of the variables of `causality`, in their order.
fn names(description: &ModelDescription, causality: Causality) -> Vec<&str> {
    let all = description.variables.iter();
    all.filter(|variable| variable.causality == causality)
        .map(|variable| variable.name.as_str())
        .collect()
}

#[test]
fn the_variables_are_those_of_the_documents() {
    let plant = unpacked("FrictionPendulum").description;
    assert_eq!(names(&plant, Causality::Input), ["u", "f_a"]);
    assert_eq!(names(&plant, Causality::Output), ["x_p", "theta", "v_p", "omega", "f_fric"]);
    let local = ["regime", "der(x_p)", "der(theta)", "der(v_p)", "der(omega)"];
    assert_eq!(names(&plant, Causality::Local), local);
    let controller = unpacked("AsoController").description;
    assert_eq!(names(&controller, Causality::Input), ["x_p", "theta", "compensate"]);
    let outputs = ["u", "f_hat", "x_hat[1]", "x_hat[2]", "x_hat[3]", "x_hat[4]"];
    assert_eq!(names(&controller, Causality::Output), outputs);
    let states = ["x_hat[1]", "x_hat[2]", "x_hat[3]", "x_hat[4]", "f_hat"];
    assert_eq!(names(&controller, Causality::Local), states.map(|name| format!("der({name})")));
    for (name, description) in [("plant", &plant), ("controller", &controller)] {
        let page = fs::read_to_string(root().join("docs/reference/fmus.md")).unwrap();
        for causality in [Causality::Input, Causality::Output] {
            for variable in names(description, causality) {
                let family = variable.split('[').next().unwrap_or(variable);
                assert!(
                    page.contains(&format!("`{family}")),
                    "docs/reference/fmus.md: {name}.{variable}"
                );
            }
        }
    }
}

#[test]
fn no_output_of_the_controller_depends_on_an_input_within_a_step() {
    let controller = unpacked("AsoController").description;
    assert_eq!(controller.structure.outputs.len(), 6);
    for unknown in &controller.structure.outputs {
        for known in unknown.dependencies.iter().flatten() {
            let known = &controller.variables[*known as usize - 1];
            assert_ne!(known.causality, Causality::Input, "{}", known.name);
        }
        assert!(unknown.dependencies.is_some());
    }
}

#[test]
fn packing_twice_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(&["pack", "--out", &folder.path().display().to_string()]);
    assert!(output.status.success());
    for model in MODELS {
        let file = format!("{model}.fmu");
        let (first, second) = (fs::read(dist().join(&file)), fs::read(folder.path().join(&file)));
        assert!(first.unwrap() == second.unwrap(), "{file}");
    }
}

#[test]
fn an_fmu_holds_library_resources_documentation_licences_and_picture() {
    for (model, resource) in [("FrictionPendulum", None), ("AsoController", Some("design.toml"))] {
        let fmu = unpacked(model);
        let folder = fmu.folder();
        assert!(fmu.library(model).unwrap().is_file());
        let page = fs::read_to_string(folder.join("documentation/index.html")).unwrap();
        for part in ["f_fric", "MIT", "Patton"] {
            assert!(page.contains(part) || model == "AsoController", "{model}: {part}");
        }
        let license =
            fs::read_to_string(folder.join("documentation/licenses/license.txt")).unwrap();
        assert!(license.contains("MIT License") && license.contains("Apache License"));
        assert!(fs::read(folder.join("model.png")).unwrap().starts_with(b"\x89PNG"));
        if let Some(resource) = resource {
            assert!(fmu.resources().join(resource).is_file());
        }
    }
}

#[test]
fn an_fmu_contains_the_licences_of_exactly_the_linked_crates() {
    for (member, model) in [("fmu-plant", "FrictionPendulum"), ("fmu-controller", "AsoController")]
    {
        let tree = ["tree", "--locked", "--package", member, "--edges", "normal,no-proc-macro"];
        let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .current_dir(root())
            .args(tree)
            .args(["--prefix", "none", "--format", "{p}"])
            .output()
            .unwrap();
        let named = |line: &str| {
            let mut words = line.split([' ', ':']);
            let name = words.next().unwrap_or_default().to_owned();
            let version = words.next().unwrap_or_default().trim_start_matches('v').to_owned();
            (name, version)
        };
        let linked = String::from_utf8(output.stdout).unwrap();
        let linked: BTreeSet<_> =
            linked.lines().map(named).filter(|(name, _)| name != member).collect();
        let fmu = unpacked(model);
        let licenses = fmu.folder().join("documentation/licenses");
        let entry = fs::read_to_string(licenses.join("license.txt")).unwrap();
        let (_, list) = entry.split_once("The library contains the packages below.").unwrap();
        let (_, list) = list.split_once("\n\n").unwrap();
        let listed: Vec<_> = list.lines().map(named).collect();
        let (standard_library, packages) = listed.split_last().unwrap();
        assert_eq!(standard_library.0, "rust");
        assert!(packages.is_sorted());
        assert_eq!(packages.iter().cloned().collect::<BTreeSet<_>>(), linked, "{model}");
        for (name, version) in packages {
            let texts = fs::read_dir(licenses.join(format!("{name}-{version}")));
            assert!(texts.is_ok_and(|mut texts| texts.next().is_some()), "{model}: {name}");
        }
    }
}

#[test]
fn the_libraries_are_stripped() {
    for model in MODELS {
        let library = fs::read(unpacked(model).library(model).unwrap()).unwrap();
        assert!(!library.windows(7).any(|bytes| bytes == b".symtab"), "{model} has symbols");
    }
}

#[test]
fn the_libraries_contain_no_path_of_the_building_machine() {
    let home = std::env::var("HOME").unwrap_or_default();
    for model in MODELS {
        let library = fs::read(unpacked(model).library(model).unwrap()).unwrap();
        for path in [root().display().to_string(), format!("{home}/.cargo")] {
            let actual = library.windows(path.len()).any(|bytes| bytes == path.as_bytes());
            assert!(!actual, "{model} contains {path}");
        }
    }
}
