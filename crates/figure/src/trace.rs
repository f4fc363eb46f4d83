//! Reduces a long series to a short SVG path with the same appearance.

use super::axis::Axis;

/// Returns the SVG path of a series, with a resolution of 0.1 page unit; empty without points.
///
/// Points outside of the range of `horizontal` are left out, and values that are not finite leave a gap. Of the points
/// in a column of one unit, the first, lowest, highest and last are kept, so that no spike is lost and the width
/// of the page bounds the length of the path. Takes time proportional to the number of points.
#[must_use]
pub(crate) fn path(time: &[f64], values: &[f64], horizontal: &Axis, vertical: &Axis) -> String {
    let place = |value: f64| if value.is_finite() { vertical.place(value) } else { f64::NAN };
    let points: Vec<(f64, f64)> = time
        .iter()
        .zip(values)
        .filter(|(time, _)| horizontal.contains(**time))
        .map(|(time, value)| (horizontal.place(*time), place(*value)))
        .collect();
    points
        .split(|point| point.1.is_nan())
        .filter(|run| !run.is_empty())
        .map(|run| stroke(&decimate(run)))
        .collect()
}

/// Keeps the first, lowest, highest and last point of each column in a run of points without gaps.
fn decimate(run: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for column in run.chunk_by(|a, b| (a.0.floor() - b.0.floor()).abs() < 0.5) {
        let by_height = |a: &usize, b: &usize| column[*a].1.total_cmp(&column[*b].1);
        let lowest = (0..column.len()).min_by(by_height).unwrap_or(0);
        let highest = (0..column.len()).max_by(by_height).unwrap_or(0);
        let mut indices = [0, lowest, highest, column.len() - 1];
        indices.sort_unstable();
        for (place, index) in indices.iter().enumerate() {
            if place == 0 || indices[place - 1] != *index {
                points.push(column[*index]);
            }
        }
    }
    points
}

/// Formats one stroke. The first point occurs twice, so that a single point is drawn as a dot.
fn stroke(points: &[(f64, f64)]) -> String {
    let write = |point: &(f64, f64)| format!("{:.1} {:.1}", point.0, point.1);
    let texts: Vec<String> = points.iter().take(1).chain(points).map(write).collect();
    format!("M{}", texts.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> (Axis, Axis) {
        (Axis::exact(0.0, 100.0, (0.0, 900.0), 10), Axis::exact(-10.0, 10.0, (200.0, 0.0), 5))
    }

    fn points(path: &str) -> Vec<Vec<(f64, f64)>> {
        let numbers = |stroke: &str| -> Vec<f64> {
            stroke.split(' ').map(|number| number.parse().unwrap()).collect()
        };
        path.split('M')
            .skip(1)
            .map(|stroke| numbers(stroke).chunks(2).map(|pair| (pair[0], pair[1])).collect())
            .collect()
    }

    #[test]
    fn spikes_of_one_sample_survive_decimation_at_their_place_and_height() {
        let (horizontal, vertical) = axes();
        let time: Vec<f64> = (0..=1_000_000).map(|i| f64::from(i) * 1e-4).collect();
        let mut values: Vec<f64> = time.iter().map(|t| t.sin()).collect();
        let spikes = [(123_457, 9.0), (500_003, -8.0), (999_999, 7.0), (0, -6.0)];
        for (index, height) in spikes {
            values[index] = height;
        }
        let path = path(&time, &values, &horizontal, &vertical);
        let drawn = points(&path).concat();
        assert!(drawn.len() <= 4 * 901 + 1, "{} points", drawn.len());
        assert!(path.len() < 50_000, "{} bytes", path.len());
        for (index, height) in spikes {
            let (x, y) = (9.0 * time[index], 100.0 - 10.0 * height);
            let seen =
                drawn.iter().any(|point| (point.0 - x).abs() < 0.06 && (point.1 - y).abs() < 0.06);
            assert!(seen, "spike {height} at {}", time[index]);
        }
        assert!(drawn.is_sorted_by(|a, b| a.0 <= b.0));
    }

    #[test]
    fn the_envelope_of_every_column_is_that_of_the_samples() {
        let (horizontal, vertical) = axes();
        let time: Vec<f64> = (0..200_000).map(|i| f64::from(i) * 5e-4).collect();
        let values: Vec<f64> = time.iter().map(|t| 5.0 * (700.0 * t * t).sin()).collect();
        let drawn = points(&path(&time, &values, &horizontal, &vertical)).concat();
        let top = |pairs: &mut dyn Iterator<Item = (f64, f64)>, column: f64| {
            pairs
                .filter(|(x, _)| (column + 0.1..column + 0.9).contains(x))
                .fold(f64::INFINITY, |low, (_, y)| low.min(y))
        };
        for column in [0.0, 17.0, 450.0, 899.0] {
            let mut all = time.iter().zip(&values).map(|(t, v)| (9.0 * t, 100.0 - 10.0 * v));
            let expected = top(&mut all, column);
            let actual = top(&mut drawn.iter().copied(), column);
            assert!((actual - expected).abs() < 0.5, "column {column}: {actual}, {expected}");
        }
    }

    #[test]
    fn values_that_are_not_finite_are_gaps_and_huge_ones_stay_near_the_page() {
        let (horizontal, vertical) = axes();
        let time = [0.0, 10.0, 20.0, 30.0, 40.0, f64::NAN, 60.0];
        let values = [1.0, 2.0, f64::NAN, 3.0, f64::INFINITY, 1.0, -1e300];
        let strokes = points(&path(&time, &values, &horizontal, &vertical));
        let shape: Vec<usize> = strokes.iter().map(Vec::len).collect();
        assert_eq!(shape, [3, 2, 2], "each stroke names its first point twice");
        assert!(strokes.concat().iter().all(|point| (-200.0..=400.0).contains(&point.1)));
    }

    #[test]
    fn a_window_shows_only_its_own_samples() {
        let horizontal = Axis::exact(50.0, 60.0, (0.0, 900.0), 10);
        let time: Vec<f64> = (0..=100).map(f64::from).collect();
        let drawn = points(&path(&time, &[0.0; 101], &horizontal, &axes().1)).concat();
        assert_eq!(drawn.len(), 11 + 1);
    }
}
