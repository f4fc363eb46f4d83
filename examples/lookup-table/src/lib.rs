//! Linear interpolation in `resources/table.csv`: the first column is the input, the others are outputs. Outside of
//! the table, its first or last row holds.
#![forbid(unsafe_code)]

use fmu::{About, Failure, Model, Variable as V};

#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct LookupTable {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
    values: Vec<f64>,
}

impl Model for LookupTable {
    const IDENTIFIER: &'static str = "LookupTable";

    fn about(&self) -> About {
        About { description: "Linear interpolation in a table".to_owned(), ..About::default() }
    }

    fn new(resources: &std::path::Path) -> Result<Self, Failure> {
        let failure = |error: csv::Error| Failure::Error(format!("table.csv: {error}"));
        let mut file = csv::Reader::from_path(resources.join("table.csv")).map_err(failure)?;
        let names = file.headers().map_err(failure)?.iter().map(str::to_owned).collect();
        let rows: Vec<Vec<f64>> = file.deserialize().collect::<Result<_, _>>().map_err(failure)?;
        let finite = rows.iter().flatten().all(|number| number.is_finite());
        if rows.len() < 2 || !finite || !rows.is_sorted_by(|one, next| one[0] < next[0]) {
            return Err(Failure::Error("table.csv: expected finite rows, x rising".to_owned()));
        }
        Ok(Self { names, values: rows[0].clone(), rows })
    }

    fn variables(&self) -> Vec<V<Self>> {
        let column = |k| V::real(&self.names[k], "A column", move |m: &mut Self| &mut m.values[k]);
        let outputs = (1..self.names.len()).map(|k| column(k).output(&[&self.names[0]]));
        std::iter::once(column(0).input()).chain(outputs).collect()
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let x = self.values[0];
        let upper = self.rows.partition_point(|row| row[0] < x).clamp(1, self.rows.len() - 1);
        let (low, high) = (&self.rows[upper - 1], &self.rows[upper]);
        let part = ((x - low[0]) / (high[0] - low[0])).clamp(0.0, 1.0);
        for (k, value) in self.values.iter_mut().enumerate().skip(1) {
            *value = low[k] + part * (high[k] - low[k]);
        }
        Ok(())
    }
}

fmu::export!(LookupTable);
#[cfg(test)]
mod tests;
