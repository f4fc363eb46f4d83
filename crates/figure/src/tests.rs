use resvg::tiny_skia::Pixmap;
use resvg::usvg::roxmltree::Document;
use std::fs;

use super::*;

const TIME: [f64; 4] = [0.0, 1.0, 2.0, 3.0];
const VALUES: [f64; 4] = [0.5, -1.5, f64::NAN, 1.0];

fn curve<'a>(label: &'a str, time: &'a [f64], values: &'a [f64]) -> Series<'a> {
    Series { label, time, values, ink: Ink::Blue, broad: false }
}

fn example<'a>(time: &'a [f64], values: &'a [f64]) -> Figure<'a> {
    let panel = || Panel {
        x_label: "time in s",
        y_label: "x_p in m",
        series: vec![curve("a < b & c", time, values), curve("second", time, values)],
        marks: vec![(1.5, "switched on"), (99.0, "never reached")],
        limit: Some((1.0, "claim")),
        ..Panel::default()
    };
    Figure { title: "Motion of the \"cart\" <2>", panels: vec![panel(), panel()] }
}

fn texts(svg: &str) -> Vec<String> {
    let document = Document::parse(svg).expect("well-formed XML");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| node.text()).map(str::to_owned).collect()
}

#[test]
fn the_svg_is_well_formed_and_contains_title_axes_units_legend_and_marks() {
    let svg = example(&TIME, &VALUES).svg().unwrap();
    let texts = texts(&svg);
    let count = |required: &str| texts.iter().filter(|text| *text == required).count();
    assert_eq!(count("Motion of the \"cart\" <2>"), 1);
    for twice in ["time in s", "x_p in m", "a < b & c", "second", "switched on", "claim"] {
        assert_eq!(count(twice), 2, "{twice} in {texts:?}");
    }
    assert_eq!(count("never reached"), 0);
    let document = Document::parse(&svg).unwrap();
    let paths = document.descendants().filter(|node| node.has_tag_name("path")).count();
    assert_eq!(paths, 4);
}

#[test]
fn control_characters_in_a_label_leave_the_svg_well_formed() {
    let mut figure = example(&TIME, &VALUES);
    figure.title = "bell \u{7} and nul \0";
    assert!(texts(&figure.svg().unwrap()).contains(&"bell   and nul  ".to_owned()));
}

#[test]
fn value_labels_stay_on_the_page_and_do_not_touch() {
    let svg = example(&TIME, &VALUES).svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let mut heights: Vec<f64> = document
        .descendants()
        .filter(|node| node.attribute("text-anchor") == Some("end"))
        .map(|node| node.attribute("y").unwrap().parse().unwrap())
        .collect();
    heights.sort_by(f64::total_cmp);
    assert!(heights.len() > 4, "{heights:?}");
    assert!(heights.windows(2).all(|pair| pair[1] - pair[0] >= TEXT_SIZE), "{heights:?}");
    let page = document.root_element().attribute("height").unwrap().parse::<f64>().unwrap();
    assert!(heights.iter().all(|height| (0.0..page).contains(height)));
}

#[test]
fn long_numbers_along_the_axes_stay_on_the_page_beside_the_label_of_the_axis() {
    let time = [99_999.0, 100_000.0];
    let values = [123_456.0, 123_458.5];
    let mut figure = example(&time, &values);
    figure.panels[0].limit = None;
    figure.panels[0].marks.clear();
    let svg = figure.svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let number = |node: &resvg::usvg::roxmltree::Node<'_, '_>, name: &str| -> f64 {
        node.attribute(name).unwrap().parse().unwrap()
    };
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    let mut long = 0;
    for text in texts.filter(|node| node.attribute("transform").is_none()) {
        // Digits of the font are 0.636 em wide (DejaVu Sans).
        let letters = f64::from(u8::try_from(text.text().unwrap().chars().count()).unwrap());
        let width = 0.636 * TEXT_SIZE * letters;
        let x = number(&text, "x");
        match text.attribute("text-anchor") {
            Some("end") => assert!(x - width > 26.0, "{text:?} meets the label of the axis"),
            Some("middle") if letters > 4.0 && text.text().unwrap().starts_with(['9', '1']) => {
                assert!(x + 0.5 * width <= WIDTH, "{text:?}");
            }
            _ => continue,
        }
        long += usize::from(letters > 7.0);
    }
    assert!(long > 3, "the numbers are long");
}

#[test]
fn labels_of_seconds_since_1970_do_not_overlap() {
    for length in [0.01, 1.0, 100.0, 3600.0] {
        let time = [1.7e9, 1.7e9 + length];
        let svg = example(&time, &VALUES[..2]).svg().unwrap();
        let document = Document::parse(&svg).unwrap();
        let labels = document.descendants().filter(|node| node.has_tag_name("text"));
        let ends = labels.filter_map(|node| {
            let text = node.text().filter(|text| text.ends_with("e9"))?;
            let letters = f64::from(u8::try_from(text.chars().count()).unwrap());
            // Digits of the font are 0.636 em wide (DejaVu Sans).
            let half = 0.5 * 0.636 * TEXT_SIZE * letters;
            let x: f64 = node.attribute("x").unwrap().parse().unwrap();
            Some((x - half, x + half))
        });
        let ends: Vec<_> = ends.collect();
        // Both panels have the same labels.
        let ends = &ends[..ends.len() / 2];
        assert!(ends.len() >= 3, "{length} s: {ends:?}");
        assert!(ends.windows(2).all(|pair| pair[0].1 <= pair[1].0), "{length} s: {ends:?}");
    }
}

#[test]
fn the_files_are_an_svg_and_a_png_of_2000_pixels_the_same_bytes_twice() {
    let folder = tempfile::tempdir().unwrap();
    let mut figure = example(&TIME, &VALUES);
    figure.panels.truncate(1);
    let written = |name: &str| {
        let stem = folder.path().join("new").join(name);
        figure.write(&stem).unwrap();
        [".svg", ".png"].map(|ending| fs::read(with_ending(&stem, ending)).unwrap())
    };
    let [svg, png] = written("one.step");
    assert_eq!([svg.clone(), png.clone()], written("two"));
    assert_eq!(String::from_utf8(svg).unwrap(), figure.svg().unwrap());
    let pixels = Pixmap::decode_png(&png).unwrap();
    let panel = LEGEND_HEIGHT + PLOT_HEIGHT + TICK_HEIGHT + LABEL_HEIGHT + GAP;
    assert_eq!(pixels.width(), 2000);
    assert!((f64::from(pixels.height()) - 2.0 * (TITLE_HEIGHT + panel)).abs() < 0.5);
    assert_eq!(fs::read_dir(folder.path().join("new")).unwrap().count(), 4, "no partial file");
}

#[test]
fn the_png_shows_curve_and_title_on_white() {
    let mut figure = example(&TIME, &VALUES);
    figure.panels.truncate(1);
    let pixels = Pixmap::decode_png(&rasterise(&figure.svg().unwrap()).unwrap()).unwrap();
    let count = |rows: std::ops::Range<usize>, required: [u8; 3]| {
        let part = &pixels.pixels()[2000 * rows.start..2000 * rows.end];
        part.iter().filter(|pixel| [pixel.red(), pixel.green(), pixel.blue()] == required).count()
    };
    let (title, all) = (0..80, 0..pixels.pixels().len() / 2000);
    assert!(pixels.pixels().iter().all(|pixel| pixel.alpha() == 255));
    assert!(count(all.clone(), [255; 3]) > pixels.pixels().len() * 8 / 10);
    assert!(count(title.clone(), [0x22; 3]) > 1000);
    assert_eq!(count(title, [0x00, 0x72, 0xb2]), 0);
    assert!(count(all, [0x00, 0x72, 0xb2]) > 1000);
}

#[test]
fn a_font_that_is_not_linked_in_is_replaced() {
    let svg = |text: &str| {
        format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="90" height="30"><text x="5" y="20" font-family="Nowhere">{text}</text></svg>"#
        )
    };
    let seen = |text: &str| {
        let pixels = Pixmap::decode_png(&rasterise(&svg(text)).unwrap()).unwrap();
        pixels.pixels().iter().filter(|pixel| pixel.alpha() > 128).count()
    };
    assert_eq!(seen(""), 0);
    assert!(seen("theta θ") > 100);
}

#[test]
fn a_file_that_is_not_an_svg_is_refused() {
    assert!(matches!(rasterise("no drawing"), Err(FigureError::Pixels(_))));
}

#[test]
fn a_million_samples_make_a_small_svg() {
    let time: Vec<f64> = (0..1_000_000).map(|i| f64::from(i) * 1e-4).collect();
    let values: Vec<f64> = time.iter().map(|t| (4000.0 * t).sin()).collect();
    let svg = example(&time, &values).svg().unwrap();
    assert!(svg.len() < 300_000, "{} bytes", svg.len());
}

#[test]
fn a_curve_beyond_the_cap_leaves_the_frame_and_the_legend_says_so() {
    let values = [0.0, 1.0, -1e300, f64::INFINITY];
    let mut figure = example(&TIME, &values);
    let note = "a curve leaves the frame".to_owned();
    assert!(!texts(&figure.svg().unwrap()).contains(&note));
    figure.panels[0].y_cap = Some(2.0);
    let texts = texts(&figure.svg().unwrap());
    assert_eq!(texts.iter().filter(|text| **text == note).count(), 1);
    assert!(texts.contains(&"\u{2212}2.0".to_owned()), "{texts:?}");
}

#[test]
fn a_panel_without_data_says_so() {
    for (time, values) in [(&[][..], &[][..]), (&TIME, &[f64::NAN; 4]), (&[f64::NAN; 4], &TIME)] {
        let texts = texts(&example(time, values).svg().unwrap());
        assert_eq!(texts.iter().filter(|text| *text == "no finite data").count(), 2);
    }
}

#[test]
fn unequal_lengths_are_refused_with_label_and_both_lengths() {
    let message = example(&TIME, &VALUES[..3]).svg().unwrap_err().to_string();
    assert_eq!(message, "curve \"a < b & c\": 4 times, but 3 values");
}

#[test]
fn a_file_that_cannot_be_written_is_named_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("plot.svg");
    fs::create_dir(&taken).unwrap();
    let error = example(&TIME, &VALUES).write(&folder.path().join("plot")).unwrap_err();
    assert!(error.to_string().contains(&taken.display().to_string()), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_text_is_drawn_where_its_anchor_and_its_size_say() {
    let page = |text: &str| {
        let svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="200" height="60"><g font-size="20">{text}</g></svg>"#
        );
        Pixmap::decode_png(&rasterise(&svg).unwrap()).unwrap()
    };
    let extent = |pixels: &Pixmap| {
        let width = pixels.width() as usize;
        let inked = pixels.pixels().iter().enumerate().filter(|(_, pixel)| pixel.alpha() > 128);
        let columns: Vec<usize> = inked.map(|(at, _)| at % width).collect();
        let column = |actual: Option<&usize>| f64::from(u32::try_from(*actual.unwrap()).unwrap());
        (column(columns.iter().min()), column(columns.iter().max()))
    };
    // DejaVu Sans: the advance of a capital H is 1540 of 2048 units, its left side bearing 201.
    let text = |anchor: &str| {
        extent(&page(&format!(r#"<text x="100" y="40" text-anchor="{anchor}">HHH</text>"#)))
    };
    let (bearing, width) = (201.0 / 2048.0 * 40.0, 3.0 * 1540.0 / 2048.0 * 40.0);
    for (anchor, start) in
        [("start", 200.0), ("middle", 200.0 - width / 2.0), ("end", 200.0 - width)]
    {
        let (left, right) = text(anchor);
        assert!((left - (start + bearing)).abs() <= 1.5, "{anchor}: from {left}");
        assert!((right - (start + width - bearing)).abs() <= 1.5, "{anchor}: to {right}");
    }
}

#[test]
fn a_text_that_is_not_plain_is_refused_with_its_place() {
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9\" height=\"9\">\n <text>x<tspan>2</tspan></text></svg>";
    let error = rasterise(svg).unwrap_err().to_string();
    assert!(error.contains("line 2, column 2: <text>: expected plain text"), "{error}");
}
