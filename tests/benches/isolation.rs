//! Measures the time that isolation adds to a step: microseconds per step of a tiny C FMU and of
//! the pendulum, in this process and isolated, for one instance and for several.
//!
//! `cargo bench --package tests --bench isolation` prints the table of `docs/how-to/isolation.md`.
#![forbid(unsafe_code)]
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement")]

#[cfg(target_os = "linux")]
mod linux {
    use std::path::Path;
    use std::time::{Duration, Instant};

    use fmu_description::Experiment;
    use fmu_description::{Causality, Kind, ModelDescription};
    use fmu_import::Fmu;
    use fmu_import::isolate::{self, Isolated, Options};
    use master::Transformation;
    use master::{
        Algorithm, Background as _, CallError, CommunicationStep, Extrapolation, Method,
        Simulation, Slave, StepRequest, StepResult, System,
    };
    use ssp::{Link, Terminal};
    use tests::{dist, troubles};

    /// Number of steps in a sample, and number of samples.
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

        fn step(&mut self, count: u32) -> StepRequest<'_> {
            let time = f64::from(count) * SIZE;
            let step = CommunicationStep { time, size: SIZE, never_back: true };
            let Self { inputs, outputs, input, output } = self;
            StepRequest::held(inputs, input, step, outputs, output)
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
        let (mut times, mut count) = (Vec::new(), 0);
        for _ in 0..SAMPLES {
            let begin = Instant::now();
            for _ in 0..STEPS {
                step(count);
                count += 1;
            }
            times.push(begin.elapsed().as_secs_f64() * 1e6 / f64::from(STEPS));
            std::thread::sleep(Duration::from_millis(1));
        }
        times.sort_by(f64::total_cmp);
        times
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

    /// An isolated instance that does not tell the master that it steps in the background.
    struct Alone(Isolated);

    impl Slave for Alone {
        fn description(&self) -> &ModelDescription {
            self.0.description()
        }
        fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
            self.0.setup_experiment(experiment)
        }
        fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
            self.0.enter_initialization_mode()
        }
        fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
            self.0.exit_initialization_mode()
        }
        fn terminate(&mut self) -> Result<(), CallError> {
            self.0.terminate()
        }
        fn get_real(&mut self, which: &[u32], values: &mut [f64]) -> Result<(), CallError> {
            self.0.get_real(which, values)
        }
        fn set_real(&mut self, which: &[u32], values: &[f64]) -> Result<(), CallError> {
            self.0.set_real(which, values)
        }
        fn do_step(&mut self, time: f64, size: f64, back: bool) -> Result<StepResult, CallError> {
            self.0.do_step(time, size, back)
        }
        fn advance(&mut self, request: &mut StepRequest<'_>) -> Result<StepResult, CallError> {
            self.0.advance(request)
        }
    }

    /// Microseconds per step of a ring of slaves, the output of each (second of `ports`) the input of
    /// the next (first of them), by Jacobi's method with held inputs.
    fn by_master(slaves: Vec<Box<dyn Slave>>, (input, output): (&str, &str)) -> Vec<f64> {
        let mut system = System::default();
        let count = slaves.len();
        for (position, slave) in slaves.into_iter().enumerate() {
            system.add(&format!("i{position}"), slave).unwrap();
        }
        for position in 0..count {
            let end = |position: usize, variable: &str| Terminal {
                element: format!("i{position}"),
                variable: variable.to_owned(),
            };
            let (from, to) = (end(position, output), end((position + 1) % count, input));
            // A position is connected to a force, because only the cost of the calls matters.
            let transformation = Transformation::Identity;
            study::link(&mut system, &Link { from, to, transformation, units_settled: true })
                .unwrap();
        }
        let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, SIZE);
        let mut simulation = Simulation::new(system, &algorithm, &Experiment::default()).unwrap();
        samples(|_| simulation.step().unwrap())
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

    fn measure(what: &str, fmu: &Path, ports: (&str, &str)) {
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
            let here =
                |name: &String| Box::new(opened.instantiate(name).unwrap()) as Box<dyn Slave>;
            let there = |name: &String| package.instantiate(name, &Options::default()).unwrap();
            let near = by_master(names.iter().map(here).collect(), ports);
            let alone = |name: &String| Box::new(Alone(there(name))) as Box<dyn Slave>;
            let one = by_master(names.iter().map(alone).collect(), ports);
            print(&format!("{what}, by the master, one after the other"), instances, &near, &one);
            let far = |name: &String| Box::new(there(name)) as Box<dyn Slave>;
            let all = by_master(names.iter().map(far).collect(), ports);
            print(&format!("{what}, by the master"), instances, &near, &all);
        }
    }

    pub(super) fn main() {
        println!(
            "| FMU | instances | in process, median | isolated, best | median | 3rd quartile | added per instance |"
        );
        println!("|---|---|---|---|---|---|---|");
        measure("C, 1 input, 1 output", troubles(), ("u", "y"));
        measure("pendulum", &dist().join("FrictionPendulum.fmu"), ("u", "x_p"));
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
        let worker =
            std::env::args().nth(1).is_some_and(|first| first == fmu_import::isolate::WORKER);
        if worker {
            fmu_import::isolate::worker().unwrap();
        } else {
            linux::main();
        }
    }
}
