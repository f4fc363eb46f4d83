//! Linearisation of FMUs by each method, compared with derivatives computed by hand.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use fmu_description::package::{Package, Unpacked};
use fmu_import::{Fmu, Interface};
use linearise::{Disagreement, Method};
use linearise::{Linearisation, Linearise, LineariseError, PlantEquations, linearise};
use nalgebra::DMatrix;
use tests::{dist, root, run};

/// The packed FMUs, including those written for this test.
fn packed(name: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = dist().join("linearise");
        let out = folder.display().to_string();
        let mut arguments = vec!["pack", "--out", &out];
        let models =
            ["tests/models/drained-tank", "tests/models/feedthrough", "examples/van-der-pol"];
        let models = models.map(|model| root().join(model).display().to_string());
        arguments.extend(models.iter().map(String::as_str));
        let output = run(&arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        folder
    });
    let packed_here = folder.join(name);
    if packed_here.exists() { packed_here } else { dist().join(name) }
}

/// The FMU with a changed `modelDescription.xml`; the GUID, and therefore the library, stays the
/// same.
fn changed(name: &str, change: impl Fn(&str) -> String) -> Fmu {
    let unpacked = Unpacked::open(&packed(name)).unwrap();
    let xml = fs::read_to_string(unpacked.folder().join("modelDescription.xml")).unwrap();
    let new = change(&xml);
    assert_ne!(new, xml, "the change changes something");
    let mut package = Package::new(new).for_version(unpacked.description.version());
    package.add_folder("binaries", &unpacked.folder().join("binaries")).unwrap();
    let resources = unpacked.resources();
    if resources.exists() {
        package.add_folder("resources", &resources).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    package.write(&path).unwrap();
    Fmu::open_any(&path).unwrap()
}

fn open(name: &str) -> Fmu {
    Fmu::open_any(&packed(name)).unwrap()
}

fn without_derivatives(xml: &str) -> String {
    xml.replace(" providesDirectionalDerivative=\"true\"", "")
        .replace(" providesDirectionalDerivatives=\"true\"", "")
}

/// The FMU without the element of one interface.
fn without(element: &str, xml: &str) -> String {
    let start = xml.find(&format!("  <{element} ")).unwrap();
    let end = start + xml[start..].find("/>\n").unwrap() + 3;
    format!("{}{}", &xml[..start], &xml[end..])
}

fn steps_only(xml: &str) -> String {
    without_derivatives(&without("ModelExchange", xml))
}

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|name| (*name).to_owned()).collect()
}

fn at(list: &[(&str, &str)]) -> Vec<(String, String)> {
    list.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
}

/// Each entry is within `relative` of the largest expected entry of its row.
fn expect_close(linearised: &Linearisation, expected: &DMatrix<f64>, relative: f64) {
    let matrix = linearised.matrices.joined();
    assert_eq!(matrix.shape(), expected.shape());
    for i in 0..expected.nrows() {
        let size = expected.row(i).amax();
        for j in 0..expected.ncols() {
            let difference = (matrix[(i, j)] - expected[(i, j)]).abs();
            assert!(difference <= relative * size, "[{i},{j}]: {matrix}, expected {expected}");
        }
    }
}

/// Each entry is within its own error estimate, with an allowance for rounding.
fn expect_within_errors(linearised: &Linearisation, expected: &DMatrix<f64>) {
    let Method::FiniteDifferences { errors, .. } = &linearised.method else {
        panic!("{}", linearised.method)
    };
    let (values, errors) = (linearised.matrices.joined(), errors.joined());
    for (k, (value, expected)) in values.iter().zip(expected).enumerate() {
        let allowed = errors[k] + 1e-13 * expected.abs();
        assert!((value - expected).abs() <= allowed, "{k}: {values} {expected} {errors}");
    }
}

/// The pendulum without friction, moving so slowly that it does not stick, and its A, B, F by the
/// formulas below equation (20) of the paper, for the states in their order.
fn pendulum(linearised: &str) -> (Linearise, DMatrix<f64>) {
    let request = Linearise {
        inputs: names(&["u"]),
        faults: names(&["f_a"]),
        outputs: names(&["x_p", "theta"]),
        at: at(&[
            ("F_c", "0"),
            ("F_s", "0"),
            ("x_p_0", "0"),
            ("theta_0", "0"),
            ("v_p_0", "1e-12"),
            ("linearised", linearised),
        ]),
        ..Linearise::default()
    };
    let (cart, mass, inertia, length) = (3.2, 0.535, 0.062, 0.365);
    let (damping, joint, gravity) = (6.2, 0.009, 9.807);
    let arm = mass * length;
    let determinant = (cart + mass) * inertia - arm * arm;
    let mut expected = DMatrix::zeros(6, 6);
    expected[(0, 2)] = 1.0;
    expected[(1, 3)] = 1.0;
    expected[(2, 1)] = -arm * arm * gravity / determinant;
    expected[(2, 2)] = -damping * inertia / determinant;
    expected[(2, 3)] = arm * joint / determinant;
    expected[(3, 1)] = (cart + mass) * arm * gravity / determinant;
    expected[(3, 2)] = arm * damping / determinant;
    expected[(3, 3)] = -(cart + mass) * joint / determinant;
    for column in [4, 5] {
        expected[(2, column)] = inertia / determinant;
        expected[(3, column)] = -arm / determinant;
    }
    expected[(4, 0)] = 1.0;
    expected[(5, 1)] = 1.0;
    (request, expected)
}

#[test]
fn directional_derivatives_of_the_upright_pendulum_equal_the_formulas_of_the_paper() {
    for linearised in ["true", "false"] {
        let (request, expected) = pendulum(linearised);
        let actual = linearise(&open("FrictionPendulum.fmu"), &request).unwrap();
        expect_close(&actual, &expected, 1e-12);
        let interface = Interface::ModelExchange;
        let method = Method::DirectionalDerivatives { interface, disagreement: None };
        assert_eq!(actual.method, method);
        assert!(actual.residual < 1e-10, "{}", actual.residual);
        let states: Vec<_> = actual.states.iter().map(|state| state.name.as_str()).collect();
        assert_eq!(states, ["x_p", "theta", "v_p", "omega"]);
        assert_eq!(actual.states[3].unit.as_deref(), Some("rad/s"));

        let fmu = changed("FrictionPendulum.fmu", |xml| without("ModelExchange", xml));
        let actual = linearise(&fmu, &request).unwrap();
        expect_close(&actual, &expected, 1e-12);
        let interface = Interface::CoSimulation;
        let method = Method::DirectionalDerivatives { interface, disagreement: None };
        assert_eq!(actual.method, method);
    }
}

#[test]
fn differences_of_the_upright_pendulum_equal_the_formulas_within_their_error() {
    let fmu =
        changed("FrictionPendulum.fmu", |xml| without_derivatives(&without("CoSimulation", xml)));
    for linearised in ["true", "false"] {
        let (request, expected) = pendulum(linearised);
        let actual = linearise(&fmu, &request).unwrap();
        expect_close(&actual, &expected, 1e-9);
        expect_within_errors(&actual, &expected);
        assert!(actual.relative_error().unwrap() < 1e-8, "{:e}", actual.relative_error().unwrap());
    }
}

#[test]
fn steps_of_the_upright_pendulum_give_the_formulas_within_their_error() {
    let fmu = changed("FrictionPendulum.fmu", steps_only);
    for linearised in ["true", "false"] {
        let (mut request, expected) = pendulum(linearised);
        request.states = names(&["x_p", "theta", "v_p", "omega"]);
        let actual = linearise(&fmu, &request).unwrap();
        expect_close(&actual, &expected, 1e-5);
        expect_within_errors(&actual, &expected);
    }
}

#[test]
fn an_fmu_of_fmi_3_has_the_matrices_of_the_same_model_in_fmi_2_by_each_method() {
    let simulation: fn(&str) -> String = |xml| without("ModelExchange", xml);
    let exchange: fn(&str) -> String = |xml| without("CoSimulation", xml);
    let differences: fn(&str) -> String = |xml| without_derivatives(&without("CoSimulation", xml));
    for change in [simulation, exchange, differences, steps_only] {
        let (mut request, _) = pendulum("false");
        request.states = names(&["x_p", "theta", "v_p", "omega"]);
        let [two, three] = ["FrictionPendulum.fmu", "FrictionPendulum.fmi3.fmu"]
            .map(|name| linearise(&changed(name, change), &request).unwrap());
        let matrices =
            |actual: &Linearisation| format!("{:?} {:?}", actual.matrices, actual.states);
        assert_eq!(matrices(&three), matrices(&two));
        assert_eq!(three.method, two.method);
    }
}

/// The tank at level 4 m, where sqrt(level) = 2, and its derivatives computed by hand.
fn tank() -> (Linearise, DMatrix<f64>) {
    let request = Linearise {
        inputs: names(&["pump", "valve"]),
        faults: names(&["leak"]),
        outputs: names(&["level", "drained"]),
        ..Linearise::default()
    };
    let rows = [
        [-0.0625, 0.5, 0.0, -1.0, -1.0],
        [0.0, -2.0, 2.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [0.125, 0.0, 0.0, 2.0, 0.0],
    ];
    (request, DMatrix::from_row_slice(4, 5, rows.as_flattened()))
}

#[test]
fn a_fault_at_the_limit_of_its_range_is_perturbed_to_one_side_only() {
    let (mut request, expected) = tank();
    let actual = linearise(&open("DrainedTank.fmu"), &request).unwrap();
    expect_close(&actual, &expected, 1e-15);
    assert!(actual.residual < 1e-15);
    let values: Vec<f64> = actual.outputs.iter().map(|output| output.value).collect();
    assert_eq!((values, actual.faults[0].name.as_str()), (vec![4.0, 1.0], "leak"));

    let actual = linearise(&changed("DrainedTank.fmu", without_derivatives), &request).unwrap();
    expect_close(&actual, &expected, 1e-9);
    expect_within_errors(&actual, &expected);

    // Below 0.05 s the steps of the tank's integration follow the communication step.
    (request.states, request.step) = (names(&["level", "flow"]), Some(0.0125));
    let actual = linearise(&changed("DrainedTank.fmu", steps_only), &request).unwrap();
    expect_close(&actual, &expected, 1e-5);
    expect_within_errors(&actual, &expected);
}

/// The leak is at its min, 0, below which the FMU refuses values; then the valve is at its max, 1, where
/// level' = (1 - sqrt(level)) / 2.
#[test]
fn equations_at_the_limit_of_an_input_have_the_derivatives_by_hand() {
    let (request, mut expected) = tank();
    let fmu = changed("DrainedTank.fmu", without_derivatives);
    let mut equations = PlantEquations::new(&fmu, &request).unwrap();
    let mut jacobian = DMatrix::zeros(4, 5);
    for (valve, by_level) in [(0.5, [-0.0625, 0.125]), (1.0, [-0.125, 0.25])] {
        let (mut x, u) = ([4.0, 1.0], [1.0, valve, 0.0]);
        equations.begin(0.0, &mut x, &u).unwrap();
        equations.jacobian(0.0, &x, &u, &mut jacobian).unwrap();
        [expected[(0, 0)], expected[(3, 0)]] = by_level;
        assert!((&jacobian - &expected).amax() < 1e-8, "{jacobian}");
    }
}

#[test]
fn steps_away_from_an_equilibrium_are_within_their_error_and_the_drift_is_reported() {
    let (mut request, mut expected) = tank();
    request.states = names(&["level", "flow"]);
    request.at = at(&[("level", "1"), ("flow", "1.5"), ("pump", "1.25")]);
    request.step = Some(0.005);
    expected[(0, 0)] = -0.125;
    (expected[(0, 3)], expected[(0, 4)]) = (-0.5, -0.5);
    (expected[(3, 0)], expected[(3, 3)]) = (0.25, 1.0);
    let actual = linearise(&changed("DrainedTank.fmu", steps_only), &request).unwrap();
    expect_close(&actual, &expected, 1e-4);
    expect_within_errors(&actual, &expected);
    assert!((actual.rates[0] - 0.5).abs() < 1e-3, "{:?}", actual.rates);
    assert!((actual.rates[1] + 0.5).abs() < 1e-3, "{:?}", actual.rates);
    assert!(actual.residual > 0.1);
}

/// The first record of one input has fewer rows than the coefficients of degree 2 in time of two states.
#[test]
fn steps_of_one_input_away_from_an_equilibrium_have_the_derivatives_by_hand() {
    let (mut request, _) = tank();
    (request.inputs, request.faults) = (names(&["pump"]), Vec::new());
    request.states = names(&["level", "flow"]);
    request.at = at(&[("level", "1"), ("flow", "1.5"), ("pump", "1.25")]);
    request.step = Some(0.005);
    let rows = [[-0.125, 0.5, 0.0], [0.0, -2.0, 2.0], [1.0, 0.0, 0.0], [0.25, 0.0, 0.0]];
    let expected = DMatrix::from_row_slice(4, 3, rows.as_flattened());
    let actual = linearise(&changed("DrainedTank.fmu", steps_only), &request).unwrap();
    expect_close(&actual, &expected, 2e-3);
    assert!(actual.residual > 0.1);
}

#[test]
fn steps_of_a_falling_pendulum_are_not_accurate_enough_and_refused() {
    let (mut request, _) = pendulum("false");
    request.at.retain(|(name, _)| name != "theta_0");
    request.at.extend(at(&[("theta_0", "0.3"), ("omega_0", "0.5"), ("u", "3")]));
    request.states = names(&["x_p", "theta", "v_p", "omega"]);
    let refusal = linearise(&changed("FrictionPendulum.fmu", steps_only), &request).unwrap_err();
    assert!(refusal.to_string().contains("a point nearer to an equilibrium"), "{refusal}");
}

#[test]
fn wrong_directional_derivatives_are_detected_by_differences() {
    let (mut request, _) = tank();
    request.at = at(&[("lie", "0.25")]);
    let actual = linearise(&open("DrainedTank.fmu"), &request).unwrap();
    let Method::DirectionalDerivatives { disagreement: Some(worst), .. } = &actual.method else {
        panic!("{}", actual.method)
    };
    let Disagreement { of, to, derivative, difference, relative } = worst;
    assert_eq!((of.as_str(), to.as_str()), ("der(level)", "level"));
    assert!((derivative - 0.1875).abs() < 1e-15 && (difference + 0.0625).abs() < 1e-9);
    assert!((relative - 1.0).abs() < 1e-3, "{relative}");
    assert!(actual.method.to_string().contains("contradict"));
}

#[test]
fn derivatives_of_the_van_der_pol_oscillator_equal_those_by_hand() {
    let request = Linearise {
        outputs: names(&["x0"]),
        at: at(&[("x0", "1.5"), ("x1", "-0.7"), ("mu", "2")]),
        ..Linearise::default()
    };
    let expected = DMatrix::from_row_slice(3, 2, &[0.0, 1.0, 3.2, -2.5, 1.0, 0.0]);
    let fmu = changed("VanDerPol.fmu", without_derivatives);
    for (fmu, relative) in [(open("VanDerPol.fmu"), 1e-15), (fmu, 1e-9)] {
        let actual = linearise(&fmu, &request).unwrap();
        expect_close(&actual, &expected, relative);
        for (rate, expected) in actual.rates.iter().zip([-0.7, 0.25]) {
            assert!((rate - expected).abs() < 1e-15);
        }
        assert_eq!(actual.states[0].value.to_bits(), 1.5_f64.to_bits());
    }
}

/// der(x) = -2 (x - u), y = x.
#[test]
fn outputs_that_are_stale_after_the_derivatives_have_their_own_derivatives() {
    let folder = tempfile::tempdir().unwrap();
    let fmu =
        Fmu::open_any(&tests::equations::write_with(folder.path(), &["-DSTALE_OUTPUTS"])).unwrap();
    let request = Linearise {
        inputs: names(&["u"]),
        outputs: names(&["x", "h"]),
        at: at(&[("k", "2")]),
        ..Linearise::default()
    };
    let actual = linearise(&fmu, &request).unwrap().matrices;
    let expected = DMatrix::from_row_slice(2, 4, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    assert!((actual.c - expected).amax() < 1e-9);
    assert!((actual.a[(0, 0)] + 2.0).abs() < 1e-9 && (actual.b[(0, 0)] - 2.0).abs() < 1e-9);
}

#[test]
fn states_have_the_order_of_the_request_and_one_that_nothing_depends_on_may_be_left_out() {
    let (mut request, expected) = pendulum("true");
    request.outputs = names(&["theta"]);
    request.states = names(&["omega", "theta", "v_p"]);
    let fmu = open("FrictionPendulum.fmu");
    let actual = linearise(&fmu, &request).unwrap();
    let order = [3, 1, 2];
    let a = DMatrix::from_fn(3, 3, |i, j| expected[(order[i], order[j])]);
    assert!((actual.matrices.a - a).amax() < 1e-12);
    request.states = names(&["theta", "omega"]);
    let message = linearise(&fmu, &request).unwrap_err().to_string();
    assert_eq!(message, "the state v_p may not be left out: der(omega) depends on it");
}

fn refusal(fmu: &Fmu, change: impl Fn(&mut Linearise)) -> LineariseError {
    let (mut request, _) = tank();
    change(&mut request);
    linearise(fmu, &request).unwrap_err()
}

fn expect_refusal(fmu: &Fmu, parts: &[&str], change: impl Fn(&mut Linearise)) {
    let message = refusal(fmu, change).to_string();
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

#[test]
fn names_and_values_that_do_not_fit_are_refused_with_a_reason() {
    let fmu = open("DrainedTank.fmu");
    expect_refusal(&fmu, &["no variable \"levle\"", "it has level"], |request| {
        request.outputs = names(&["levle"]);
    });
    expect_refusal(&fmu, &["level", "causality output", "expected an input"], |request| {
        request.inputs = names(&["level"]);
    });
    expect_refusal(&fmu, &["pump", "causality input", "expected an output"], |request| {
        request.outputs = names(&["pump"]);
    });
    expect_refusal(&fmu, &["pump is named twice among the inputs and faults"], |request| {
        request.faults = names(&["pump"]);
    });
    expect_refusal(&fmu, &["area = \"wide\": expected a number"], |request| {
        request.at = at(&[("area", "wide")]);
    });
    expect_refusal(&fmu, &["area = \"inf\": expected a finite number"], |request| {
        request.at = at(&[("area", "inf")]);
    });
    expect_refusal(&fmu, &["valve = 2", "fmi2Discard", "expected 0 to 1"], |request| {
        request.at = at(&[("valve", "2")]);
    });
    expect_refusal(&fmu, &["drained", "cannot be set"], |request| {
        request.at = at(&[("drained", "2")]);
    });
    expect_refusal(&fmu, &["drained is no continuous state", "level, flow"], |request| {
        request.states = names(&["drained"]);
    });
    expect_refusal(&fmu, &["typical size of pump is -1"], |request| {
        request.typical = vec![("pump".to_owned(), -1.0)];
    });
    let pendulum = open("FrictionPendulum.fmu");
    expect_refusal(&pendulum, &["regime", "type Integer", "expected a Real"], |request| {
        (request.inputs, request.faults) = (vec![], vec![]);
        request.outputs = names(&["regime"]);
    });
    expect_refusal(&pendulum, &["v_p cannot be held at -0.2", "event", "makes it 0"], |request| {
        (request.inputs, request.faults) = (names(&["u"]), vec![]);
        request.outputs = names(&["x_p"]);
        request.at = at(&[("v_p_0", "0.2"), ("v_p", "-0.2")]);
    });
}

/// With pump = 1e308, (pump - flow) / lag is infinite, while all states, inputs and outputs are finite.
#[test]
fn a_derivative_that_is_not_finite_is_named_in_both_interfaces() {
    let simulation = changed("DrainedTank.fmu", |xml| without("ModelExchange", xml));
    for fmu in [open("DrainedTank.fmu"), simulation] {
        expect_refusal(&fmu, &["der(flow) is inf, expected a finite number"], |request| {
            request.at = at(&[("pump", "1e308"), ("lag", "0.001")]);
        });
    }
}

#[test]
fn without_a_step_of_its_own_an_fmu_is_linearised_by_steps_of_several_sizes() {
    let fmu = changed("DrainedTank.fmu", |xml| {
        steps_only(xml).replace("  <DefaultExperiment stepSize=\"0.05\"/>\n", "")
    });
    let (mut request, expected) = tank();
    request.states = names(&["level", "flow"]);
    expect_close(&linearise(&fmu, &request).unwrap(), &expected, 1e-7);
}

#[test]
fn each_capability_missing_for_linearisation_by_steps_is_named() {
    let fmu = changed("DrainedTank.fmu", steps_only);
    let states = |list: &[&str]| {
        let list = names(list);
        move |request: &mut Linearise| request.states.clone_from(&list)
    };
    expect_refusal(&fmu, &["name the variables", "among level, drained, flow"], states(&[]));
    expect_refusal(
        &fmu,
        &["do not determine how the FMU continues", "name all states"],
        states(&["level"]),
    );
    let unmoved = refusal(&fmu, |request| {
        request.states = names(&["level", "flow"]);
        request.inputs = names(&["valve"]);
    });
    let LineariseError::Unreachable { rank: 3, expected: 4, names: weak } = &unmoved else {
        panic!("{unmoved}")
    };
    assert_eq!(*weak, ["flow"]);
    let nothing = changed("DrainedTank.fmu", |xml| {
        steps_only(xml).replace(" canGetAndSetFMUstate=\"true\"", "")
    });
    let parts = ["none of the three ways", "providesDirectionalDerivative", "canGetAndSetFMUstate"];
    expect_refusal(&nothing, &parts, states(&["level", "flow"]));
}
