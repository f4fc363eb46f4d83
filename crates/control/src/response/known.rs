//! A stable system whose eigenvalues and frequency response are computed once.

use super::frequency::{Transfer, grid};
use crate::balance::{divide_columns, multiply_rows};
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix, DVector};
use std::collections::HashMap;
use std::f64::consts::PI;

const PER_DECADE: u32 = 60;
/// From this order on, [`KnownResponse::scaled`] reuses the known responses; below, it computes new ones, so that the
/// result has the bits of a new system.
const LARGE: usize = 48;

/// The frequencies of modes, where a response may have peaks: in continuous time imaginary part and modulus.
pub(crate) fn resonances(modes: &[Complex<f64>], domain: Domain) -> Vec<f64> {
    let modes = modes.iter().filter(|mode| mode.im >= 0.0);
    let frequencies = |mode: &Complex<f64>| match domain {
        Domain::Continuous => vec![mode.im.abs(), mode.norm()],
        Domain::Sampled { period } => vec![mode.arg().abs() / period],
    };
    modes.flat_map(frequencies).collect()
}

/// A stable system with its eigenvalues, its Hessenberg form, and its response at frequencies of a sweep.
///
/// Systems that differ by a choice of channels, by the sign of C or by units share eigenvalues, Hessenberg form and
/// responses.
#[derive(Clone)]
pub(crate) struct KnownResponse {
    pub(crate) system: StateSpace,
    /// The eigenvalues of A.
    pub(crate) modes: Vec<Complex<f64>>,
    transfer: Transfer,
    /// Known values of C (s I - A)^-1 B; the key is the bit pattern of the frequency.
    known: HashMap<u64, DMatrix<Complex<f64>>>,
}

impl KnownResponse {
    /// A system without known responses; [`Error::NotHurwitz`] or [`Error::NotSchur`] if it is not stable.
    pub(crate) fn new(system: StateSpace) -> Result<Self, Error> {
        let modes = system.stable_eigenvalues()?;
        let transfer = Transfer::new(&system);
        Ok(Self { system, modes, transfer, known: HashMap::new() })
    }

    /// Computes and stores the responses at all [`Self::frequencies`] and [`Self::resonances`].
    pub(crate) fn swept(mut self) -> Result<Self, Error> {
        for frequency in self.frequencies().into_iter().chain(self.resonances()) {
            let response = self.transfer.without_direct(frequency)?;
            self.known.insert(frequency.to_bits(), response);
        }
        Ok(self)
    }

    /// The frequency response G at one frequency.
    pub(crate) fn gain(&self, frequency: f64) -> Result<DMatrix<Complex<f64>>, Error> {
        match self.known.get(&frequency.to_bits()) {
            Some(response) => self.transfer.with_direct(response.clone()),
            None => self.transfer.gain(frequency),
        }
    }

    /// The [`resonances`] of the eigenvalues.
    pub(crate) fn resonances(&self) -> Vec<f64> {
        resonances(&self.modes, self.system.domain)
    }

    /// The frequencies of a sweep, ascending: zero, 60 for each decade as in [`super::frequency_grid`], and the
    /// resonances; in sampled time none above the Nyquist frequency.
    pub(crate) fn frequencies(&self) -> Vec<f64> {
        let mut all = grid(&self.system, &self.modes, PER_DECADE);
        all.push(0.0);
        all.extend(self.resonances());
        if let Domain::Sampled { period } = self.system.domain {
            all.retain(|frequency| *frequency <= PI / period);
        }
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// The system with another D.
    pub(crate) fn with_direct(mut self, d: DMatrix<f64>) -> Self {
        self.transfer.d.copy_from(&d);
        self.system.d = d;
        self
    }

    /// The system with -C in place of C.
    pub(crate) fn negated(mut self) -> Self {
        self.system.c.neg_mut();
        self.transfer.c.neg_mut();
        self.known.values_mut().for_each(DMatrix::neg_mut);
        self
    }

    /// The system from input `channel` to output `channel`.
    pub(crate) fn channel(&self, channel: usize) -> Self {
        let entry = |(at, gain): (&u64, &DMatrix<Complex<f64>>)| {
            (*at, gain.view((channel, channel), (1, 1)).into())
        };
        Self {
            system: self.system.path(channel, channel),
            modes: self.modes.clone(),
            transfer: self.transfer.channel(channel),
            known: self.known.iter().map(entry).collect(),
        }
    }

    /// The system S G S^-1 with the diagonal S of `units`.
    pub(crate) fn scaled(&self, units: &DVector<f64>) -> Self {
        let StateSpace { a, b, c, d, domain } = &self.system;
        let system = StateSpace {
            a: a.clone(),
            b: divide_columns(b, units),
            c: multiply_rows(c, units),
            d: divide_columns(&multiply_rows(d, units), units),
            domain: *domain,
        };
        let transfer = Transfer::new(&system);
        let mut known = HashMap::new();
        if a.nrows() >= LARGE {
            known.clone_from(&self.known);
            for gain in known.values_mut() {
                for (i, j) in (0..gain.nrows()).flat_map(|i| (0..units.len()).map(move |j| (i, j)))
                {
                    gain[(i, j)] *= units[i] / units[j];
                }
            }
        }
        Self { system, modes: self.modes.clone(), transfer, known }
    }
}
