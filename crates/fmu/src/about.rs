//! The macro [`about!`](crate::about).

/// Returns the [`About`](crate::About) of a model from the metadata of its crate: `description`, `authors`,
/// `version` and `license` of `Cargo.toml`.
///
/// The arguments are fields of the default experiment, in s: `start_time`, `stop_time`, `step_size`; and
/// its relative `tolerance`.
///
/// ```
/// let about = fmu::about!(stop_time: 20.0, step_size: 0.01);
/// assert_eq!(about.version, env!("CARGO_PKG_VERSION"));
/// assert_eq!(about.default_experiment.stop_time, Some(20.0));
/// ```
#[macro_export]
macro_rules! about {
    ($($field:ident: $value:expr),* $(,)?) => {
        $crate::About {
            description: ::std::env!("CARGO_PKG_DESCRIPTION").to_owned(),
            author: ::std::env!("CARGO_PKG_AUTHORS").replace(':', ", "),
            version: ::std::env!("CARGO_PKG_VERSION").to_owned(),
            license: ::std::env!("CARGO_PKG_LICENSE").to_owned(),
            default_experiment: {
                #[allow(clippy::needless_update, reason = "the arguments may be all fields")]
                let experiment = $crate::description::DefaultExperiment {
                    $($field: ::core::option::Option::Some(::core::convert::Into::into($value)),)*
                    ..::core::default::Default::default()
                };
                experiment
            },
        }
    };
}
