//! A large sampled design whose names contain markup and quotes, and a bare one.

use std::f64::consts::PI;

use design_report::detection::{DecoupledInput, DetectedFault, Detection, ParameterCases, Test};
use design_report::fallback::{FallbackCase, FallbackReport};
use design_report::family::CommonCertificate;
use design_report::losses::{
    CertifiedLoss, ConstantLoss, LossLoop, LossPeak, LossProof, LossReport,
};
use design_report::reconfiguration::{
    ReconfigurationReport, Reconfigured, ServedByFallback, WithoutActuator, WithoutSeveral,
};
use design_report::{
    Bound, Certificate, Check, CommandPeak, Curve, Effectiveness, Estimation, EstimationErrors,
    FreeP, Frequency, Loop, Matrix, Norm, Plant, ReferenceStep, Region, Report, Sampled, Signal,
    StepResponse, Theorem1, Ultimate, Variable,
};

use design_report::robustness::{
    Channel, Compared, Disk, ExactDelays, Level, Limits, LoopPoint, Number, Parameter,
    PeakSensitivity, Remedy, Robustness, ToleranceResult, Verdict,
};

pub(super) const MARKUP: &str = "</code></pre><script>alert(1)</script>";
pub(super) const QUOTES: &str = "a\" onload=\"x' & <b>";
const PERIOD: f64 = 1e-3;

/// Numbers of all magnitudes, the same every time.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let digits = f64::from(u32::try_from(self.0 >> 32).unwrap()) / f64::from(u32::MAX) - 0.5;
        let power = i32::try_from(self.0 >> 20 & 15).unwrap() - 7;
        digits * 10_f64.powi(power)
    }

    fn matrix(&mut self, name: &str, rows: usize, columns: usize) -> Matrix {
        Matrix {
            name: name.to_owned(),
            meaning: format!("for {QUOTES}"),
            rows: (1..=rows).map(|k| format!("z{k} <{k}>")).collect(),
            columns: (1..=columns).map(|k| format!("ζ{k} & 'q'")).collect(),
            values: (0..rows).map(|_| (0..columns).map(|_| self.next()).collect()).collect(),
        }
    }

    fn signals(&mut self, kind: &str, count: usize) -> Vec<Signal> {
        (1..=count)
            .map(|k| Signal {
                name: format!("{kind}{k} {QUOTES}"),
                unit: (k > 1).then(|| "µm/√s <".to_owned()),
                description: format!("température {MARKUP}"),
                operating: self.next(),
                notes: "at most 3 & at least 1".to_owned(),
            })
            .collect()
    }
}

fn sampled_loop(matrix: &str, rates: &[[f64; 2]], region: Option<Region>) -> Loop {
    let place = |[re, im]: &[f64; 2]| {
        let (sine, cosine) = (im * PERIOD).sin_cos();
        [(re * PERIOD).exp() * cosine, (re * PERIOD).exp() * sine]
    };
    let eigenvalues: Vec<_> = rates.iter().map(place).collect();
    Loop {
        matrix: matrix.to_owned(),
        method: format!("weights {QUOTES}"),
        wanted: Vec::new(),
        required: if region.is_some() { Vec::new() } else { eigenvalues.clone() },
        eigenvalues,
        condition: Some(1.234_567_89e3),
        balanced_condition: Some(f64::INFINITY),
        pole_error: None,
        region,
        norm: None,
    }
}

fn curve(index: u32) -> Curve {
    // One curve has other times, with a long gap.
    let has = |k: &u32| index != 2 || !(20..320).contains(k) && k % 3 != 1;
    let times: Vec<f64> = (0..=400).filter(has).map(|k| f64::from(k) * PERIOD).collect();
    let wave = |time: &f64| (-time * 20.0).exp() * (time * f64::from(index) * 30.0 * PI).sin();
    Curve {
        name: format!("error {index} {QUOTES}"),
        unit: (index != 2).then(|| MARKUP.to_owned()),
        peak: 0.987_654_321,
        peak_time: 0.012_345,
        settling_time: 0.1357,
        values: times.iter().map(wave).collect(),
        times,
    }
}

fn frequency(count: u32) -> Frequency {
    let frequencies: Vec<f64> = (0..=100).map(|k| 10_f64.powf(f64::from(k) / 25.0)).collect();
    let value = |order: u32, w: &f64| 1.0 / (1.0 + w / 10_f64.powf(f64::from(order)));
    Frequency {
        name: format!("faults to estimates {QUOTES}"),
        singular_values: (0..count)
            .map(|k| frequencies.iter().map(|w| value(4 - k, w)).collect())
            .collect(),
        frequencies,
    }
}

fn certificate(numbers: &mut Numbers) -> Certificate {
    Certificate {
        printed: Err(format!("the design is sampled {MARKUP}")),
        free: Ok(FreeP {
            decay: 12.345_678_9,
            decay_margin: 2.5e-9,
            delta: 0.012_345_678_9,
            p: numbers.matrix("", 13, 13).values,
            margin: 1.5e-9,
        }),
        ultimate: Ok(Ultimate {
            rate: 3.25,
            radius: 0.0625,
            peaks: vec![0.03125, 0.015_625],
            margin: 1.25e-9,
        }),
        norms: vec![Norm {
            name: "H∞ <".to_owned(),
            from: QUOTES.to_owned(),
            to: MARKUP.to_owned(),
            value: 3.333_333_3e-4,
            method: "bisection & eigenvalues".to_owned(),
        }],
    }
}

fn region() -> Region {
    Region {
        decay: Some(3.25),
        disc_center: Some(-400.0),
        disc_radius: Some(398.5),
        sector: Some(45.5),
    }
}

fn reconfiguration() -> ReconfigurationReport {
    let number = || Number { name: MARKUP.to_owned(), unit: Some(QUOTES.to_owned()), value: -0.0 };
    let reconfigured = Reconfigured {
        method: MARKUP.to_owned(),
        residual: 0.25,
        eigenvalues: vec![[-1.0, 2.0], [-1.0, -2.0]],
        gain_norm: f64::NAN,
        intact_gain_norm: 1e300,
        k_x: vec![vec![1.0]],
        k_f: vec![vec![1.0]],
        k_s: vec![vec![1.0]],
        commands: vec![number()],
        beyond_limits: vec![MARKUP.to_owned()],
        measurements: vec![number()],
        kept: false,
    };
    let without = |outcome| WithoutActuator {
        actuator: QUOTES.to_owned(),
        unit: None,
        stuck_at: 0.0,
        outcome,
    };
    ReconfigurationReport {
        by_estimate: Some([0.9, 1.0]),
        without: vec![without(Ok(reconfigured)), without(Err(MARKUP.to_owned()))],
        several: vec![WithoutSeveral {
            actuators: vec![QUOTES.to_owned(), MARKUP.to_owned()],
            outcome: Err(QUOTES.to_owned()),
        }],
        by_fallback: vec![ServedByFallback {
            actuators: vec![MARKUP.to_owned()],
            decay: -0.0,
            stable: false,
        }],
    }
}

fn fallback() -> FallbackReport {
    let number = || Number { name: MARKUP.to_owned(), unit: Some(QUOTES.to_owned()), value: -0.0 };
    let case = FallbackCase {
        name: QUOTES.to_owned(),
        decay: 0.5,
        feedback_decay: f64::NAN,
        points: Vec::new(),
        delay_margin: f64::INFINITY,
        price: vec![number()],
        commands: vec![number()],
        beyond_limits: vec![MARKUP.to_owned()],
        measurements: vec![number()],
    };
    FallbackReport {
        loss: 1.0,
        method: MARKUP.to_owned(),
        decay: 0.5,
        compensates: false,
        k_x: vec![vec![1.0]],
        gain_norm: f64::NAN,
        intact_gain_norm: 1e300,
        intact_decay: 1.0,
        feedback: CommonCertificate { p: vec![vec![1.0]], margin: 1e-300 },
        whole: Err(MARKUP.to_owned()),
        whole_left_out: false,
        cases: vec![case],
    }
}

fn losses() -> LossReport {
    let numbers = || vec![Number { name: MARKUP.to_owned(), unit: None, value: 0.25 }];
    let constant = || ConstantLoss { losses: numbers(), stable: false, factor: 1.5 };
    let loop_losses = |proof| LossLoop {
        name: format!("passive {QUOTES}"),
        meaning: MARKUP.to_owned(),
        constant: vec![constant()],
        proof,
        certified: vec![CertifiedLoss { losses: numbers(), factor: f64::NAN }],
    };
    let peak = LossPeak {
        disturbance: MARKUP.to_owned(),
        size: f64::INFINITY,
        state: QUOTES.to_owned(),
        unit: Some(MARKUP.to_owned()),
        largest: -0.0,
    };
    let proof = LossProof { margin: 1e-300, p: vec![vec![1.0]], decay: None, peaks: vec![peak] };
    LossReport {
        stated: numbers(),
        loops: vec![loop_losses(Ok(proof)), loop_losses(Err(MARKUP.to_owned()))],
    }
}

fn interface() -> Vec<Variable> {
    (1..=40)
        .map(|k| Variable {
            name: format!("L_x[{k},1] {QUOTES}"),
            causality: "parameter".to_owned(),
            variability: "tunable".to_owned(),
            unit: (k == 1).then(|| "N·m".to_owned()),
            start: Some(format!("{MARKUP} {k}")),
            description: QUOTES.to_owned(),
        })
        .collect()
}

fn plant(numbers: &mut Numbers) -> Plant {
    let mut extremes = numbers.matrix(MARKUP, 2, 3);
    extremes.values = vec![vec![-0.0, f64::MAX, 5e-324], vec![0.1 + 0.2, -1e16, f64::MIN_POSITIVE]];
    Plant {
        origin: format!("Linearised from Plant.fmu {MARKUP}"),
        states: numbers.signals("x", 10),
        actuators: numbers.signals("u", 3),
        measurements: numbers.signals("y", 8),
        faults: numbers.signals("f", 3),
        matrices: vec![
            numbers.matrix("A", 10, 10),
            numbers.matrix("C'", 10, 8),
            numbers.matrix("1x1", 1, 1),
            extremes,
        ],
        eigenvalues: vec![[1e-17, 0.0], [0.5, 2.0], [0.5, -2.0], [-3.0, 0.0]],
        sample_time: None,
    }
}

fn bare_plant() -> Plant {
    let signal = |name: &str| Signal {
        name: name.to_owned(),
        unit: None,
        description: String::new(),
        operating: 0.0,
        notes: String::new(),
    };
    Plant {
        origin: String::new(),
        states: vec![signal("x1")],
        actuators: vec![signal("u1")],
        measurements: vec![signal("y1")],
        faults: vec![signal("f1")],
        matrices: Vec::new(),
        eigenvalues: vec![[0.0, 0.0]],
        sample_time: None,
    }
}

/// Infinite margins, and names that contain markup and quotes.
fn robustness(numbers: &mut Numbers) -> Robustness {
    let disk = || Disk {
        alpha: 2.5,
        certified: 2.25,
        frequency: f64::INFINITY,
        gain: [0.0, f64::INFINITY],
        phase: 102.6,
    };
    let channel = |name: &str| Channel {
        name: name.to_owned(),
        gain: [0.0, f64::INFINITY],
        phase: f64::INFINITY,
        delay: 1e-9,
        disk: disk(),
    };
    let point = |point: &str| LoopPoint {
        point: point.to_owned(),
        s_peak: 1.5e5,
        s_frequency: 12.0,
        t_peak: 1.5e5,
        t_frequency: 12.0,
        s_peak_scaled: 3.0,
        judged: 3.0,
        judged_frequency: f64::INFINITY,
        together: disk(),
        channels: vec![channel(MARKUP), channel(QUOTES)],
    };
    Robustness {
        delays: Some(ExactDelays {
            observer_order: 3,
            judged_order: 10,
            s_peaks: [1.5e5, f64::INFINITY],
            difference: 3.25,
            frequency: f64::INFINITY,
            frequencies: 900,
        }),
        points: vec![point("input"), point("output")],
        delay_margin: f64::INFINITY,
        longest_hold: 0.0,
        noise_of_measurements: vec![1.0; 8],
        noise: numbers.matrix("noise", 3, 8),
        noise_together: vec![Number { name: QUOTES.to_owned(), unit: None, value: 3.25 }],
        comparison: vec![Compared {
            name: MARKUP.to_owned(),
            design: 12.5,
            linear_quadratic: None,
        }],
        tolerance: ToleranceResult {
            entries: 0,
            varying: Vec::new(),
            parameters: vec![Parameter {
                name: QUOTES.to_owned(),
                unit: Some(QUOTES.to_owned()),
                value: 1.0,
                limits: [0.5, 1.5],
                worst: 0.5,
                effects: vec![0.25, 0.75],
            }],
            cases: 200,
            seed: 1,
            stable: Some(0.125),
            worst_instability: 0.5,
            first_unstable: 0.75,
            worst: vec![numbers.matrix("A", 10, 10)],
        },
        tolerance_proof: Err(MARKUP.to_owned()),
        sensitivity: vec![PeakSensitivity {
            point: QUOTES.to_owned(),
            matrices: vec![numbers.matrix("A", 10, 10)],
        }],
        curves: vec![frequency(2)],
    }
}

fn detection(numbers: &mut Numbers) -> Detection {
    Detection {
        method: MARKUP.to_owned(),
        sample_time: PERIOD,
        from: 0.0,
        false_alarm_interval: 3600.0,
        noise: vec![0.125],
        process_noise: format!("{MARKUP} {QUOTES}"),
        tests: vec![Test {
            name: MARKUP.to_owned(),
            residuals: 1,
            drift: Some(0.5),
            window: None,
            model_error: 0.25,
            interior_excess: Some(0.125),
            threshold: 5.5,
            false_alarm_interval: 3600.0,
            decoupled: vec![DecoupledInput {
                name: QUOTES.to_owned(),
                exact: false,
                size: None,
                largest_mean: 0.125,
            }],
        }],
        faults: vec![DetectedFault {
            fault: MARKUP.to_owned(),
            unit: Some(QUOTES.to_owned()),
            size: 0.5,
            test: MARKUP.to_owned(),
            mean: 1.5,
            delay: None,
            delay_90: Some(2.5),
            within: 3.5,
            least: None,
        }],
        structure: numbers.matrix("structure", 1, 1),
        reacts: vec![vec![true]],
        confused: vec![vec![MARKUP.to_owned(), QUOTES.to_owned()]],
        parameter_cases: Some(ParameterCases::new(200, 1)),
    }
}

/// A sampled design with all sections.
pub(super) fn hostile() -> Report {
    let mut numbers = Numbers(7);
    let rates = [[-4.0, 3.0], [-4.0, -3.0], [-60.0, 0.0], [-300.0, 200.0], [-300.0, -200.0]];
    let check = |condition: &str, holds, value| Check {
        condition: format!("{condition} {QUOTES}"),
        holds,
        value,
        explanation: MARKUP.to_owned(),
    };
    Report {
        description: format!("Tanks «Überlauf» {MARKUP}"),
        plant_file: format!("C:\\plants\\{QUOTES}.toml"),
        plant: plant(&mut numbers),
        warnings: vec![format!("{MARKUP}:1:2: {QUOTES}")],
        verdict: Verdict {
            level: Level::Red,
            reasons: vec![format!("the peak of S {MARKUP}")],
            remedies: vec![Remedy {
                reason: format!("the peak of S {MARKUP}"),
                change: format!("with {MARKUP}"),
                lines: vec![MARKUP.to_owned()],
            }],
            limits: Limits { amber: 2.0, red: 4.0, tolerance: [0.0; 4] },
        },
        robustness: Some(robustness(&mut numbers)),
        checks: vec![check("observable", true, None), check("detectable", false, Some(2.75e-13))],
        gains: vec![numbers.matrix("L_x", 10, 8), numbers.matrix("L_f", 3, 8)],
        pid: Vec::new(),
        feedback: sampled_loop("Φ + Γ K_x", &rates, Some(region())),
        observer: sampled_loop("Φ_0 - L C_0", &rates[2..], None),
        estimation: Estimation {
            law: QUOTES.to_owned(),
            sources: MARKUP.to_owned(),
            equations: vec![format!("f' = L {MARKUP}")],
            parameters: vec![Number { name: QUOTES.to_owned(), unit: None, value: 0.5 }],
            conditions: vec![check("rank", true, Some(2.0))],
            errors: vec![EstimationErrors {
                fault: MARKUP.to_owned(),
                unit: Some(QUOTES.to_owned()),
                constant: 0.0,
                step_settling: 0.25,
                step_peak: 1.0,
                ramp: None,
                sine: 0.125,
                sine_frequency: 3.5,
                peak_gain: 2.0,
                noise: Some(f64::INFINITY),
                noise_peak: None,
            }],
        },
        sampling: Some(Sampled { sample_time: PERIOD, estimator: "current".to_owned() }),
        detection: Some(detection(&mut numbers)),
        certificate: certificate(&mut numbers),
        bounds: (1..=3)
            .map(|k| Bound {
                fault: format!("f{k} {QUOTES}"),
                error: MARKUP.to_owned(),
                unit: None,
                gain_of_fault: numbers.next(),
                gain_of_rate: numbers.next(),
                largest: (k == 2).then_some(4.321e-5),
            })
            .collect(),
        steps: (1..=3)
            .map(|k| StepResponse {
                fault: format!("f{k} {QUOTES}"),
                unit: None,
                size: 0.375,
                rate: Some(12.25),
                parts: Vec::new(),
                curves: (1..=5).map(curve).collect(),
            })
            .collect(),
        frequency: vec![frequency(3), frequency(1)],
        references: references(),
        family: None,
        schedule: None,
        effectiveness: vec![Effectiveness {
            actuator: QUOTES.to_owned(),
            largest_stable_loss: 0.625_125,
        }],
        losses: Some(losses()),
        reconfiguration: Some(reconfiguration()),
        fallback: Some(fallback()),
        assumptions: vec![format!("linear {MARKUP}"), "bell \u{7} and nul \0".to_owned()],
        interface: interface(),
    }
}

/// A step of a reference whose names are markup.
fn references() -> Vec<ReferenceStep> {
    vec![ReferenceStep {
        reference: MARKUP.to_owned(),
        unit: Some(QUOTES.to_owned()),
        size: -0.25,
        stated: true,
        rise_time: None,
        overshoot: 0.125,
        settling_time: 3.5,
        steady_state_error: 1e-17,
        commands: vec![CommandPeak {
            name: QUOTES.to_owned(),
            unit: None,
            range: [-1.5, 0.75],
            limits: Some([-1.0, 1.0]),
            final_value: 0.5,
        }],
        others: vec![Number { name: MARKUP.to_owned(), unit: None, value: 0.0625 }],
        largest_step: [f64::NEG_INFINITY, 2.5],
        curves: (1..=2).map(curve).collect(),
    }]
}

/// A scalar plant without optional data.
pub(super) fn bare() -> Report {
    let system = |pole: f64| Loop {
        matrix: "a".to_owned(),
        method: "given".to_owned(),
        wanted: Vec::new(),
        required: Vec::new(),
        eigenvalues: vec![[pole, 0.0]],
        condition: None,
        balanced_condition: None,
        pole_error: None,
        region: None,
        norm: None,
    };
    Report {
        description: String::new(),
        plant_file: "plant.toml".to_owned(),
        plant: bare_plant(),
        warnings: vec![format!("{MARKUP}:1:2: {QUOTES}")],
        verdict: Verdict {
            level: Level::Green,
            reasons: Vec::new(),
            remedies: Vec::new(),
            limits: Limits { amber: 2.0, red: 4.0, tolerance: [0.0; 4] },
        },
        checks: Vec::new(),
        robustness: None,
        gains: Vec::new(),
        pid: Vec::new(),
        feedback: system(-1.5),
        observer: system(-20.25),
        estimation: Estimation::default(),
        sampling: None,
        detection: None,
        certificate: Certificate {
            printed: Ok(Theorem1 {
                alpha: 1.0,
                beta: 2.5,
                p: vec![vec![0.5]],
                smallest_eigenvalue: 0.5,
                largest_eigenvalue: 0.5,
                residual: 1.25e-16,
                delta: 0.75,
            }),
            free: Err("not asked for".to_owned()),
            ultimate: Err("without \"rate_bound\"".to_owned()),
            norms: Vec::new(),
        },
        bounds: Vec::new(),
        steps: Vec::new(),
        references: Vec::new(),
        frequency: Vec::new(),
        family: None,
        schedule: None,
        effectiveness: Vec::new(),
        losses: None,
        reconfiguration: None,
        fallback: None,
        assumptions: Vec::new(),
        interface: Vec::new(),
    }
}
