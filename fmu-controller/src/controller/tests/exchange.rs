//! Model exchange: the test is the importer that integrates.

use super::*;

const FREE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// The small design in model exchange, after the first event.
fn exchanged(limits: &str) -> (AsoController, Event) {
    let mut controller = ready(with_design(&small(limits)).unwrap());
    let event = controller.event(0.0).unwrap();
    (controller, event)
}

fn indicators(controller: &AsoController) -> Vec<f64> {
    let mut values = vec![f64::NAN; controller.model_exchange().unwrap().event_indicators];
    controller.event_indicators(0.0, &mut values);
    values
}

/// The derivatives at t and z with y(t) = 0.4 + 0.5 t.
fn rates(controller: &mut AsoController, t: f64, z: [f64; 3]) -> [f64; 3] {
    controller.values.y[0] = 0.4 + 0.5 * t;
    controller.values.z.copy_from_slice(&z);
    controller.update(t).unwrap();
    let slopes = &controller.with_slopes().z_slopes;
    std::array::from_fn(|i| slopes[i])
}

/// Integrates to 1 s by classic Runge-Kutta steps of 50 us, with events at t_on and after each
/// step that changed the sign of an indicator. Returns z and the number of such steps.
fn integrate(limits: &str) -> ([f64; 3], usize) {
    let (mut controller, event) = exchanged(limits);
    assert_eq!(event.next_event_time, Some(0.35));
    let (h, mut z, mut crossings) = (5e-5, [0.0; 3], 0);
    let mut before = indicators(&controller);
    for k in 0..20_000_u32 {
        let t = f64::from(k) * h;
        if k == 7_000 {
            assert_eq!(controller.event(0.35).unwrap(), Event::default());
            before = indicators(&controller);
        }
        let along = |k: [f64; 3], f: f64| std::array::from_fn(|i| z[i] + f * h * k[i]);
        let k1 = rates(&mut controller, t, z);
        let k2 = rates(&mut controller, t + 0.5 * h, along(k1, 0.5));
        let k3 = rates(&mut controller, t + 0.5 * h, along(k2, 0.5));
        let k4 = rates(&mut controller, t + h, along(k3, 1.0));
        z = std::array::from_fn(|i| z[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        rates(&mut controller, t + h, z);
        let after = indicators(&controller);
        if before.iter().zip(&after).any(|(before, after)| (*before > 0.0) != (*after > 0.0)) {
            controller.event(t + h).unwrap();
            crossings += 1;
        }
        before = indicators(&controller);
        assert!(before.iter().all(|value| *value != 0.0));
    }
    (z, crossings)
}

#[test]
fn integrated_from_outside_it_ends_where_the_equations_end() {
    for (text, limits) in [("", FREE), ("limits = [-1.5, 0.3]", [-1.5, 0.3])] {
        let (z, crossings) = integrate(text);
        for (estimate, exact) in z.iter().zip(small_reference(1.0, limits)) {
            assert!((estimate - exact).abs() < 1e-5, "{text}: {estimate} {exact}");
        }
        assert_eq!(crossings > 0, limits != FREE, "{crossings}");
        assert!(crossings < 10, "{crossings}");
    }
}

#[test]
fn a_limit_is_reached_and_left_at_events_only_and_each_shows_in_one_indicator() {
    let (mut controller, _) = exchanged("limits = [-1.5, 0.3]");
    let mut at = |command: f64| {
        rates(&mut controller, 0.0, [-command / 3.0, 0.0, 0.0]);
        let u = controller.values.u[0];
        let signs: Vec<bool> = indicators(&controller).iter().map(|value| *value > 0.0).collect();
        controller.event(0.0).unwrap();
        controller.update(0.0).unwrap();
        let restarted: Vec<bool> =
            indicators(&controller).iter().map(|value| *value > 0.0).collect();
        (u, signs, controller.values.u[0], restarted)
    };
    let (inside, above, below) = (vec![true, true], vec![true, false], vec![false, true]);
    let close = |u: f64, required: f64| assert!((u - required).abs() < 1e-12, "{u} {required}");
    for (command, signs, before, after) in [
        (0.2, &inside, 0.2, 0.2),
        (0.7, &above, 0.7, 0.3),
        (0.9, &above, 0.3, 0.3),
        (-0.1, &inside, 0.3, -0.1),
        (-1.6, &below, -1.6, -1.5),
        (0.4, &above, -1.5, 0.3),
    ] {
        let (u, actual, u_after, restarted) = at(command);
        close(u, before);
        close(u_after, after);
        assert_eq!((&actual, &restarted), (signs, signs), "{command}");
    }
}

#[test]
fn a_command_on_its_limit_is_an_event_once() {
    for command in [0.3, 0.3 - 1e-12, 0.3 + 1e-12, 0.3 + 1.8e-9 * 1.1, 0.3 - 1.8e-9 * 1.1] {
        let (mut controller, _) = exchanged("limits = [-1.5, 0.3]");
        rates(&mut controller, 0.0, [-command / 3.0, 0.0, 0.0]);
        let mut events = 0;
        let mut before = [true, true];
        loop {
            let now = indicators(&controller);
            assert!(now.iter().all(|value| *value != 0.0));
            let now = [now[0] > 0.0, now[1] > 0.0];
            if now == before {
                break;
            }
            before = now;
            controller.event(0.0).unwrap();
            events += 1;
        }
        assert_eq!(events, usize::from(command > 0.3 + 1.8e-9), "{command}");
    }
}

#[test]
fn indicators_are_scaled_by_the_range_and_come_with_limits_only() {
    let (mut controller, _) = exchanged("limits = [-1.5, 0.3]");
    rates(&mut controller, 0.0, [-0.2, 0.0, 0.0]);
    let required = [(0.6 + 1.5) / 1.8, (0.3 - 0.6) / 1.8];
    for (actual, required) in indicators(&controller).iter().zip(required) {
        assert!((actual - required).abs() < 1e-8, "{actual} {required}");
    }
    let (controller, _) = exchanged("");
    assert_eq!(controller.model_exchange(), Some(ModelExchange { event_indicators: 0 }));
}

#[test]
fn the_activation_is_a_time_event_while_it_is_to_come_and_wanted() {
    let (mut controller, event) = exchanged("");
    assert_eq!(event.next_event_time, Some(0.35));
    controller.compensate = false;
    assert_eq!(controller.event(0.1).unwrap().next_event_time, None);
    controller.compensate = true;
    assert_eq!(controller.event(0.2).unwrap().next_event_time, Some(0.35));
    assert!(!controller.mode.compensating);
    assert_eq!(controller.event(0.35).unwrap().next_event_time, None);
    assert!(controller.mode.compensating);
    controller.compensate = false;
    controller.update(0.4).unwrap();
    assert!(controller.mode.compensating, "it takes effect at the event");
    controller.event(0.4).unwrap();
    assert!(!controller.mode.compensating);
}

/// At 1e7 s neighbouring numbers differ by 1.9e-9 s: the announced time is 3.7e-10 s too early.
#[test]
fn a_loss_decides_at_the_announced_time_late_in_a_run_too() {
    let fault = "[[faults]]\nname = \"f\"\n";
    let case = "loss_of = \"u\"\nleast_command = 1.0\n[[reconfigurations]]\ngone = \"u\"\nstuck_at = 0.0\n\
                K_x = [[0.0, 0.0]]\nK_f = [[0.0]]\nK_s = [0.0]\nloss = 0.5\ntime = 0.1\n";
    let text = small("").replace(fault, &format!("{fault}{case}"));
    let mut controller = ready(with_design(&text).unwrap());
    controller.losses[0].estimate = 1.0;
    assert_eq!(controller.event(1e7).unwrap().next_event_time, Some(1e7 + 0.1));
    assert_eq!(controller.event(1e7 + 0.1).unwrap().next_event_time, None);
    assert_eq!(controller.reconfigurator.output, 1);
}

#[test]
fn a_copy_through_bytes_stays_in_its_mode() {
    let (mut controller, _) = exchanged("limits = [-1.5, 0.3]");
    rates(&mut controller, 0.0, [-0.7 / 3.0, 0.0, 0.0]);
    let bytes = postcard::to_stdvec(&controller).unwrap();
    let mut copy: AsoController = postcard::from_bytes(&bytes).unwrap();
    let z = [-0.8 / 3.0, 0.1, 0.2];
    let bits = |model: &mut AsoController| rates(model, 0.1, z).map(f64::to_bits);
    assert_eq!(bits(&mut copy), bits(&mut controller));
    assert_eq!(copy.values.u, controller.values.u);
    assert!(copy.values.u[0] > 0.3, "no event has limited it");
    assert_eq!(indicators(&copy), indicators(&controller));
}

#[test]
fn evaluations_allocate_nothing() {
    let (mut controller, _) = exchanged("limits = [-1.5, 0.3]");
    let mut values = [0.0; 2];
    let allocations = allocation_counter::measure(|| {
        for k in 0..100_u32 {
            rates(&mut controller, 0.0, [f64::from(k) * 0.01 - 0.5, 0.0, 0.0]);
            controller.event_indicators(0.0, &mut values);
            controller.event(0.0).unwrap();
        }
    });
    assert_eq!(allocations.count_total, 0);
}

/// The small design with `limits` between two masses, 1 kg and 2 kg.
fn scheduled(limits: &str) -> AsoController {
    let point = |mass: f64, at: f64| {
        format!(
            "[[schedule.points]]\nat = {mass:?}\nA = [[0.0, 1.0], [0.0, {:?}]]\nB = [[0.0], [{:?}]]\n\
             C = [[1.0, 0.0]]\nF_a = [[0.0], [{:?}]]\nK_x = [[{:?}, {:?}]]\nK_f = [[1.0]]\n\
             L_x = [[9.0], [24.0]]\nL_f = [[-12.0]]\nx_op = [{at:?}, 0.0]\nu_op = [0.1]\ny_op = [{at:?}]\n",
            -0.2 / mass,
            2.0 / mass,
            -2.0 / mass,
            -3.0 * mass,
            -2.0 * mass,
        )
    };
    let text =
        small(limits) + "[schedule]\nvariable = \"mass\"\n" + &point(1.0, 0.2) + &point(2.0, 0.5);
    ready(with_design(&text).unwrap())
}

#[test]
fn evaluations_of_a_scheduled_controller_allocate_nothing() {
    let mut controller = scheduled("limits = [-1.5, 0.3]");
    controller.event(0.0).unwrap();
    let mut values = [0.0; 2];
    rates(&mut controller, 0.0, [0.0; 3]);
    let allocations = allocation_counter::measure(|| {
        for k in 0..100_u32 {
            controller.schedule_input = 1.0 + 0.01 * f64::from(k);
            rates(&mut controller, 0.0, [f64::from(k) * 0.01 - 0.5, 0.0, 0.0]);
            controller.event_indicators(0.0, &mut values);
            controller.event(0.0).unwrap();
        }
    });
    assert_eq!(allocations.count_total, 0);
}

#[test]
fn a_scheduled_controller_leaves_the_step_to_the_exporter() {
    let mut controller = scheduled("limits = [-1.5, 0.3]");
    assert_eq!(controller.step(&Step { start: 0.0, size: 0.1 }), Err(Failure::Unsolved));
    let mut constant = exchanged("").0;
    assert_eq!(constant.step(&Step { start: 0.0, size: 0.1 }), Ok(()));
}
