//! Reduction of a long time series to the samples that a plot shows, in bounded memory.

/// Largest number of buckets: several for each pixel of a plot.
const BUCKETS: u16 = 8192;

/// A time interval of the series: its first, lowest, highest and last finite sample, and the time of the
/// first sample that is not finite, if any.
#[derive(Debug, Clone, Copy)]
struct Bucket {
    samples: Option<[(f64, f64); 4]>,
    gap: Option<f64>,
}

const EMPTY: Bucket = Bucket { samples: None, gap: None };

impl Bucket {
    fn merge(self, later: Self) -> Self {
        let samples = match (self.samples, later.samples) {
            (Some([first, low, high, _]), Some([_, next_low, next_high, last])) => {
                let low = if next_low.1 < low.1 { next_low } else { low };
                let high = if next_high.1 > high.1 { next_high } else { high };
                Some([first, low, high, last])
            }
            (one, other) => one.or(other),
        };
        Self { samples, gap: self.gap.or(later.gap) }
    }
}

/// The envelope of a time series: the samples that a plot shows.
///
/// Samples are added in the order of time, to buckets of equal length in time. When time passes the
/// last bucket, neighbouring buckets are merged and the length doubles. Thus at most 8192 buckets cover a
/// series of any length, and at least 4096 once buckets were merged.
#[derive(Debug, Clone)]
pub struct Envelope {
    /// Time of the first sample, in s.
    start: f64,
    /// Length of a bucket in s; 0 until two samples differ in time.
    length: f64,
    buckets: Vec<Bucket>,
}

impl Default for Envelope {
    fn default() -> Self {
        Self { start: f64::NAN, length: 0.0, buckets: vec![EMPTY] }
    }
}

impl Envelope {
    /// Adds a sample. A sample without a finite time is ignored; one that goes back in time belongs to the
    /// last bucket.
    pub fn push(&mut self, time: f64, value: f64) {
        if !time.is_finite() {
            return;
        }
        if self.start.is_nan() {
            self.start = time;
        }
        // The factor 0.5 keeps the difference of any two times finite.
        let half_elapsed = (0.5 * time - 0.5 * self.start).max(0.0);
        if self.length == 0.0 && half_elapsed > 0.0 {
            self.length = 2.0 * half_elapsed.min(f64::MAX / 4.0);
        }
        let mut place = self.place(half_elapsed);
        while place >= f64::from(BUCKETS) {
            self.double();
            place = self.place(half_elapsed);
        }
        let last = self.buckets.len() - 1;
        // Not negative, and below the number of buckets.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "as said")]
        let place = (place as usize).max(last);
        self.buckets.resize(place + 1, EMPTY);
        let sample = if value.is_finite() {
            Bucket { samples: Some([(time, value); 4]), gap: None }
        } else {
            Bucket { samples: None, gap: Some(time) }
        };
        self.buckets[place] = self.buckets[place].merge(sample);
    }

    /// Returns the number of the bucket, as a float, for half the time since the start.
    fn place(&self, half_elapsed: f64) -> f64 {
        if self.length > 0.0 { (half_elapsed / (0.5 * self.length)).floor() } else { 0.0 }
    }

    /// Doubles the length of the buckets and merges pairs of them.
    fn double(&mut self) {
        self.length *= 2.0;
        let pairs = self.buckets.chunks(2);
        self.buckets =
            pairs.map(|pair| pair.iter().fold(EMPTY, |all, one| all.merge(*one))).collect();
    }

    /// Returns the times and the values of the samples. One NaN represents all values of a bucket that are not finite.
    /// It has the time of the first of them, but follows the other samples of the bucket even if these are later.
    #[must_use]
    pub fn samples(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut times, mut values) = (Vec::new(), Vec::new());
        for bucket in &self.buckets {
            let mut samples = bucket.samples.map_or(Vec::new(), |all| all.to_vec());
            samples.sort_by(|a, b| a.0.total_cmp(&b.0));
            samples.dedup();
            samples.extend(bucket.gap.map(|time| (time, f64::NAN)));
            times.extend(samples.iter().map(|sample| sample.0));
            values.extend(samples.iter().map(|sample| sample.1));
        }
        (times, values)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "samples are kept, not computed")]
mod tests {
    use super::*;

    #[test]
    fn a_series_of_any_length_keeps_its_spikes_its_ends_and_little_else() {
        let mut envelope = Envelope::default();
        let count = 3_000_000_u32;
        for k in 0..count {
            let spike = if k == 1_234_567 { 50.0 } else { 0.0 };
            envelope.push(f64::from(k) * 1e-3, (f64::from(k) * 0.01).sin() + spike);
        }
        let (times, values) = envelope.samples();
        let buckets = usize::from(BUCKETS);
        assert!(times.len() <= 4 * buckets && times.len() > buckets, "{}", times.len());
        assert!(times.is_sorted());
        assert_eq!((times[0], values[0]), (0.0, 0.0));
        assert_eq!(times[times.len() - 1], f64::from(count - 1) * 1e-3);
        let high = values.iter().copied().fold(0.0, f64::max);
        let at = values.iter().position(|value| *value == high).unwrap();
        assert_eq!(times[at], 1234.567);
        assert_eq!(high, (1_234_567.0_f64 * 0.01).sin() + 50.0);
    }

    #[test]
    fn a_short_series_is_kept_whole() {
        let mut envelope = Envelope::default();
        let samples = [(0.0, 1.0), (0.0, 3.0), (0.5, -2.0), (1.0, 4.0), (9.0, 0.0)];
        for (time, value) in samples {
            envelope.push(time, value);
        }
        let (times, values) = envelope.samples();
        assert_eq!(times.into_iter().zip(values).collect::<Vec<_>>(), samples);
    }

    #[test]
    fn nan_and_infinity_remain_gaps() {
        let mut envelope = Envelope::default();
        for k in 0..100_000_u32 {
            let value = if (40_000..60_000).contains(&k) { f64::NAN } else { 1.0 };
            envelope.push(f64::from(k), value);
        }
        envelope.push(f64::NAN, 7.0);
        let (times, values) = envelope.samples();
        let inside = times.iter().zip(&values).filter(|(t, _)| (40_020.0..59_980.0).contains(*t));
        assert!(inside.clone().count() > 1000 && inside.clone().all(|(_, value)| value.is_nan()));
        let outside = times.iter().zip(&values).filter(|(t, _)| **t < 39_980.0 || **t > 60_020.0);
        assert!(outside.clone().count() > 4000 && outside.clone().all(|(_, value)| *value == 1.0));
    }

    #[test]
    fn times_at_the_ends_of_the_numbers_end() {
        let mut envelope = Envelope::default();
        for time in [-f64::MAX, -1.0, 0.0, f64::MIN_POSITIVE, 5e-324, 1.0, 1e300, f64::MAX] {
            envelope.push(time, 1.0);
        }
        assert!(envelope.samples().0.contains(&f64::MAX));
        let mut small = Envelope::default();
        for time in [0.0, 5e-324, 1e-300, 1.0, f64::MAX] {
            small.push(time, time);
        }
        assert!(small.samples().0.contains(&f64::MAX));
    }
}
