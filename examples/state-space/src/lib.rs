//! A linear system of any order, der(x) = A x + B u, y = C x + D u: arrays whose extents the importer
//! chooses in FMI 3.0 by the structural parameters n, m and p.
#![forbid(unsafe_code)]

use fmu::{About, Failure, Model, ModelExchange, Variable as V};

/// Largest number of states, of inputs and of outputs.
const LARGEST: f64 = 100.0;

/// The model. Matrices are stored row by row.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct StateSpace {
    n: u64,
    m: u64,
    p: u64,
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    d: Vec<f64>,
    u: Vec<f64>,
    x: Vec<f64>,
    rates: Vec<f64>,
    y: Vec<f64>,
}

impl Model for StateSpace {
    const IDENTIFIER: &'static str = "StateSpace";

    fn about(&self) -> About {
        fmu::about!(stop_time: 10.0, step_size: 0.01)
    }

    /// The oscillator x1' = x2, x2' = u - x1, y = x1.
    fn new(_: &std::path::Path) -> Result<Self, Failure> {
        let (a, b, c) = (vec![0.0, 1.0, -1.0, 0.0], vec![0.0, 1.0], vec![1.0, 0.0]);
        let (x, zero) = (vec![1.0, 0.0], || vec![0.0]);
        let (d, u, y, rates) = (zero(), zero(), zero(), vec![0.0; 2]);
        Ok(Self { n: 2, m: 1, p: 1, a, b, c, d, u, x, rates, y })
    }

    fn variables(&self) -> Vec<V<Self>> {
        let [n, m, p] = [&self.x, &self.u, &self.y].map(Vec::len);
        let extent = |variable: V<Self>| variable.tunable().max(LARGEST);
        let mut all = vec![
            extent(V::structural("n", "Number of states", |system: &mut Self| &mut system.n)),
            extent(V::structural("m", "Number of inputs", |system: &mut Self| &mut system.m)),
            extent(V::structural("p", "Number of outputs", |system: &mut Self| &mut system.p)),
        ];
        let matrix = |name,
                      by: [&'static str; 2],
                      extents: [usize; 2],
                      field: fn(&mut Self) -> &mut [f64]| {
            let elements = V::real_array(name, "Coefficients", &extents, field);
            elements.map(move |element| element.tunable().sized_by(&by))
        };
        all.extend(matrix("A", ["n", "n"], [n, n], |system| &mut system.a));
        all.extend(matrix("B", ["n", "m"], [n, m], |system| &mut system.b));
        all.extend(matrix("C", ["p", "n"], [p, n], |system| &mut system.c));
        all.extend(matrix("D", ["p", "m"], [p, m], |system| &mut system.d));
        let u = V::real_array("u", "Inputs", &[m], |system: &mut Self| &mut system.u[..]);
        all.extend(u.map(|element| element.input().sized_by(&["m"])));
        let x = V::real_array("x", "States", &[n], |system: &mut Self| &mut system.x[..]);
        all.extend(x.map(|element| element.exact().sized_by(&["n"])));
        let knowns = names("x", n).chain(names("u", m)).collect::<Vec<_>>();
        let knowns: Vec<_> = knowns.iter().map(String::as_str).collect();
        let y = V::real_array("y", "Outputs", &[p], |system: &mut Self| &mut system.y[..]);
        all.extend(y.map(|element| element.output(&knowns).sized_by(&["p"])));
        let rates =
            V::real_array("der(x)", "Rates", &[n], |system: &mut Self| &mut system.rates[..]);
        all.extend(rates.zip(names("x", n)).map(|(element, state)| {
            let kind = fmu::description::DependencyKind::Dependent;
            let element = element.depends(kind, knowns.iter().copied());
            element.derivative_of(state).sized_by(&["n"])
        }));
        all
    }

    /// Keeps the coefficients and values that fit into the new extents; the others are zero.
    fn resize(&mut self) -> Result<(), Failure> {
        let extent = |extent: u64| usize::try_from(extent).unwrap_or(usize::MAX);
        let old = [&self.x, &self.u, &self.y].map(Vec::len);
        let [n, m, p] = [self.n, self.m, self.p].map(extent);
        let matrices = [
            (&mut self.a, old[0], [n, n]),
            (&mut self.b, old[1], [n, m]),
            (&mut self.c, old[0], [p, n]),
            (&mut self.d, old[1], [p, m]),
        ];
        for (matrix, columns, extents) in matrices {
            *matrix = with_extents(matrix, columns, extents);
        }
        for (vector, extent) in
            [(&mut self.x, n), (&mut self.rates, n), (&mut self.u, m), (&mut self.y, p)]
        {
            vector.resize(extent, 0.0);
        }
        Ok(())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        for (to, of_x, of_u) in
            [(&mut self.rates, &self.a, &self.b), (&mut self.y, &self.c, &self.d)]
        {
            let rows = of_x.chunks_exact(self.x.len()).zip(of_u.chunks_exact(self.u.len()));
            for (to, (by_x, by_u)) in to.iter_mut().zip(rows) {
                *to = product(by_x, &self.x) + product(by_u, &self.u);
            }
        }
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange::default())
    }
}

/// Returns the names of the elements of a vector.
fn names(vector: &str, extent: usize) -> impl Iterator<Item = String> {
    (1..=extent).map(move |k| format!("{vector}[{k}]"))
}

/// Returns the matrix, which has `columns` columns, with other extents, filled with zeros.
fn with_extents(matrix: &[f64], columns: usize, [rows, new_columns]: [usize; 2]) -> Vec<f64> {
    let mut new = vec![0.0; rows * new_columns];
    for (to, from) in new.chunks_exact_mut(new_columns).zip(matrix.chunks_exact(columns)) {
        let common = columns.min(new_columns);
        to[..common].copy_from_slice(&from[..common]);
    }
    new
}

/// Returns the scalar product of two vectors.
fn product(one: &[f64], two: &[f64]) -> f64 {
    one.iter().zip(two).map(|(a, b)| a * b).sum()
}

fmu::export!(StateSpace);
#[cfg(test)]
mod tests;
