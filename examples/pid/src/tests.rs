//! The first test of a model.

use std::path::Path;

use super::Pid;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<Pid>(Path::new("resources")), Ok(vec![]));
}
