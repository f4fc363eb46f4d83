//! Changes of the scenario during the run.

use super::Simulation;
use crate::drive::Scenario;
use crate::error::{SystemError, contradiction};

impl Simulation {
    /// Returns the earliest time in s at which a change of the scenario may take effect: the first
    /// communication point after the ends of all steps attempted so far, including rejected steps and
    /// steps of slaves that are ahead. `None` if the run ends at this point or before.
    ///
    /// A run that has the change in its scenario from the start gives the same results, bit for bit,
    /// because it uses nothing of the change before this time.
    #[must_use]
    pub fn next_change(&self) -> Option<f64> {
        if self.is_finished() {
            return None;
        }
        let grid = &self.engine.grid;
        let ahead = self.slow_slaves().filter_map(|slave| self.current_step(slave));
        let touched = ahead.fold(self.attempted.max(grid.time), |last, (_, end)| last.max(end));
        let next = self.control.varied_end(touched).unwrap_or_else(|| grid.point_after(touched));
        grid.stop.is_none_or(|stop| next < stop).then_some(next)
    }

    /// Replaces the scenario by one that adds to it: further driven variables, further points of
    /// signals, and faults after the present faults of a connection. The additions must not take effect before
    /// [`Simulation::next_change`]; this is not checked. An added [`crate::fault::Fault::Delay`] has no
    /// values from before now: until its delay has passed, it gives its initial or the present value.
    ///
    /// # Errors
    ///
    /// Returns an error, and keeps the scenario, if a driven variable or a fault is missing, if a fault
    /// has changed, if a fault has no connection or is on a String, a binary or a clock, or if an input has two chains
    /// of faults.
    pub fn change_scenario(&mut self, mut scenario: Scenario) -> Result<(), SystemError> {
        let engine = &mut self.engine;
        scenario.limit_faults(&engine.system);
        let present = engine.exchange.faults().count();
        let mut inherited = 0;
        let mut same = scenario.drives.inherit(&engine.drives);
        for (input, chain) in &mut scenario.faults {
            if let Some(earlier) = engine.exchange.fault(*input) {
                same &= chain.inherit(earlier);
                inherited += 1;
            }
        }
        if !same || inherited < present {
            return Err(contradiction(
                "the new scenario lacks a driven variable or a fault of the present one, expected all of them",
            ));
        }
        engine.exchange.set_faults(&engine.system, &scenario.faults)?;
        engine.drives = scenario.drives;
        engine.choose_sweep();
        // New faults record the present values.
        engine.commit();
        Ok(())
    }
}
