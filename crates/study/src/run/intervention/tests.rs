use super::*;

#[test]
fn times_that_are_not_stated_are_the_next_ones_exactly() {
    let from = 0.1 + 0.2;
    let text = "[[set]]\nvariable = \"a.b\"\nvalue = 1\n[[fault]]\nconnection = \"a.c\"\nbias = { value = 2 }";
    let (found, complete) = entries(text, from).unwrap();
    assert!(found.set[0].get_ref().at.total_cmp(&from).is_eq());
    let bias = found.fault[0].get_ref().bias.as_ref().unwrap().get_ref();
    assert!(bias.from.unwrap().total_cmp(&from).is_eq());
    assert_eq!(entries(&complete, from).unwrap().0.set.len(), 1);
}

#[test]
fn a_later_time_is_kept_and_an_earlier_one_refused() {
    let with =
        |at: &str| entries(&format!("[[set]]\nvariable = \"a.b\"\nvalue = 1\nat = {at}"), 2.0);
    assert!(with("3").unwrap().0.set[0].get_ref().at >= 3.0);
    let error = with("1.5").unwrap_err().sentence();
    assert!(error.starts_with("at is 1.5, expected a time of 2 s or later"), "{error}");
}

#[test]
fn what_cannot_be_repeated_and_what_is_no_entry_is_one_sentence() {
    let cases = [
        ("", "found no entry, expected [[set]] or [[fault]]"),
        ("[[signal]]\nvariable = \"a.b\"", "found \"signal\", expected [[set]] or [[fault]]"),
        ("[[fault]]\nconnection = \"a.b\"\ndelay = { seconds = 1 }", "a delay needs the values"),
        ("[[set]]\nvariable = \"a.b\"", "missing field `value`"),
        ("[[set]]\nvariable = \"a.b\"\nvalue = 1\nat = \"x\"", "invalid type"),
        ("set = 3", "invalid type"),
        ("[[set", "intervention:1:"),
        ("[[fault]]\nconnection = \"a.b\"\nbias = 1", "invalid type"),
        ("[[set]]\nvariable = \"a\"\nvalue = 1\nat = nan", "at is NaN, expected a time of"),
    ];
    for (text, expected) in cases {
        let error = entries(text, 1.0).unwrap_err().sentence();
        assert!(error.starts_with(expected), "{text}: {error}");
    }
}
