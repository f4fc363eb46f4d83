//! The macro that declares the function table of a library, for each version of the standard.

/// Declares the function table. The first row has the version of FMI that the library must have, and the function that
/// returns it; each other row has a field of the table, the name in the standard, and the signature.
macro_rules! functions {
    (
        $version:literal = $get_version:literal;
        $($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*
    ) => {
        /// The functions of a library. The standard requires every function in every library. Here a library may lack
        /// functions that [`Functions::open`] does not check: calling one returns an error.
        #[derive(Clone, Copy)]
        pub(crate) struct Functions {
            $(pub(super) $field: Option<unsafe extern "C" fn($($argument),*) $(-> $result)?>,)*
        }

        impl Functions {
            /// The names of the functions in the standard.
            #[cfg(target_os = "linux")]
            pub(crate) const NAMES: &[&str] = &[$($name,)*];

            /// Loads a library, and checks its version and that it exports the functions `required`. Its symbols are
            /// `prefix` and the name in the standard.
            pub(super) fn open(
                loading: &$crate::library::Loading<'_>,
                prefix: &str,
                required: &[&[&str]],
            ) -> Result<std::sync::Arc<$crate::library::Loaded<Self>>, $crate::LoadError> {
                let handle = loading.load()?;
                let symbol = |name: &str| format!("{prefix}{name}\0");
                // SAFETY: the standard gives each name its signature.
                let (get_version, functions) = unsafe {
                    let get_version = handle.get(symbol($get_version).as_bytes()).ok();
                    let functions = Self { $($field: {
                        handle.get(symbol($name).as_bytes()).ok().map(|function| *function)
                    },)* };
                    (get_version.map(|function| *function), functions)
                };
                let path = loading.path;
                $crate::library::check_version(path, get_version, $get_version, $version)?;
                let has = |function: &str| match function {
                    $($name => functions.$field.is_some(),)*
                    _ => false,
                };
                let missing = required.iter().copied().flatten().find(|function| !has(function));
                missing.map_or(Ok(()), |function| {
                    let (path, function) = (path.to_owned(), format!("{prefix}{function}"));
                    Err($crate::LoadError::Missing { path, function })
                })?;
                Ok($crate::library::Loaded::new(functions, path, handle).into())
            }
        }
    };
}
pub(super) use functions;
