//! Partial derivatives and output derivatives (sections 2.2.12 and 4.1.2).

use super::super::Instance;
use crate::model::{Failure, Model};
use crate::room::Room;
use fmu_description::NativeType;

/// The variables of a partial derivative, and the lengths of the vectors of unknowns and knowns.
pub(crate) struct Jacobian<'a> {
    pub(crate) unknowns: &'a [u32],
    pub(crate) knowns: &'a [u32],
    /// Number of elements of all unknowns, stated by the importer.
    pub(crate) unknown_count: usize,
    /// Number of elements of all knowns, stated by the importer.
    pub(crate) known_count: usize,
}

impl<M: Model> Instance<M> {
    /// Finds the places of unknowns and knowns and runs `body` with them.
    pub(crate) fn jacobian(
        &mut self,
        jacobian: &Jacobian<'_>,
        body: impl FnOnce(&mut Self, &[u32], &[u32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut knowns = Vec::new();
        let table = &self.session()?.table;
        table.locate(NativeType::Float64, jacobian.knowns, jacobian.known_count, &mut knowns)?;
        self.located(
            NativeType::Float64,
            jacobian.unknowns,
            jacobian.unknown_count,
            |instance, unknowns| body(instance, unknowns, &knowns),
        )
    }

    /// `fmi3GetAdjointDerivative`: `to = seed^T (dh/dv)` for the unknowns h and the knowns v, by one
    /// directional derivative for each known.
    pub(crate) fn get_adjoint_derivative(
        &mut self,
        unknowns: &[u32],
        seed: &[f64],
        knowns: &[u32],
        to: &mut Room<f64>,
    ) -> Result<(), Failure> {
        Self::provides_derivatives()?;
        for (&known, place) in knowns.iter().zip(to) {
            let (mut sum, mut seed) = (0.0, seed.iter());
            self.directional_derivative(unknowns, &[known], &[1.0], |entry| {
                sum += entry * seed.next().copied().unwrap_or_default();
            })?;
            place.write(sum);
        }
        Ok(())
    }

    /// `fmi3GetOutputDerivatives`. A derivative that the model does not have is 0, up to the highest order of any
    /// output.
    pub(crate) fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        to: &mut Room<f64>,
    ) -> Result<(), Failure> {
        let session = self.session_mut()?;
        let mut expanded = std::mem::take(&mut session.integers);
        expanded.clear();
        for (size, &order) in session.table.sizes(references).zip(orders) {
            expanded.extend((0..size).map(|_| order));
        }
        let result = self.located(NativeType::Float64, references, to.len(), |instance, places| {
            instance.get_real_output_derivatives(places, &expanded, to)
        });
        self.session_mut()?.integers = expanded;
        result
    }
}
