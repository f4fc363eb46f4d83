//! The boundary of a required region of eigenvalues.

use std::f64::consts::PI;

use super::plane::Plane;
use design_report::Region;

/// Number of points that draw a part of the boundary.
const STEPS: u16 = 400;

/// Returns points of `plane` along the boundary of each part of the region (decay, disc, each side of the sector),
/// densest near the real axis. Points beyond the largest frequency of the plane are NaN: 1e9 rad/s, or half the sample
/// rate.
pub(super) fn boundary(region: &Region, plane: Plane) -> Vec<Vec<(f64, f64)>> {
    let mut parts = Vec::new();
    let both_sides = |share: f64| (2.0 * share - 1.0).powi(3);
    if let Some(decay) = region.decay {
        parts.push(along(plane, |share| [-decay, far(plane) * both_sides(share)]));
    }
    if let Some((center, radius)) = region.disc_center.zip(region.disc_radius) {
        parts.push(along(plane, |share| {
            let (sine, cosine) = (PI * both_sides(share)).sin_cos();
            [center + radius * cosine, radius * sine]
        }));
    }
    if let Some(degrees) = region.sector {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        for side in [1.0, -1.0] {
            parts.push(along(plane, |share| {
                let size = far(plane) / sine * 10_f64.powf(12.0 * (share - 1.0));
                [-size * cosine, side * size * sine]
            }));
        }
    }
    parts
}

/// Returns the largest frequency of a plane in rad/s: beyond all frequencies of interest, or half the sample rate.
fn far(plane: Plane) -> f64 {
    match plane {
        Plane::Continuous => 1e9,
        Plane::Sampled(period) => PI / period,
    }
}

/// Returns the points of `point(share)` for shares from 0 to 1, mapped into `plane`.
fn along(plane: Plane, point: impl Fn(f64) -> [f64; 2]) -> Vec<(f64, f64)> {
    (0..=STEPS)
        .map(|step| {
            let [re, im] = point(f64::from(step) / f64::from(STEPS));
            if im.abs() > 1.000_001 * far(plane) {
                return (f64::NAN, f64::NAN);
            }
            let [x, y] = plane.place([re, im]);
            (x, y)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boundaries_have_the_decay_the_distance_and_the_angle_required_in_both_planes() {
        let region = Region {
            decay: Some(3.0),
            disc_center: Some(-40.0),
            disc_radius: Some(30.0),
            sector: Some(60.0),
        };
        for plane in [Plane::Continuous, Plane::Sampled(0.01)] {
            let parts = boundary(&region, plane);
            assert_eq!(parts.len(), 4);
            for (index, points) in parts.iter().enumerate() {
                let drawn = points.iter().filter(|point| point.0.is_finite());
                assert!(drawn.clone().count() > 300);
                for [re, im] in drawn.map(|(x, y)| plane.rate([*x, *y])) {
                    let error = match index {
                        0 => re + 3.0,
                        1 => (re + 40.0).hypot(im) / 30.0 - 1.0,
                        _ => (im.abs() + 3.0_f64.sqrt() * re) / (re.hypot(im) + 1e-3),
                    };
                    assert!(error.abs() < 1e-6, "part {index}: {re} {im}");
                }
            }
        }
    }
}
