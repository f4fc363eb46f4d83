//! What a step costs more when the FMU has a process of its own: microseconds per step of a tiny C
//! FMU and of the pendulum, in this process and isolated, one instance and several.
//!
//! `cargo bench --package tests --bench isolation` prints the table of `docs/isolation.md`.
#![forbid(unsafe_code)]
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement")]

#[cfg(target_os = "linux")]
mod linux {
    use std::path::Path;
    use std::time::{Duration, Instant};

    use fmi2::Experiment;
    use fmi2::description::{Causality, Kind};
    use master::isolate::{self, Isolated, Options};
    use master::{Advance, Fmu, Slave};
    use tests::{dist, troubles};

    /// Steps of one sample, and samples.
    const STEPS: u32 = 2000;
    const SAMPLES: usize = 41;
    const SIZE: f64 = 1e-4;

    /// References and values of one slave.
    struct Values {
        inputs: Vec<u32>,
        outputs: Vec<u32>,
        input: Vec<f64>,
        output: Vec<f64>,
    }

    impl Values {
        fn of(slave: &dyn Slave) -> Self {
            let references = |causality| -> Vec<u32> {
                let variables = slave.description().variables.iter();
                variables
                    .filter(|v| v.causality == causality && matches!(v.kind, Kind::Real(_)))
                    .map(|variable| variable.value_reference)
                    .collect()
            };
            let (inputs, outputs) = (references(Causality::Input), references(Causality::Output));
            let (input, output) = (vec![0.0; inputs.len()], vec![0.0; outputs.len()]);
            Self { inputs, outputs, input, output }
        }

        fn step(&mut self, count: u32) -> Advance<'_> {
            Advance {
                inputs: &self.inputs,
                input_values: &self.input,
                derived_inputs: &[],
                input_orders: &[],
                input_derivatives: &[],
                time: f64::from(count) * SIZE,
                size: SIZE,
                never_back: true,
                outputs: &self.outputs,
                output_values: &mut self.output,
                derived_outputs: &[],
                output_orders: &[],
                output_derivatives: &mut [],
            }
        }
    }

    fn initialised<S: Slave>(mut slave: S) -> (S, Values) {
        slave.setup_experiment(&Experiment::default()).unwrap();
        slave.enter_initialization_mode().unwrap();
        slave.exit_initialization_mode().unwrap();
        let values = Values::of(&slave);
        (slave, values)
    }

    /// Microseconds per step of each sample, in ascending order.
    fn samples(mut step: impl FnMut(u32)) -> Vec<f64> {
        let (mut found, mut count) = (Vec::new(), 0);
        for _ in 0..SAMPLES {
            let begin = Instant::now();
            for _ in 0..STEPS {
                step(count);
                count += 1;
            }
            found.push(begin.elapsed().as_secs_f64() * 1e6 / f64::from(STEPS));
            std::thread::sleep(Duration::from_millis(1));
        }
        found.sort_by(f64::total_cmp);
        found
    }

    fn one_by_one<S: Slave>(slaves: &mut [(S, Values)], count: u32) {
        for (slave, values) in slaves {
            slave.advance(&mut values.step(count)).unwrap();
        }
    }

    fn together(slaves: &mut [(Isolated, Values)], count: u32) {
        for (slave, values) in &mut *slaves {
            slave.begin_advance(&values.step(count)).unwrap();
        }
        for (slave, values) in slaves {
            slave.finish_advance(&mut values.step(count)).unwrap();
        }
    }

    fn print(what: &str, instances: usize, near: &[f64], far: &[f64]) {
        let at = |samples: &[f64], part: usize| samples[part * (samples.len() - 1) / 4];
        let added =
            |part| (at(far, part) - at(near, part)) / f64::from(u32::try_from(instances).unwrap());
        println!(
            "| {what} | {instances} | {:.3} | {:.2} | {:.2} | {:.2} | {:.2} |",
            at(near, 2),
            at(far, 0),
            at(far, 2),
            at(far, 3),
            added(2)
        );
    }

    fn measure(what: &str, fmu: &Path) {
        let opened = Fmu::open(fmu).unwrap();
        for instances in [1, 2, 4] {
            let names: Vec<String> = (0..instances).map(|k| format!("i{k}")).collect();
            let near = names.iter().map(|name| initialised(opened.instantiate(name).unwrap()));
            let mut near: Vec<_> = near.collect();
            let near = samples(|count| one_by_one(&mut near, count));
            let package = isolate::Package::open(fmu).unwrap();
            let start = |name: &String| {
                initialised(package.instantiate(name, &Options::default()).unwrap())
            };
            let mut far: Vec<_> = names.iter().map(start).collect();
            let one = samples(|count| one_by_one(&mut far, count));
            print(&format!("{what}, one after the other"), instances, &near, &one);
            if instances > 1 {
                let mut far: Vec<_> = names.iter().map(start).collect();
                let all = samples(|count| together(&mut far, count));
                print(&format!("{what}, begun together"), instances, &near, &all);
            }
        }
    }

    pub(super) fn main() {
        println!(
            "| FMU | instances | in process, median | isolated, best | median | 3rd quartile | added per instance |"
        );
        println!("|---|---|---|---|---|---|---|");
        measure("C, 1 input, 1 output", troubles());
        measure("pendulum", &dist().join("FrictionPendulum.fmu"));
        let package = isolate::Package::open(troubles()).unwrap();
        let begin = Instant::now();
        for _ in 0..20 {
            drop(package.instantiate("one", &Options::default()).unwrap());
        }
        println!("start and end of a worker: {:.1} ms", begin.elapsed().as_secs_f64() * 1e3 / 20.0);
    }
}

fn main() {
    #[cfg(target_os = "linux")]
    {
        let worker = std::env::args().nth(1).is_some_and(|first| first == master::isolate::WORKER);
        if worker {
            master::isolate::worker().unwrap();
        } else {
            linux::main();
        }
    }
}
