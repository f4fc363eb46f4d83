//! Plans: the C calls for a list of value references, one for each type, clock and kind of change.

use std::collections::HashMap;

use fmu_description::NativeType;

use super::buffer::Buffer;
use super::elements::{ElementView, Variable};

/// Largest number of lists of value references whose plans are kept.
const KEPT: usize = 32;

/// The calls for one list of value references.
#[derive(Debug)]
struct Plan {
    /// Value references in the list.
    references: Vec<u32>,
    runs: Vec<Run>,
}

/// One call: variables of one type with the same clocks. Either all variables may change in Event Mode only, or none.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) kind: NativeType,
    /// Whether the variables may change in Event Mode only.
    pub(super) event: bool,
    /// Value references of the clocks of the variables.
    pub(super) clocks: Vec<u32>,
    /// Value references of whole variables, for the C function.
    pub(super) references: Vec<u32>,
    /// For each value of the list: its position in the list, and its position among the values of the call.
    pub(super) places: Vec<(usize, usize)>,
    /// For each value of the call, its position among all elements that may change in Event Mode only.
    pub(super) shadows: Vec<usize>,
    /// Whether the list lacks elements of an array. The missing elements keep their values.
    pub(super) partial: bool,
    pub(super) buffer: Buffer,
}

impl Plan {
    /// Creates the plan for a list. On failure returns the reference that no variable has.
    fn new(view: &ElementView, list: &[u32]) -> Result<Self, u32> {
        let mut runs: Vec<Run> = Vec::new();
        // For each variable its run and the place of its first element in the call.
        let mut added: HashMap<usize, (usize, usize)> = HashMap::new();
        for (position, &reference) in list.iter().enumerate() {
            let (number, element) = view.locate(reference).ok_or(reference)?;
            let (run, first) = *added.entry(number).or_insert_with(|| {
                let run = run_for(&mut runs, &view.variables[number]);
                (run, runs[run].add(&view.variables[number]))
            });
            runs[run].places.push((position, first + element));
        }
        for run in &mut runs {
            let count = run.shadows.len();
            run.buffer = Buffer::new(run.kind, count);
            let mut is_listed = vec![false; count];
            run.places.iter().for_each(|(_, place)| is_listed[*place] = true);
            run.partial = is_listed.contains(&false);
        }
        Ok(Self { references: list.to_vec(), runs })
    }
}

/// Returns the position of the run for `variable`; adds a run if none fits.
fn run_for(runs: &mut Vec<Run>, variable: &Variable) -> usize {
    let (kind, event, clocks) = (variable.kind, variable.event, &variable.clocks);
    let same = |run: &Run| (run.kind, run.event, &run.clocks) == (kind, event, clocks);
    runs.iter().position(same).unwrap_or_else(|| {
        runs.push(Run {
            kind,
            event,
            clocks: clocks.clone(),
            references: Vec::new(),
            places: Vec::new(),
            shadows: Vec::new(),
            partial: false,
            buffer: Buffer::new(kind, 0),
        });
        runs.len() - 1
    })
}

impl Run {
    /// Returns the calls for whole `variables`, without places in a list.
    pub(super) fn of_whole<'a>(variables: impl IntoIterator<Item = &'a Variable>) -> Vec<Self> {
        let mut runs = Vec::new();
        for variable in variables {
            let run = run_for(&mut runs, variable);
            runs[run].add(variable);
        }
        for run in &mut runs {
            run.buffer = Buffer::new(run.kind, run.shadows.len());
        }
        runs
    }

    /// Adds a variable and returns the place of its first element.
    fn add(&mut self, variable: &Variable) -> usize {
        self.references.push(variable.reference);
        let first = self.shadows.len();
        self.shadows.extend(variable.shadow..variable.shadow + variable.size);
        first
    }
}

/// The plans of the lists used last.
#[derive(Debug, Default)]
pub(super) struct Plans {
    plans: Vec<Plan>,
    /// Position of the plan that the next new plan replaces, if there are [`KEPT`].
    next: usize,
}

impl Plans {
    /// Returns the position of the plan for a list; makes the plan if there is none. On failure returns the reference
    /// that no variable has.
    pub(super) fn find(&mut self, view: &ElementView, list: &[u32]) -> Result<usize, u32> {
        if let Some(position) = self.plans.iter().position(|plan| plan.references == list) {
            return Ok(position);
        }
        let plan = Plan::new(view, list)?;
        if self.plans.len() < KEPT {
            self.plans.push(plan);
            return Ok(self.plans.len() - 1);
        }
        let place = self.next;
        self.next = (self.next + 1) % KEPT;
        self.plans[place] = plan;
        Ok(place)
    }

    pub(super) fn runs(&mut self, plan: usize) -> &mut Vec<Run> {
        &mut self.plans[plan].runs
    }
}
