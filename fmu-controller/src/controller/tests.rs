//! The controller against its own equations, integrated here by small Runge-Kutta steps.

use std::path::PathBuf;

use super::*;

mod dependencies;
mod derivatives;
mod detection;
mod exchange;
mod extended;
mod oracle;
mod refusals;
mod sampled;
mod sized;
mod transfer;
mod validity;

/// The folder with the shipped design.
fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("resources")
}

/// A slow design of two states, one actuator, one measurement and one fault, with `limits`.
fn small(limits: &str) -> String {
    format!(
        "description = \"a mass\"\nt_on = 0.35\nA = [[0.0, 1.0], [0.0, -0.2]]\nB = [[0.0], [2.0]]\n\
         C = [[1.0, 0.0]]\nF_a = [[0.0], [-2.0]]\nK_x = [[-3.0, -2.0]]\nK_f = [[1.0]]\n\
         L_x = [[9.0], [24.0]]\nL_f = [[-12.0]]\n[experiment]\nstop_time = 10.0\nstep_size = 0.01\n\
         [[states]]\nname = \"x\"\n[[states]]\nname = \"v\"\n[[actuators]]\nname = \"u\"\n{limits}\n\
         [[measurements]]\nname = \"x\"\n[[faults]]\nname = \"f\"\n"
    )
}

fn with_design(text: &str) -> Result<AsoController, Failure> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("design.toml"), text).unwrap();
    AsoController::new(folder.path())
}

fn ready(mut controller: AsoController) -> AsoController {
    controller.initialize(&Experiment::default()).unwrap();
    controller
}

/// A step with the inputs `y`: the measurements, and after them the references, if any.
fn step(controller: &mut AsoController, start: f64, size: f64, y: &[f64], slope: &[f64]) {
    let values = &mut controller.values;
    let (y, r) = y.split_at(values.y.len());
    let (y_slopes, r_slopes) = slope.split_at(values.y.len());
    values.y.copy_from_slice(y);
    values.y_slopes.copy_from_slice(y_slopes);
    if !r.is_empty() {
        values.r.copy_from_slice(r);
        values.r_slopes.copy_from_slice(r_slopes);
    }
    controller.step(&Step { start, size }).unwrap();
}

/// Right-hand side for the small design at time t and y(t), by the equations in the comment of `equations.rs`.
fn small_rates(z: [f64; 3], t: f64, y: f64, limits: [f64; 2]) -> [f64; 3] {
    let on = t >= 0.35;
    let u = (-3.0 * z[0] - 2.0 * z[1] + if on { z[2] } else { 0.0 }).clamp(limits[0], limits[1]);
    let innovation = y - z[0];
    [
        z[1] + 9.0 * innovation,
        -0.2 * z[1] + 2.0 * u - 2.0 * z[2] + 24.0 * innovation,
        if on { -12.0 * innovation } else { 0.0 },
    ]
}

/// Classic Runge-Kutta steps of 10 us from zero with y(t) = 0.4 + 0.5 t.
fn small_reference(end: f64, limits: [f64; 2]) -> [f64; 3] {
    let y = |t: f64| 0.4 + 0.5 * t;
    let h = 1e-5;
    let mut z = [0.0; 3];
    let mut t = 0.0;
    while t < end - 0.5 * h {
        let along = |k: [f64; 3], f: f64| std::array::from_fn(|i| z[i] + f * h * k[i]);
        let k1 = small_rates(z, t, y(t), limits);
        let k2 = small_rates(along(k1, 0.5), t + 0.5 * h, y(t + 0.5 * h), limits);
        let k3 = small_rates(along(k2, 0.5), t + 0.5 * h, y(t + 0.5 * h), limits);
        let k4 = small_rates(along(k3, 1.0), t + h, y(t + h), limits);
        z = std::array::from_fn(|i| z[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        t += h;
    }
    z
}

/// Follows the small design to 1 s in steps of `size`, y given with its slope.
fn follow_small(limits: &str, size: f64) -> AsoController {
    let mut controller = ready(with_design(&small(limits)).unwrap());
    let mut start = 0.0;
    while start < 1.0 - 1e-9 {
        step(&mut controller, start, size, &[0.4 + 0.5 * start], &[0.5]);
        start += size;
    }
    controller
}

#[test]
fn any_step_follows_the_equations_with_the_activation_inside_a_step() {
    let reference = small_reference(1.0, [f64::NEG_INFINITY, f64::INFINITY]);
    for size in [1.0, 0.25, 0.1, 0.001] {
        let controller = follow_small("", size);
        for (estimate, exact) in controller.values.z.iter().zip(reference) {
            assert!((estimate - exact).abs() < 1e-5, "{size}: {estimate} {exact}");
        }
    }
}

#[test]
fn a_saturated_command_is_the_one_that_the_observer_uses() {
    let reference = small_reference(1.0, [-1.5, 0.3]);
    for size in [0.5, 0.1, 0.001] {
        let controller = follow_small("limits = [-1.5, 0.3]", size);
        for (estimate, exact) in controller.values.z.iter().zip(reference) {
            assert!((estimate - exact).abs() < 2e-5, "{size}: {estimate} {exact}");
        }
        assert!((-1.5..=0.3).contains(&controller.values.u[0]));
    }
    let free = small_reference(1.0, [f64::NEG_INFINITY, f64::INFINITY]);
    assert!((free[1] - reference[1]).abs() > 1e-2, "the limits are reached in this test");
}

#[test]
fn limits_in_the_wrong_order_stop_the_next_step_and_no_reading_before() {
    let mut controller = ready(with_design(&small("limits = [-1.5, 0.3]")).unwrap());
    controller.design.actuators[0].limits = Some([0.9, 0.8]);
    controller.update(0.0).unwrap();
    let message = controller.check().unwrap_err().to_string();
    assert!(message.contains("u_min = 0.9") && message.contains("u_max = 0.8"), "{message}");
    controller.design.actuators[0].limits = Some([0.1, 0.8]);
    controller.check().unwrap();
    controller.update(0.0).unwrap();
    assert!((controller.values.u[0] - 0.1).abs() < 1e-15);
}

#[test]
fn the_slopes_of_the_outputs_are_the_limits_of_their_differences() {
    let mut controller = ready(AsoController::new(&shipped()).unwrap());
    step(&mut controller, 41.0, 1e-3, &[1e-3, -2e-3], &[0.1, 0.2]);
    let (u, f_hat) = (controller.values.u[0], controller.values.z[4]);
    let slopes = controller.with_slopes();
    let (u_slope, f_slope) = (slopes.u_slopes[0], slopes.z_slopes[4]);
    let h = 1e-9;
    step(&mut controller, 41.001, h, &[1e-3 + 1e-4, -2e-3 + 2e-4], &[0.1, 0.2]);
    assert!(((controller.values.u[0] - u) / h / u_slope - 1.0).abs() < 1e-4);
    assert!(((controller.values.z[4] - f_hat) / h / f_slope - 1.0).abs() < 1e-4);
}

#[test]
fn the_estimate_is_held_before_the_activation_unless_it_is_monitored() {
    for monitor in [false, true] {
        let mut controller = AsoController::new(&shipped()).unwrap();
        controller.design.monitor = monitor;
        let mut controller = ready(controller);
        step(&mut controller, 0.0, 1e-3, &[0.1, 0.0], &[0.0, 0.0]);
        assert_eq!(controller.values.z[4] != 0.0, monitor);
    }
}

/// Without `relativeQuantity` an importer shows a fault of 5 degC as 278.15 K.
#[test]
fn the_fault_of_a_temperature_is_a_difference_and_its_state_a_value() {
    for unit in ["degC", "K"] {
        let mut text = small("");
        for name in ["x", "f"] {
            let entry = format!("s]]\nname = \"{name}\"\n");
            text = text.replacen(&entry, &format!("{entry}unit = \"{unit}\"\n"), 1);
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("design.toml"), text).unwrap();
        let description = fmu::describe::<AsoController>(folder.path()).unwrap();
        let is_relative = |name: &str| {
            let variable = description.variables.iter().find(|variable| variable.name == name);
            let kind = &variable.unwrap().kind;
            assert_eq!(kind.as_real().unwrap().unit.as_deref(), Some(unit), "{name}");
            kind.as_real().unwrap().is_relative()
        };
        let names = ["x_hat[1]", "x_hat_0[1]", "f_hat", "f_hat_0"];
        assert_eq!(names.map(is_relative), [false, false, true, true]);
    }
}

#[test]
fn a_copy_through_bytes_continues_with_the_same_bits() {
    let mut controller = ready(AsoController::new(&shipped()).unwrap());
    step(&mut controller, 39.9995, 1e-3, &[0.1, -0.1], &[1.0, 2.0]);
    let bytes = postcard::to_stdvec(&controller).unwrap();
    let mut copy: AsoController = postcard::from_bytes(&bytes).unwrap();
    for controller in [&mut controller, &mut copy] {
        step(controller, 40.0005, 1e-3, &[0.1, -0.1], &[1.0, 2.0]);
    }
    let bits =
        |model: &AsoController| model.values.z.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&controller), bits(&copy));
}

#[test]
fn steps_of_a_known_size_allocate_nothing() {
    let mut controller = ready(AsoController::new(&shipped()).unwrap());
    step(&mut controller, 50.0, 1e-3, &[0.0, 0.0], &[0.0, 0.0]);
    let allocations = allocation_counter::measure(|| {
        for k in 1..100_u32 {
            step(&mut controller, 50.0 + f64::from(k) * 1e-3, 1e-3, &[1e-3, 0.0], &[0.1, 0.0]);
        }
    });
    assert_eq!(allocations.count_total, 0);
}
