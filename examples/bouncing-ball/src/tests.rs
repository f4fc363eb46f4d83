//! The first test of a model.

use std::path::Path;

use super::BouncingBall;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<BouncingBall>(Path::new("resources")), Ok(vec![]));
}
