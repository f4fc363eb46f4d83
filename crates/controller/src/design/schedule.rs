//! The table `[schedule]`.

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// The table `[schedule]` of a design file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// The name of a measurement, or of an input of its own.
    pub variable: String,
    /// The unit of that input.
    #[serde(default)]
    pub unit: Option<String>,
    /// What that input is.
    #[serde(default)]
    pub description: String,
    /// The grid, in ascending order.
    pub points: Vec<Point>,
}

/// The matrices and the operating point at a value of the scheduling variable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// The value.
    pub at: f64,
    /// The states at the operating point.
    pub x_op: Vec<f64>,
    /// The commands at the operating point.
    pub u_op: Vec<f64>,
    /// The measurements at the operating point.
    pub y_op: Vec<f64>,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "A")]
    pub a: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "B")]
    pub b: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "C")]
    pub c: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "F_a")]
    pub f_a: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "K_x")]
    pub k_x: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "K_f")]
    pub k_f: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "L_x")]
    pub l_x: Matrix,
    /// In place of the matrix of this name of the design.
    #[serde(rename = "L_f")]
    pub l_f: Matrix,
    /// In place of the matrix of this name of the design, if it has one.
    #[serde(rename = "P_f", default)]
    pub p_f: Option<Matrix>,
    /// In place of the matrix of this name of the design, if it has one.
    #[serde(rename = "K_i", default)]
    pub k_i: Option<Matrix>,
    /// In place of the matrix of this name of the design, if it has one.
    #[serde(rename = "L_w", default)]
    pub l_w: Option<Matrix>,
    /// In place of the matrix of this name of the design, if it has one.
    #[serde(rename = "N_r", default)]
    pub n_r: Option<Matrix>,
    /// The references at the operating point; empty without references.
    #[serde(default)]
    pub r_op: Vec<f64>,
}

impl Point {
    /// The matrices, in the order of [`super::Design::scheduled_mut`].
    pub fn matrices(&self) -> impl Iterator<Item = (&'static str, &Matrix)> {
        super::named_matrices! { self: "P_f" p_f, "K_i" k_i, "L_w" l_w, "N_r" n_r }
    }
}
