//! The transcendental functions of the equations, computed each time or remembered.

use std::cell::Cell;

use num_dual::Dual64;

/// Sine, cosine and exponential of numbers `D`.
pub(crate) trait Functions<D> {
    /// The sine.
    fn sine(&self, angle: D) -> D;

    /// Sine and cosine.
    fn sine_and_cosine(&self, angle: D) -> (D, D);

    /// The exponential function.
    fn exponential(&self, exponent: D) -> D;
}

/// Computes each value, without memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direct;

impl Functions<f64> for Direct {
    #[inline]
    fn sine(&self, angle: f64) -> f64 {
        libm::sin(angle)
    }

    #[inline]
    fn sine_and_cosine(&self, angle: f64) -> (f64, f64) {
        libm::sincos(angle)
    }

    #[inline]
    fn exponential(&self, exponent: f64) -> f64 {
        libm::exp(exponent)
    }
}

impl Functions<Dual64> for Direct {
    fn sine(&self, angle: Dual64) -> Dual64 {
        self.sine_and_cosine(angle).0
    }

    fn sine_and_cosine(&self, angle: Dual64) -> (Dual64, Dual64) {
        let (sine, cosine) = self.sine_and_cosine(angle.re);
        (Dual64::new(sine, cosine * angle.eps), Dual64::new(cosine, -sine * angle.eps))
    }

    fn exponential(&self, exponent: Dual64) -> Dual64 {
        let value = self.exponential(exponent.re);
        // e^x tends to zero faster than any power of x, whose derivative may be infinite.
        Dual64::new(value, if value == 0.0 { 0.0 } else { value * exponent.eps })
    }
}

/// Remembers the sines and cosines of the last two angles and the last exponential.
///
/// The equations are evaluated several times at the start and at the end of each step: for the regime,
/// the first and the last slope of the integration, the event margins and the outputs; and the end of
/// a step is the start of the next one. The values depend on the arguments alone, so results do not
/// depend on what is remembered: all memories are equal, and none is part of the FMU state.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    last: Cell<Angle>,
    before: Cell<Angle>,
    /// The last exponent and its exponential.
    exponential: Cell<[f64; 2]>,
}

#[derive(Clone, Copy, Debug)]
struct Angle {
    argument: f64,
    sine: f64,
    cosine: f64,
}

impl Default for Memory {
    fn default() -> Self {
        let zero = Angle { argument: 0.0, sine: 0.0, cosine: 1.0 };
        Self { last: Cell::new(zero), before: Cell::new(zero), exponential: Cell::new([0.0, 1.0]) }
    }
}

impl PartialEq for Memory {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Functions<f64> for Memory {
    #[inline]
    fn sine(&self, angle: f64) -> f64 {
        self.sine_and_cosine(angle).0
    }

    #[inline]
    fn sine_and_cosine(&self, angle: f64) -> (f64, f64) {
        let (last, before) = (self.last.get(), self.before.get());
        if last.argument.to_bits() == angle.to_bits() {
            return (last.sine, last.cosine);
        }
        if before.argument.to_bits() == angle.to_bits() {
            return (before.sine, before.cosine);
        }
        let (sine, cosine) = Direct.sine_and_cosine(angle);
        self.before.set(last);
        self.last.set(Angle { argument: angle, sine, cosine });
        (sine, cosine)
    }

    #[inline]
    fn exponential(&self, exponent: f64) -> f64 {
        let [known, value] = self.exponential.get();
        if known.to_bits() == exponent.to_bits() {
            return value;
        }
        let value = Direct.exponential(exponent);
        self.exponential.set([exponent, value]);
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arguments of every size and sign, each next to others and repeated.
    fn arguments() -> Vec<f64> {
        let mut all = vec![0.0, -0.0, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE];
        for exponent in -40..12 {
            for factor in [1.0, 1.37, -1.9] {
                all.push(factor * 2.0_f64.powi(exponent));
            }
        }
        let again: Vec<_> =
            all.windows(3).flat_map(|three| [three[0], three[1], three[0], three[2]]).collect();
        [all, again].concat()
    }

    #[test]
    fn what_is_remembered_has_the_bits_of_what_is_computed() {
        let memory = Memory::default();
        for argument in arguments() {
            let actual = memory.sine_and_cosine(argument);
            let computed = Direct.sine_and_cosine(argument);
            assert_eq!(
                [actual.0, actual.1].map(f64::to_bits),
                [computed.0, computed.1].map(f64::to_bits)
            );
            let [actual, computed] = [memory.exponential(argument), Direct.exponential(argument)];
            assert_eq!(actual.to_bits(), computed.to_bits());
        }
    }

    #[test]
    fn the_sine_alone_has_the_bits_of_the_sine_with_its_cosine() {
        for argument in arguments() {
            let (sine, _) = Direct.sine_and_cosine(argument);
            assert_eq!(Direct.sine(argument).to_bits(), sine.to_bits());
        }
    }
}
