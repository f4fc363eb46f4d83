//! Sequences of calls of FMI 3.0 through the C entry points of [`Machine`], legal and illegal.
//!
//! Each status is compared with the lists of allowed functions of the standard; the state after a call
//! follows the figures of sections 3.2 and 4.2: an error leads to Terminated, a call that succeeds to the
//! mode that its name says.
#![expect(unsafe_code, reason = "calls of the C interface")]

use std::cell::Cell;
use std::ffi::{CString, c_int, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::OnceLock;

use fmu::abi3::fmi3Instance;
use fmu::call_order::{InterfaceType, State};
use fmu::call_order3::{Function, allowed};
use fmu::ffi::fmi3;

use crate::choice::Choice;
use crate::machine::Machine;

const ERROR: c_int = 3;
/// Bytes of one call.
pub const LENGTH: usize = 8;

/// The functions that are called; the others differ from these in the type of their values only, or refuse
/// always.
pub const FUNCTIONS: [Function; 35] = [
    Function::EnterInitializationMode,
    Function::ExitInitializationMode,
    Function::EnterEventMode,
    Function::EnterStepMode,
    Function::EnterContinuousTimeMode,
    Function::UpdateDiscreteStates,
    Function::DoStep,
    Function::GetFloat64,
    Function::SetFloat64,
    Function::GetInt32,
    Function::SetInt32,
    Function::GetInt64,
    Function::GetBoolean,
    Function::SetBoolean,
    Function::GetString,
    Function::GetBinary,
    Function::SetDebugLogging,
    Function::SetTime,
    Function::SetContinuousStates,
    Function::GetContinuousStates,
    Function::GetContinuousStateDerivatives,
    Function::GetEventIndicators,
    Function::GetNominalsOfContinuousStates,
    Function::GetNumberOfContinuousStates,
    Function::CompletedIntegratorStep,
    Function::GetOutputDerivatives,
    Function::GetDirectionalDerivative,
    Function::GetFMUState,
    Function::SetFMUState,
    Function::FreeFMUState,
    Function::EnterConfigurationMode,
    Function::ExitConfigurationMode,
    Function::SetUInt64,
    Function::Terminate,
    Function::Reset,
];

/// What the callback for intermediate update does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Deed {
    Nothing,
    SetInput,
    Free,
    Step,
}

/// `instanceEnvironment`.
struct Environment {
    instance: Cell<fmi3Instance>,
    deed: Cell<Deed>,
    input: u32,
    /// Whether a call in the callback was forbidden.
    forbidden: Cell<bool>,
}

unsafe extern "C" fn update(
    environment: *mut c_void,
    _time: f64,
    set_requested: u8,
    get_allowed: u8,
    finished: u8,
    can_return_early: u8,
    return_requested: *mut u8,
    return_time: *mut f64,
) {
    assert_eq!((set_requested, get_allowed, finished, can_return_early), (1, 0, 0, 0));
    assert!(!return_requested.is_null() && !return_time.is_null());
    // SAFETY: the environment of `Sequence::new`, whose instance waits for this callback.
    unsafe {
        let shared = &*environment.cast::<Environment>();
        let instance = shared.instance.get();
        match shared.deed.get() {
            Deed::Nothing => {}
            Deed::SetInput => {
                let (input, value) = (shared.input, 2.0);
                let status = fmi3::set_float64::<Machine>(
                    instance,
                    &raw const input,
                    1,
                    &raw const value,
                    1,
                );
                assert_eq!(status == ERROR, shared.forbidden.get());
            }
            // Has no effect during a call.
            Deed::Free => fmi3::free_instance::<Machine>(instance),
            Deed::Step => {
                shared.forbidden.set(true);
                let (mut flags, mut last) = ([0_u8; 3], 0.0);
                let [event, terminate, early] = &mut flags;
                let last = &raw mut last;
                let status =
                    fmi3::do_step::<Machine>(instance, 0.0, 1.0, 1, event, terminate, early, last);
                assert_eq!(status, ERROR);
            }
        }
    }
}

/// An instance and what the standard says about it.
struct Sequence {
    instance: fmi3Instance,
    environment: Box<Environment>,
    interface: InterfaceType,
    event_mode: bool,
    state: State,
    time: f64,
    /// The structural parameter.
    size: u64,
    saved: *mut c_void,
    /// State, time and structural parameter of `saved`.
    known: (State, f64, u64),
}

/// The structural parameter at the start.
const SIZE: u64 = 2;

/// The token, and the value references of a Float64, an Int32 and a Boolean that are inputs.
fn known() -> &'static (CString, u32, u32, u32) {
    static KNOWN: OnceLock<(CString, u32, u32, u32)> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let description = fmu::describe_3::<Machine>(Path::new("")).unwrap();
        let of = |name: &str| description.variable(name).unwrap().value_reference;
        (CString::new(description.guid.as_str()).unwrap(), of("u"), of("n"), of("on"))
    })
}

/// The value references of the structural parameter and of its array.
fn sized() -> (u32, u32) {
    static SIZED: OnceLock<(u32, u32)> = OnceLock::new();
    *SIZED.get_or_init(|| {
        let description = fmu::describe_3::<Machine>(Path::new("")).unwrap();
        let of = |name: &str| description.variable(name).unwrap().value_reference;
        (of("size"), of("v"))
    })
}

impl Sequence {
    fn new(choice: &mut Choice<'_>) -> Self {
        let &(ref token, input, ..) = known();
        let kind = choice.byte();
        let interface = if kind.is_multiple_of(3) {
            InterfaceType::ModelExchange
        } else {
            InterfaceType::CoSimulation
        };
        let event_mode = kind % 3 == 1;
        let environment = Box::new(Environment {
            instance: Cell::new(null_mut()),
            deed: Cell::new(Deed::Nothing),
            input,
            forbidden: Cell::new(false),
        });
        let context: *mut c_void = std::ptr::from_ref(&*environment).cast_mut().cast();
        let (name, token, none) = (c"one".as_ptr(), token.as_ptr(), null());
        // SAFETY: C strings; an environment that outlives the instance.
        let instance = unsafe {
            match interface {
                InterfaceType::ModelExchange => fmi3::instantiate_model_exchange::<Machine>(
                    name, token, none, 0, 0, context, None,
                ),
                InterfaceType::CoSimulation => fmi3::instantiate_co_simulation::<Machine>(
                    name,
                    token,
                    none,
                    0,
                    0,
                    event_mode.into(),
                    event_mode.into(),
                    &raw const input,
                    1,
                    context,
                    None,
                    Some(update),
                ),
            }
        };
        assert!(!instance.is_null());
        environment.instance.set(instance);
        let (state, saved) = (State::Instantiated, null_mut());
        let known = (state, 0.0, SIZE);
        let (time, size) = (0.0, SIZE);
        Self { instance, environment, interface, event_mode, state, time, size, saved, known }
    }

    /// Makes one call; panics if its status is none that the standard allows.
    fn call(&mut self, function: Function, choice: &mut Choice<'_>) {
        let legal = allowed(self.interface, function, self.state);
        self.environment.deed.set(choice.of(&[
            Deed::Nothing,
            Deed::SetInput,
            Deed::SetInput,
            Deed::Free,
            Deed::Step,
        ]));
        self.environment.forbidden.set(false);
        let status = self.perform(function, choice);
        assert!((0..=3).contains(&status), "{function:?} returns {status}");
        if !legal {
            assert_eq!(status, ERROR, "{function:?} in {:?}", self.state);
        }
        if status == ERROR {
            self.state = State::Terminated;
        } else {
            self.state = self.after(function);
        }
    }

    /// The state after a function that has succeeded.
    fn after(&self, function: Function) -> State {
        let exchange = self.interface == InterfaceType::ModelExchange;
        match function {
            Function::EnterInitializationMode => State::InitializationMode,
            Function::ExitInitializationMode if exchange || self.event_mode => State::EventMode,
            Function::ExitInitializationMode | Function::EnterStepMode => State::StepComplete,
            Function::EnterEventMode => State::EventMode,
            Function::EnterContinuousTimeMode => State::ContinuousTimeMode,
            Function::Terminate => State::Terminated,
            Function::Reset => State::Instantiated,
            Function::SetFMUState => self.known.0,
            Function::EnterConfigurationMode if self.state == State::Instantiated => {
                State::ConfigurationMode
            }
            Function::EnterConfigurationMode => State::ReconfigurationMode,
            Function::ExitConfigurationMode => match self.state {
                State::ConfigurationMode => State::Instantiated,
                _ if exchange => State::EventMode,
                _ => State::StepComplete,
            },
            _ => self.state,
        }
    }

    /// Calls the function with arguments of which some are forbidden.
    #[expect(clippy::too_many_lines, reason = "one arm for each function")]
    fn perform(&mut self, function: Function, choice: &mut Choice<'_>) -> c_int {
        let &(_, input, number, switch) = known();
        let odd = [0, 3, 40, u32::MAX];
        let reference = |choice: &mut Choice<'_>, fine: u32| choice.either(&[fine], &odd);
        let (real, integer) = (reference(choice, input), reference(choice, number));
        let boolean = reference(choice, switch);
        let mut value = choice.real();
        let (mut size, mut whole, mut flags) = (0_usize, 0_i32, [0_u8; 5]);
        let (mut long, mut text, mut bytes) = (0_i64, null(), null());
        let count = choice.either(&[1], &[0, 2]);
        let real = &raw const real;
        let instance = self.instance;
        // SAFETY: each pointer leads to as many elements as the call says; counts above 1 come with a
        // reference count of 1, which the FMU must compare before it reads or writes.
        unsafe {
            match function {
                Function::EnterInitializationMode => {
                    self.time = 0.0;
                    fmi3::enter_initialization_mode::<Machine>(instance, 0, 0.0, 0.0, 0, 0.0)
                }
                Function::ExitInitializationMode => {
                    fmi3::exit_initialization_mode::<Machine>(instance)
                }
                Function::EnterEventMode => fmi3::enter_event_mode::<Machine>(instance),
                Function::EnterStepMode => fmi3::enter_step_mode::<Machine>(instance),
                Function::EnterContinuousTimeMode => {
                    fmi3::enter_continuous_time_mode::<Machine>(instance)
                }
                Function::UpdateDiscreteStates => {
                    let [a, b, c, d, e] = &mut flags;
                    fmi3::update_discrete_states::<Machine>(instance, a, b, c, d, e, &raw mut value)
                }
                Function::DoStep => {
                    let step = choice.either(&[0.125], &[f64::NAN, -1.0, f64::INFINITY, 0.0]);
                    let start = choice.either(&[self.time], &[f64::NAN, 7.0]);
                    let [event, terminate, early, ..] = &mut flags;
                    let last = &raw mut value;
                    let status = fmi3::do_step::<Machine>(
                        instance, start, step, 1, event, terminate, early, last,
                    );
                    if status < 2 {
                        self.time = value;
                    }
                    assert!(!self.environment.forbidden.get() || status == ERROR);
                    status
                }
                Function::GetFloat64 => {
                    fmi3::get_float64::<Machine>(instance, real, 1, &raw mut value, count)
                }
                Function::SetFloat64 => {
                    fmi3::set_float64::<Machine>(instance, real, 1, &raw const value, count)
                }
                Function::GetInt32 => fmi3::get_int32::<Machine>(
                    instance,
                    &raw const integer,
                    1,
                    &raw mut whole,
                    count,
                ),
                Function::SetInt32 => fmi3::set_int32::<Machine>(
                    instance,
                    &raw const integer,
                    1,
                    &raw const whole,
                    count,
                ),
                Function::GetInt64 => fmi3::get_int64::<Machine>(
                    instance,
                    &raw const integer,
                    1,
                    &raw mut long,
                    count,
                ),
                Function::GetBoolean => fmi3::get_boolean::<Machine>(
                    instance,
                    &raw const boolean,
                    1,
                    flags.as_mut_ptr(),
                    count,
                ),
                Function::SetBoolean => fmi3::set_boolean::<Machine>(
                    instance,
                    &raw const boolean,
                    1,
                    flags.as_ptr(),
                    count,
                ),
                Function::GetString => fmi3::get_string::<Machine>(
                    instance,
                    &raw const integer,
                    1,
                    &raw mut text,
                    count,
                ),
                Function::GetBinary => fmi3::get_binary::<Machine>(
                    instance,
                    real,
                    1,
                    &raw mut size,
                    &raw mut bytes,
                    count,
                ),
                Function::SetDebugLogging => {
                    fmi3::set_debug_logging::<Machine>(instance, flags[0], 0, null())
                }
                Function::SetTime => {
                    self.time += 0.125;
                    fmi3::set_time::<Machine>(instance, choice.either(&[self.time], &[f64::NAN]))
                }
                Function::SetContinuousStates => {
                    fmi3::set_continuous_states::<Machine>(instance, &raw const value, count)
                }
                Function::GetContinuousStates => {
                    fmi3::get_continuous_states::<Machine>(instance, &raw mut value, count)
                }
                Function::GetContinuousStateDerivatives => {
                    fmi3::get_continuous_state_derivatives::<Machine>(
                        instance,
                        &raw mut value,
                        count,
                    )
                }
                Function::GetEventIndicators => {
                    fmi3::get_event_indicators::<Machine>(instance, &raw mut value, count)
                }
                Function::GetNominalsOfContinuousStates => {
                    fmi3::get_nominals_of_continuous_states::<Machine>(
                        instance,
                        &raw mut value,
                        count,
                    )
                }
                Function::GetNumberOfContinuousStates => {
                    fmi3::get_number_of_continuous_states::<Machine>(instance, &raw mut size)
                }
                Function::CompletedIntegratorStep => {
                    let [enter, terminate, ..] = &mut flags;
                    fmi3::completed_integrator_step::<Machine>(instance, 1, enter, terminate)
                }
                Function::GetOutputDerivatives => {
                    let order = choice.either(&[1], &[0, 9]);
                    fmi3::get_output_derivatives::<Machine>(
                        instance,
                        real,
                        1,
                        &raw const order,
                        &raw mut value,
                        count,
                    )
                }
                Function::GetDirectionalDerivative => {
                    let (seed, mut change) = (1.0, 0.0);
                    fmi3::get_directional_derivative::<Machine>(
                        instance,
                        real,
                        1,
                        real,
                        1,
                        &raw const seed,
                        1,
                        &raw mut change,
                        count,
                    )
                }
                Function::GetFMUState => {
                    let status = fmi3::get_fmu_state::<Machine>(instance, &raw mut self.saved);
                    if status == 0 {
                        self.known = (self.state, self.time, self.size);
                    }
                    status
                }
                Function::SetFMUState => {
                    let status = fmi3::set_fmu_state::<Machine>(instance, self.saved);
                    if status == 0 {
                        (_, self.time, self.size) = self.known;
                    }
                    status
                }
                Function::FreeFMUState => {
                    fmi3::free_fmu_state::<Machine>(instance, &raw mut self.saved)
                }
                Function::EnterConfigurationMode => {
                    fmi3::enter_configuration_mode::<Machine>(instance)
                }
                Function::ExitConfigurationMode => {
                    let status = fmi3::exit_configuration_mode::<Machine>(instance);
                    self.assert_size(status);
                    status
                }
                Function::SetUInt64 => {
                    let (reference, value) =
                        (sized().0, choice.either(&[1, 2, 3, 5], &[0, 6, u64::MAX]));
                    let status = fmi3::set_uint64::<Machine>(
                        instance,
                        &raw const reference,
                        1,
                        &raw const value,
                        1,
                    );
                    if status == 0 {
                        assert!((1..=5).contains(&value), "{value}");
                        self.size = value;
                    }
                    status
                }
                Function::Terminate => fmi3::terminate::<Machine>(instance),
                Function::Reset => {
                    (self.time, self.size) = (0.0, SIZE);
                    fmi3::reset::<Machine>(instance)
                }
                _ => ERROR,
            }
        }
    }
}

impl Sequence {
    /// Asserts after a successful `fmi3ExitConfigurationMode` that the array has the new size.
    fn assert_size(&self, status: c_int) {
        if status != 0 {
            return;
        }
        let (reference, size) = (sized().1, usize::try_from(self.size).unwrap());
        let mut values = [0.0; 8];
        let values = values.as_mut_ptr();
        // SAFETY: the array is larger than any size.
        let status = unsafe {
            fmi3::get_float64::<Machine>(self.instance, &raw const reference, 1, values, size)
        };
        assert_eq!(status, 0, "{size} values");
    }
}

impl Drop for Sequence {
    fn drop(&mut self) {
        // SAFETY: the state and the instance are freed once.
        unsafe {
            if !self.saved.is_null() {
                fmi3::reset::<Machine>(self.instance);
                fmi3::free_fmu_state::<Machine>(self.instance, &raw mut self.saved);
            }
            fmi3::free_instance::<Machine>(self.instance);
        }
    }
}

/// Runs the sequence that the bytes stand for; panics if a claim does not hold.
pub fn run(data: &[u8]) {
    let (first, rest) = data.split_at(data.len().min(1));
    let mut sequence = Sequence::new(&mut Choice::new(first));
    for call in rest.chunks(LENGTH) {
        let mut choice = Choice::new(call);
        let byte = choice.byte();
        // Three of four calls are legal ones.
        choice.hostile = byte.is_multiple_of(4);
        let legal: Vec<Function> = FUNCTIONS
            .into_iter()
            .filter(|function| {
                choice.hostile || allowed(sequence.interface, *function, sequence.state)
            })
            .collect();
        let function = choice.of(&legal);
        sequence.call(function, &mut choice);
    }
}
