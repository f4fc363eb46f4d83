//! A model with a variable of every type and role, for both interfaces, that fails on demand.
//!
//! x' = q (u - x), y = p x + u.

use std::cell::Cell;
use std::path::Path;

use fmu::{
    About, At, Enumeration, Event, Experiment, Failure, Model, ModelExchange, Step, Variable,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The methods of the model in which a failure can be planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    New,
    About,
    Variables,
    Exchange,
    Field,
    Check,
    Initialize,
    Step,
    Update,
    Differentiate,
    Indicators,
    Event,
    Clone,
    Drop,
    Serialize,
    Deserialize,
}

impl Place {
    pub const EVERY: [Place; 16] = [
        Place::New,
        Place::About,
        Place::Variables,
        Place::Exchange,
        Place::Field,
        Place::Check,
        Place::Initialize,
        Place::Step,
        Place::Update,
        Place::Differentiate,
        Place::Indicators,
        Place::Event,
        Place::Clone,
        Place::Drop,
        Place::Serialize,
        Place::Deserialize,
    ];
}

/// The failure that replaces the model's work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misbehaviour {
    Panic,
    Discard,
    Incomplete,
    Terminated,
    Error,
    Fatal,
}

impl Misbehaviour {
    pub const EVERY: [Misbehaviour; 6] = [
        Misbehaviour::Panic,
        Misbehaviour::Discard,
        Misbehaviour::Incomplete,
        Misbehaviour::Terminated,
        Misbehaviour::Error,
        Misbehaviour::Fatal,
    ];
}

thread_local! {
    static PLAN: Cell<Option<(Place, Misbehaviour)>> = const { Cell::new(None) };
    static HAPPENED: Cell<bool> = const { Cell::new(false) };
    static ALIVE: Cell<isize> = const { Cell::new(0) };
}

/// Runs `work` while the models of this thread fail by `plan`; returns whether the failure
/// happened.
pub fn with_plan<T>(plan: Option<(Place, Misbehaviour)>, work: impl FnOnce() -> T) -> (T, bool) {
    HAPPENED.set(false);
    PLAN.set(plan);
    let done = work();
    PLAN.set(None);
    (done, happened())
}

/// Whether the planned failure has happened in this thread.
pub fn happened() -> bool {
    HAPPENED.get()
}

/// Number of models that exist in this thread.
pub fn alive() -> isize {
    ALIVE.get()
}

/// Reports that the model's code has reached `place`, and fails if this is planned.
fn reach(place: Place, time: f64) -> Result<(), Failure> {
    let Some((_, misbehaviour)) = PLAN.get().filter(|(planned, _)| *planned == place) else {
        return Ok(());
    };
    HAPPENED.set(true);
    let message = || "100 % misbehaviour #1".to_owned();
    Err(match misbehaviour {
        Misbehaviour::Panic => panic!("100 % misbehaviour #1"),
        Misbehaviour::Discard => Failure::Discard(message()),
        Misbehaviour::Incomplete => Failure::Incomplete { time, message: message() },
        Misbehaviour::Terminated => Failure::Terminated { time, message: message() },
        Misbehaviour::Error => Failure::Error(message()),
        Misbehaviour::Fatal => Failure::Fatal(message()),
    })
}

/// The same for code that can fail by a panic only.
fn reach_infallible(place: Place) {
    if PLAN.get() == Some((place, Misbehaviour::Panic)) {
        HAPPENED.set(true);
        panic!("100 % misbehaviour #1");
    }
}

/// Counts the models that exist.
struct Witness;

impl Witness {
    fn new() -> Self {
        ALIVE.set(ALIVE.get() + 1);
        Self
    }
}

impl Clone for Witness {
    fn clone(&self) -> Self {
        reach_infallible(Place::Clone);
        Self::new()
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        ALIVE.set(ALIVE.get() - 1);
        reach_infallible(Place::Drop);
    }
}

impl Serialize for Witness {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        reach_infallible(Place::Serialize);
        serializer.serialize_unit()
    }
}

impl<'de> Deserialize<'de> for Witness {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        reach_infallible(Place::Deserialize);
        <()>::deserialize(deserializer).map(|()| Self::new())
    }
}

#[derive(Clone, Serialize, Deserialize)]
pub struct Machine {
    u: f64,
    u_slope: f64,
    x: f64,
    x_slope: f64,
    y: f64,
    y_slope: f64,
    p: f64,
    q: f64,
    guess: f64,
    half: f64,
    n: i32,
    side: i32,
    count: i32,
    on: bool,
    positive: bool,
    label: String,
    word: String,
    said: String,
    size: u64,
    v: Vec<f64>,
    witness: Witness,
}

/// Value references of the Reals; 0 is time.
pub mod real {
    pub const U: u32 = 1;
}

macro_rules! field {
    ($name:ident) => {
        |machine: &mut Self| {
            reach_infallible(Place::Field);
            &mut machine.$name
        }
    };
}

impl Model for Machine {
    const IDENTIFIER: &'static str = "Machine";
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        reach_infallible(Place::About);
        About::default()
    }

    fn new(_: &Path) -> Result<Self, Failure> {
        reach(Place::New, 0.0)?;
        Ok(Self {
            u: 0.0,
            u_slope: 0.0,
            x: 1.0,
            x_slope: 0.0,
            y: 0.0,
            y_slope: 0.0,
            p: 2.0,
            q: 0.5,
            guess: 3.0,
            half: 0.0,
            n: 0,
            side: 1,
            count: 0,
            on: false,
            positive: false,
            label: "100 %".to_owned(),
            word: String::new(),
            said: String::new(),
            size: 2,
            v: vec![0.0; 2],
            witness: Witness::new(),
        })
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        reach_infallible(Place::Variables);
        let sides = Enumeration::new("Side", [("left", 1), ("right", 2)]);
        let v =
            Variable::real_array("v", "", &[self.v.len()], |machine: &mut Self| &mut machine.v[..]);
        let v = v.map(|element| element.tunable().sized_by(&["size"]));
        let mut all = vec![
            Variable::real("u", "", field!(u)).input().derivative(field!(u_slope)),
            Variable::real("x", "", field!(x)).output(&["x"]).exact(),
            Variable::real("der(x)", "", field!(x_slope)).derivative_of("x"),
            Variable::real("y", "", field!(y)).output(&["u", "x"]).derivative(field!(y_slope)),
            Variable::real("p", "", field!(p)).range(-10.0, 10.0).parameter(),
            Variable::real("q", "", field!(q)).tunable(),
            Variable::real("guess", "", field!(guess)).approximate(),
            Variable::real("half", "", field!(half)).calculated_parameter(),
            Variable::integer("n", "", field!(n)).range(-5.0, 5.0).input(),
            Variable::enumeration("side", "", sides, field!(side)).tunable(),
            Variable::integer("count", "", field!(count)),
            Variable::boolean("on", "", field!(on)).input(),
            Variable::boolean("positive", "", field!(positive)).output(&["x"]),
            Variable::string("label", "", field!(label)).tunable(),
            Variable::string("word", "", field!(word)).input(),
            Variable::string("said", "", field!(said)).output(&["x"]),
            Variable::structural("size", "", field!(size)).tunable().max(5.0),
        ];
        all.extend(v);
        all
    }

    fn resize(&mut self) -> Result<(), Failure> {
        self.v.resize(usize::try_from(self.size).unwrap_or(usize::MAX), 0.0);
        Ok(())
    }

    fn check(&self) -> Result<(), Failure> {
        reach(Place::Check, 0.0)
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        reach(Place::Initialize, experiment.start_time)?;
        self.half = 0.5 * self.p;
        self.count = 0;
        self.compute();
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        reach(Place::Step, step.start + 0.5 * step.size)?;
        self.x += step.size * self.q * (self.u + 0.5 * step.size * self.u_slope - self.x);
        self.count = self.count.wrapping_add(1);
        self.compute();
        Ok(())
    }

    fn update(&mut self, time: f64) -> Result<(), Failure> {
        reach(Place::Update, time)?;
        self.compute();
        Ok(())
    }

    fn differentiate(&self, _: &At, direction: &mut Self) -> Result<(), Failure> {
        reach(Place::Differentiate, 0.0)?;
        direction.half = 0.5 * direction.p;
        direction.x_slope = self.q * (direction.u - direction.x);
        direction.y = self.p * direction.x + direction.u;
        Ok(())
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        reach_infallible(Place::Exchange);
        Some(ModelExchange { event_indicators: 1 })
    }

    fn event_indicators(&self, _: f64, indicators: &mut [f64]) {
        reach_infallible(Place::Indicators);
        assert_eq!(indicators, [0.0], "the model sees nothing of the importer's memory");
        indicators[0] = self.x;
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        reach(Place::Event, time)?;
        let late = time > 50.0;
        Ok(Event {
            terminate_simulation: late.then(|| "late".to_owned()),
            next_event_time: Some(time + 1.0),
            ..Event::default()
        })
    }
}

impl Machine {
    fn compute(&mut self) {
        self.x_slope = self.q * (self.u - self.x);
        self.y = self.p * self.x + self.u;
        self.y_slope = self.p * self.x_slope + self.u_slope;
        self.positive = self.x > 0.0;
        self.said = format!("{} {}", self.label, self.positive);
    }
}
