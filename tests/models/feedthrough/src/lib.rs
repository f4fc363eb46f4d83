//! The variables of the model Feedthrough of the Reference-FMUs, for the benchmark against it.
#![forbid(unsafe_code)]

use std::path::Path;

use fmu::{About, Enumeration, Experiment, Failure, Model, Step, Variable};
use serde::{Deserialize, Serialize};

/// Outputs that equal their inputs. A step does nothing else.
#[derive(Clone, Serialize, Deserialize)]
struct Feedthrough {
    fixed: f64,
    tunable: f64,
    continuous: [f64; 2],
    discrete: [f64; 2],
    integer: [i32; 2],
    boolean: [bool; 2],
    string: [String; 2],
    option: [i32; 2],
}

impl Model for Feedthrough {
    const IDENTIFIER: &'static str = "Feedthrough";

    fn about(&self) -> About {
        About { description: "Outputs that are their inputs".to_owned(), ..About::default() }
    }

    fn new(_resources: &Path) -> Result<Self, Failure> {
        Ok(Self {
            fixed: 0.0,
            tunable: 0.0,
            continuous: [0.0; 2],
            discrete: [0.0; 2],
            integer: [0; 2],
            boolean: [false; 2],
            string: ["Set me!", "Set me!"].map(str::to_owned),
            option: [1; 2],
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        let option = Enumeration::new("Option", [("Option 1", 1), ("Option 2", 2)]);
        let [fixed, tunable] = ["Float64_fixed_parameter", "Float64_tunable_parameter"];
        let [continuous, shown] = ["Float64_continuous_input", "Float64_continuous_output"];
        let [discrete, held] = ["Float64_discrete_input", "Float64_discrete_output"];
        vec![
            Variable::real(fixed, "", |model: &mut Self| &mut model.fixed).parameter(),
            Variable::real(tunable, "", |model: &mut Self| &mut model.tunable).tunable(),
            Variable::real(continuous, "", |model: &mut Self| &mut model.continuous[0]).input(),
            Variable::real(shown, "", |model: &mut Self| &mut model.continuous[1])
                .output(&[continuous]),
            Variable::real(discrete, "", |model: &mut Self| &mut model.discrete[0])
                .input()
                .discrete(),
            Variable::real(held, "", |model: &mut Self| &mut model.discrete[1])
                .output(&[discrete])
                .discrete(),
            Variable::integer("Int32_input", "", |model: &mut Self| &mut model.integer[0]).input(),
            Variable::integer("Int32_output", "", |model: &mut Self| &mut model.integer[1])
                .output(&["Int32_input"]),
            Variable::boolean("Boolean_input", "", |model: &mut Self| &mut model.boolean[0])
                .input(),
            Variable::boolean("Boolean_output", "", |model: &mut Self| &mut model.boolean[1])
                .output(&["Boolean_input"]),
            Variable::string("String_input", "", |model: &mut Self| &mut model.string[0]).input(),
            Variable::string("String_output", "", |model: &mut Self| &mut model.string[1])
                .output(&["String_input"]),
            Variable::enumeration("Enumeration_input", "", option.clone(), |model: &mut Self| {
                &mut model.option[0]
            })
            .input(),
            Variable::enumeration("Enumeration_output", "", option, |model: &mut Self| {
                &mut model.option[1]
            })
            .output(&["Enumeration_input"]),
        ]
    }

    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Failure> {
        self.feed_through();
        Ok(())
    }

    fn step(&mut self, _step: &Step) -> Result<(), Failure> {
        self.feed_through();
        Ok(())
    }

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.feed_through();
        Ok(())
    }
}

impl Feedthrough {
    fn feed_through(&mut self) {
        self.continuous[1] = self.continuous[0];
        self.discrete[1] = self.discrete[0];
        self.integer[1] = self.integer[0];
        self.boolean[1] = self.boolean[0];
        self.option[1] = self.option[0];
        let [input, output] = &mut self.string;
        output.clone_from(input);
    }
}

fmu::export!(Feedthrough);
