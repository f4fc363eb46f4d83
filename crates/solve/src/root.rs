//! Root finding: the time of a change of sign.

use serde::{Deserialize, Serialize};

/// An interval of time that contains a change of sign; each further value narrows it.
///
/// The sign is defined as for event indicators of FMI: z > 0 or z <= 0. The method is interpolate,
/// truncate and project (ITP; Oliveira and Takahashi 2021, "An enhancement of the bisection method
/// average performance preserving minmax optimality", ACM Trans. Math. Softw. 47, with
/// `kappa_1 = 0.2 / (b - a)`, `kappa_2 = 2`, `n_0 = 1`). It converges superlinearly for a smooth
/// function and needs at most one value more than bisection, `ceil(log2((b - a) / width)) + 1`.
///
/// A NaN has no sign and does not narrow the bracket. The search then bisects between the left end of
/// the bracket and the first NaN and, if it finds no change of sign there, between the last NaN and the
/// right end. If neither part has a change of sign, the bracket remains as wide as the gap of NaN:
/// [`ask`](Self::ask) returns `None`, and the signs at [`before`](Self::before) and
/// [`after`](Self::after) still differ. This takes at most `ceil(log2((b - a) / width))` more values
/// for each part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bracket {
    /// Time and value of the left end.
    left: (f64, f64),
    /// Time and value of the right end.
    right: (f64, f64),
    width: f64,
    /// The size `kappa_1` of the truncation.
    truncation: f64,
    /// Half the widest bracket that bisection can still narrow to `width` with the remaining values.
    radius: f64,
    /// The first and the last time within the bracket with a NaN.
    gap: Option<(f64, f64)>,
}

impl Bracket {
    /// Creates a bracket from two points (time in s, value), to be narrowed to `width` s; `None` if the
    /// signs are equal, a time or value is not finite, or `left` is not before `right`.
    ///
    /// A width that is NaN or below the resolution of double precision is replaced by that resolution.
    #[must_use]
    pub fn new(left: (f64, f64), right: (f64, f64), width: f64) -> Option<Self> {
        let all = [left.0, left.1, right.0, right.1];
        let changes = (left.1 > 0.0) != (right.1 > 0.0);
        if !changes || !all.iter().all(|value| value.is_finite()) || left.0 >= right.0 {
            return None;
        }
        let whole = right.0 - left.0;
        let least = 4.0 * f64::EPSILON * left.0.abs().max(right.0.abs());
        let width = if width > least { width } else { least };
        let halvings = (whole / width).log2().ceil().max(0.0);
        // A power of two, exactly.
        #[expect(clippy::cast_possible_truncation, reason = "below 2100")]
        let radius = width * 2.0_f64.powi(halvings as i32);
        Some(Self { left, right, width, truncation: 0.2 / whole, radius, gap: None })
    }

    /// Returns the time of the next evaluation; `None` if the bracket is narrow enough, or a gap of NaN remains.
    #[must_use]
    pub fn ask(&self) -> Option<f64> {
        let ((a, fa), (b, fb)) = (self.left, self.right);
        if b - a <= self.width {
            return None;
        }
        if let Some((first, last)) = self.gap {
            let sides = [(a, first), (last, b)];
            let side = sides.into_iter().find(|(from, to)| to - from > self.width)?;
            return Some(side.0 + 0.5 * (side.1 - side.0));
        }
        let middle = a + 0.5 * (b - a);
        let secant = a + (b - a) * (fa / (fa - fb));
        let towards = if middle >= secant { 1.0 } else { -1.0 };
        let step = self.truncation * (b - a).powi(2);
        let truncated =
            if step <= (middle - secant).abs() { secant + towards * step } else { middle };
        let room = (self.radius - 0.5 * (b - a)).max(0.0);
        let projected =
            if (truncated - middle).abs() <= room { truncated } else { middle - towards * room };
        let inside = projected > a && projected < b;
        Some(if inside { projected } else { middle })
    }

    /// Narrows the bracket by the value at the time that [`ask`](Self::ask) returned; a NaN widens the gap.
    pub fn tell(&mut self, time: f64, value: f64) {
        if value.is_nan() {
            let (first, last) = self.gap.unwrap_or((time, time));
            self.gap = Some((first.min(time), last.max(time)));
            return;
        }
        self.radius *= 0.5;
        if (value > 0.0) == (self.right.1 > 0.0) {
            self.right = (time, value);
        } else {
            self.left = (time, value);
        }
        let within = |(first, last): &(f64, f64)| *first > self.left.0 && *last < self.right.0;
        self.gap = self.gap.filter(within);
    }

    /// Returns the left end of the bracket, before the change of sign.
    #[must_use]
    pub fn before(&self) -> f64 {
        self.left.0
    }

    /// Returns the right end of the bracket, after the change of sign: the end of a step that handles the event.
    #[must_use]
    pub fn after(&self) -> f64 {
        self.right.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the final bracket and the number of evaluations.
    fn locate(function: impl Fn(f64) -> f64, a: f64, b: f64, width: f64) -> (Bracket, u32) {
        let mut bracket = Bracket::new((a, function(a)), (b, function(b)), width).unwrap();
        let mut count = 0;
        while let Some(time) = bracket.ask() {
            assert!(time > bracket.before() && time < bracket.after());
            bracket.tell(time, function(time));
            count += 1;
        }
        (bracket, count)
    }

    #[test]
    fn roots_known_in_closed_form_lie_in_the_bracket() {
        type Function = fn(f64) -> f64;
        let cases: [(Function, f64, f64, f64); 5] = [
            (|t| t * t - 2.0, 0.0, 2.0, f64::sqrt(2.0)),
            (|t| t.cos(), 1.0, 2.0, std::f64::consts::FRAC_PI_2),
            (|t| (1.0 - 9.81 * 0.5 * t * t).powi(3), 0.0, 1.0, f64::sqrt(2.0 / 9.81)),
            (|t| (t - 1e-9).exp() - 1.0, -1.0, 1.0, 1e-9),
            (|t| if t < 0.3 { 1.0 } else { -5.0 }, 0.0, 1.0, 0.3),
        ];
        for (number, (function, a, b, root)) in cases.into_iter().enumerate() {
            let (actual, _) = locate(function, a, b, 1e-12);
            let range = actual.before() - 1e-15..=actual.after() + 1e-15;
            assert!(range.contains(&root), "{number}: {actual:?}");
            assert!(actual.after() - actual.before() <= 1e-12);
        }
    }

    #[test]
    fn never_more_values_than_bisection_and_one() {
        // ceil(log2(1 / 1e-9)) = 30
        let hard: [fn(f64) -> f64; 4] = [
            |t| if t < 0.7 { 1e-9 } else { -1e9 },
            |t| (t - 0.9).powi(21),
            |t| (0.1 - t).signum(),
            |t| (-50.0 * t).exp() - 1e-15,
        ];
        for function in hard {
            assert!(locate(function, 0.0, 1.0, 1e-9).1 <= 31);
        }
    }

    #[test]
    fn smooth_functions_take_far_fewer() {
        let (_, count) = locate(|t| t * t * t + t - 1.0, 0.0, 1.0, 1e-12);
        assert!(count <= 10, "{count} where bisection takes 40");
    }

    #[test]
    fn a_value_of_zero_is_not_above_zero() {
        // From above to exactly zero is a change, from zero to below is none.
        let actual = Bracket::new((0.0, 1.0), (1.0, 0.0), 1e-3).unwrap();
        assert_eq!(actual.after().to_bits(), 1.0_f64.to_bits());
        assert!(Bracket::new((0.0, 0.0), (1.0, -1.0), 1e-3).is_none());
        assert!(Bracket::new((0.0, 0.0), (1.0, 1.0), 1e-3).is_some());
    }

    #[test]
    fn invalid_brackets_are_refused() {
        assert!(Bracket::new((0.0, 1.0), (1.0, 2.0), 1e-3).is_none());
        assert!(Bracket::new((1.0, 1.0), (0.0, -1.0), 1e-3).is_none());
        assert!(Bracket::new((0.0, f64::NAN), (1.0, 1.0), 1e-3).is_none());
        assert!(Bracket::new((0.0, f64::NEG_INFINITY), (1.0, 1.0), 1e-3).is_none());
    }

    #[test]
    fn a_width_that_doubles_cannot_resolve_ends_too() {
        let (actual, count) = locate(|t| t - 1000.5, 1000.0, 1001.0, 0.0);
        assert!(actual.after() - actual.before() < 1e-12 && count < 60);
    }

    /// Returns a function that is NaN between two times, and otherwise 1 before `root` and -1 after it.
    fn broken(from: f64, to: f64, root: f64) -> impl Fn(f64) -> f64 {
        move |t| {
            let sign = if t < root { 1.0 } else { -1.0 };
            if t > from && t < to { f64::NAN } else { sign }
        }
    }

    #[test]
    fn a_root_beside_a_gap_of_nan_is_found() {
        for (from, to, root) in
            [(0.4, 0.6, 0.3), (0.4, 0.6, 0.7), (0.1, 0.9, 0.95), (0.499, 0.501, 0.4985)]
        {
            let (actual, count) = locate(broken(from, to, root), 0.0, 1.0, 1e-9);
            assert!(actual.before() < root && root <= actual.after(), "{actual:?}");
            assert!(actual.after() - actual.before() <= 1e-9, "{actual:?}");
            assert!(count <= 3 * 31, "{count}");
        }
    }

    #[test]
    fn a_root_within_a_gap_of_nan_is_known_to_the_gap() {
        let function = broken(0.4, 0.6, 0.5);
        let (actual, count) = locate(&function, 0.0, 1.0, 1e-9);
        assert!((actual.before() - 0.4).abs() <= 1e-9, "{actual:?}");
        assert!((actual.after() - 0.6).abs() <= 1e-9, "{actual:?}");
        assert!(function(actual.before()) > 0.0 && function(actual.after()) < 0.0);
        assert!(count <= 3 * 31, "{count}");
    }

    #[test]
    fn values_that_are_all_nan_end_the_search_and_leave_the_bracket() {
        let mut bracket = Bracket::new((0.0, 1.0), (1.0, -1.0), 1e-9).unwrap();
        let mut count = 0;
        while let Some(time) = bracket.ask() {
            bracket.tell(time, f64::NAN);
            count += 1;
        }
        assert!(count <= 2 * 31, "{count}");
        assert_eq!(
            [bracket.before(), bracket.after()].map(f64::to_bits),
            [0.0, 1.0].map(f64::to_bits)
        );
    }
}
