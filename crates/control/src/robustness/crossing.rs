//! The argument at which a function changes its sign.

/// Relative width of the interval at which a search ends.
const WIDTH: f64 = 1e-14;
const STEPS: usize = 160;

#[derive(Clone, Copy)]
pub(super) struct Evaluation {
    pub(super) at: f64,
    pub(super) value: f64,
}

/// Narrows an interval in which a function changes its sign; returns the ends of the interval in the given order.
///
/// `low`, `high`: the ends, with values of different signs; NaN counts as negative. The function need not be
/// continuous. Method: regula falsi in the Illinois variant (M. Dowell and P. Jarratt, BIT 11, 1971); every third step
/// bisects.
pub(super) fn narrow<E>(
    mut low: Evaluation,
    mut high: Evaluation,
    function: impl Fn(f64) -> Result<f64, E>,
) -> Result<(f64, f64), E> {
    let positive = low.value > 0.0;
    let mut before = None;
    for step in 1..=STEPS {
        let width = high.at - low.at;
        let least = WIDTH * low.at.abs().max(high.at.abs());
        if width.abs() <= least {
            break;
        }
        let part = low.value / (low.value - high.value);
        // A least distance from both ends lets the interval close around the crossing.
        let edge = (0.5 * least / width.abs()).min(0.5);
        let finite = [low.value, high.value, part].iter().all(|value| value.is_finite());
        let inside = finite && step % 3 != 0;
        let middle = low.at + width * if inside { part.clamp(edge, 1.0 - edge) } else { 0.5 };
        let value = function(middle)?;
        let replaces_low = (value > 0.0) == positive;
        if replaces_low {
            low = Evaluation { at: middle, value };
            high.value *= if before == Some(true) { 0.5 } else { 1.0 };
        } else {
            high = Evaluation { at: middle, value };
            low.value *= if before == Some(false) { 0.5 } else { 1.0 };
        }
        before = Some(replaces_low);
    }
    Ok((low.at, high.at))
}

/// The argument up to which `instability`, tested at `points`, is negative; None if it is negative at all of them. At
/// `start` it is assumed to be negative.
pub(super) fn stability_limit<E>(
    start: f64,
    points: impl IntoIterator<Item = f64>,
    instability: impl Fn(f64) -> Result<f64, E>,
) -> Result<Option<f64>, E> {
    let mut good = Evaluation { at: start, value: f64::NAN };
    for at in points {
        let value = instability(at)?;
        if value < 0.0 {
            good = Evaluation { at, value };
            continue;
        }
        // Zero and NaN are unstable.
        let bad = Evaluation { at, value: value.max(f64::MIN_POSITIVE) };
        return Ok(Some(narrow(good, bad, instability)?.0));
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    fn crossing(low: f64, high: f64, of: impl Fn(f64) -> f64) -> ((f64, f64), u32) {
        let calls = Cell::new(0);
        let counted = |x: f64| {
            calls.set(calls.get() + 1);
            Ok::<_, ()>(of(x))
        };
        let [low, high] = [low, high].map(|at| Evaluation { at, value: of(at) });
        (narrow(low, high, counted).unwrap(), calls.get())
    }

    #[test]
    fn smooth_functions_need_few_steps_and_steps_are_found_by_bisection() {
        let ((low, high), calls) = crossing(1.0, 1.25, |x| x.powi(3) - 1.5);
        assert!(low.powi(3) <= 1.5 && 1.5 <= high.powi(3) && high - low < 2e-14, "{low} {high}");
        assert!(calls <= 14, "{calls}");
        let ((good, bad), _) = crossing(1.0, 2.0, |x| if x < 1.7 { -1.0 } else { f64::INFINITY });
        assert!(good < 1.7 && 1.7 <= bad && bad - good < 4e-14, "{good} {bad}");
        let ((good, bad), _) = crossing(2.0, 1.0, |x| if x < 1.7 { f64::NAN } else { 1e300 });
        assert!(bad < 1.7 && 1.7 <= good && good - bad < 4e-14, "{good} {bad}");
        // Both ends reach the value zero.
        let ((low, high), _) =
            crossing(0.0, 1.0, |x| if x < 0.3 { 0.0 } else { f64::MIN_POSITIVE });
        assert!(low < 0.3 && 0.3 <= high && high - low < 2e-14, "{low} {high}");
        let ((low, high), _) = crossing(0.0, 1.0, |x| (x - 0.3).powi(9));
        assert!((low - 0.3).abs() < 1e-3 && (high - 0.3).abs() < 1e-3, "{low} {high}");
    }
}
