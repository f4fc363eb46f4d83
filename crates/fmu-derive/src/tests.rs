//! The mistakes that the derive macro refuses, by their messages.

use quote::quote;
use syn::DeriveInput;

/// The message of the macro for a struct with these fields; panics if it has none.
fn refusal(fields: &str) -> String {
    let input: DeriveInput = syn::parse_str(&format!("struct M {{ {fields} }}")).unwrap();
    let errors = crate::table::expand(&input).map(|code| code.to_string()).unwrap_err();
    errors.into_iter().map(|error| error.to_string()).collect::<Vec<_>>().join("; ")
}

#[test]
fn each_mistake_has_its_message() {
    let cases = [
        ("h: f64", "field `h`: expected #[fmu(...)]"),
        ("#[fmu] h: f64", "expected #[fmu(...)]"),
        ("#[fmu(outptu)] h: f64", "unknown attribute `outptu`, expected one of: input, output"),
        ("#[fmu(output, input)] h: f64", "one role"),
        ("#[fmu(output, output)] h: f64", "`output` is there twice"),
        ("#[fmu(output)] h: u128", "no variable has this type: expected f64, i32, bool, String"),
        ("#[fmu(output)] h: [[u128; 2]; 2]", "no variable has this type"),
        ("#[fmu(output)] h: f64, #[fmu(name = \"h\")] v: f64", "two variables have the name \"h\""),
        ("#[fmu(output)] time: f64", "cannot have the name \"time\""),
        ("#[fmu(derivative_of = h)] v: f64", "`h` is no variable of this struct"),
        ("#[fmu(derivative_of = v)] v: f64", "its own derivative"),
        ("#[fmu(output)] h: i32, #[fmu(derivative_of = h)] v: f64", "are f64"),
        ("#[fmu(output)] h: [f64; 2], #[fmu(derivative_of = h)] v: f64", "the same dimensions"),
        ("#[fmu(input)] h: f64, #[fmu(derivative_of = h)] v: f64", "must be an output or local"),
        ("#[fmu(output)] h: f64, #[fmu(input, derivative_of = h)] v: f64", "the model computes it"),
        (
            "#[fmu(output)] h: f64, #[fmu(derivative_of = h)] v: f64, #[fmu(derivative_of = h)] w: f64",
            "`h` has two derivatives",
        ),
        ("#[fmu(output, state)] h: f64", "no field is the derivative of this state"),
        ("#[fmu(output, reinit)] h: f64", "only a continuous state"),
        ("#[fmu(input, exact)] h: f64", "states how it starts"),
        ("#[fmu(calculated_parameter, start = 1)] h: f64", "no start value"),
        ("#[fmu(output, unit = \"m\")] n: i32", "only a variable of type f64 or f32 has a unit"),
        ("#[fmu(output, relative_quantity)] n: i32", "f64 or f32 is a relative quantity"),
        ("#[fmu(output, min = 0)] b: bool", "`min` does not fit the type"),
        ("#[fmu(parameter, min = 1.5, max = -1)] h: f64", "`min` is above `max`"),
        ("#[fmu(parameter, nominal = 0)] h: f64", "`nominal` must be above 0"),
        ("#[fmu(input, enumeration(\"Mode\"))] m: i32", "at least one item"),
        ("#[fmu(input, enumeration(\"Mode\", off = 0))] m: f64", "a field of type i32"),
        ("#[fmu(output, discrete)] n: i32", "can be discrete"),
        ("#[fmu(constant, discrete)] h: f64", "only an input, an output or a local variable"),
        ("#[fmu(tunable, discrete)] h: f64", "only an input, an output or a local variable"),
        ("#[fmu(output, depends(u))] h: f64", "`u` is no variable"),
        (
            "#[fmu(parameter)] p: f64, #[fmu(output, depends(p))] h: f64",
            "neither an input nor a state",
        ),
        ("#[fmu(parameter, depends())] h: f64", "only an output or a derivative"),
        (
            "#[fmu(parameter, derivatives(v))] h: f64, #[fmu(skip)] v: f64",
            "only an input or output",
        ),
        ("a: Log, b: fmu::Log", "one field of the type Log"),
    ];
    for (fields, expected) in cases {
        let actual = refusal(fields);
        assert!(actual.contains(expected), "{fields}: {actual}");
    }
}

#[test]
fn all_mistakes_are_reported_at_once() {
    let actual = refusal("#[fmu(derivative_of = x)] a: f64, #[fmu(derivative_of = y)] b: f64");
    assert!(actual.contains("`x`") && actual.contains("`y`"), "{actual}");
    let actual = refusal("a: f64, b: f64");
    assert!(actual.contains("field `a`") && actual.contains("field `b`"), "{actual}");
}

#[test]
fn only_a_plain_struct_is_a_model() {
    for item in ["enum M { A }", "struct M(f64);", "struct M<T> { #[fmu(skip)] a: T }"] {
        let input: DeriveInput = syn::parse_str(item).unwrap();
        assert!(crate::table::expand(&input).is_err(), "{item}");
    }
}

#[test]
fn arguments_of_the_model_that_have_no_effect_are_refused() {
    let expand = |arguments: &str, block: &str| -> Result<String, String> {
        let arguments = syn::parse_str(arguments).map_err(|error: syn::Error| error.to_string())?;
        let block = syn::parse_str(block).unwrap();
        let code = crate::model::expand(&arguments, block).map_err(|error| error.to_string())?;
        Ok(code.to_string())
    };
    let message = |arguments: &str, block: &str| expand(arguments, block).unwrap_err();
    assert!(
        message("stop = 1", "impl Model for M {}").contains("expected one of: event_indicators")
    );
    assert!(message("stop_time = 1, stop_time = 2", "impl Model for M {}").contains("twice"));
    assert!(message("", "impl M {}").contains("impl Model for"));
    let about = "impl Model for M { fn about(&self) -> About { todo() } }";
    assert!(message("stop_time = 1", about).contains("the block has the function"));
    let missing = message("event_indicators = 1", "impl Model for M {}");
    assert!(missing.contains("expected the function `event_indicators`"), "{missing}");
    assert!(expand("event_indicators = 0", "impl Model for M {}").is_ok());
    let code = expand("", about).unwrap();
    assert!(code.contains("expected the function `update`"), "{code}");
    let update =
        "impl Model for M { fn update(&mut self, _: f64) -> Result<(), Failure> { todo() } }";
    assert!(!expand("", update).unwrap().contains("expected the function"));
    let count = |text: String| code.matches(&text).count();
    assert_eq!(count(quote!(fn about).to_string()), 1);
    assert_eq!(count(quote!(fn variables).to_string()), 1);
}
