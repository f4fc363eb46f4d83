//! Random numbers as functions of time: the same time gives the same number.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::signal::reached;

/// Distribution of a random number with mean zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum NoiseDistribution {
    /// Normal distribution with this standard deviation.
    Normal(f64),
    /// Uniform distribution from minus to plus this bound `a`, with standard deviation `a /
    /// sqrt(3)`.
    Uniform(f64),
}

/// A series of random numbers with random access.
///
/// A sample is the output of the `ChaCha` stream cipher with 8 rounds (Bernstein 2008). The stream
/// is the number of the sample, or the bits of the time if each communication point has a sample; the key is the
/// SHA-256 hash of seed, place and name. A sample therefore does not depend on earlier samples, and different names
/// give independent series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RandomSeries {
    key: [u8; 32],
    every: Option<f64>,
}

impl RandomSeries {
    /// Creates the series for the fault number `place` (0, 1, ..) on the connection to the input
    /// `name`. A new sample starts every `every` s; `None`: at each communication point.
    #[must_use]
    pub fn new(seed: u64, name: &str, place: u64, every: Option<f64>) -> Self {
        let hash = Sha256::new()
            .chain_update(seed.to_le_bytes())
            .chain_update(place.to_le_bytes())
            .chain_update(name.as_bytes());
        Self { key: hash.finalize().into(), every }
    }

    /// Returns the noise at `time` of a series that starts at `from`, both in s.
    pub(super) fn noise(&self, spread: NoiseDistribution, from: f64, time: f64) -> f64 {
        let mut generator = self.generator(from, time);
        match spread {
            NoiseDistribution::Normal(deviation) => {
                let normal: f64 = StandardNormal.sample(&mut generator);
                deviation * normal
            }
            NoiseDistribution::Uniform(bound) => bound * (2.0 * unit(&mut generator) - 1.0),
        }
    }

    /// Whether an event of this probability happens at `time`, in a series that starts at `from`, both
    /// in s.
    pub(super) fn happens(&self, probability: f64, from: f64, time: f64) -> bool {
        unit(&mut self.generator(from, time)) < probability
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    fn generator(&self, from: f64, time: f64) -> ChaCha8Rng {
        let sample = match self.every {
            Some(every) => period_of(from, every, time) as u64,
            // Adding zero maps minus zero to plus zero, which is the same time.
            None => (time + 0.0).to_bits(),
        };
        let mut generator = ChaCha8Rng::from_seed(self.key);
        generator.set_stream(sample);
        generator
    }
}

/// Returns a uniform random number in `[0, 1)` with 53 bits.
#[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
}

/// Returns the number of complete periods between `from` and `time`, all in s; 0 before `from`. A period
/// whose end differs from `time` by rounding is complete.
pub(super) fn period_of(from: f64, period: f64, time: f64) -> f64 {
    let periods = (time - from) / period;
    let next = periods.round();
    let whole = if reached(time, from + next * period) { next } else { next - 1.0 };
    whole.max(0.0)
}
