//! The same as `controller_loop.c` for a crate that `aso-ftc design --no-std` has written.
use controller::*;
use std::io::{Read, Write};

#[cfg(single)]
type Real = f32;
#[cfg(not(single))]
type Real = f64;

#[cfg(not(references))]
const REFERENCES: usize = 0;

fn main() {
    let mut input = Vec::new();
    std::io::stdin().read_to_end(&mut input).unwrap();
    let values: Vec<f64> = input.chunks_exact(8).map(|own| f64::from_le_bytes(own.try_into().unwrap())).collect();
    let mut controller = Controller::new();
    eprintln!("{}", size_of_val(&controller));
    let mut output = Vec::new();
    for sample in values.chunks_exact(MEASUREMENTS + REFERENCES + 1) {
        let measured: [Real; MEASUREMENTS] = core::array::from_fn(|k| sample[k] as Real);
        let referred: [Real; REFERENCES] = core::array::from_fn(|k| sample[MEASUREMENTS + k] as Real);
        let compensate = sample[MEASUREMENTS + REFERENCES] > 0.5;
        #[cfg(references)]
        let found = controller.step(&measured.into(), &referred.into(), compensate);
        #[cfg(not(references))]
        let (found, _) = (controller.step(&measured.into(), compensate), referred);
        let commands: [Real; ACTUATORS] = found.commands.into();
        let estimates: [Real; ESTIMATES] = found.estimates.into();
        let Status { held, at_limit, overflow } = found.status;
        let status = u8::from(held) + 2 * u8::from(at_limit) + 4 * u8::from(overflow);
        let all = commands.iter().chain(&estimates).map(|value| f64::from(*value)).chain([f64::from(status)]);
        all.for_each(|value| output.extend(value.to_le_bytes()));
    }
    std::io::stdout().write_all(&output).unwrap();
}
