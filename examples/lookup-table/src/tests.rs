//! The first test of a model.

use std::path::Path;

use super::LookupTable;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<LookupTable>(Path::new("resources")), Ok(vec![]));
}
