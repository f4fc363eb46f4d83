//! The gains of feedback and observer for one plant.

use control::aso::{FaultyPlant, Gains};
use control::faults::ExtendedPlant;
use control::{Domain, lmi, sampled};
use files::PlaceError;
use nalgebra::DMatrix;
use plant_file::PlantFile;
use plant_file::loop_shape::LoopShape;
use plant_file::requirements::Request;

use crate::plant::linear::LinearPlant;
use crate::solve::gain::{FeedbackProblem, GainResult};
use crate::solve::gains::{feedback, observer};
use crate::solve::loop_shape::{LoopProblem, ShapedGains};
use crate::solve::names::observer_states;
use crate::solve::norm_gains::ObserverProblem;
use crate::solve::pid::{PidProblem, entries_besides};
use crate::solve::refusal::{States, feedback_refused, refused};
use crate::solve::tracking::LoopModel;

/// What the gains of feedback and observer are computed for.
pub(crate) struct GainProblem<'a> {
    pub(crate) file: &'a PlantFile<'a>,
    pub(crate) linear: &'a LinearPlant,
    pub(crate) extended: &'a ExtendedPlant,
    /// The model in the observer.
    pub(crate) plant: &'a FaultyPlant,
    /// A and B of the feedback.
    pub(crate) pair: &'a (DMatrix<f64>, DMatrix<f64>),
    pub(crate) domain: Domain,
}

/// Starts of the search for the shape of a loop, and the entries of the gains that vary.
struct Search {
    /// Pairs of feedback and observer gains.
    starts: Vec<[DMatrix<f64>; 2]>,
    /// Rows and columns of the entries of feedback and observer that are tuned.
    free: [Vec<(usize, usize)>; 2],
}

impl GainProblem<'_> {
    /// Computes the gains of feedback and observer. `common`: the feedback of a family, which is used if there is one.
    pub(crate) fn solve(
        &self,
        common: Option<GainResult>,
    ) -> Result<(GainResult, GainResult), PlaceError> {
        let Self { file, linear, extended, plant, pair: (a, b), domain } = *self;
        // No command and no state of the plant depends on the filters before the controllers of low order are in the
        // loop.
        let filters = linear.filter_states(file);
        let (first, count) = (filters.start, filters.len());
        let square =
            |m: &DMatrix<f64>| m.clone().remove_rows(first, count).remove_columns(first, count);
        let (a, b) = (&square(a), &b.clone().remove_rows(first, count));
        let n = extended.states - count;
        let order = a.nrows();
        let c = linear.c.clone().remove_columns(first, count);
        let problem = FeedbackProblem {
            a,
            b,
            c: &c.resize_horizontally(order, 0.0),
            states: n,
            f_a: &plant.f_a.rows(0, n).into_owned().resize_vertically(order, 0.0),
        };
        let of_feedback = linear.with_delays(&file.feedback.requirement, order);
        let feedback = || match common {
            Some(common) => Ok(common),
            None => feedback(&of_feedback, &problem, domain),
        };
        let a_0 = square(&plant.augmented_dynamics());
        let c_0 = plant.augmented_output().remove_columns(first, count);
        let of_observer = linear.with_delays(&file.observer.requirement, a_0.nrows());
        let filter = sampled::filter(extended, domain);
        let observer_problem = ObserverProblem {
            a_0: &a_0,
            c_0: &c_0,
            b: &plant.b.clone().remove_rows(first, count),
            channels: &extended.channels,
            faults: plant.f_a.ncols(),
            filter: filter.as_deref(),
            estimator: file.estimator(),
        };
        // Both run in other threads, with the same time limit.
        let ending = lmi::ending();
        let feedback = || lmi::until(ending.clone(), feedback);
        let observer = || observer(&of_observer, &observer_problem, domain);
        let observer = || lmi::until(ending.clone(), observer);
        let (feedback, observer) = rayon::join(feedback, observer);
        let feedback =
            feedback.map_err(|refusal| feedback_refused(file, linear, domain, refusal))?;
        let observer = observer.map_err(|refusal| {
            let names = observer_states(linear, extended);
            let meaning = "states, filters, faults and rates of ramps";
            let states = States { names, meaning, of_delays: linear.delay_states() };
            refused(file, domain, &file.observer, refusal, &states)
        })?;
        if count == 0 {
            return Ok((feedback, observer));
        }
        Ok((
            feedback.mapped(|gain| gain.clone().insert_columns(first, count, 0.0)),
            observer.mapped(|gain| gain.clone().insert_rows(first, count, 0.0)),
        ))
    }

    /// Returns the gains of feedback and observer: tuned to the loop shape of the plant file, with a warning if they do
    /// not reach it; without a loop shape, the pair with the lowest peaks of S, or the first pair of a design with a
    /// schedule.
    ///
    /// `common`: the feedback of a family, not used with a loop shape. `filter`: the coefficients of the measurement
    /// filter. `gains`: computes the gains of the controller from those of feedback and observer.
    pub(crate) fn chosen(
        &self,
        common: Option<GainResult>,
        filter: Option<&[f64]>,
        gains: impl Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains + Sync,
    ) -> Result<(GainResult, GainResult, Option<PlaceError>), crate::Error> {
        let Self { file, linear, plant, pair, domain, .. } = *self;
        let model = LoopModel { linear, plant, filter, domain };
        if let Some(shape) = &file.loop_shape {
            let Search { starts, free } = self.search(shape)?;
            let references =
                file.references.as_ref().filter(|one| one.integral && !one.feedforward);
            let red = file.robustness.red;
            let problem = LoopProblem { shape, model, pair, references, red, free, gains };
            let ShapedGains { feedback, observer, warning } = problem.tuned(&starts)?;
            return Ok((feedback, observer, warning.map(|text| file.error_at(&shape.place, text))));
        }
        let (feedback, observer) = self.solve(common)?;
        // The gains of a schedule are interpolated, so that each point takes the first of its pairs.
        if file.is_scheduled() {
            return Ok((feedback, observer, None));
        }
        let (feedback, observer) = model.chosen(feedback, observer, gains)?;
        Ok((feedback, observer, None))
    }

    /// Returns the gains of state feedbacks and observers, at which the search for the shape of the loop starts.
    fn starts(&self, shape: &LoopShape) -> Result<Vec<[DMatrix<f64>; 2]>, PlaceError> {
        let gains = |[feedback, observer]: [Request; 2]| {
            let mut file = self.file.clone();
            (file.feedback, file.observer) = (feedback, observer);
            let (feedback, observer) = GainProblem { file: &file, ..*self }.solve(None)?;
            Ok([feedback.gain, observer.gain])
        };
        shape.starts(self.domain).into_iter().map(gains).collect()
    }

    /// Returns the starts of the search for the structure of the file, a state feedback or controllers of low order,
    /// and the entries that vary.
    fn search(&self, shape: &LoopShape) -> Result<Search, crate::Error> {
        let Self { file, linear, pair, domain, .. } = *self;
        let starts = self.starts(shape)?;
        let [of_feedback, of_observer] = starts[0].each_ref().map(DMatrix::shape);
        let of_observer = entries_besides(&linear.filter_states(file), of_observer);
        let (Some(pid), Some(references)) = (&shape.pid, &file.references) else {
            let of_feedback = entries_besides(&(0..0), of_feedback);
            return Ok(Search { starts, free: [of_feedback, of_observer] });
        };
        let problem = PidProblem { pid, shape, linear, references, pair, domain };
        let free = [problem.free(), of_observer];
        Ok(Search { starts: problem.starts(file, &starts)?, free })
    }
}
