//! Transformations of values on connections (SSP 1.0, section 4.5.4).

/// A transformation of the values of a connection.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Transformation {
    /// `target = source`.
    #[default]
    Identity,
    /// `target = factor source + offset` for Reals. An Integer source is converted to Real.
    Linear {
        /// The factor.
        factor: f64,
        /// The offset, in the unit of the target.
        offset: f64,
    },
    /// A map of Integers or enumeration values: pairs of source and target. A value without a pair is passed on.
    Integer(Vec<(i32, i32)>),
    /// A map of Booleans.
    Boolean {
        /// The target for the source `false`.
        from_false: bool,
        /// The target for the source `true`.
        from_true: bool,
    },
}
