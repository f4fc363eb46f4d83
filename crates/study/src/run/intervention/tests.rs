use super::*;

#[test]
fn times_that_are_not_stated_are_the_next_ones_exactly() {
    let from = 0.1 + 0.2;
    let text = "[[set]]\nvariable = \"a.b\"\nvalue = 1\n[[fault]]\nconnection = \"a.c\"\nbias = { value = 2 }";
    let (actual, complete) = entries(text, 0.2, from).unwrap();
    assert!(actual.set[0].get_ref().at.total_cmp(&from).is_eq());
    let bias = actual.fault[0].get_ref().bias.as_ref().unwrap().get_ref();
    assert!(bias.from.unwrap().total_cmp(&from).is_eq());
    assert_eq!(entries(&complete, 0.2, from).unwrap().0.set.len(), 1);
}

#[test]
fn a_later_time_is_kept_and_an_earlier_one_refused() {
    let with =
        |at: &str| entries(&format!("[[set]]\nvariable = \"a.b\"\nvalue = 1\nat = {at}"), 1.0, 2.0);
    assert!(with("3").unwrap().0.set[0].get_ref().at >= 3.0);
    let error = with("1.5").unwrap_err().sentence();
    assert!(error.starts_with("at is 1.5, expected a time of 2 s or later"), "{error}");
}

#[test]
fn a_delay_starts_when_the_run_has_kept_all_values_that_it_needs() {
    let start = |seconds: &str| {
        let text = format!("[[fault]]\nconnection = \"a.b\"\ndelay = {{ seconds = {seconds} }}");
        let (actual, _) = entries(&text, 4.0, 4.5)?;
        Ok::<_, Error>(actual.fault[0].get_ref().delay.as_ref().unwrap().get_ref().from)
    };
    assert_eq!(start("2").unwrap(), Some(6.0));
    assert_eq!(start("0.25").unwrap(), Some(4.5));
    assert_eq!(start("2, from = 7").unwrap(), Some(7.0));
    let error = start("2, from = 5.5").unwrap_err().sentence();
    assert!(error.starts_with("from is 5.5, expected a time of 6 s or later, when"), "{error}");
}

#[test]
fn what_cannot_be_repeated_and_what_is_no_entry_is_one_sentence() {
    let cases = [
        ("", "found no entry, expected [[set]] or [[fault]]"),
        ("set = []", "found no entry, expected [[set]] or [[fault]]"),
        ("[[signal]]\nvariable = \"a.b\"", "found \"signal\", expected [[set]] or [[fault]]"),
        ("[[set]]\nvariable = \"a.b\"", "missing field `value`"),
        ("[[set]]\nvariable = \"a.b\"\nvalue = 1\nat = \"x\"", "invalid type"),
        ("set = 3", "invalid type"),
        ("[[set", "intervention:1:"),
        ("[[fault]]\nconnection = \"a.b\"\nbias = 1", "invalid type"),
        ("[[set]]\nvariable = \"a\"\nvalue = 1\nat = nan", "at is NaN, expected a time of"),
    ];
    for (text, expected) in cases {
        let error = entries(text, 0.5, 1.0).unwrap_err().sentence();
        assert!(error.starts_with(expected), "{text}: {error}");
    }
}
