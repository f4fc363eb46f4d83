//! The table `[schedule]`.

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// The table `[schedule]` of a design file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Schedule {
    /// The name of a measurement, or of an input of its own.
    pub(crate) variable: String,
    #[serde(default)]
    pub(crate) unit: Option<String>,
    #[serde(default)]
    pub(crate) description: String,
    /// The grid, in ascending order.
    pub(crate) points: Vec<Point>,
}

/// The matrices and the operating point at a value of the scheduling variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Point {
    /// The value.
    pub(crate) at: f64,
    pub(crate) x_op: Vec<f64>,
    pub(crate) u_op: Vec<f64>,
    pub(crate) y_op: Vec<f64>,
    #[serde(rename = "A")]
    a: Matrix,
    #[serde(rename = "B")]
    b: Matrix,
    #[serde(rename = "C")]
    c: Matrix,
    #[serde(rename = "F_a")]
    f_a: Matrix,
    #[serde(rename = "K_x")]
    k_x: Matrix,
    #[serde(rename = "K_f")]
    k_f: Matrix,
    #[serde(rename = "L_x")]
    l_x: Matrix,
    #[serde(rename = "L_f")]
    l_f: Matrix,
    #[serde(rename = "P_f", default)]
    p_f: Option<Matrix>,
    #[serde(rename = "K_i", default)]
    k_i: Option<Matrix>,
    #[serde(rename = "L_w", default)]
    l_w: Option<Matrix>,
    #[serde(rename = "N_r", default)]
    n_r: Option<Matrix>,
    /// The references at the operating point; empty without references.
    #[serde(default)]
    pub(crate) r_op: Vec<f64>,
}

impl Point {
    /// The matrices, in the order of [`super::Design::scheduled_mut`].
    pub(crate) fn matrices(&self) -> impl Iterator<Item = (&'static str, &Matrix)> {
        let always = [
            ("A", &self.a),
            ("B", &self.b),
            ("C", &self.c),
            ("F_a", &self.f_a),
            ("K_x", &self.k_x),
            ("K_f", &self.k_f),
            ("L_x", &self.l_x),
            ("L_f", &self.l_f),
        ];
        let stated =
            [("P_f", &self.p_f), ("K_i", &self.k_i), ("L_w", &self.l_w), ("N_r", &self.n_r)];
        let stated = stated.into_iter().filter_map(|(name, own)| Some((name, own.as_ref()?)));
        always.into_iter().chain(stated)
    }
}
