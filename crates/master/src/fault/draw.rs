//! Random numbers that are functions of the time: asked twice, they say the same.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::signal::reached;

/// Distribution of a random number of mean zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Spread {
    /// Normal, of this standard deviation.
    Normal(f64),
    /// Uniform from minus to plus this; its standard deviation is smaller by the factor `sqrt(3)`.
    Uniform(f64),
}

/// A series of random numbers: of the `ChaCha` stream cipher with 8 rounds (Bernstein 2008), whose
/// stream is the number of the sample and whose key is a hash (SHA-256) of seed, place and name. So a
/// sample needs none of those before it, and different names give independent series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    key: [u8; 32],
    every: Option<f64>,
}

impl Draw {
    /// The series of `seed` for the fault in `place` (0, 1, ..) among those on the way to the
    /// input `name`; with a new sample `every` so many s, or else at each communication point.
    #[must_use]
    pub fn new(seed: u64, name: &str, place: u64, every: Option<f64>) -> Self {
        let hash = Sha256::new()
            .chain_update(seed.to_le_bytes())
            .chain_update(place.to_le_bytes())
            .chain_update(name.as_bytes());
        Self { key: hash.finalize().into(), every }
    }

    /// The noise at `time`, of a series that begins at `from`, both in s.
    pub(super) fn noise(&self, spread: Spread, from: f64, time: f64) -> f64 {
        let mut generator = self.generator(from, time);
        match spread {
            Spread::Normal(deviation) => {
                let normal: f64 = StandardNormal.sample(&mut generator);
                deviation * normal
            }
            Spread::Uniform(bound) => bound * (2.0 * unit(&mut generator) - 1.0),
        }
    }

    /// Whether an event of that probability happens at `time`.
    pub(super) fn happens(&self, probability: f64, from: f64, time: f64) -> bool {
        unit(&mut self.generator(from, time)) < probability
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    fn generator(&self, from: f64, time: f64) -> ChaCha8Rng {
        let sample = match self.every {
            Some(every) => period_of(from, every, time) as u64,
            // Plus zero, as minus zero is the same time.
            None => (time + 0.0).to_bits(),
        };
        let mut generator = ChaCha8Rng::from_seed(self.key);
        generator.set_stream(sample);
        generator
    }
}

/// A number from 0, included, to 1, with 53 bits.
#[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
}

/// How many periods from `from` on are over at `time`, all in s; a period is over where its end differs
/// by rounding only.
pub(super) fn period_of(from: f64, period: f64, time: f64) -> f64 {
    let periods = (time - from) / period;
    let next = periods.round();
    let whole = if reached(time, from + next * period) { next } else { next - 1.0 };
    whole.max(0.0)
}
