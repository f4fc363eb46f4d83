//! The s-plane or z-plane of the eigenvalues.

use design_report::{Loop, Plant, Report};

/// An eigenvalue: real and imaginary part.
pub(super) type Pole = [f64; 2];

/// The s-plane of a continuous loop, or the z-plane of a loop sampled with this period in s.
#[derive(Clone, Copy)]
pub(super) enum Plane {
    Continuous,
    Sampled(f64),
}

impl Plane {
    pub(super) fn of(report: &Report) -> Self {
        let sampled = report.sampling.as_ref();
        sampled.map_or(Self::Continuous, |sampled| Self::Sampled(sampled.sample_time))
    }

    /// The plane of the eigenvalues of the plant.
    pub(super) fn of_plant(plant: &Plant) -> Self {
        plant.sample_time.map_or(Self::Continuous, Self::Sampled)
    }

    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Continuous => " (1/s)",
            Self::Sampled(_) => " (z-plane)",
        }
    }

    pub(super) fn is_stable(self, pole: Pole) -> bool {
        match self {
            Self::Continuous => pole[0] < 0.0,
            Self::Sampled(_) => pole[0].hypot(pole[1]) < 1.0,
        }
    }

    /// Returns the eigenvalue of the equivalent continuous system, 1/s: ln z / T in the z-plane.
    pub(super) fn rate(self, [re, im]: Pole) -> Pole {
        match self {
            Self::Continuous => [re, im],
            Self::Sampled(period) => [re.hypot(im).ln() / period, im.atan2(re) / period],
        }
    }

    /// Maps an eigenvalue of a continuous system into this plane.
    pub(super) fn place(self, [re, im]: Pole) -> Pole {
        match self {
            Self::Continuous => [re, im],
            Self::Sampled(period) => {
                let (length, angle) = ((re * period).exp(), im * period);
                [length * angle.cos(), length * angle.sin()]
            }
        }
    }

    /// Returns the real part of the slowest eigenvalue of a loop, 1/s; `None` without eigenvalues.
    pub(super) fn slowest(self, system: &Loop) -> Option<f64> {
        system.eigenvalues.iter().map(|pole| self.rate(*pole)[0]).max_by(f64::total_cmp)
    }
}

/// A required eigenvalue and an actual one; one of them may be missing.
type Pair = (Option<Pole>, Option<Pole>);

/// Pairs each required eigenvalue of a loop with the nearest remaining actual one, then lists the actual eigenvalues
/// that remain.
pub(super) fn pairs(system: &Loop) -> Vec<Pair> {
    let mut remaining = system.eigenvalues.clone();
    let mut pairs = Vec::new();
    for required in &system.required {
        let distance = |pole: &Pole| (pole[0] - required[0]).hypot(pole[1] - required[1]);
        let nearest = (0..remaining.len())
            .min_by(|a, b| distance(&remaining[*a]).total_cmp(&distance(&remaining[*b])));
        pairs.push((Some(*required), nearest.map(|index| remaining.remove(index))));
    }
    pairs.extend(remaining.into_iter().map(|pole| (None, Some(pole))));
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_to_the_z_plane_is_inverted() {
        let plane = Plane::Sampled(0.01);
        for pole in [[-3.0, 4.0], [-300.0, -200.0], [0.0, 0.0], [2.0, 1.0]] {
            let back = plane.rate(plane.place(pole));
            assert!((back[0] - pole[0]).hypot(back[1] - pole[1]) < 1e-9, "{pole:?}: {back:?}");
            assert_eq!(plane.is_stable(plane.place(pole)), pole[0] < 0.0);
        }
    }

    #[test]
    fn each_required_eigenvalue_is_paired_with_the_nearest_reached_one() {
        let system = Loop {
            matrix: String::new(),
            method: String::new(),
            required: vec![[-1.0, 2.0], [-1.0, -2.0], [-5.0, 0.0]],
            wanted: Vec::new(),
            eigenvalues: vec![[-5.1, 0.0], [-1.1, -2.0], [-9.0, 0.0], [-1.1, 2.0]],
            condition: Some(1.0),
            balanced_condition: Some(1.0),
            pole_error: None,
            region: None,
            norm: None,
        };
        let expected = [
            (Some([-1.0, 2.0]), Some([-1.1, 2.0])),
            (Some([-1.0, -2.0]), Some([-1.1, -2.0])),
            (Some([-5.0, 0.0]), Some([-5.1, 0.0])),
            (None, Some([-9.0, 0.0])),
        ];
        assert_eq!(pairs(&system), expected);
    }
}
