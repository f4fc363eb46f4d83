//! Many instances in many threads.

use std::thread;

use robustness::array::Array;
use robustness::exporter::order;
use robustness::importer::Importer;

const OK: i32 = 0;
const COUNT: usize = if cfg!(miri) { 2 } else { 40 };

/// The bits of the outputs in each step of a separate run for each `seed`.
fn steps(importer: &Importer, seed: usize) -> impl FnMut(u32) -> [u64; 2] {
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let drive = seed as f64 * 0.01;
    move |number| {
        let time = 0.25 * f64::from(number);
        let set = importer.set_real(&Array::right(vec![1]), &Array::right(vec![drive + time]));
        let mut values = Array::right(vec![0.0; 2]);
        let stepped = importer.do_step(time, 0.25);
        let got = importer.get_real(&Array::right(vec![2, 4]), &mut values);
        assert_eq!([set, stepped, got], [OK; 3]);
        [values.items[0].to_bits(), values.items[1].to_bits()]
    }
}

fn started() -> Importer {
    let importer = Importer::new(&order(1));
    let done = [importer.enter_initialization_mode(), importer.exit_initialization_mode()];
    assert_eq!(done, [OK; 2]);
    importer
}

/// Runs `COUNT` instances step by step in turn.
fn interleaved(from: usize) -> Vec<[u64; 2]> {
    let importers: Vec<_> = (0..COUNT).map(|_| started()).collect();
    let mut runs: Vec<_> =
        importers.iter().enumerate().map(|(k, importer)| steps(importer, from + k)).collect();
    (0..20).flat_map(|number| runs.iter_mut().map(|run| run(number)).collect::<Vec<_>>()).collect()
}

#[test]
fn instances_in_many_threads_give_the_bits_of_each_alone() {
    let threads = [0, 7, 0, 100, 7, 0];
    let together = thread::scope(|scope| {
        let running = threads.map(|from| scope.spawn(move || interleaved(from)));
        running.map(|thread| thread.join().unwrap())
    });
    for (from, rows) in threads.into_iter().zip(together) {
        for k in 0..COUNT {
            let importer = started();
            let mut alone = steps(&importer, from + k);
            for number in 0..20 {
                assert_eq!(rows[number as usize * COUNT + k], alone(number), "{from} {k} {number}");
            }
        }
    }
}

#[test]
fn two_thousand_instances_exist_at_once() {
    let count = if cfg!(miri) { 10 } else { 2000 };
    let importers: Vec<_> = (0..count).map(|_| started()).collect();
    assert!(importers.iter().rev().all(|importer| importer.do_step(0.0, 0.5) == OK));
}
