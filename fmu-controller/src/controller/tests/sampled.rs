//! Sampled controllers against the recursion of their doc comment, for communication steps of any size.

use nalgebra::DVector;

use super::oracle::{Estimate, Oracle, agree, tamed};
use super::sized::SAMPLED;
use super::*;

/// The sample time of these designs in s.
const T: f64 = 0.1;
const SLOPE: f64 = 0.8;

/// Samples 0 to `last` with measurements that grow from y: estimates and commands used at each.
fn samples(
    oracle: &Oracle,
    (mut z, y): (Estimate, DVector<f64>),
    current: bool,
    last: u32,
) -> Vec<(Vec<f64>, DVector<f64>)> {
    let slope = DVector::from_element(y.len(), SLOPE);
    let mut all = Vec::new();
    let mut before = oracle.operating_command();
    for k in 0..=last {
        let at = &y + &slope * (f64::from(k) * T);
        let is_on = |k: u32| f64::from(k) * T >= 0.35;
        let switches = [current, is_on(k.saturating_sub(1)), is_on(k)];
        let (used, u, next) = oracle.sample(&z, (&at, &before), switches);
        before.clone_from(&u);
        all.push((used.all(), u));
        z = next;
    }
    all
}

#[test]
fn for_every_communication_step_it_acts_at_its_samples_and_holds_in_between() {
    for of in SAMPLED {
        for size in [0.1 * T, T / 3.0, 0.7 * T, T, 2.0 * T, 2.7 * T, 13.0 * T] {
            let (mut model, oracle) = tamed(of);
            model.design.t_on = 7.35;
            let (start, y) = oracle.start(&model);
            let required = samples(&oracle, (start, y.clone()), of.2.contains('c'), 40);
            model.initialize(&Experiment { start_time: 7.0, ..Experiment::default() }).unwrap();
            let slopes = vec![SLOPE; y.len()];
            let mut time = 0.0;
            for taken in 0.. {
                let end: f64 = time + if taken == 0 { 0.0 } else { size };
                if end > 40.0 * T {
                    break;
                }
                if taken > 0 {
                    let begun = y.map(|y| y + SLOPE * time);
                    step(&mut model, 7.0 + time, size, begun.as_slice(), &slopes);
                }
                let instants = (0..41).map(|k| f64::from(k) * T);
                let (z, u) =
                    &required[instants.filter(|instant| *instant < end + 1e-9).count() - 1];
                assert!(agree(&model.values.z, z, 1e-9), "{of:?} {size} {end}");
                assert!(agree(&model.values.u, u.as_slice(), 1e-9), "{of:?} {size} {end}");
                time = end;
            }
        }
    }
}

#[test]
fn ten_steps_of_a_tenth_of_the_sample_time_take_one_sample_a_million_times() {
    for (period, start) in [(0.1, 0.0), (0.007, 3.3)] {
        let (mut model, _) = tamed(([1, 1, 1, 1], "l", "c"));
        model.design.sample_time = Some(period);
        model.sampler = Sampler::new(&model.design);
        model.initialize(&Experiment { start_time: start, ..Experiment::default() }).unwrap();
        let (size, mut time) = (period / 10.0, start);
        for k in 1..=1_000_000_u32 {
            model.step(&Step { start: time, size }).unwrap();
            time += size;
            let next = model.sampler.as_ref().unwrap().clock.next_instant();
            let required = start + f64::from(k / 10 + 1) * period;
            assert_eq!(next.to_bits(), required.to_bits(), "{period} {k}");
        }
    }
}

#[test]
fn some_command_is_at_a_limit_at_some_samples_and_free_at_others() {
    for of in SAMPLED.into_iter().filter(|of| of.1.contains('l')) {
        let (model, oracle) = tamed(of);
        let commands = samples(&oracle, oracle.start(&model), of.2.contains('c'), 40);
        let j = of.1.find('l').unwrap();
        let [low, high] = model.design.actuators[j].limits.unwrap();
        let limited = |u: f64| u.to_bits() == low.to_bits() || u.to_bits() == high.to_bits();
        let count = commands.iter().filter(|(_, u)| limited(u[j])).count();
        assert!(0 < count && count < commands.len(), "{of:?} {count}");
    }
}

#[test]
fn in_model_exchange_each_sample_is_a_time_event() {
    for of in SAMPLED {
        let (mut model, oracle) = tamed(of);
        model.design.t_on = 0.35;
        let (start, y) = oracle.start(&model);
        let required = samples(&oracle, (start, y.clone()), of.2.contains('c'), 20);
        let mut model = ready(model);
        assert_eq!(model.model_exchange(), Some(ModelExchange { event_indicators: 0 }));
        for (k, (z, u)) in (0..).zip(&required) {
            let time = f64::from(k) * T;
            let inputs = model.values.y.iter_mut().chain(&mut model.values.r);
            inputs.zip(&y).for_each(|(input, y)| *input = y + SLOPE * time);
            let event = model.event(time).unwrap();
            assert_eq!(event.next_event_time, Some(f64::from(k + 1) * T));
            assert!(agree(&model.values.z, z, 1e-9), "{of:?} {k}");
            assert!(agree(&model.values.u, u.as_slice(), 1e-9), "{of:?} {k}");
            let before = (model.values.z.clone(), model.values.u.clone());
            model.values.y.fill(9.0);
            model.update(time).unwrap();
            assert_eq!(model.event(time + 0.5 * T).unwrap(), event, "an event between samples");
            assert_eq!((&model.values.z, &model.values.u), (&before.0, &before.1));
        }
    }
}

/// Seconds since 1970 are rounded by up to 0.12 us.
#[test]
fn an_event_at_the_announced_time_takes_the_sample_in_seconds_since_1970() {
    for period in [1e-3, 1e-4] {
        let (mut model, _) = tamed(([1, 1, 1, 1], "l", "c"));
        model.design.sample_time = Some(period);
        model.sampler = Sampler::new(&model.design);
        let start_time = 1.7e9;
        model.initialize(&Experiment { start_time, ..Experiment::default() }).unwrap();
        let mut time = start_time;
        for k in 1..=1000_u32 {
            let next = model.event(time).unwrap().next_event_time;
            let required = start_time + f64::from(k) * period;
            assert_eq!(next, Some(required), "{period} {k}");
            time = required;
        }
    }
}

#[test]
fn compensate_and_t_on_act_at_samples() {
    let (mut model, _) = tamed(([2, 2, 2, 2], "--", "c"));
    model.design.t_on = 0.25;
    let mut model = ready(model);
    for (k, compensate, on) in
        [(1, true, false), (2, true, false), (3, true, true), (4, false, false), (5, true, true)]
    {
        let start = f64::from(k - 1) * T;
        model.compensate = compensate;
        for half in [0.0, 0.5] {
            model.step(&Step { start: start + half * T, size: 0.5 * T }).unwrap();
        }
        assert_eq!(model.mode.compensating, on, "{k}");
    }
}

#[test]
fn an_estimate_that_is_not_monitored_is_frozen_with_its_fault_model_too() {
    for of in SAMPLED {
        for monitor in [false, true] {
            let (mut model, _) = tamed(of);
            (model.compensate, model.design.monitor) = (false, monitor);
            let mut model = ready(model);
            let n = model.x_hat_0.len();
            let y = model.values.y.clone();
            for k in 0..5_u32 {
                step(&mut model, f64::from(k) * T, T, &y, &y);
            }
            let held = model.values.z[n..][..model.f_hat_0.len()] == model.f_hat_0;
            assert_eq!(held, !monitor, "{of:?}");
        }
    }
}

#[test]
fn a_copy_through_bytes_continues_with_the_same_bits() {
    for of in SAMPLED {
        let (model, _) = tamed(of);
        let mut model = ready(model);
        let y = model.values.y.clone();
        step(&mut model, 0.0, 0.17, &y, &y);
        let mut copy: AsoController =
            postcard::from_bytes(&postcard::to_stdvec(&model).unwrap()).unwrap();
        for model in [&mut model, &mut copy] {
            step(model, 0.17, 0.55, &y, &y);
        }
        let bits = |model: &AsoController| -> Vec<u64> {
            model.values.z.iter().chain(&model.values.u).map(|value| value.to_bits()).collect()
        };
        assert_eq!(bits(&model), bits(&copy));
    }
}

#[test]
fn steps_and_events_allocate_nothing() {
    for of in SAMPLED {
        let (model, _) = tamed(of);
        let mut model = ready(model);
        let y = model.values.y.clone();
        let allocations = allocation_counter::measure(|| {
            for k in 0..100_u32 {
                step(&mut model, f64::from(k) * 0.37, 0.37, &y, &y);
            }
            for k in 0..100_u32 {
                model.event(40.0 + f64::from(k) * T).unwrap();
            }
        });
        assert_eq!(allocations.count_total, 0, "{of:?}");
    }
}
