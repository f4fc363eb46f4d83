//! Directional derivatives and output derivatives of variables that may be elements of arrays.

use std::collections::HashMap;

use super::Instance;
use super::unknown;
use crate::library::v3::InputElement;
use slave::CallError;

/// The whole variables to which the elements of a list belong.
struct Whole {
    /// Value references of the variables, in the FMU.
    references: Vec<u32>,
    /// Number of all elements of the variables.
    count: usize,
    /// For each value of the list, its position among all elements of the variables.
    places: Vec<usize>,
}

impl Instance {
    /// Returns whether all references are value references of scalars in the FMU.
    fn are_scalars(&self, list: &[u32]) -> bool {
        list.iter().all(|reference| {
            let place = self.view.locate(*reference);
            place.is_some_and(|(position, _)| {
                let variable = &self.view.variables[position];
                variable.reference == *reference && variable.size == 1
            })
        })
    }

    /// Returns the whole variables to which the elements of a list belong; an error if no variable has a reference.
    fn whole(&self, function: &'static str, list: &[u32]) -> Result<Whole, CallError> {
        let mut whole = Whole { references: Vec::new(), count: 0, places: Vec::new() };
        let mut known: HashMap<usize, usize> = HashMap::new();
        for &reference in list {
            let (number, element) =
                self.view.locate(reference).ok_or_else(|| unknown(function, reference))?;
            let variable = &self.view.variables[number];
            let first = *known.entry(number).or_insert_with(|| {
                let first = whole.count;
                whole.references.push(variable.reference);
                whole.count += variable.size;
                first
            });
            whole.places.push(first + element);
        }
        Ok(whole)
    }

    /// Sets `changes` to `(dh/dv) seed` for the unknowns h and the knowns v. The seed of elements of an array that are
    /// not in `knowns` is 0.
    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetDirectionalDerivative";
        if self.are_scalars(unknowns) && self.are_scalars(knowns) {
            return self.component.directional_derivative(unknowns, knowns, seed, changes);
        }
        let (unknowns, knowns) = (self.whole(NAME, unknowns)?, self.whole(NAME, knowns)?);
        let (mut seeds, mut derivatives) = (vec![0.0; knowns.count], vec![0.0; unknowns.count]);
        for (place, value) in knowns.places.iter().zip(seed) {
            seeds[*place] += value;
        }
        let (rows, columns) = (&unknowns.references, &knowns.references);
        self.component.directional_derivative(rows, columns, &seeds, &mut derivatives)?;
        for (change, place) in changes.iter_mut().zip(&unknowns.places) {
            *change = derivatives[*place];
        }
        Ok(())
    }

    /// Sets the derivatives of inputs for the next step, which starts with the present values of these inputs. An input
    /// that the FMU does not request within a step is held constant.
    pub(crate) fn set_input_derivatives(
        &mut self,
        list: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        let (view, time) = (&self.view, self.state.time);
        let locate = |input| {
            let (number, element) = view.locate(input)?;
            let variable = &view.variables[number];
            let (reference, size) = (variable.reference, variable.size);
            variable.intermediate.then_some(InputElement { reference, size, element })
        };
        self.component.set_input_derivatives(list, orders, values, time, locate)
    }

    /// Reads derivatives of outputs with respect to time.
    pub(crate) fn get_output_derivatives(
        &mut self,
        list: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetOutputDerivatives";
        if self.are_scalars(list) {
            return self.component.get_output_derivatives(list, orders, values);
        }
        // One call for each sequence of equal orders.
        let mut start = 0;
        for equal in orders.chunk_by(i32::eq) {
            let end = start + equal.len();
            let whole = self.whole(NAME, &list[start..end])?;
            let mut derivatives = vec![0.0; whole.count];
            let orders = vec![equal[0]; whole.references.len()];
            self.component.get_output_derivatives(&whole.references, &orders, &mut derivatives)?;
            for (value, place) in values[start..end].iter_mut().zip(&whole.places) {
                *value = derivatives[*place];
            }
            start = end;
        }
        Ok(())
    }
}
