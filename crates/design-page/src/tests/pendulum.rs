//! The page of the paper's pendulum: its gains as committed, its curves computed here.

use control::aso::{Estimator, FaultyPlant, Gains};
use control::exponential::exponential;
use nalgebra::{Complex, DMatrix, DVector};

use design_report::{
    Bound, Certificate, Check, Curve, Estimation, Frequency, Loop, Matrix, Norm, Plant, Report,
    Signal, StepResponse, Theorem1,
};

use design_report::robustness::{Level, Limits, Verdict};

const DESIGN: &str = include_str!("../../../../fmu-controller/resources/design.toml");
const STATES: [(&str, &str, &str); 4] = [
    ("x_p", "m", "cart position"),
    ("theta", "rad", "pendulum angle"),
    ("v_p", "m/s", "cart velocity"),
    ("omega", "rad/s", "angular velocity of the pendulum"),
];

fn rows_of(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn pairs(numbers: &[Complex<f64>]) -> Vec<[f64; 2]> {
    numbers.iter().map(|number| [number.re, number.im]).collect()
}

fn named(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn signal((name, unit, description): (&str, &str, &str), notes: &str) -> Signal {
    Signal {
        name: name.to_owned(),
        unit: Some(unit.to_owned()),
        description: description.to_owned(),
        operating: 0.0,
        notes: notes.to_owned(),
    }
}

struct Design {
    plant: FaultyPlant,
    gains: Gains,
}

impl Design {
    fn read() -> Self {
        let file: toml::Table = DESIGN.parse().unwrap();
        let matrix = |name: &str| {
            let rows: Vec<Vec<f64>> = file[name].clone().try_into().unwrap();
            DMatrix::from_row_iterator(rows.len(), rows[0].len(), rows.iter().flatten().copied())
        };
        Self {
            plant: FaultyPlant::with_constant_faults(
                matrix("A"),
                matrix("B"),
                matrix("C"),
                matrix("F_a"),
            ),
            gains: Gains {
                estimator: Estimator::Prediction,
                k_x: matrix("K_x"),
                k_f: matrix("K_f"),
                l_x: matrix("L_x"),
                l_f: matrix("L_f"),
                p_f: None,
                integral: None,
            },
        }
    }

    /// The curves after a sudden fault: [x; e; eps] starts at [0; 0; -size].
    fn step(&self, size: f64) -> StepResponse {
        let (plant, gains) = (&self.plant, &self.gains);
        let mut all = DMatrix::zeros(9, 9);
        all.view_mut((0, 0), (4, 4)).copy_from(&gains.controlled_dynamics(plant));
        all.view_mut((0, 4), (4, 4)).copy_from(&(-(&plant.b * &gains.k_x)));
        all.view_mut((0, 8), (4, 1)).copy_from(&(&plant.b * &gains.k_f));
        all.view_mut((4, 4), (5, 5)).copy_from(&gains.error_dynamics(plant));
        let mut start = DVector::zeros(9);
        start[8] = -size;
        let times: Vec<f64> = (0..=240).map(|k| 10_f64.powf(f64::from(k) / 40.0 - 5.0)).collect();
        let states: Vec<_> =
            times.iter().map(|time| exponential(&(&all * *time)).unwrap() * &start).collect();
        let curve = |name: &str, unit: &str, value: &dyn Fn(&DVector<f64>) -> f64| {
            self::curve(name, unit, &times, states.iter().map(value).collect())
        };
        let mut curves = vec![curve("estimate of f_fric", "N", &|state| size + state[8])];
        for (index, (name, unit, _)) in STATES.iter().enumerate() {
            curves.push(curve(&format!("error of {name}"), unit, &|state| state[4 + index]));
        }
        for (index, (name, unit, _)) in STATES.iter().enumerate() {
            curves.push(curve(name, unit, &|state| state[index]));
        }
        StepResponse {
            fault: "f_fric".to_owned(),
            unit: Some("N".to_owned()),
            size,
            rate: None,
            parts: Vec::new(),
            curves,
        }
    }

    /// Gains from the fault to its estimate and from its rate to the error.
    fn frequencies(&self) -> Vec<Frequency> {
        let error = self.gains.error_dynamics(&self.plant);
        let frequencies: Vec<f64> =
            (0..=140).map(|k| 10_f64.powf(f64::from(k) / 20.0 - 2.0)).collect();
        let solve = |frequency: &f64| {
            let s = DMatrix::from_diagonal_element(5, 5, Complex::new(0.0, *frequency));
            let mut input = DVector::from_element(5, Complex::new(0.0, 0.0));
            input[4].re = -1.0;
            (s - error.map(|entry| Complex::new(entry, 0.0))).lu().solve(&input).unwrap()
        };
        let solutions: Vec<_> = frequencies.iter().map(solve).collect();
        let estimate = frequencies.iter().zip(&solutions).map(|(frequency, solution)| {
            (Complex::new(1.0, 0.0) + solution[4] * Complex::new(0.0, *frequency)).norm()
        });
        let frequency = |name: &str, values: Vec<f64>| Frequency {
            name: name.to_owned(),
            frequencies: frequencies.clone(),
            singular_values: vec![values],
        };
        vec![
            frequency("fault to its estimate", estimate.collect()),
            frequency(
                "rate of the fault to all errors",
                solutions.iter().map(nalgebra::Matrix::norm).collect(),
            ),
        ]
    }

    fn matrices(&self) -> [Vec<Matrix>; 2] {
        let states = named(&STATES.map(|state| state.0));
        let (u, y, f) = (named(&["u"]), named(&["x_p", "theta"]), named(&["f_fric"]));
        let matrix =
            |name: &str, meaning: &str, rows: &[String], columns: &[String], values| Matrix {
                name: name.to_owned(),
                meaning: meaning.to_owned(),
                rows: rows.to_vec(),
                columns: columns.to_vec(),
                values: rows_of(values),
            };
        let (plant, gains) = (&self.plant, &self.gains);
        [
            vec![
                matrix("A", "dynamics", &states, &states, &plant.a),
                matrix("B", "from the actuators", &states, &u, &plant.b),
                matrix("C", "to the measurements", &y, &states, &plant.c),
                matrix("F_a", "from the faults", &states, &f, &plant.f_a),
            ],
            vec![
                matrix("K_x", "feedback of the estimated states", &u, &states, &gains.k_x),
                matrix("K_f", "compensation of the estimated faults", &u, &f, &gains.k_f),
                matrix("L_x", "correction of the estimated states", &states, &y, &gains.l_x),
                matrix("L_f", "correction of the estimated faults", &f, &y, &gains.l_f),
            ],
        ]
    }

    fn certificate(&self) -> Certificate {
        let theorem = control::theorem1::certify(&self.plant, &self.gains, 1.0, 30.0).unwrap();
        let norm = |name: &str, value| Norm {
            name: name.to_owned(),
            from: "rate of f_fric".to_owned(),
            to: "all errors".to_owned(),
            value,
            method: "eigenvalues of the Hamiltonian matrix".to_owned(),
        };
        Certificate {
            printed: Ok(Theorem1 {
                alpha: theorem.alpha,
                beta: theorem.beta,
                p: rows_of(&theorem.p),
                smallest_eigenvalue: theorem.p_range.0,
                largest_eigenvalue: theorem.p_range.1,
                residual: theorem.residual,
                delta: theorem.delta,
            }),
            free: Err("numerical trouble at a decay rate of 1187 1/s".to_owned()),
            ultimate: Err("it needs `rate_bound` for every fault".to_owned()),
            norms: vec![norm("H-infinity", 0.002_513_7), norm("generalised H2", 0.041_27)],
        }
    }
}

fn curve(name: &str, unit: &str, times: &[f64], values: Vec<f64>) -> Curve {
    let largest = |a: &usize, b: &usize| values[*a].abs().total_cmp(&values[*b].abs());
    let peak = (0..values.len()).max_by(largest).unwrap();
    let (end, size) = (values[values.len() - 1], values[peak].abs());
    let outside = values.iter().rposition(|value| (value - end).abs() > 0.02 * size);
    Curve {
        name: name.to_owned(),
        unit: Some(unit.to_owned()),
        peak: size,
        peak_time: times[peak],
        settling_time: times[outside.map_or(0, |last| last + 1)],
        times: times.to_vec(),
        values,
    }
}

fn checks() -> Vec<Check> {
    let check = |condition: &str, value, explanation: &str| Check {
        condition: condition.to_owned(),
        holds: true,
        value: Some(value),
        explanation: explanation.to_owned(),
    };
    vec![
        check(
            "(A, B) is controllable",
            0.1316,
            "rank 4 of 4; the number is the relative distance to a plant that is not",
        ),
        check("(A, C) is observable", 0.8721, "rank 4 of 4; the number is the relative distance"),
        check(
            "No invariant zero of (A, F_a, C) lies at the origin",
            0.0317,
            "rank 5 of 5 of [A, F_a; C, 0], so the constant fault f_fric can be seen in the measurements",
        ),
        check("B K_f = -F_a", 0.0, "the fault f_fric is cancelled exactly"),
    ]
}

fn bound(error: &str, unit: &str, gain_of_fault: f64, gain_of_rate: f64) -> Bound {
    Bound {
        fault: "f_fric".to_owned(),
        error: error.to_owned(),
        unit: Some(unit.to_owned()),
        gain_of_fault,
        gain_of_rate,
        largest: Some(30.0 * gain_of_fault),
    }
}

fn system(matrix: &str, required: &[f64], reached: &DMatrix<f64>, conditions: [f64; 3]) -> Loop {
    Loop {
        matrix: matrix.to_owned(),
        method: "eigenvalues placed for a small condition number (Kautsky, Nichols and Van Dooren)"
            .to_owned(),
        wanted: Vec::new(),
        required: required.iter().map(|pole| [*pole, 0.0]).collect(),
        eigenvalues: pairs(&control::eigen::eigenvalues(reached).unwrap()),
        condition: Some(conditions[0]),
        balanced_condition: Some(conditions[1]),
        pole_error: Some(conditions[2]),
        region: None,
        norm: None,
    }
}

fn plant(design: &Design, matrices: Vec<Matrix>) -> Plant {
    Plant {
        origin: "The plant file states the matrices.".to_owned(),
        states: STATES.map(|state| signal(state, "")).into(),
        actuators: vec![signal(("u", "N", "actuator force"), "no limits")],
        measurements: STATES[..2].iter().map(|state| signal(*state, "")).collect(),
        faults: vec![signal(
            ("f_fric", "N", "friction force on the cart"),
            "constant; enters by F_a; at most 30 N",
        )],
        eigenvalues: pairs(&control::eigen::eigenvalues(&design.plant.a).unwrap()),
        sample_time: None,
        matrices,
    }
}

/// The continuous design of the paper.
pub(super) fn pendulum() -> Report {
    let design = Design::read();
    let [matrices, gains] = design.matrices();
    Report {
        description: "Fault-tolerant controller of the inverted pendulum".to_owned(),
        plant_file: "pendulum.toml".to_owned(),
        plant: plant(&design, matrices),
        warnings: Vec::new(),
        verdict: Verdict {
            level: Level::Green,
            reasons: Vec::new(),
            remedies: Vec::new(),
            limits: Limits { amber: 2.0, red: 4.0, tolerance: [0.1; 4] },
        },
        checks: checks(),
        robustness: None,
        gains,
        pid: Vec::new(),
        feedback: system(
            "A + B K_x",
            &[-4.5, -6.0, -7.5, -9.0],
            &design.gains.controlled_dynamics(&design.plant),
            [1245.3, 402.1, 3.1e-14],
        ),
        observer: system(
            "A_0 - L C_0",
            &[-1200.0, -1500.0, -1800.0, -2100.0, -3000.0],
            &design.gains.error_dynamics(&design.plant),
            [8.31e6, 21.7, 4.4e-10],
        ),
        estimation: Estimation::default(),
        sampling: None,
        detection: None,
        certificate: design.certificate(),
        bounds: vec![
            bound("x_p", "m", 3.1e-6, 1.2e-9),
            bound("theta", "rad", 8.2e-6, 3.9e-9),
            bound("v_p", "m/s", 1.02e-3, 4.1e-7),
            bound("omega", "rad/s", 3.4e-3, 1.3e-6),
            bound("f_fric", "N", 2.31, 2.6e-3),
        ],
        steps: vec![design.step(60.0)],
        references: Vec::new(),
        frequency: design.frequencies(),
        family: None,
        schedule: None,
        effectiveness: Vec::new(),
        losses: None,
        reconfiguration: None,
        fallback: None,
        assumptions: vec![
            "The plant is linear around its operating point.".to_owned(),
            "Faults are constant; what they change by per second is a disturbance.".to_owned(),
            "The actuators have no limits and act without delay.".to_owned(),
        ],
        interface: Vec::new(),
    }
}
