//! The same as `controller_loop.c` for a crate that `aso-ftc design --no-std` has written.
use controller::*;
use std::io::{Read, Write};

#[cfg(single)]
type Real = f32;
#[cfg(not(single))]
type Real = f64;

#[cfg(not(references))]
const REFERENCES: usize = 0;
const SCHEDULED: usize = cfg!(schedule) as usize;
const FLAGS: usize = 1 + cfg!(detection) as usize;
#[cfg(not(reconfigurations))]
const SWITCHES: usize = 0;

fn main() {
    let mut input = Vec::new();
    std::io::stdin().read_to_end(&mut input).unwrap();
    let values: Vec<f64> = input.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
    let mut controller = Controller::new();
    eprintln!("{}", size_of_val(&controller));
    let mut output = Vec::new();
    for sample in values.chunks_exact(MEASUREMENTS + REFERENCES + SCHEDULED + FLAGS + SWITCHES) {
        let measured: [Real; MEASUREMENTS] = core::array::from_fn(|k| sample[k] as Real);
        let referred: [Real; REFERENCES] = core::array::from_fn(|k| sample[MEASUREMENTS + k] as Real);
        let compensate = sample[MEASUREMENTS + REFERENCES + SCHEDULED] > 0.5;
        let scheduled = [sample[MEASUREMENTS + REFERENCES] as Real];
        #[cfg(all(references, schedule))]
        let actual = controller.step(&measured.into(), &referred.into(), &scheduled.into(), compensate);
        #[cfg(all(references, not(schedule)))]
        let (actual, _) = (controller.step(&measured.into(), &referred.into(), compensate), scheduled);
        #[cfg(all(not(references), schedule))]
        let (actual, _) = (controller.step(&measured.into(), &scheduled.into(), compensate), referred);
        let first = MEASUREMENTS + REFERENCES + SCHEDULED + FLAGS;
        let switches: [bool; SWITCHES] = core::array::from_fn(|k| sample[first + k] > 0.5);
        #[cfg(all(reconfigurations, not(detection)))]
        let actual = controller.step(&measured.into(), &switches.into(), compensate);
        #[cfg(all(reconfigurations, detection))]
        let actual = controller.step(&measured.into(), &switches.into(), compensate, sample[first - 1] > 0.5);
        let _ = (referred, scheduled, switches);
        #[cfg(not(any(references, schedule, detection, reconfigurations)))]
        let (actual, _) = (controller.step(&measured.into(), compensate), (referred, scheduled));
        #[cfg(all(detection, not(reconfigurations)))]
        let reset = sample[MEASUREMENTS + REFERENCES + SCHEDULED + 1] > 0.5;
        #[cfg(all(detection, not(reconfigurations)))]
        let (actual, _) = (controller.step(&measured.into(), compensate, reset), (referred, scheduled));
        let commands: [Real; ACTUATORS] = actual.commands.into();
        let estimates: [Real; ESTIMATES] = actual.estimates.into();
        let Status { held, at_limit, overflow, .. } = actual.status;
        #[cfg(outside)]
        let outside = actual.status.outside;
        #[cfg(not(outside))]
        let outside = false;
        #[cfg(lost)]
        let lost = actual.status.lost;
        #[cfg(not(lost))]
        let lost = false;
        let bits = [held, at_limit, overflow, outside, lost];
        let status: u8 = bits.iter().enumerate().map(|(k, bit)| u8::from(*bit) << k).sum();
        let mut all: Vec<f64> = commands.iter().chain(&estimates).map(|value| f64::from(*value)).collect();
        #[cfg(detection)]
        {
            let Detection { detected, isolated, t_detected, t_onset, residual, statistic } = actual.detection;
            all.extend([f64::from(u8::from(detected)), f64::from(isolated)]);
            all.extend([t_detected, t_onset].iter().chain(&residual).chain(&statistic).map(|value| f64::from(*value)));
        }
        #[cfg(reconfigurations)]
        all.push(f64::from(actual.reconfiguration));
        all.push(f64::from(status));
        all.iter().for_each(|value| output.extend(value.to_le_bytes()));
    }
    std::io::stdout().write_all(&output).unwrap();
}
