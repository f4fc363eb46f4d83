//! Tests of the model.

use std::path::Path;

use super::WindTurbineMonitor;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<WindTurbineMonitor>(Path::new("resources")), Ok(vec![]));
}
