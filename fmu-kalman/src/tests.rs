//! The mean of the commands between samples.

use crate::held_mean::HeldMean;

#[test]
fn the_mean_weights_each_command_by_the_time_that_it_acts() {
    let mut mean = HeldMean::of(2);
    assert_eq!(mean.mean(&[7.0, 8.0]), [7.0, 8.0]);
    mean.add(&[1.0, 10.0], 3.0);
    mean.add(&[5.0, 30.0], 1.0);
    mean.add(&[100.0, 100.0], 0.0);
    assert_eq!(mean.mean(&[0.0, 0.0]), [2.0, 15.0]);
    mean.clear();
    mean.add(&[4.0, 4.0], 0.5);
    assert_eq!(mean.mean(&[0.0, 0.0]), [4.0, 4.0]);
}
