//! Robustness of a feedback loop: sensitivity, margins, hold time, noise, parameter tolerances.
//!
//! The loop is y = G u, u = K y, with the sign of the feedback inside the controller K. With the
//! loop transfers L = -K G at the plant's input and L = -G K at its output,
//!
//! ```text
//! S = (I + L)^-1,  T = L (I + L)^-1 = I - S
//! ```
//!
//! | question | answer |
//! |---|---|
//! | S and T as systems, their peaks | [`Loop::sensitivity`], [`Loop::complementary`], [`crate::response::h_infinity`] |
//! | changes of gain and phase in all channels at once | [`disk_margin`] |
//! | changes of gain, phase and delay in one channel | [`channel_margins`], [`sampled_channel_delay`] |
//! | a delay in all channels | [`delay_margin`], [`sampled_delay_margin`] |
//! | several of these margins and peaks at one point of a loop | [`OpenedLoop`] |
//! | the longest time over which signals may be held | [`longest_hold`], [`longest_period`] |
//! | effect of measurement noise | [`noise_gains`] |
//! | which of several loops has the lowest peaks of S | [`least_sensitive`] |
//! | errors of the plant's parameters | [`EntryFamily`], [`PlantFamily`], [`tolerance_test`] |
//! | stability within tolerances, proven | [`proven_tolerance`], [`structured_bound`] |
//! | gains for comparison | [`regulator_of_same_speed`] |

mod channel;
mod choice;
mod crossing;
mod delay;
mod disk;
mod entries;
mod family;
mod held;
mod hold_time;
mod noise;
mod opened;
mod scaling;
mod speed;
mod structured;
mod sweep;
mod tolerance;
mod worst_case;

pub use channel::{ChannelMargins, channel_margins};
pub use choice::least_sensitive;
pub use delay::{delay_margin, sampled_channel_delay, sampled_delay_margin};
pub use disk::{DiskMargin, disk_margin, scaled_peak};
pub use entries::{PeakDerivatives, SensitivityPeak, peak_derivatives};
pub use family::{PlantFamily, ToleranceCase, ToleranceSearch};
pub use hold_time::{longest_hold, longest_period};
pub use noise::noise_gains;
pub use opened::OpenedLoop;
pub use scaling::ScaledPeak;
pub use speed::regulator_of_same_speed;
pub use structured::{
    Block, ProvenTolerance, StructuredBound, Unproven, proven_tolerance, structured_bound,
};
pub(crate) use tolerance::uniform;
pub use tolerance::{
    EntryFamily, PlantEntry, ToleranceTest, Tolerances, random_deviations, tolerance_test,
};

use crate::blocks::{beside, block_2x2, stacked};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// The point at which the loop is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Point {
    /// The loop is opened at the commands.
    Input,
    /// The loop is opened at the measurements.
    Output,
}

/// The `plant` under a zero-order hold of its inputs, in samples of `period` seconds.
///
/// A continuous plant is discretised; a sampled plant keeps A and B. With y = C x + D u the output at a sample contains
/// the previous command v: `y[k] = C x[k] + D v[k]`, `v[k+1] = u[k]`; the state is [x; v], D becomes zero.
///
/// # Errors
///
/// Same as [`crate::hold::zero_order_hold`]; [`Error::OutOfRange`] for a sampled plant with another period.
pub fn held_plant(plant: &StateSpace, period: f64) -> Result<StateSpace, Error> {
    let (a, b) = match plant.domain {
        Domain::Continuous => held::hold_inputs(&plant.a, &plant.b, period)?,
        Domain::Sampled { period: stated } if stated.total_cmp(&period).is_ne() => {
            let rule = "that of the sampled plant";
            return Err(Error::OutOfRange { name: "the sample time", value: period, rule });
        }
        Domain::Sampled { .. } => (plant.a.clone(), plant.b.clone()),
    };
    let held = StateSpace { a, b, domain: Domain::Sampled { period }, ..plant.clone() };
    Ok(if plant.d.amax() <= 0.0 { held } else { with_previous_command(held) })
}

/// The sampled plant whose D acts on the previous command v, a further state: the state is [x; v], D becomes zero.
fn with_previous_command(plant: StateSpace) -> StateSpace {
    let StateSpace { a, b, c, d, domain } = plant;
    let (n, m) = b.shape();
    let b = stacked(&b, &DMatrix::identity(m, m));
    StateSpace::strictly_proper(a.resize(n + m, n + m, 0.0), b, beside(&c, &d), domain)
}

/// The loop y = G u, u = K y of a plant G and a controller K, at least one of them strictly proper.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    plant: StateSpace,
    controller: StateSpace,
}

impl Loop {
    /// Closes the loop of `plant`, from m commands to p measurements, and `controller`, from p
    /// measurements to m commands, both in the same domain. D of one of them is zero.
    ///
    /// # Errors
    ///
    /// Same as [`StateSpace::check`]; [`Error::Shape`] for a controller that does not fit the plant;
    /// [`Error::OutOfRange`] for a plant and a controller with D other than zero, or for different domains.
    pub fn new(plant: StateSpace, controller: StateSpace) -> Result<Self, Error> {
        plant.check()?;
        controller.check()?;
        check::shape("the controller's D", &controller.d, (plant.b.ncols(), plant.c.nrows()))?;
        let direct = plant.d.amax();
        let is_proper = direct <= 0.0 || controller.d.amax() <= 0.0;
        let rule = "zero, because D of the controller is not";
        check::that(is_proper, "the plant's D", direct, rule)?;
        let is_same = plant.domain == controller.domain;
        check::that(is_same, "the domain", f64::NAN, "the same for plant and controller")?;
        Ok(Self { plant, controller })
    }

    /// The plant G.
    #[must_use]
    pub fn plant(&self) -> &StateSpace {
        &self.plant
    }

    /// The controller K.
    #[must_use]
    pub fn controller(&self) -> &StateSpace {
        &self.controller
    }

    /// The matrix A of the closed loop, with the states of plant and controller.
    #[must_use]
    pub fn dynamics(&self) -> DMatrix<f64> {
        let (plant, controller) = (&self.plant, &self.controller);
        block_2x2(
            [&(&plant.a + &plant.b * &controller.d * &plant.c), &(&plant.b * &controller.c)],
            [
                &(&controller.b * &plant.c),
                &(&controller.a + &controller.b * &plant.d * &controller.c),
            ],
        )
    }

    /// Commands and measurements from the states of plant and controller: [`D_k` C, `C_k`] and [C, D `C_k`].
    fn signals(&self) -> [DMatrix<f64>; 2] {
        let (plant, controller) = (&self.plant, &self.controller);
        [
            beside(&(&controller.d * &plant.c), &controller.c),
            beside(&plant.c, &(&plant.d * &controller.c)),
        ]
    }

    /// The effects of signals that are added to the commands, and to the measurements, on the states of plant and
    /// controller: [B; `B_k` D] and [B `D_k`; `B_k`].
    fn inputs(&self) -> [DMatrix<f64>; 2] {
        let (plant, controller) = (&self.plant, &self.controller);
        [
            stacked(&plant.b, &(&controller.b * &plant.d)),
            stacked(&(&plant.b * &controller.d), &controller.b),
        ]
    }

    /// The loop as a system: from signals that are added to commands and measurements to the commands and
    /// measurements before the addition.
    #[must_use]
    pub fn system(&self) -> StateSpace {
        let (plant, controller) = (&self.plant, &self.controller);
        let ([to_commands, to_measurements], [commands, measurements]) =
            (self.inputs(), self.signals());
        let zeros = |size| DMatrix::zeros(size, size);
        let (p, m) = plant.d.shape();
        StateSpace {
            a: self.dynamics(),
            b: beside(&to_commands, &to_measurements),
            c: stacked(&commands, &measurements),
            d: block_2x2([&zeros(m), &controller.d], [&plant.d, &zeros(p)]),
            domain: plant.domain,
        }
    }

    /// S as a system: from a signal that is added at `at` to the sum.
    #[must_use]
    pub fn sensitivity(&self, at: Point) -> StateSpace {
        let mut system = self.response(at);
        system.d.fill_with_identity();
        system
    }

    /// T as a system: from a signal that is added at `at` to the negative of the signal that returns there.
    #[must_use]
    pub fn complementary(&self, at: Point) -> StateSpace {
        let mut system = self.response(at);
        system.c.neg_mut();
        system
    }

    /// The system S - I = -T at `at`.
    fn response(&self, at: Point) -> StateSpace {
        let [b, c] = [self.inputs(), self.signals()].map(|[input, output]| match at {
            Point::Input => input,
            Point::Output => output,
        });
        StateSpace::strictly_proper(self.dynamics(), b, c, self.plant.domain)
    }

    /// The system from noise that is added to the measurements to another output of the controller.
    ///
    /// `output`: C and D of that output; A and B are not read.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] when `output` does not fit the controller.
    pub fn from_noise(&self, output: &StateSpace) -> Result<StateSpace, Error> {
        let controller = &self.controller;
        check::shape("C of the output", &output.c, (output.c.nrows(), controller.a.nrows()))?;
        check::shape("D of the output", &output.d, (output.c.nrows(), controller.b.ncols()))?;
        let mut c = &output.d * &self.signals()[1];
        let mut from_controller = c.columns_mut(self.plant.a.nrows(), controller.a.nrows());
        from_controller += &output.c;
        Ok(StateSpace { c, d: output.d.clone(), ..self.response(Point::Output) })
    }
}
