//! The interval of frequencies in which given scales bound the structured singular value.

use super::hermitian::times;
use super::scales::Scales;
use crate::blocks::{ComplexMatrix, block_2x2, to_complex};
use crate::eigen::complex_eigenvalues;
use crate::response::Transfer;
use crate::{Error, StateSpace};
use nalgebra::Complex;

/// M(s) = C (s I - A)^-1 B + D in continuous time, square, with A balanced.
pub(super) struct Response {
    system: StateSpace,
    transfer: Transfer,
}

/// An open interval of frequencies. It contains zero if `from` is below zero, and infinity if `to` is infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Response {
    pub(super) fn new(system: &StateSpace) -> Self {
        let transfer = Transfer::new(system);
        Self { system: system.balanced(), transfer }
    }

    /// M at s = j w; D at an infinite frequency.
    pub(super) fn at(&self, frequency: f64) -> Result<ComplexMatrix, Error> {
        if frequency.is_infinite() {
            return Ok(to_complex(&self.system.d));
        }
        // M(-j w) is the conjugate.
        let m = self.transfer.gain(frequency.abs())?;
        Ok(if frequency < 0.0 { m.map(|x| x.conj()) } else { m })
    }

    /// The largest interval about `frequency` in which `scales` hold for their bound; None if `scales` do not hold at
    /// `frequency`, or the Hamiltonian matrix does not exist.
    ///
    /// F, see [`super::form::form`], is positive definite at `frequency` and singular only at the imaginary
    /// eigenvalues of a Hamiltonian matrix, so that F is definite up to the first of them on each side. Which
    /// eigenvalues are imaginary need not be decided: if F is positive definite at the imaginary part of an
    /// eigenvalue and between this and the next one, the interval continues.
    pub(super) fn interval(
        &self,
        scales: &Scales,
        frequency: f64,
    ) -> Result<Option<Interval>, Error> {
        let holds =
            |frequency: f64| Ok::<_, Error>(scales.hold(&self.at(frequency)?, scales.bound));
        if !holds(frequency)? {
            return Ok(None);
        }
        let Some(hamiltonian) = self.hamiltonian(scales) else { return Ok(None) };
        let mut candidates: Vec<f64> =
            complex_eigenvalues(&hamiltonian)?.iter().map(|value| value.im).collect();
        candidates.sort_by(f64::total_cmp);
        let above: Vec<f64> = candidates.iter().copied().filter(|w| *w > frequency).collect();
        let below: Vec<f64> =
            candidates.iter().rev().copied().filter(|w| *w <= frequency).collect();
        // The first candidate that is negative, or at or after which the scales do not hold. After each candidate they
        // are tested in the middle between it and the next one, after the last candidate at `last`.
        let end = |candidates: &[f64], last: f64| {
            for (at, &candidate) in candidates.iter().enumerate() {
                let after = candidates.get(at + 1).map_or(last, |next| 0.5 * (candidate + next));
                if candidate < 0.0 || !(holds(candidate)? && holds(after)?) {
                    return Ok(Some(candidate));
                }
            }
            Ok::<_, Error>(None)
        };
        let to = match end(&above, f64::INFINITY)? {
            Some(candidate) => candidate,
            None if holds(f64::INFINITY)? => f64::INFINITY,
            None => f64::MAX,
        };
        let from = end(&below, -1.0)?.unwrap_or(f64::NEG_INFINITY);
        Ok(Some(Interval { from, to }))
    }

    /// The matrix whose imaginary eigenvalues j w are the frequencies at which F is singular:
    ///
    /// ```text
    /// [A + B W S*, B W B*; -(Q + S W S*), -(A + B W S*)*],
    /// Q = C' D C,  S = C' (D M_oo - j G),  W = (F at infinite frequency)^-1
    /// ```
    ///
    /// `M_oo` is M at infinite frequency. None if F is singular there, or an entry is not finite.
    fn hamiltonian(&self, scales: &Scales) -> Option<ComplexMatrix> {
        let [a, b, c, direct] =
            [&self.system.a, &self.system.b, &self.system.c, &self.system.d].map(to_complex);
        let Scales { d, g, bound } = scales;
        // Scales may be multiplied by any number; a size of about 1 / bound gives blocks of similar size.
        let size = d.diagonal().iter().map(|x| x.re).fold(0.0, f64::max) * bound;
        let (d, g) = (d.unscale(size), g.unscale(size));
        let weight = super::form::form(&direct, &d, &g, *bound).try_inverse()?;
        let ct = c.adjoint();
        let cross = times(&ct, &(times(&d, &direct) - g.map(|x| x * Complex::i())));
        let through = times(&times(&b, &weight), &cross.adjoint());
        let dynamics = a + &through;
        let mut upper = times(&times(&b, &weight), &b.adjoint());
        let mut lower =
            -(times(&times(&ct, &d), &c) + times(&times(&cross, &weight), &cross.adjoint()));
        let ratio = (lower.norm() / upper.norm()).sqrt();
        if ratio.is_normal() {
            upper.scale_mut(ratio);
            lower.unscale_mut(ratio);
        }
        let whole = block_2x2([&dynamics, &upper], [&lower, &-dynamics.adjoint()]);
        whole.iter().all(|x| x.is_finite()).then_some(whole)
    }
}
