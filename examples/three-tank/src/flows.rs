//! The flows of pumps and pipes, and the derivatives of the levels.

use num_dual::{Dual64, DualNum};

/// Number of parameters, and the indices of the parameters that are also used outside of the flows.
pub(crate) const COUNT: usize = 18;
pub(crate) const Q_MAX: usize = 6;
pub(crate) const H_MAX: usize = 7;
pub(crate) const ONSET: usize = 12;
pub(crate) const BIAS: usize = 15;

/// `f64`, or a dual number `x + x' e` with `e^2 = 0`, which carries a derivative through the same
/// equations.
pub(crate) trait Number: DualNum<Primitive = f64> + Copy {
    /// Returns `sign(x) sqrt(|x|)`; its derivative at zero is infinite, but 0 if `x' = 0`.
    fn root(self) -> Self;
}

impl Number for f64 {
    fn root(self) -> Self {
        self.signum() * self.abs().sqrt()
    }
}

impl Number for Dual64 {
    fn root(self) -> Self {
        let value = self.re.root();
        let rise = if self.eps == 0.0 { 0.0 } else { 0.5 * self.eps / value.abs() };
        Self::new(value, rise)
    }
}

/// Flows in m3/s.
pub(crate) struct Flows<D> {
    /// `q_01`, `q_02`: the flows that the pumps deliver.
    pub(crate) pumps: [D; 2],
    /// `q_13`, `q_32`, `q_20`: through the pipes.
    pub(crate) pipes: [D; 3],
    /// Inflow minus outflow of each tank.
    pub(crate) net: [D; 3],
}

/// Commands and parameters, and conditions that change at events only.
pub(crate) struct Tanks<D> {
    /// `Q_1`, `Q_2` in m3/s.
    pub(crate) command: [D; 2],
    pub(crate) parameters: [D; COUNT],
    /// For each pump, whether its fault has started.
    pub(crate) faulty: [bool; 2],
}

impl<D: Number> Tanks<D> {
    /// Returns the flows at the levels `h` in m.
    ///
    /// A pipe follows Torricelli's law, `q_ij = mu_ij S_p sign(h_i - h_j) sqrt(2 g |h_i - h_j|)`; a
    /// pump delivers `Q` and, once it is faulty, `(1 - E) Q + f`, both between 0 and `Q_max`.
    pub(crate) fn flows(&self, h: &[D; 3]) -> Flows<D> {
        let [_, s_p, mu_13, mu_32, mu_20, g, q_max, _, f_1, f_2, e_1, e_2, ..] = self.parameters;
        let within = |flow: D| {
            if flow < D::zero() {
                D::zero()
            } else if flow > q_max {
                q_max
            } else {
                flow
            }
        };
        let pump = |k: usize, loss: D, fault: D| {
            let flow = within(self.command[k]);
            if self.faulty[k] { within(flow * (D::one() - loss) + fault) } else { flow }
        };
        let pipe = |mu: D, drop: D| mu * s_p * (g * drop * 2.0).root();
        let [q_1, q_2] = [pump(0, e_1, f_1), pump(1, e_2, f_2)];
        let q_13 = pipe(mu_13, h[0] - h[2]);
        let q_32 = pipe(mu_32, h[2] - h[1]);
        let q_20 = pipe(mu_20, h[1]);
        let net = [q_1 - q_13, q_2 + q_32 - q_20, q_13 - q_32];
        Flows { pumps: [q_1, q_2], pipes: [q_13, q_32, q_20], net }
    }

    /// Returns the derivatives of the levels in m/s; zero for a tank that is `full` and spills.
    pub(crate) fn slope(&self, h: &[D; 3], full: [bool; 3]) -> [D; 3] {
        let [area, ..] = self.parameters;
        let net = self.flows(h).net;
        std::array::from_fn(|i| if full[i] { D::zero() } else { net[i] / area })
    }
}
