//! Identifiers of C and Rust from the names of plant files and signals.

/// Words that C, C++ or Rust reserve, or that headers of C define as macros.
const RESERVED: &str = "\
abstract alignas alignof and and_eq as asm assert async atomic auto await become bitand bitor bool \
box break case catch char class co_await co_return co_yield compl complex concept const const_cast \
consteval constexpr constinit continue crate decltype default delete do double dyn \
dynamic_cast else enum eof errno explicit export extern false final float fn for friend gen goto \
i386 if impl imaginary import in inline int let linux long loop macro match mod module move mut \
mutable namespace new noexcept not not_eq null nullptr operator or or_eq override priv private \
protected pub ref register reinterpret_cast requires restrict return self short signed sizeof static \
static_assert static_cast stderr stdin stdout struct super switch template this thread_local throw \
trait true try type typedef typeid typename typeof typeof_unqual union unix unsafe unsigned unsized \
use using virtual void volatile wchar_t where while xor xor_eq yield";

/// Names of headers of C, of crates that come with Rust, of folders of cargo, of devices of Windows; the names that
/// `aso_controller.h` uses.
const RESERVED_FILES: &str = "\
alloc aso aso_controller aso_residual aux build com1 com2 com3 com4 com5 com6 com7 com8 com9 con core ctype \
deps examples fenv incremental inttypes iso646 limits locale lpt1 lpt2 lpt3 lpt4 lpt5 lpt6 lpt7 \
lpt8 lpt9 math nul prn proc_macro setjmp signal stdalign stdarg stdatomic stdbool stddef stdint \
stdio stdlib stdnoreturn std string test tgmath threads time uchar wchar wctype";

/// The most characters of the name of a controller: with `_init_at` it has the 31 characters that C99 guarantees for an
/// external name.
const LONGEST_PREFIX: usize = 23;
/// The most characters of the name of a signal, before a number is appended to make it unique; C99 guarantees 63 for a
/// field.
const LONGEST_FIELD: usize = 40;

/// Returns the start of the names of files, types and functions for the plant `name`: an identifier of C and Rust with
/// at most 23 characters. The result is no reserved word; without letters and digits in `name` it is `controller`.
#[must_use]
pub fn prefix(name: &str) -> String {
    let mut prefix = plain(name, LONGEST_PREFIX);
    if prefix.is_empty() {
        "controller".clone_into(&mut prefix);
    }
    if is_in(RESERVED, &prefix) || is_in(RESERVED_FILES, &prefix) {
        prefix.push_str("_ctl");
    }
    prefix
}

/// Returns a field for each name: letters, digits and `_`. Ignoring case, the fields differ from each other and from
/// reserved words.
pub(super) fn fields<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for (position, name) in names.enumerate() {
        let mut plain = plain(name, LONGEST_FIELD);
        if plain.is_empty() {
            plain = format!("signal_{}", position + 1);
        }
        let is_free = |field: &str| {
            !is_in(RESERVED, field) && !all.iter().any(|other| other.eq_ignore_ascii_case(field))
        };
        let numbered = (2..).map(|number: u32| format!("{plain}_{number}"));
        let field = std::iter::once(plain.clone()).chain(numbered).find(|field| is_free(field));
        all.extend(field);
    }
    all
}

/// Replaces characters that an identifier cannot hold: `motor.u` gives `motor_u`, `q[2]` gives `q_2`. The result has at
/// most `longest` characters, and starts with a letter or is empty.
fn plain(name: &str, longest: usize) -> String {
    let mut plain = String::new();
    for sign in name.chars() {
        match sign {
            'a'..='z' | 'A'..='Z' | '0'..='9' => plain.push(sign),
            _ if plain.is_empty() || plain.ends_with('_') => {}
            _ => plain.push('_'),
        }
    }
    if plain.starts_with(|sign: char| sign.is_ascii_digit()) {
        plain.insert(0, 'n');
    }
    plain.truncate(longest);
    plain.trim_end_matches('_').to_owned()
}

fn is_in(list: &str, name: &str) -> bool {
    list.split_ascii_whitespace().any(|word| word.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_identifiers_that_differ_in_any_case() {
        let names =
            ["motor.u", "q[2]", "'motor 2'", "q_2", "Q_2", "int", "3d", "Druck \u{3b8}", "\u{3b8}"];
        let expected =
            ["motor_u", "q_2", "motor_2", "q_2_2", "Q_2_3", "int_2", "n3d", "Druck", "signal_9"];
        assert_eq!(fields(names.into_iter()), expected);
    }

    #[test]
    fn a_repeated_name_gets_a_number_that_is_free() {
        assert_eq!(fields(["a", "a_2", "A"].into_iter()), ["a", "a_2", "A_3"]);
    }

    #[test]
    fn a_plant_file_is_no_header_of_c_no_crate_of_rust_and_no_device() {
        for (stem, expected) in [
            ("three-tank", "three_tank"),
            ("String", "String_ctl"),
            ("core", "core_ctl"),
            ("com7", "com7_ctl"),
            // The file `aso_controller.h` takes the samples; its macros start with `ASO_`.
            ("aso-controller", "aso_controller_ctl"),
            ("aso-residual", "aso_residual_ctl"),
            ("Aso", "Aso_ctl"),
            ("float", "float_ctl"),
            ("2024", "n2024"),
            ("", "controller"),
            ("a-plant-with-a-very-long-name", "a_plant_with_a_very_lon"),
        ] {
            assert_eq!(prefix(stem), expected);
        }
    }
}
