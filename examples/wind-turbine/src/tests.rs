//! Tests of the model.

use std::path::Path;

use super::WindTurbine;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<WindTurbine>(Path::new("resources")), Ok(vec![]));
}
