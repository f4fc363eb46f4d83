//! What becomes of a value between an output and an input (SSP 1.0, section 4.5.4).

/// A change of values on a connection.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Transformation {
    /// None.
    #[default]
    Identity,
    /// `target = factor source + offset`, of Reals. An Integer source is taken as a Real.
    Linear {
        /// The factor.
        factor: f64,
        /// The offset, in the unit of the target.
        offset: f64,
    },
    /// Source and target of each pair, of Integers or of the numbers of enumerations.
    Integer(Vec<(i32, i32)>),
    /// `false` and `true` become these.
    Boolean {
        /// What becomes of `false`.
        from_false: bool,
        /// What becomes of `true`.
        from_true: bool,
    },
}
