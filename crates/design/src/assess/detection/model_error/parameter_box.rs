//! Searches the largest value of a function of parameters within their limits, at corners and in the interior.

use std::cell::RefCell;

/// Largest number of parameters with which all corners are tried.
const ALL_CORNERS: usize = 6;
/// With more than [`ALL_CORNERS`] parameters: largest number of rounds, in which each moves to its worse limit.
const ROUNDS: usize = 10;
/// The steps of the search around the largest value, as parts of the distance from the centre to a limit.
const STEPS: [f64; 4] = [0.5, 0.25, 0.125, 0.0625];

/// The largest values that were found in the box of deviations -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LargestValue {
    /// Largest value at the corners, the centre and the centres of faces.
    pub(super) corners: f64,
    /// Largest value at all points that were tried.
    pub(super) everywhere: f64,
}

/// Searches the largest value of a function of `count` deviations.
///
/// Up to six parameters it tries the centre, the centres of the faces and all corners; with more it starts at the
/// centre and moves one parameter after the other to a limit. Then it tries the points `random` of the interior, and
/// searches along the axes from the point with the largest value. The result is a lower bound of the largest value,
/// because values between these points are unknown.
///
/// # Errors
///
/// The first error of `value`.
pub(super) fn largest<E>(
    count: usize,
    random: &[Vec<f64>],
    value: impl Fn(&[f64]) -> Result<f64, E>,
) -> Result<LargestValue, E> {
    let best = RefCell::new((f64::NEG_INFINITY, vec![0.0; count]));
    // Tries a point; returns whether its value is the largest.
    let improves = |at: Vec<f64>| {
        let height = value(&at)?;
        let mut best = best.borrow_mut();
        let is_largest = height > best.0;
        if is_largest {
            *best = (height, at);
        }
        Ok(is_largest)
    };
    improves(vec![0.0; count])?;
    if count <= ALL_CORNERS {
        for axis in 0..count {
            for end in [-1.0, 1.0] {
                let mut face = vec![0.0; count];
                face[axis] = end;
                improves(face)?;
            }
        }
        for corner in 0..1_u32 << count {
            let sign = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            improves((0..count).map(sign).collect())?;
        }
    } else {
        for _ in 0..ROUNDS {
            let mut is_improved = false;
            for (axis, end) in (0..count).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
                let mut other = best.borrow().1.clone();
                other[axis] = end;
                is_improved |= improves(other)?;
            }
            if !is_improved {
                break;
            }
        }
    }
    let corners = best.borrow().0;
    for case in random {
        improves(case.clone())?;
    }
    for step in STEPS {
        for (axis, step) in (0..count).flat_map(|axis| [(axis, -step), (axis, step)]) {
            let mut other = best.borrow().1.clone();
            other[axis] = (other[axis] + step).clamp(-1.0, 1.0);
            improves(other)?;
        }
    }
    Ok(LargestValue { corners, everywhere: best.into_inner().0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    type Found = Result<LargestValue, control::Error>;

    #[test]
    fn a_maximum_between_the_corners_is_found_and_told_from_the_corners() {
        // 2 at (0.3, -0.6), less along both axes; at the corner (1, -1) it is 1.35.
        let hill = |at: &[f64]| Ok(2.0 - (at[0] - 0.3).powi(2) - (at[1] + 0.6).powi(2));
        let outcome: Found = largest(2, &[], hill);
        let largest_value = outcome.unwrap();
        assert!(
            largest_value.everywhere > 1.99 && largest_value.everywhere <= 2.0,
            "{largest_value:?}"
        );
        // The centre of a face, (0, -1), is above all corners: 2 - 0.09 - 0.16.
        assert!((largest_value.corners - 1.75).abs() < 1e-12, "{largest_value:?}");
    }

    #[test]
    fn a_narrow_maximum_is_found_by_a_random_case_alone() {
        let narrow =
            |at: &[f64]| Ok(at[0] + 10.0 * f64::from(u8::from((at[0] - 0.3).abs() < 1e-3)));
        let outcome: Found = largest(1, &[vec![-0.8], vec![0.3005]], narrow);
        assert_eq!(outcome.unwrap(), LargestValue { corners: 1.0, everywhere: 10.3005 });
        let outcome: Found = largest(1, &[vec![-0.8]], narrow);
        assert_eq!(outcome.unwrap(), LargestValue { corners: 1.0, everywhere: 1.0 });
    }

    #[test]
    fn a_linear_function_of_eight_parameters_is_largest_at_a_corner() {
        let slopes = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0, -8.0];
        let linear = |at: &[f64]| Ok(at.iter().zip(slopes).map(|(at, slope)| at * slope).sum());
        let outcome: Found = largest(8, &[vec![0.5; 8]], linear);
        assert_eq!(outcome.unwrap(), LargestValue { corners: 36.0, everywhere: 36.0 });
    }
}
