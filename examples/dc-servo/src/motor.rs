//! The equations of the servo at one point in time.

use num_dual::DualNum;

/// `f64`, or a dual number that carries a derivative through the same equations.
pub(crate) trait Number: DualNum<Primitive = f64> + Copy {}
impl<D: DualNum<Primitive = f64> + Copy> Number for D {}

/// Number of parameters, and the indices of the parameters that are also used outside of these equations.
pub(crate) const COUNT: usize = 12;
pub(crate) const ONSET: usize = 9;
pub(crate) const BIAS: usize = 11;

/// The parameters, and conditions that change at events only.
pub(crate) struct Motor<D> {
    pub(crate) parameters: [D; COUNT],
    /// Whether the fault of the drive has started.
    pub(crate) faulty: bool,
    /// Whether there is dry friction.
    pub(crate) friction: bool,
}

/// Acceleration, friction and current for a velocity, a voltage and a regime.
pub(crate) struct Response<D> {
    /// In rad/s2.
    pub(crate) acceleration: D,
    /// Dry friction in N m.
    pub(crate) friction: D,
    /// In A.
    pub(crate) current: D,
}

impl<D: Number> Motor<D> {
    /// Returns the voltage at the armature: `u`, or with a faulty drive `(1 - E) u + f_u + r_u (t - t_fault)`.
    pub(crate) fn voltage(&self, u: D, time: D) -> D {
        let [.., loss, fault, rate, onset, _, _] = self.parameters;
        if self.faulty { (D::one() - loss) * u + fault + rate * (time - onset) } else { u }
    }

    /// Returns the derivative of this voltage with respect to time; `u_slope` is the derivative of `u`.
    pub(crate) fn voltage_rise(&self, u_slope: D) -> D {
        let [.., loss, _, rate, _, _, _] = self.parameters;
        if self.faulty { (D::one() - loss) * u_slope + rate } else { u_slope }
    }

    /// Evaluates `J w' = k i - F_v w - T_f` with the current from `R i = v - k w`.
    ///
    /// The dry friction `T_f` is `T_c sign(w)` while the load slides. At rest it balances the
    /// torque, up to `T_s`.
    pub(crate) fn response(&self, regime: i32, omega: D, voltage: D) -> Response<D> {
        let [resistance, k, inertia, viscous, coulomb, holding, ..] = self.parameters;
        let current = (voltage - k * omega) / resistance;
        let torque = k * current - viscous * omega;
        let friction = match regime {
            _ if !self.friction => D::zero(),
            0 if torque > holding => holding,
            0 if torque < -holding => -holding,
            0 => torque,
            direction => coulomb * f64::from(direction),
        };
        let held = self.friction && regime == 0;
        let acceleration = if held { D::zero() } else { (torque - friction) / inertia };
        Response { acceleration, friction, current }
    }
}
