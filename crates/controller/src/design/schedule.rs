//! The table `[schedule]` of a design file: matrices and operating points at the points of a grid.

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// The table `[schedule]` of a design file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// The name of the scheduling variable: a measurement, or a separate input.
    pub variable: String,
    /// The unit of the input.
    pub unit: Option<String>,
    /// What the input is, for a reader.
    #[serde(default)]
    pub description: String,
    /// The points of the grid, at least two, in ascending order.
    pub points: Vec<Point>,
}

/// The matrices and the operating point at one value of the scheduling variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// The value of the scheduling variable.
    pub at: f64,
    /// The states at the operating point.
    pub x_op: Vec<f64>,
    /// The commands at the operating point.
    pub u_op: Vec<f64>,
    /// The measurements at the operating point.
    pub y_op: Vec<f64>,
    /// A at this value.
    #[serde(rename = "A")]
    pub a: Matrix,
    /// B at this value.
    #[serde(rename = "B")]
    pub b: Matrix,
    /// C at this value.
    #[serde(rename = "C")]
    pub c: Matrix,
    /// F_a at this value.
    #[serde(rename = "F_a")]
    pub f_a: Matrix,
    /// K_x at this value.
    #[serde(rename = "K_x")]
    pub k_x: Matrix,
    /// K_f at this value.
    #[serde(rename = "K_f")]
    pub k_f: Matrix,
    /// L_x at this value.
    #[serde(rename = "L_x")]
    pub l_x: Matrix,
    /// L_f at this value.
    #[serde(rename = "L_f")]
    pub l_f: Matrix,
    /// P_f at this value, if the design states one.
    #[serde(rename = "P_f")]
    pub p_f: Option<Matrix>,
    /// K_i at this value, if the design states one.
    #[serde(rename = "K_i")]
    pub k_i: Option<Matrix>,
    /// L_w at this value, if the design states one.
    #[serde(rename = "L_w")]
    pub l_w: Option<Matrix>,
    /// N_r at this value, if the design states one.
    #[serde(rename = "N_r")]
    pub n_r: Option<Matrix>,
    /// The references at the operating point; empty without references.
    #[serde(default)]
    pub r_op: Vec<f64>,
}

impl Point {
    /// The values of the operating point: states, commands, measurements, references.
    pub(crate) fn operating(&self) -> impl Iterator<Item = &f64> {
        [&self.x_op, &self.u_op, &self.y_op, &self.r_op].into_iter().flatten()
    }

    /// The matrices, in the order of [`super::Design::scheduled_mut`].
    pub fn matrices(&self) -> impl Iterator<Item = (&'static str, &Matrix)> {
        super::named_matrices! { self: "P_f" p_f, "K_i" k_i, "L_w" l_w, "N_r" n_r }
    }
}
