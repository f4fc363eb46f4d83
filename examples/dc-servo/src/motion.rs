//! The motion in closed form: between events the equation is linear and the torque linear in time.

use crate::motor::Motor;

/// Maximum number of pieces of motion (sliding or held) in one interval. The torque is linear in time, so that an
/// interval has at most four.
const PIECES: u32 = 16;
/// Number of bisection steps that locate an event.
const HALVINGS: u32 = 100;

/// A servo under a voltage that is linear in time.
pub(crate) struct Motion {
    /// Torque at velocity zero, in N m, and its derivative, in N m/s.
    torque: [f64; 2],
    inertia: f64,
    /// Torque per velocity, `F_v + k^2 / R`, in N m s/rad.
    damping: f64,
    coulomb: f64,
    holding: f64,
    friction: bool,
}

impl Motion {
    /// Creates the motion under `voltage` in V and its derivative in V/s, at time zero.
    pub(crate) fn new(motor: &Motor<f64>, voltage: [f64; 2]) -> Self {
        let [resistance, k, inertia, viscous, coulomb, holding, ..] = motor.parameters;
        let torque = voltage.map(|part| k / resistance * part);
        let damping = viscous + k * k / resistance;
        Self { torque, inertia, damping, coulomb, holding, friction: motor.friction }
    }

    fn torque(&self, time: f64) -> f64 {
        self.torque[0] + self.torque[1] * time
    }

    /// Returns whether the load slides backward (-1) or forward (1), or is held (0); 1 without friction.
    pub(crate) fn regime(&self, omega: f64, time: f64) -> i32 {
        let torque = self.torque(time);
        if !self.friction || omega > 0.0 || omega == 0.0 && torque > self.holding {
            1
        } else {
            -i32::from(omega < 0.0 || torque < -self.holding)
        }
    }

    /// Returns angle and velocity after `duration` in s; `None` if they are not finite or need more than [`PIECES`].
    pub(crate) fn advance(&self, state: [f64; 2], duration: f64) -> Option<[f64; 2]> {
        let (mut state, mut time) = (state, 0.0);
        for _ in 0..PIECES {
            let left = duration - time;
            if left <= 0.0 {
                return Some(state);
            }
            let regime = self.regime(state[1], time);
            if regime == 0 {
                let direction = self.torque[1].signum();
                let margin = |time: f64| self.holding - direction * self.torque(time);
                if margin(duration) >= 0.0 {
                    return Some(state);
                }
                time = first_negative(margin, time, duration);
                continue;
            }
            let slide = self.slide(regime, state, time);
            let Some(stop) = slide.stop(regime, left).filter(|_| self.friction) else {
                return Some(slide.at(left)).filter(|end| end.iter().all(|part| part.is_finite()));
            };
            (state, time) = ([slide.at(stop)[0], 0.0], time + stop);
        }
        None
    }

    fn slide(&self, regime: i32, start: [f64; 2], time: f64) -> Slide {
        let friction = if self.friction { f64::from(regime) * self.coulomb } else { 0.0 };
        let push = [self.torque(time) - friction, self.torque[1]].map(|part| part / self.inertia);
        Slide { start, decay: self.damping / self.inertia, push }
    }
}

/// The solution of `w' = -a w + b_0 + b_1 t`, and its integral, for initial values.
struct Slide {
    /// Angle and velocity at time zero.
    start: [f64; 2],
    /// `a`
    decay: f64,
    /// `b_0`, `b_1`
    push: [f64; 2],
}

impl Slide {
    /// Returns angle and velocity at a time.
    fn at(&self, t: f64) -> [f64; 2] {
        let ([angle, omega], [b_0, b_1]) = (self.start, self.push);
        let [phi_0, phi_1, phi_2, phi_3] = phi(-self.decay * t);
        let turned = t * (phi_1 * omega + t * (phi_2 * b_0 + t * phi_3 * b_1));
        [angle + turned, phi_0 * omega + t * (phi_1 * b_0 + t * phi_2 * b_1)]
    }

    fn acceleration(&self, t: f64) -> f64 {
        let [phi_0, phi_1, ..] = phi(-self.decay * t);
        phi_0 * (self.push[0] - self.decay * self.start[1]) + t * phi_1 * self.push[1]
    }

    /// Returns the first time up to `end` at which the velocity is opposite to `direction`; `None` if it is not.
    ///
    /// The acceleration is monotone, so the velocity has at most one extremum, and at most one zero
    /// before and one after it.
    fn stop(&self, direction: i32, end: f64) -> Option<f64> {
        let direction = f64::from(direction);
        let speed = |t: f64| direction * self.at(t)[1];
        let sign = self.acceleration(0.0).signum();
        let rise = |t: f64| sign * self.acceleration(t);
        let turn = if rise(end) < 0.0 { first_negative(rise, 0.0, end) } else { end };
        [(0.0, turn), (turn, end)]
            .into_iter()
            .find(|(_, to)| speed(*to) < 0.0)
            .map(|(from, to)| first_negative(speed, from, to))
    }
}

/// Returns `phi_0` to `phi_3` at `z <= 0`: `phi_0(z) = e^z`, `phi_(k+1)(z) = (phi_k(z) - 1/k!) / z`.
///
/// Near zero, the last one is computed by its power series, and the others from it.
fn phi(z: f64) -> [f64; 4] {
    if z < -1.0 {
        let phi_1 = z.exp_m1() / z;
        let phi_2 = (phi_1 - 1.0) / z;
        return [z.exp(), phi_1, phi_2, (phi_2 - 0.5) / z];
    }
    let phi_3 = (4..21).rev().fold(1.0, |sum, k| 1.0 + sum * z / f64::from(k)) / 6.0;
    let phi_2 = 0.5 + z * phi_3;
    let phi_1 = 1.0 + z * phi_2;
    [1.0 + z * phi_1, phi_1, phi_2, phi_3]
}

/// Locates the sign change of a margin that is not negative at `low` and negative at `high`.
///
/// Returns the upper end of the interval after bisection down to neighbouring numbers.
fn first_negative(margin: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        (low, high) = if margin(middle) < 0.0 { (low, middle) } else { (middle, high) };
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `phi_k(z)` is the integral of `e^((1-s) z) s^(k-1) / (k-1)!` over `s` from 0 to 1.
    fn integral(k: i32, z: f64) -> f64 {
        let factorial = f64::from((1..k).product::<i32>());
        let value = |s: f64| ((1.0 - s) * z).exp() * s.powi(k - 1) / factorial;
        let cells = 2000;
        let simpson = |i: i32| {
            let (left, right) = (f64::from(i) / 2000.0, f64::from(i + 1) / 2000.0);
            (value(left) + 4.0 * value(0.5 * (left + right)) + value(right)) / 12000.0
        };
        (0..cells).map(simpson).sum()
    }

    #[test]
    fn the_phi_functions_are_their_integrals() {
        for z in [0.0, -1e-9, -0.01, -0.5, -0.999_999, -1.000_001, -3.0, -20.0] {
            let actual = phi(z);
            assert!((actual[0] - z.exp()).abs() < 1e-15);
            for k in 1..4 {
                let actual = actual[usize::try_from(k).unwrap()];
                assert!((actual - integral(k, z)).abs() < 1e-12, "phi_{k}({z}) = {actual}");
            }
        }
    }
}
