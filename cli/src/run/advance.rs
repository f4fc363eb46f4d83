//! The stepping loop, with what happens beside it.

use std::path::PathBuf;
use std::time::Instant;

use master::{Simulation, SlowState, SystemError};

use super::interrupt;
use super::progress::Progress;
use super::record::Recorder;
use super::saved::Saved;
use crate::config::Every;

/// How a run ended.
pub(crate) enum Ended {
    /// At its stop time.
    AtStop,
    /// Because this FMU asked for it.
    ByFmu(String),
    /// By a signal.
    Interrupted,
    /// By a failure.
    Lost(anyhow::Error),
}

/// Where checkpoints go.
pub(super) struct Saver {
    pub(super) path: PathBuf,
    /// Simulated seconds between two; none: only at the end.
    pub(super) interval: Option<f64>,
    /// The complete configuration.
    pub(super) text: String,
    pub(super) every: Every,
}

/// How much a run has done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Communication steps.
    pub(crate) steps: u64,
    /// Wall-clock time in s.
    pub(crate) seconds: f64,
}

/// What goes on beside the steps.
pub(crate) struct Beside<'a> {
    pub(super) recorder: Option<&'a mut Recorder>,
    pub(super) saver: Option<&'a Saver>,
    /// Stop time in s.
    pub(super) stop: f64,
    /// The point where the simulation stands was recorded by the run that was resumed.
    pub(super) resumed: bool,
    pub(super) tally: Tally,
}

impl<'a> Beside<'a> {
    /// Nothing but a recording.
    pub(crate) fn recording(recorder: Option<&'a mut Recorder>, stop: f64) -> Self {
        Self { recorder, saver: None, stop, resumed: false, tally: Tally::default() }
    }

    /// Advances `simulation` to its end; `watch` sees the start and every step.
    pub(crate) fn advance(
        &mut self,
        simulation: &mut Simulation,
        watch: impl FnMut(&mut Simulation) -> Result<(), SystemError>,
    ) -> Ended {
        let begin = Instant::now();
        let ended = self.steps(simulation, watch).unwrap_or_else(Ended::Lost);
        self.tally.seconds = begin.elapsed().as_secs_f64();
        ended
    }

    fn steps(
        &mut self,
        simulation: &mut Simulation,
        mut watch: impl FnMut(&mut Simulation) -> Result<(), SystemError>,
    ) -> anyhow::Result<Ended> {
        interrupt::begin();
        let begin = simulation.time();
        let mut progress = Progress::new(begin, self.stop);
        let interval = self.saver.and_then(|saver| saver.interval);
        let mut saved = 0.0;
        let mut save_at = interval.map_or(f64::INFINITY, |interval| begin + interval);
        watch(simulation)?;
        if !self.resumed {
            self.sample(simulation)?;
        }
        while !simulation.is_finished() && !interrupt::is_raised() {
            if let Some(recorder) = &mut self.recorder {
                recorder.before_step(simulation)?;
            }
            let before = simulation.time();
            simulation.step()?;
            self.tally.steps += 1;
            watch(simulation)?;
            let time = simulation.time();
            // An end that an FMU asked for may be one that the others have not reached together.
            if time > before {
                self.sample(simulation)?;
            }
            progress.show(time);
            if let Some(interval) = interval
                && time >= save_at
            {
                self.save(simulation)?;
                saved = ((time - begin) / interval).floor().max(saved + 1.0);
                save_at = begin + (saved + 1.0) * interval;
            }
        }
        interrupt::notice();
        self.save(simulation)?;
        // An FMU may take the process with it from here on.
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.flush())?;
        simulation.terminate()?;
        simulation.free()?;
        Ok(match simulation.ended_by() {
            Some(name) => Ended::ByFmu(name.to_owned()),
            None if simulation.is_finished() => Ended::AtStop,
            None => Ended::Interrupted,
        })
    }

    #[inline]
    fn sample(&mut self, simulation: &mut Simulation) -> anyhow::Result<()> {
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.sample(simulation))
    }

    /// Saves a checkpoint, behind the rows that belong to it.
    fn save(&mut self, simulation: &mut Simulation) -> anyhow::Result<()> {
        let Some(saver) = self.saver else { return Ok(()) };
        let (mut due, mut slow) = (None, SlowState::default());
        if let Some(recorder) = &mut self.recorder {
            recorder.flush()?;
            due = Some((saver.every, recorder.due().clone()));
            slow = recorder.slow_state(simulation);
        }
        Saved::new(&saver.text, simulation.checkpoint()?, due, slow).write(&saver.path)
    }
}
