//! The plane in which eigenvalues lie, and what they say there.

use nalgebra::Complex;

use crate::design::report::{Loop, Report};

/// The s-plane of a continuous loop, or the z-plane of one that is sampled with this period in s.
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

    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Continuous => " (1/s)",
            Self::Sampled(_) => " (z-plane)",
        }
    }

    pub(super) fn is_stable(self, pole: [f64; 2]) -> bool {
        match self {
            Self::Continuous => pole[0] < 0.0,
            Self::Sampled(_) => pole[0].hypot(pole[1]) < 1.0,
        }
    }

    /// The eigenvalue of the continuous system whose samples move like that, 1/s.
    pub(super) fn rate(self, [re, im]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Continuous => [re, im],
            Self::Sampled(period) => [re.hypot(im).ln() / period, im.atan2(re) / period],
        }
    }

    /// Where an eigenvalue of a continuous system comes to lie.
    pub(super) fn place(self, [re, im]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Continuous => [re, im],
            Self::Sampled(period) => {
                let z = (Complex::new(re, im) * period).exp();
                [z.re, z.im]
            }
        }
    }
}

impl Loop {
    /// The real part, 1/s, of the slowest eigenvalue.
    pub(super) fn slowest(&self, plane: Plane) -> Option<f64> {
        self.eigenvalues.iter().map(|pole| plane.rate(*pole)[0]).max_by(f64::total_cmp)
    }

    pub(super) fn is_stable(&self, plane: Plane) -> bool {
        self.eigenvalues.iter().all(|pole| plane.is_stable(*pole))
    }

    /// Each wanted eigenvalue beside the nearest reached one that is left, then the reached ones
    /// that were not asked for.
    pub(super) fn pairs(&self) -> Vec<(Option<[f64; 2]>, Option<[f64; 2]>)> {
        let mut left = self.eigenvalues.clone();
        let mut pairs = Vec::new();
        for wanted in &self.wanted {
            let distance = |pole: &[f64; 2]| (pole[0] - wanted[0]).hypot(pole[1] - wanted[1]);
            let nearest =
                (0..left.len()).min_by(|a, b| distance(&left[*a]).total_cmp(&distance(&left[*b])));
            pairs.push((Some(*wanted), nearest.map(|index| left.remove(index))));
        }
        pairs.extend(left.into_iter().map(|pole| (None, Some(pole))));
        pairs
    }
}
