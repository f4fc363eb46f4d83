//! An importer with arbitrary arguments: calls the C entry points of [`Machine`] in this process.
//!
//! It observes only what C cannot check: a pointer that is neither null nor misaligned points to as
//! many elements as the call says, and a state has not been freed yet.
#![expect(unsafe_code, reason = "calls of the C interface")]

use std::cell::{Cell, RefCell};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

use fmu::ffi;
use fmu_description::abi::{
    fmi2CallbackFunctions, fmi2CallbackLogger, fmi2Component, fmi2EventInfo, fmi2FMUstate,
    fmi2String,
};

use crate::array::{Array, Shape, Text, pointer, pointers, shared};
use crate::machine::Machine;

/// One call of the logger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    pub status: c_int,
    pub category: String,
    pub text: String,
}

/// The messages that the logger received, and the instance that it calls from inside.
#[derive(Debug)]
struct Ear {
    messages: RefCell<Vec<Message>>,
    component: Cell<fmi2Component>,
    panics: Cell<bool>,
}

/// A logger with C's signature, without variadic arguments. On platforms that pass variadic
/// arguments like all others, this is the same function.
unsafe extern "C" fn receive(
    environment: *mut c_void,
    _instance: fmi2String,
    status: c_int,
    category: fmi2String,
    format: fmi2String,
    text: fmi2String,
) {
    // SAFETY: the environment is the ear of `Importer::new`, the strings are the library's.
    let (ear, [category, format, text]) = unsafe {
        (&*environment.cast::<Ear>(), [category, format, text].map(|each| CStr::from_ptr(each)))
    };
    assert_eq!(format, c"%s");
    let [category, text] = [category, text].map(|each| each.to_string_lossy().into_owned());
    ear.messages.borrow_mut().push(Message { status, category, text });
    if ear.panics.get() {
        assert!(std::panic::catch_unwind(|| panic!("the importer's logger")).is_err());
    }
    // A call from the logger returns an error and does nothing else: no message, no reset, no free.
    let component = ear.component.get();
    // SAFETY: the component is null or its memory is there until the logger returns.
    unsafe {
        assert_eq!(ffi::reset::<Machine>(component), 3);
        ffi::free_instance::<Machine>(component);
    }
}

/// Whether messages can be received: not on platforms whose variadic calls differ or cannot be
/// made.
pub const HEARS: bool = cfg!(not(any(miri, target_vendor = "apple")));

/// A state that was saved or deserialised, and is freed once.
#[derive(Debug)]
pub struct Saved(fmi2FMUstate);

impl Saved {
    pub const NULL: Saved = Saved(null_mut());

    pub fn is_null(&self) -> bool {
        self.0.is_null()
    }

    pub fn raw(&self) -> fmi2FMUstate {
        self.0
    }
}

/// An instance, or null.
#[derive(Debug)]
pub struct Importer {
    component: fmi2Component,
    ear: Box<Ear>,
}

/// The description that `fmuDescribe` returns for the machine.
pub fn describe() -> Result<String, String> {
    unsafe extern "C" fn sink(context: *mut c_void, text: *const c_char, length: usize) {
        // SAFETY: the context is the vector below, the text has this length.
        unsafe {
            let bytes = std::slice::from_raw_parts(text.cast::<u8>(), length);
            (*context.cast::<Vec<u8>>()).extend_from_slice(bytes);
        }
    }
    let mut text = Vec::new();
    let context = (&raw mut text).cast();
    // SAFETY: the path is a C string, the sink fits its context.
    let status = unsafe { ffi::describe::<Machine>(c"".as_ptr(), context, sink) };
    let text = String::from_utf8_lossy(&text).into_owned();
    if status == 0 { Ok(text) } else { Err(text) }
}

/// The arguments of `fmi2Instantiate`.
pub struct Order {
    pub name: Text,
    pub kind: c_int,
    pub guid: Text,
    pub resources: Text,
    pub callbacks: bool,
    pub logger: bool,
}

impl Importer {
    pub fn new(order: &Order) -> Self {
        let messages = RefCell::default();
        let (component, panics) = (Cell::new(null_mut()), Cell::new(false));
        let ear = Box::new(Ear { messages, component, panics });
        // SAFETY: the same function, see `receive`.
        let logger = unsafe {
            std::mem::transmute::<
                unsafe extern "C" fn(
                    *mut c_void,
                    fmi2String,
                    c_int,
                    fmi2String,
                    fmi2String,
                    fmi2String,
                ),
                fmi2CallbackLogger,
            >(receive)
        };
        let callbacks = fmi2CallbackFunctions {
            logger: (HEARS && order.logger).then_some(logger),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: (&raw const *ear).cast_mut().cast(),
        };
        let functions = if order.callbacks { &raw const callbacks } else { null() };
        let texts = [&order.name, &order.guid, &order.resources].map(pointer);
        // SAFETY: strings and callbacks outlive the call, the ear the instance.
        let component = unsafe {
            ffi::instantiate::<Machine>(texts[0], order.kind, texts[1], texts[2], functions, 0, 0)
        };
        ear.component.set(component);
        Self { component, ear }
    }

    pub fn exists(&self) -> bool {
        !self.component.is_null()
    }

    pub fn component(&self) -> fmi2Component {
        self.component
    }

    /// Makes the logger panic, and catch the panic, from now on.
    pub fn let_the_logger_panic(&self) {
        self.ear.panics.set(true);
    }

    /// Returns the messages since the previous call.
    pub fn take_messages(&self) -> Vec<Message> {
        self.ear.messages.take()
    }

    /// Calls `fmi2FreeInstance`; afterwards the component is null.
    pub fn free(&mut self) {
        let component = std::mem::replace(&mut self.component, null_mut());
        // SAFETY: the component is null or not yet freed.
        unsafe { ffi::free_instance::<Machine>(component) }
        self.ear.component.set(null_mut());
    }
}

impl Drop for Importer {
    fn drop(&mut self) {
        self.free();
    }
}

/// Calls an entry point with the component and these arguments.
macro_rules! call {
    ($importer:ident.$name:ident($($argument:expr),*)) => {
        // SAFETY: the component is null or not yet freed; pointers are as `Array` has them.
        unsafe { ffi::$name::<Machine>($importer.component, $($argument),*) }
    };
}

macro_rules! without_arguments {
    ($($name:ident)*) => {
        $(pub fn $name(&self) -> c_int { call!(self.$name()) })*
    };
}

macro_rules! values {
    ($($get:ident $set:ident $type:ty;)*) => {
        $(pub fn $get(&self, vr: &Array<u32>, values: &mut Array<$type>) -> c_int {
            call!(self.$get(vr.pointer(), shared(vr, values), values.pointer_mut()))
        }

        pub fn $set(&self, vr: &Array<u32>, values: &Array<$type>) -> c_int {
            call!(self.$set(vr.pointer(), shared(vr, values), values.pointer()))
        })*
    };
}

macro_rules! vectors {
    ($($name:ident)*) => {
        $(pub fn $name(&self, values: &mut Array<f64>) -> c_int {
            call!(self.$name(values.pointer_mut(), values.count()))
        })*
    };
}

macro_rules! statuses {
    ($($name:ident $type:ty;)*) => {
        $(pub fn $name(&self, kind: c_int, value: &mut Array<$type>) -> c_int {
            call!(self.$name(kind, value.pointer_mut()))
        })*
    };
}

impl Importer {
    without_arguments! {
        enter_initialization_mode exit_initialization_mode terminate reset cancel_step
        enter_event_mode enter_continuous_time_mode
    }

    values! {
        get_real set_real f64;
        get_integer set_integer c_int;
        get_boolean set_boolean c_int;
    }

    vectors! { get_event_indicators get_continuous_states get_derivatives get_nominals }

    statuses! {
        get_status c_int;
        get_real_status f64;
        get_integer_status c_int;
        get_boolean_status c_int;
        get_string_status fmi2String;
    }

    pub fn set_debug_logging(&self, on: bool, categories: &Array<Text>) -> c_int {
        let categories = pointers(categories);
        call!(self.set_debug_logging(on.into(), categories.count(), categories.pointer()))
    }

    pub fn setup_experiment(&self, tolerance: Option<f64>, start: f64, stop: Option<f64>) -> c_int {
        call!(self.setup_experiment(
            tolerance.is_some().into(),
            tolerance.unwrap_or(-1.0),
            start,
            stop.is_some().into(),
            stop.unwrap_or(f64::NAN)
        ))
    }

    /// Returns the status and, if it is OK, the texts.
    pub fn get_string(&self, vr: &Array<u32>, shape: Shape) -> (c_int, Vec<String>) {
        let mut values = Array { items: vec![null(); vr.items.len()], shape };
        let count = shared(vr, &values);
        let status = call!(self.get_string(vr.pointer(), count, values.pointer_mut()));
        let text = |pointer: &fmi2String| {
            // SAFETY: a string of the library, valid until the next call.
            unsafe { CStr::from_ptr(*pointer) }.to_string_lossy().into_owned()
        };
        let got = status == 0 && shape == Shape::Right;
        (status, if got { values.items.iter().map(text).collect() } else { Vec::new() })
    }

    pub fn set_string(&self, vr: &Array<u32>, values: &Array<Text>) -> c_int {
        let values = pointers(values);
        call!(self.set_string(vr.pointer(), shared(vr, &values), values.pointer()))
    }

    pub fn set_real_input_derivatives(
        &self,
        vr: &Array<u32>,
        orders: &Array<c_int>,
        values: &Array<f64>,
    ) -> c_int {
        let count = shared(vr, orders).max(shared(vr, values));
        call!(self.set_real_input_derivatives(
            vr.pointer(),
            count,
            orders.pointer(),
            values.pointer()
        ))
    }

    pub fn get_real_output_derivatives(
        &self,
        vr: &Array<u32>,
        orders: &Array<c_int>,
        values: &mut Array<f64>,
    ) -> c_int {
        let count = shared(vr, orders).max(shared(vr, values));
        call!(self.get_real_output_derivatives(
            vr.pointer(),
            count,
            orders.pointer(),
            values.pointer_mut()
        ))
    }

    pub fn get_directional_derivative(
        &self,
        (unknowns, to): (&Array<u32>, &mut Array<f64>),
        (knowns, delta): (&Array<u32>, &Array<f64>),
    ) -> c_int {
        call!(self.get_directional_derivative(
            unknowns.pointer(),
            shared(unknowns, to),
            knowns.pointer(),
            shared(knowns, delta),
            delta.pointer(),
            to.pointer_mut()
        ))
    }

    pub fn do_step(&self, start: f64, size: f64) -> c_int {
        call!(self.do_step(start, size, 1))
    }

    pub fn new_discrete_states(&self, info: &mut Array<fmi2EventInfo>) -> c_int {
        call!(self.new_discrete_states(info.pointer_mut()))
    }

    pub fn completed_integrator_step(
        &self,
        enter: &mut Array<c_int>,
        terminate: &mut Array<c_int>,
    ) -> c_int {
        call!(self.completed_integrator_step(1, enter.pointer_mut(), terminate.pointer_mut()))
    }

    pub fn set_time(&self, time: f64) -> c_int {
        call!(self.set_time(time))
    }

    pub fn set_continuous_states(&self, values: &Array<f64>) -> c_int {
        call!(self.set_continuous_states(values.pointer(), values.count()))
    }

    /// `None` stands for a null pointer.
    pub fn get_fmu_state(&self, state: Option<&mut Saved>) -> c_int {
        call!(self.get_fmu_state(state.map_or(null_mut(), |state| &raw mut state.0)))
    }

    pub fn set_fmu_state(&self, state: &Saved) -> c_int {
        call!(self.set_fmu_state(state.0))
    }

    pub fn free_fmu_state(&self, state: Option<&mut Saved>) -> c_int {
        call!(self.free_fmu_state(state.map_or(null_mut(), |state| &raw mut state.0)))
    }

    pub fn serialized_fmu_state_size(&self, state: &Saved, size: &mut Array<usize>) -> c_int {
        call!(self.serialized_fmu_state_size(state.0, size.pointer_mut()))
    }

    pub fn serialize_fmu_state(&self, state: &Saved, bytes: &mut Array<u8>) -> c_int {
        let count = bytes.count();
        call!(self.serialize_fmu_state(state.0, bytes.pointer_mut().cast(), count))
    }

    pub fn de_serialize_fmu_state(&self, bytes: &Array<u8>, state: Option<&mut Saved>) -> c_int {
        let state = state.map_or(null_mut(), |state| &raw mut state.0);
        call!(self.de_serialize_fmu_state(bytes.pointer().cast(), bytes.count(), state))
    }
}
