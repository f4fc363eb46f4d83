//! The macro that declares the function table of a library, for each version of the standard.

/// Declares the function table and its loader.
macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions of a library. The standard requires every function in every library. Here a library may lack
        /// those that [`Functions::require`] does not check: they fail when they are called.
        #[derive(Clone, Copy)]
        pub(crate) struct Functions {
            $(pub(super) $field: Option<unsafe extern "C" fn($($argument),*) $(-> $result)?>,)*
        }

        impl Functions {
            /// Looks up the functions. Their symbols are `prefix` and the name in the standard.
            pub(super) fn load(handle: &libloading::Library, prefix: &str) -> Self {
                Self { $($field: {
                    // SAFETY: the standard gives this name this signature.
                    let symbol = unsafe { handle.get(format!("{prefix}{}\0", $name).as_bytes()) };
                    symbol.ok().map(|symbol| *symbol)
                },)* }
            }

            /// Checks that the library at `path` exports the functions `required`. `prefix` is that of their symbols.
            pub(super) fn require(
                &self,
                path: &std::path::Path,
                prefix: &str,
                required: &[&[&str]],
            ) -> Result<(), crate::LoadError> {
                let has = |function: &str| match function {
                    $($name => self.$field.is_some(),)*
                    _ => false,
                };
                let missing = required.iter().copied().flatten().find(|function| !has(function));
                missing.map_or(Ok(()), |function| {
                    let (path, function) = (path.to_owned(), format!("{prefix}{function}"));
                    Err(crate::LoadError::Missing { path, function })
                })
            }
        }
    };
}
pub(super) use functions;
