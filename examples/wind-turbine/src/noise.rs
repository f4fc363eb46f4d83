//! Random numbers that depend on the seed, the channel and the number of the sample only.

use std::f64::consts::TAU;

/// Returns a number from the standard normal distribution.
///
/// The bits are mixed as in `SplitMix64` (Steele, Lea and Flood 2014); the distribution follows by the method
/// of Box and Muller (1958).
pub(crate) fn normal(seed: u64, channel: u64, sample: u64) -> f64 {
    let start = mix(mix(seed).wrapping_add(channel)).wrapping_add(sample.wrapping_mul(2));
    let [first, second] = [start, start.wrapping_add(1)].map(uniform);
    libm::sqrt(-2.0 * libm::log(first)) * libm::cos(TAU * second)
}

/// Returns a number above 0 and up to 1, evenly distributed.
fn uniform(number: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "53 bits are left")]
    let bits = ((mix(number) >> 11) + 1) as f64;
    bits / 9_007_199_254_740_992.0
}

fn mix(number: u64) -> u64 {
    let mut bits = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
