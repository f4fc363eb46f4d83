//! The C functions of FMI 3.0.

mod clocks;
mod entry;
mod exports;
mod instantiate;
#[cfg(test)]
mod tests;
mod values;

pub use super::free_instance;
pub use clocks::*;
pub use entry::*;
pub use instantiate::*;
pub use values::*;

use std::ffi::{c_char, c_void};

use super::{fmi2Integer, pass_description};
use crate::model::Model;
use fmu_description::abi::DescribeSink;
use fmu_description::abi3::{self, fmi3String};

/// Defines C functions that call `dispatch`: their arguments, then the safe code.
macro_rules! entry_points_3 {
    ($($(#[$attribute:meta])* $name:ident = $function:ident($($argument:ident: $type:ty),* $(,)?), $instance:ident => $body:expr;)*) => {
        $($(#[$attribute])* pub unsafe fn $name<M: crate::model::Model>(
            instance: fmu_description::abi3::fmi3Instance,
            $($argument: $type),*
        ) -> fmu_description::abi3::fmi3Status {
            // SAFETY: pointers and lengths are as the standard requires; null is handled.
            unsafe {
                crate::ffi::dispatch::<M, _>(
                    instance,
                    fmu_description::call_order3::Function::$function,
                    |$instance| $body,
                )
            }
        })*
    };
}
use entry_points_3;

#[must_use]
pub fn version<M: Model>() -> fmi3String {
    abi3::VERSION.as_ptr()
}

/// [`abi::DESCRIBE_3`](fmu_description::abi::DESCRIBE_3): passes the model description of FMI 3.0, or an
/// error message, to `sink`.
pub unsafe fn describe<M: Model>(
    resources: *const c_char,
    context: *mut c_void,
    sink: DescribeSink,
) -> fmi2Integer {
    // SAFETY: the arguments are passed on unchanged.
    unsafe { pass_description(resources, context, sink, crate::interface::describe_3::<M>) }
}
