//! Predicts how an instance of [`Machine`](crate::machine::Machine) must answer. This is an
//! independent statement of the standard: the tables of sections 3.2.3 and 4.2.4 and the text.

use std::sync::OnceLock;

use fmu::call_order::{Function, State};

use crate::machine::Misbehaviour;

/// Sets of statuses, as bit masks.
pub const OK: u8 = 1;
pub const DISCARD: u8 = 1 << 2;
pub const ERROR: u8 = 1 << 3;
pub const FATAL: u8 = 1 << 4;

const EXCHANGE: &str =
    include_str!("../../../crates/fmu-description/src/call_order/section_3_2_3.csv");
const SIMULATION: &str =
    include_str!("../../../crates/fmu-description/src/call_order/section_4_2_4.csv");

/// The entries of a table, by function and state.
type Table = Vec<[bool; State::EVERY.len()]>;

fn read(text: &str) -> Table {
    let head: Vec<_> = text.lines().next().unwrap_or_default().split(',').collect();
    let row = |function: &Function| {
        let row = text.lines().find(|line| line.split(',').next() == Some(function.name()));
        State::EVERY.map(|state| {
            let name = format!("{state:?}");
            let column = head.iter().position(|column_name| *column_name == name);
            let cell = column.zip(row).and_then(|(column, row)| row.split(',').nth(column));
            cell.is_some_and(|cell| cell != "-")
        })
    };
    Function::EVERY.iter().map(row).collect()
}

/// Whether the table of the interface has an entry for the function in that state.
pub fn in_table(exchange: bool, function: Function, state: State) -> bool {
    static TABLES: OnceLock<[Table; 2]> = OnceLock::new();
    let tables = TABLES.get_or_init(|| [SIMULATION, EXCHANGE].map(read));
    tables[usize::from(exchange)][function as usize][state as usize]
}

/// Whether the function may return `fmi2Discard` (section 2.1.3).
fn may_discard(exchange: bool, function: Function) -> bool {
    use Function as F;
    match function {
        F::SetReal | F::SetInteger | F::SetBoolean | F::SetString => true,
        F::SetContinuousStates
        | F::GetReal
        | F::GetDerivatives
        | F::GetContinuousStates
        | F::GetEventIndicators => exchange,
        F::DoStep
        | F::GetStatus
        | F::GetRealStatus
        | F::GetIntegerStatus
        | F::GetBooleanStatus
        | F::GetStringStatus => !exchange,
        _ => false,
    }
}

/// Values that were set and must be read back.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// u, p, q, guess.
    pub reals: [f64; 4],
    /// n, side.
    pub integers: [i32; 2],
    pub on: bool,
    /// label, word.
    pub strings: [String; 2],
}

impl Values {
    /// The place at which the Real is kept; not x, because the model changes it.
    pub fn place_of_real(reference: u32) -> Option<usize> {
        [1, 5, 6, 7].iter().position(|known| *known == reference)
    }

    fn new() -> Self {
        Self {
            reals: [0.0, 2.0, 0.5, 3.0],
            integers: [0, 1],
            on: false,
            strings: ["100 %".to_owned(), String::new()],
        }
    }
}

/// The content of an FMU state.
#[derive(Clone, Debug, PartialEq)]
pub struct Core {
    pub exchange: bool,
    pub state: State,
    pub start: f64,
    pub stop: Option<f64>,
    pub time: f64,
    /// The times to which the importer may go back and of the last completed step, and that of the next event.
    pub earliest: f64,
    pub completed: f64,
    pub next_event: Option<f64>,
    pub ended: bool,
    pub values: Values,
}

impl Core {
    pub fn new(exchange: bool) -> Self {
        let values = Values::new();
        let state = State::Instantiated;
        Self {
            exchange,
            state,
            start: 0.0,
            stop: None,
            time: 0.0,
            earliest: 0.0,
            completed: 0.0,
            next_event: None,
            ended: false,
            values,
        }
    }

    /// The statuses that the call may return; `verdict` is the set that its arguments allow.
    pub fn statuses(
        &self,
        function: Function,
        verdict: u8,
        misbehaviour: Option<Misbehaviour>,
    ) -> u8 {
        if self.state == State::Fatal {
            return FATAL;
        }
        if !in_table(self.exchange, function, self.state) {
            return ERROR;
        }
        match misbehaviour {
            None if verdict & DISCARD != 0 && !may_discard(self.exchange, function) => ERROR,
            None => verdict,
            Some(Misbehaviour::Panic | Misbehaviour::Fatal) => FATAL,
            Some(Misbehaviour::Error) => ERROR,
            Some(_) if may_discard(self.exchange, function) => DISCARD,
            Some(_) => ERROR,
        }
    }

    /// Updates the predicted state after a call that returned `status`.
    pub fn after(&mut self, function: Function, status: u8, misbehaviour: Option<Misbehaviour>) {
        match status {
            DISCARD if function == Function::DoStep => {
                self.state = State::StepFailed;
                self.ended = misbehaviour == Some(Misbehaviour::Terminated);
            }
            ERROR => self.state = State::Error,
            FATAL => self.state = State::Fatal,
            _ => {}
        }
    }

    /// Whether a step may end there: not beyond `stopTime`, if it is defined (section 2.1.6).
    pub fn is_before_stop(&self, time: f64) -> bool {
        self.stop.is_none_or(|stop| time <= stop + 1e-9 * stop.abs().max(1.0))
    }

    /// Whether an event may be handled now: not past `stopTime`, and not long after the event that was due.
    pub fn takes_event(&self) -> bool {
        let delay = self.next_event.map_or(0.0, |next| self.time - next);
        self.is_before_stop(self.time) && delay <= 1e7
    }

    /// Whether the Real may be set now: the variables of `machine.rs` by section 2.2.7 and the
    /// conditions of the tables.
    pub fn settable_real(&self, reference: u32) -> bool {
        use State as S;
        let early = matches!(self.state, S::Instantiated | S::InitializationMode);
        let event = matches!(self.state, S::EventMode | S::StepComplete);
        let continuous = self.state == S::ContinuousTimeMode;
        match reference {
            1 => true,
            2 => early || continuous,
            5 => early,
            6 | 9 | 10 => early || event,
            7 => self.state == S::Instantiated,
            _ => false,
        }
    }

    /// Whether the Real is an unknown of the equations solved in this state.
    pub fn is_unknown(&self, reference: u32) -> bool {
        match self.state {
            State::InitializationMode => [3, 4, 8].contains(&reference),
            _ => [2, 3, 4].contains(&reference),
        }
    }

    /// Whether the Real is a known of the equations solved in this state.
    pub fn is_known(&self, reference: u32) -> bool {
        match self.state {
            State::InitializationMode => [0, 1, 2, 5, 6, 9, 10].contains(&reference),
            _ => [0, 1, 2].contains(&reference),
        }
    }
}
