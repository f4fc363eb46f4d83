//! The page of a real design, of a hostile one and of a bare one, read by a strict XML parser.

mod content;
mod hostile;
mod pendulum;
mod plots;

use resvg::usvg::roxmltree::{Document, Node};

use design_report::family::{CommonCertificate, FamilyReport, MemberMargins, MemberReport};
use design_report::robustness::{Level, Number, ToleranceResult};
use design_report::{Matrix, Report, Signal};
use hostile::{bare, hostile};
use pendulum::pendulum;

fn page(report: &Report) -> String {
    super::page(report, hostile::QUOTES)
}

/// Converts the page to XML: only the `meta` elements of its head lack an end tag.
fn xml(html: &str) -> String {
    let body = html.strip_prefix("<!DOCTYPE html>").expect("begins with the document type");
    let mut parts = body.split("<meta");
    let mut text = parts.next().unwrap().to_owned();
    for part in parts {
        let (tag, rest) = part.split_once('>').unwrap();
        text.extend(["<meta", tag, "/>", rest]);
    }
    text.replace(" hidden ", " hidden=\"\" ")
}

fn with_pages(look: impl Fn(&Report, &Document<'_>)) {
    for report in [pendulum(), hostile(), bare()] {
        let text = xml(&page(&report));
        look(&report, &Document::parse(&text).expect("well-formed"));
    }
}

fn elements<'a>(document: &'a Document<'_>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    document.descendants().filter(move |node| node.has_tag_name(name))
}

/// All text in an element.
fn text(node: Node<'_, '_>) -> String {
    let texts = node.descendants().filter(Node::is_text);
    texts.map(|node| node.text().unwrap()).collect()
}

#[test]
fn the_same_design_gives_the_same_bytes() {
    assert_eq!(page(&hostile()), page(&hostile()));
}

#[test]
fn identifiers_are_unique_and_every_reference_has_a_target() {
    with_pages(|_, document| {
        let all = document.descendants().filter_map(|node| node.attribute("id"));
        let mut identifiers: Vec<_> = all.collect();
        let count = identifiers.len();
        identifiers.sort_unstable();
        identifiers.dedup();
        assert_eq!(identifiers.len(), count);
        let mut references = 0;
        for attribute in document.descendants().flat_map(|node| node.attributes()) {
            let targets = match attribute.name() {
                "href" => attribute.value().strip_prefix('#').unwrap(),
                "clip-path" => {
                    attribute.value().strip_prefix("url(#").unwrap().trim_end_matches(')')
                }
                "aria-labelledby" | "data-copy" => attribute.value(),
                _ => continue,
            };
            for target in targets.split(' ') {
                assert!(identifiers.contains(&target), "nothing is called {target}");
                references += 1;
            }
        }
        assert!(references > 10);
    });
}

#[test]
fn paragraphs_and_captions_hold_only_text() {
    const INLINE: [&str; 12] =
        ["p", "code", "data", "strong", "sub", "sup", "span", "button", "a", "svg", "path", "line"];
    with_pages(|_, document| {
        for name in ["p", "h1", "h2", "h3", "caption", "figcaption", "th", "dt"] {
            for node in elements(document, name) {
                let mut inside = node.descendants().skip(1).filter(Node::is_element);
                let block = inside.find(|node| !INLINE[1..].contains(&node.tag_name().name()));
                assert!(block.is_none(), "{name}: {block:?}");
            }
        }
    });
}

#[test]
fn the_page_makes_no_requests() {
    with_pages(|_, document| {
        let plots = elements(document, "div").any(|node| node.attribute("class") == Some("plot"));
        assert_eq!(elements(document, "script").count(), if plots { 6 } else { 2 });
        assert_eq!(elements(document, "style").count(), 1);
        for name in ["link", "img", "image", "iframe", "object", "embed", "use", "base", "form"] {
            assert_eq!(elements(document, name).count(), 0, "{name}");
        }
        for attribute in document.descendants().flat_map(|node| node.attributes()) {
            assert!(!["src", "srcset", "action"].contains(&attribute.name()));
            assert!(!attribute.name().starts_with("on"), "{}", attribute.name());
        }
        let all = ["script", "style"].into_iter().flat_map(|name| elements(document, name));
        let code: String = all
            .filter(|node| node.attribute("type").is_none())
            .map(text)
            .collect::<Vec<_>>()
            .join("\n")
            .replace("/*! https://github.com/leeoniya/uPlot (v1.6.32) */", "");
        for word in ["http:", "https:", "//", "@import", "url(", "import ", "fetch"] {
            assert!(!code.contains(word), "{word}");
        }
        let policy = elements(document, "meta")
            .find(|node| node.attribute("http-equiv") == Some("Content-Security-Policy"));
        assert!(policy.unwrap().attribute("content").unwrap().starts_with("default-src 'none';"));
    });
}

#[test]
fn no_section_or_cell_is_empty() {
    with_pages(|_, document| {
        for name in ["section", "h2", "h3", "p", "ul", "li", "dl", "dd", "table", "caption", "pre"]
        {
            for node in elements(document, name) {
                let status = node.attribute("role") == Some("status");
                assert!(status || !text(node).trim().is_empty(), "an empty {name}");
            }
        }
        for body in elements(document, "tbody") {
            assert!(body.children().count() > 0);
        }
        for section in elements(document, "section") {
            let folded = section.first_element_child().unwrap();
            assert!(folded.children().filter(Node::is_element).count() > 1, "{}", text(section));
        }
    });
}

#[test]
fn only_sections_with_content_appear_in_reading_order() {
    let titles = |report: &Report| -> Vec<String> {
        let text = xml(&page(report));
        let document = Document::parse(&text).unwrap();
        elements(&document, "h2").map(self::text).collect()
    };
    assert_eq!(
        titles(&hostile()),
        [
            "1. Plant",
            "2. Checks",
            "3. Gains",
            "4. Eigenvalues",
            "5. Condition and pole errors",
            "6. Estimation of the faults",
            "7. Robustness",
            "8. Detection of faults",
            "9. Singular values",
            "10. References",
            "11. Sudden faults",
            "12. Bounds of the errors",
            "13. Certificate",
            "14. Assumptions",
            "15. Loss of effectiveness",
            "16. Without an actuator",
            "17. Fall-back",
            "18. Interface of the FMU",
        ]
    );
    assert_eq!(
        titles(&bare()),
        ["1. Plant", "2. Eigenvalues", "3. Condition and pole errors", "4. Certificate"]
    );
}

#[test]
fn tables_have_captions_and_scoped_heads_and_figures_have_titles_and_descriptions() {
    with_pages(|_, document| {
        for table in elements(document, "table") {
            let caption = table.children().find(Node::is_element).unwrap();
            assert!(caption.has_tag_name("caption"));
            let heads = table.descendants().filter(|node| node.has_tag_name("th"));
            assert!(heads.map(|node| node.attribute("scope")).all(|scope| scope.is_some()));
            let widths: Vec<usize> = table
                .descendants()
                .filter(|node| node.has_tag_name("tr"))
                .map(|row| row.children().filter(Node::is_element).count())
                .collect();
            assert!(widths.iter().all(|width| *width == widths[0]), "{widths:?}");
        }
        for svg in elements(document, "svg") {
            if svg.attribute("aria-hidden") != Some("true") {
                assert_eq!(svg.attribute("role"), Some("img"));
                for name in ["title", "desc"] {
                    let said = svg.children().find(|node| node.has_tag_name(name)).unwrap();
                    assert!(text(said).len() > 5, "{name}: {}", text(said));
                }
            }
        }
        assert_eq!(elements(document, "h1").count(), 1);
    });
}

#[test]
fn the_verdict_names_the_failed_checks() {
    let verdict = |report: &Report| {
        let page = xml(&page(report));
        let document = Document::parse(&page).unwrap();
        let mut all = elements(&document, "div");
        text(all.find(|node| node.attribute("class").unwrap().starts_with("verdict")).unwrap())
    };
    assert!(
        verdict(&pendulum())
            .starts_with("✓ Verdict: green; all 4 checks hold; both loops are stable.")
    );
    let mut amber = pendulum();
    amber.verdict.level = Level::Amber;
    amber.verdict.reasons = vec!["the peak of S".to_owned()];
    let said = verdict(&amber);
    assert!(
        said.starts_with("! Verdict: amberthe peak of SAll 4 checks hold; both loops are stable."),
        "{said}"
    );
    let failed = verdict(&hostile());
    assert!(failed.starts_with("✗") && failed.contains("detectable"), "{failed}");
    assert!(!failed.contains("observable"), "{failed}");
    let mut unstable = bare();
    unstable.observer.eigenvalues[0] = [0.0, 1.0];
    assert!(verdict(&unstable).contains("The observer is unstable"));
    assert!(!verdict(&unstable).contains("feedback loop is unstable"));
    let mut sampled = hostile();
    sampled.feedback.eigenvalues[0] = [-0.9, 0.5];
    assert!(verdict(&sampled).contains("The feedback loop is unstable"));
}

/// The places of all markers of this class in a map.
fn signs(map: Node<'_, '_>, class: &str) -> Vec<(f64, f64)> {
    map.descendants()
        .filter(|node| node.attribute("class") == Some(class))
        .map(|node| {
            let path = node.attribute("d").unwrap()[1..].split('m').next().unwrap();
            let (x, y) = path.split_once(' ').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        })
        .collect()
}

fn map<'a>(document: &'a Document<'_>, id: &str) -> Node<'a, 'a> {
    let title = format!("{id}-title");
    let title = elements(document, "title").find(|node| node.attribute("id") == Some(&title));
    title.unwrap_or_else(|| panic!("no map {id}")).parent().unwrap()
}

#[test]
fn maps_show_every_eigenvalue_inside_the_frame_required_around_actual() {
    with_pages(|report, document| {
        for (id, system) in [("map-feedback", &report.feedback), ("map-observer", &report.observer)]
        {
            let planes = if report.sampling.is_some() { &["", "-z"][..] } else { &[""] };
            for plane in planes {
                let map = map(document, &format!("{id}{plane}"));
                let reached = signs(map, "sign ink-2");
                assert_eq!(reached.len(), system.eigenvalues.len(), "{id}{plane}");
                for (x, y) in &reached {
                    assert!((66.0..=426.0).contains(x) && (10.0..=322.0).contains(y), "{x} {y}");
                }
                let required = signs(map, "sign ink-1");
                assert_eq!(required.len(), system.required.len(), "{id}{plane}");
                for (x, y) in required {
                    let near = |place: &(f64, f64)| (place.0 - x).hypot(place.1 - y) < 1.0;
                    assert!(reached.iter().any(near), "{id}: nothing near the required {x} {y}");
                }
            }
        }
    });
}

#[test]
fn the_stability_boundary_is_between_stable_and_unstable_eigenvalues() {
    let text = xml(&page(&pendulum()));
    let document = Document::parse(&text).unwrap();
    let map = map(&document, "map-all");
    let edge = map.descendants().find(|node| node.attribute("class") == Some("boundary")).unwrap();
    let edge: f64 = edge.attribute("x1").unwrap().parse().unwrap();
    let right = |class: &str| signs(map, class).iter().filter(|sign| sign.0 > edge + 1.0).count();
    assert_eq!([right("sign ink-3"), right("sign ink-2"), right("sign ink-4")], [1, 0, 0]);
    let text = xml(&page(&hostile()));
    let document = Document::parse(&text).unwrap();
    let map = self::map(&document, "map-observer-z");
    let circle = map.descendants().find(|node| node.has_tag_name("circle")).unwrap();
    let [x, y, radius] =
        ["cx", "cy", "r"].map(|name| circle.attribute(name).unwrap().parse::<f64>().unwrap());
    let crosses = signs(map, "sign ink-2");
    let expected = hostile().observer.eigenvalues;
    assert_eq!(crosses.len(), expected.len());
    for (cross, pole) in crosses.iter().zip(expected) {
        let distance = (cross.0 - x).hypot(cross.1 - y) / radius;
        assert!((distance - pole[0].hypot(pole[1])).abs() < 2e-3);
    }
}

/// The text of the table with a caption.
fn table(report: &Report, caption: &str) -> String {
    let page = xml(&page(report));
    let document = Document::parse(&page).unwrap();
    let mut captions = elements(&document, "caption");
    let caption = captions.find(|node| text(*node) == caption).unwrap();
    text(caption.parent().unwrap())
}

/// The sensitivities are those of a plant with ten states.
#[test]
fn the_sensitivities_have_no_values_of_matrices_with_other_states() {
    let shown = |report: &Report| table(report, "Sensitivity of the peaks of S").contains("value");
    let mut report = hostile();
    assert!(shown(&report));
    report.plant.states.pop();
    assert!(!shown(&report));
}

#[test]
fn a_member_whose_entries_are_exact_has_no_limit_of_its_tolerances() {
    let shown = |entries| {
        let mut report = bare();
        let tolerance = ToleranceResult {
            entries,
            varying: Vec::new(),
            parameters: Vec::new(),
            cases: 200,
            seed: 1,
            stable: None,
            worst_instability: -1.0,
            first_unstable: f64::INFINITY,
            worst: Vec::new(),
        };
        let margins = MemberMargins {
            points: Vec::new(),
            delay_margin: 1.0,
            longest_hold: 1.0,
            noise_together: Vec::new(),
            tolerance: Some(tolerance),
        };
        let name = "nominal".to_owned();
        let member = MemberReport { name, instability: -1.0, margins: Some(margins) };
        let whole = Err("not found".to_owned());
        report.family = Some(FamilyReport { members: vec![member], feedback: None, whole });
        table(&report, "Members of the family")
    };
    assert!(!shown(0).contains("tolerances"), "{}", shown(0));
    assert!(shown(3).contains("not up to 16"), "{}", shown(3));
}

/// The loop is judged with three states for each delay, of which the observer has two.
#[test]
fn the_lyapunov_matrix_of_a_family_names_all_states_of_delays() {
    let mut report = bare();
    let states = ["x1", "delayed u1", "delay of u1, 2", "delay of y1, 1", "delay of y1, 2"];
    let signal = |name: &str| Signal { name: name.to_owned(), ..bare().plant.states.remove(0) };
    report.plant.states = states.map(signal).into();
    report.gains.push(Matrix {
        name: "K_x".to_owned(),
        meaning: String::new(),
        rows: vec!["u1".to_owned()],
        columns: states.map(str::to_owned).into(),
        values: vec![vec![0.0; 5]],
    });
    let member = MemberReport { name: "nominal".to_owned(), instability: -1.0, margins: None };
    let whole = Ok(CommonCertificate { p: vec![vec![0.0; 12]; 12], margin: 1.0 });
    report.family = Some(FamilyReport { members: vec![member], feedback: None, whole });
    let shown = table(&report, "P, Lyapunov matrix (12 × 12)");
    let names = "x1delayed u1delay of u1, 2delay of u1, 3delay of y1, 1delay of y1, 2delay of y1, 3\
                 estimate of x1estimate of delayed u1";
    assert!(shown.contains(names), "{shown}");
}

/// The only fault of this report has neither a mean delay nor a least size.
#[test]
fn a_fault_that_is_not_detected_for_sure_says_so() {
    let shown = table(&hostile(), "Predicted detection");
    assert!(shown.contains("mean delay, s") && shown.contains("never for sure"), "{shown}");
    assert!(shown.contains("least detectable") && shown.contains("none"), "{shown}");
}

/// No other design may meet the limits: the change is then the best one found, or a sentence that there is none.
#[test]
fn a_change_is_not_said_to_make_the_design_green() {
    let text = page(&hostile());
    assert!(text.contains("What to change") && !text.contains("make it green"));
}

/// The judged peak is 3 in the best units, and 1.5e5 in those of the plant file, as is the 12.5 of the other design.
#[test]
fn a_linear_quadratic_design_is_proposed_for_a_peak_in_the_same_units_only() {
    let proposed = |judged: f64| {
        let mut report = hostile();
        report.verdict.remedies.clear();
        let robustness = report.robustness.as_mut().unwrap();
        robustness.points[0].judged = judged;
        robustness.comparison[0].name = "peak of S at the input".to_owned();
        robustness.comparison[0].linear_quadratic = Some(12.5);
        page(&report).contains("for the linear-quadratic design of the same speed")
    };
    assert!(!proposed(3.0) && proposed(1.5e5));
}

#[test]
fn a_hold_without_a_limit_makes_no_loop_unstable() {
    let hold = |longest| {
        let mut report = hostile();
        report.robustness.as_mut().unwrap().longest_hold = longest;
        let text = page(&report);
        ["stable up to a sample time of", "up to 1000 sample times"].map(|part| text.contains(part))
    };
    assert_eq!([hold(0.5), hold(f64::INFINITY)], [[true, false], [false, true]]);
}

/// The reasons of the verdict say "above 4 (red)" and "above 2 (amber)".
#[test]
fn the_peaks_of_s_are_beside_both_limits_of_the_verdict() {
    let page = xml(&page(&hostile()));
    let document = Document::parse(&page).unwrap();
    let mut keys = elements(&document, "dt").filter(|key| text(*key) == "Peak of S");
    let shown = text(keys.next().unwrap().parent().unwrap());
    assert!(shown.ends_with(" (amber above 2, red above 4)"), "{shown}");
}

#[test]
fn an_infinite_time_is_no_number_with_a_unit() {
    let mut report = hostile();
    report.robustness.as_mut().unwrap().delay_margin = f64::INFINITY;
    report.steps[0].curves[0].settling_time = f64::INFINITY;
    let page = page(&report);
    assert!(page.contains(", not settled at the end of the response.") && !page.contains("∞ s."));
    let document = xml(&page);
    let text = text(Document::parse(&document).unwrap().root());
    for expected in
        ["Delay marginno limit", "Delay margin of all commands together", ": no limit. "]
    {
        assert!(text.contains(expected), "{expected}");
    }
}

#[test]
fn signals_without_units_are_not_in_the_unit_of_a_change() {
    let mut report = hostile();
    let part = Number { name: "f1".to_owned(), unit: None, value: 0.375 };
    report.steps[0].parts = vec![part];
    let has_mark = |report: &Report| page(report).contains("size of the change, in the same unit");
    assert!(report.steps[0].curves.iter().any(|curve| curve.unit.is_none()));
    assert!(!has_mark(&report));
    let step = &mut report.steps[0];
    step.unit.clone_from(&step.curves[0].unit);
    assert!(has_mark(&report));
}

#[test]
fn eigenvalues_without_an_actuator_have_the_plane_of_the_design() {
    assert!(page(&hostile()).contains("eigenvalue of A + B K_x (z-plane)"));
    let mut report = hostile();
    report.sampling = None;
    assert!(page(&report).contains("eigenvalue of A + B K_x (1/s)"));
}

#[test]
fn errors_at_samples_and_losses_that_were_tested_are_named_so() {
    let text = page(&hostile());
    assert!(text.contains("The errors of a sampled design are those at its samples."));
    assert!(text.contains("Of 50 losses from 0 to 1 that were tested for each actuator,"));
}
