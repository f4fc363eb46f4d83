//! Random sequences of calls of FMI 3.0.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use robustness::exporter::order;
use robustness::importer::Importer;
use robustness::sequence3::{LENGTH, run};

#[test]
fn every_sequence_of_calls_of_fmi_3_is_answered_as_the_standard_says_and_leaves_no_memory() {
    // Data that is created once for the process is created before memory is counted.
    run(&[0; 3 * LENGTH]);
    // The panic hook is shared by all instances: this instance keeps it in place during the count.
    let _instance = Importer::new(&order(1));
    let cases = if cfg!(miri) { 3 } else { 4000 };
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let bytes = vec(any::<u8>(), 1..50 * LENGTH);
    let done = TestRunner::new(config).run(&bytes, |bytes| {
        let memory = allocation_counter::measure(|| run(&bytes));
        let memory = (memory.count_current, memory.bytes_current);
        prop_assert!(memory == (0, 0), "{memory:?} blocks and bytes are left");
        Ok(())
    });
    assert_eq!(done, Ok(()));
}
