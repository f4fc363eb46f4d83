//! What is written is read again as the same, and has the same bytes each time.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use fmu_description::package::{Package, platforms};
use fmu_description::unit::BaseUnit;
use slave::Transformation as Change;
use ssp::structure::{
    Component, Connection, Connector, ConnectorKind, Content, Conversion, DefaultExperiment,
    Definitions, DictionaryReference, DictionarySource, Element, ElementBase, End, Enumeration,
    Implementation, MappingEntry, Parameter, ParameterBinding, ParameterMapping, ParameterSet,
    ParameterValue, SignalDictionary, Source, System, SystemStructure, Transformation, Type, Unit,
};
use ssp::{Assembly, Element as Fmu, Link, Setting, Terminal};
use ssp::{
    open, read_ssb, read_ssd, read_ssm, read_ssv, render_ssb, render_ssd, render_ssm, render_ssv,
    write,
};

use crate::bench::{self, Bench, connection, description, links, root, settings};

fn definitions() -> Definitions {
    let base = BaseUnit { m: 1, s: -2, factor: 0.1, offset: -0.5, ..BaseUnit::default() };
    Definitions {
        enumerations: vec![Enumeration {
            name: "Gear".into(),
            items: vec![("low".into(), -1), ("high <&\">".into(), 2)],
        }],
        units: vec![Unit { name: "dm/s²".into(), base }],
    }
}

fn parameters() -> ParameterSet {
    let values = [
        ParameterValue::Real(0.1 + 0.2, Some("dm/s²".into())),
        ParameterValue::Real(-1e-300, None),
        ParameterValue::Integer(i32::MIN),
        ParameterValue::Boolean(true),
        ParameterValue::String("two\nlines, a\ttab, \"quotes\" & <tags>".into()),
        ParameterValue::Enumeration("low".into(), Some("Gear".into())),
        ParameterValue::Binary("00ff".into()),
    ];
    let list = values.into_iter().enumerate();
    let parameters = list.map(|(k, value)| Parameter { name: format!("p[{k}].'x y'"), value });
    ParameterSet {
        name: "set".into(),
        parameters: parameters.collect(),
        definitions: definitions(),
    }
}

fn mapping() -> ParameterMapping {
    let all = [
        None,
        Some(Transformation::Linear { factor: 1.0 / 3.0, offset: -2.5 }),
        Some(Transformation::Boolean(vec![(true, false)])),
        Some(Transformation::Integer(vec![(1, -1), (2, 4)])),
        Some(Transformation::Enumeration(vec![("a".into(), "b".into())])),
    ];
    let entries = all.into_iter().enumerate().map(|(k, transformation)| MappingEntry {
        source: "s".into(),
        target: format!("t{k}"),
        conversion: Conversion { transformation, suppress_units: k % 2 == 1 },
        ..MappingEntry::default()
    });
    ParameterMapping { entries: entries.collect() }
}

fn dictionary() -> SignalDictionary {
    let kinds = [
        Type::Real(Some("dm/s²".into())),
        Type::Integer,
        Type::Boolean,
        Type::String,
        Type::Enumeration("Gear".into()),
        Type::Binary,
    ];
    let entries = kinds.into_iter().enumerate().map(|(k, kind)| (format!("s{k}"), kind));
    SignalDictionary { entries: entries.collect(), definitions: definitions() }
}

fn connectors() -> Vec<Connector> {
    let kinds = [
        ConnectorKind::Input,
        ConnectorKind::Output,
        ConnectorKind::Parameter,
        ConnectorKind::CalculatedParameter,
        ConnectorKind::Inout,
    ];
    let kinds = kinds.into_iter().zip(dictionary().entries);
    kinds
        .map(|(kind, (name, value))| Connector { name, kind, kind_of_value: Some(value) })
        .collect()
}

fn file<T>(uri: &str, in_component: bool) -> Source<T> {
    Source::File { uri: uri.into(), in_component }
}

fn named(name: &str) -> ElementBase {
    ElementBase { name: name.into(), ..ElementBase::default() }
}

/// A component with all that a component can have.
fn component() -> Component {
    let binding = |prefix: &str, values, mapping| ParameterBinding {
        prefix: prefix.into(),
        values,
        mapping,
        at: ElementBase::default().at,
    };
    Component {
        base: ElementBase {
            connectors: connectors(),
            bindings: vec![
                binding("a.", Source::Inline(parameters()), Some(Source::Inline(mapping()))),
                binding("", file("x%20y.ssv", true), Some(file("m.ssm", true))),
            ],
            ..named("c")
        },
        content: Content::Fmu,
        source: "resources/a%20b.fmu".into(),
        implementation: Implementation::CoSimulation,
        step_size: Some(0.25),
    }
}

fn structure() -> SystemStructure {
    let component = component();
    let package =
        Component { content: Content::Package, source: "p.ssp".into(), ..component.clone() };
    let package = Component { base: named("p"), step_size: None, ..package };
    let inner = System {
        base: ElementBase { id: Some("i".into()), ..named("inner") },
        ..System::default()
    };
    let reference = DictionaryReference { base: named("r"), dictionary: "bus".into() };
    let connection = |(k, entry): (usize, MappingEntry)| Connection {
        start: End { element: (k > 0).then(|| "c".into()), connector: entry.source },
        end: End { element: None, connector: entry.target },
        conversion: entry.conversion,
        ..Connection::default()
    };
    let bus = |name: &str, content| DictionarySource {
        name: name.into(),
        content,
        at: ElementBase::default().at,
    };
    SystemStructure {
        name: "S".into(),
        system: System {
            base: ElementBase { connectors: connectors(), ..named("root") },
            elements: vec![
                Element::Component(component),
                Element::System(inner),
                Element::Dictionary(reference),
                Element::Component(package),
            ],
            connections: mapping().entries.into_iter().enumerate().map(connection).collect(),
            dictionaries: vec![
                bus("bus", Source::Inline(dictionary())),
                bus("other", file("d.ssb", false)),
            ],
        },
        definitions: definitions(),
        experiment: Some(DefaultExperiment {
            start_time: Some(0.5),
            stop_time: Some(100.0),
            step_size: Some(1e-3),
        }),
        generation_tool: Some("tool".into()),
    }
}

#[test]
fn every_file_is_read_again_as_it_was() {
    assert_eq!(read_ssd(render_ssd(&structure()).as_bytes()).unwrap().0, structure());
    assert_eq!(read_ssv(render_ssv(&parameters()).as_bytes()).unwrap().0, parameters());
    assert_eq!(read_ssm(render_ssm(&mapping()).as_bytes()).unwrap().0, mapping());
    assert_eq!(read_ssb(render_ssb(&dictionary()).as_bytes()).unwrap().0, dictionary());
}

fn assembly(bench: &Bench) -> Assembly {
    let a = bench.fmu("one/a.fmu", "y output Real unit=\"mm\"\nn output Integer\ns output String");
    let b = bench.fmu(
        "two/a.fmu",
        "u input Real unit=\"m\"\nn input Integer\np parameter Real\ng parameter Enumeration declaredType=\"Gear\"\nt parameter String\nk parameter Boolean",
    );
    let end = |element: &str, variable: &str| Terminal {
        element: element.into(),
        variable: variable.into(),
    };
    let link =
        |from, to, transformation, units_settled| Link { from, to, transformation, units_settled };
    let setting = |(variable, value): (&str, &str)| Setting {
        variable: variable.into(),
        value: value.into(),
    };
    let values = [("p", "1"), ("g", "2"), ("t", " x "), ("k", "1"), ("p", "0.3")];
    Assembly {
        name: Some("Pair".into()),
        functions: vec![],
        elements: vec![
            Fmu { name: "a".into(), fmu: a.clone(), ..Fmu::default() },
            Fmu {
                name: "my b".into(),
                fmu: b,
                settings: values.map(setting).into(),
                ..Fmu::default()
            },
            Fmu { name: "again".into(), fmu: a, ..Fmu::default() },
        ],
        links: vec![
            link(
                end("a", "y"),
                end("my b", "u"),
                Change::Linear { factor: 2.0, offset: 1.0 },
                true,
            ),
            link(end("a", "n"), end("my b", "n"), Change::Integer(vec![(1, 2)]), false),
        ],
        start_time: Some(1.0),
        stop_time: Some(3.0),
    }
}

#[test]
fn an_assembly_comes_back_from_its_ssp_and_the_bytes_are_always_the_same() {
    let bench = Bench::new();
    let mut assembly = assembly(&bench);
    assembly.elements[0].implementation = Implementation::CoSimulation;
    let (first, second) = (bench.path("new/first.ssp"), bench.path("second.ssp"));
    write(&assembly, Some(0.5), &first).unwrap();
    write(&assembly, Some(0.5), &second).unwrap();
    assert_eq!(fs::read(&first).unwrap(), fs::read(&second).unwrap());
    let opened = open(&first).unwrap();
    // The units are settled there: the conversion is suppressed.
    assert_eq!(links(&opened.assembly), ["a.y -> my b.u * 2.0 + 1.0", "a.n -> my b.n [(1, 2)]"]);
    assert_eq!(
        settings(&opened.assembly),
        ["my b.p = 0.3", "my b.g = 2", "my b.t =  x ", "my b.k = true"]
    );
    assert_eq!((opened.assembly.start_time, opened.assembly.stop_time), (Some(1.0), Some(3.0)));
    assert_eq!(opened.experiment.step_size, Some(0.5));
    // The step is there for libcosim: what is written here asks for no algorithm.
    assert!(!opened.fixed_step);
    assert_eq!(opened.warnings, [""; 0]);
    let names: Vec<_> =
        opened.assembly.elements.iter().map(|element| element.name.as_str()).collect();
    assert_eq!(names, ["a", "my b", "again"]);
    assert_eq!(opened.assembly.elements[0].fmu, opened.assembly.elements[2].fmu);
    let interfaces: Vec<_> =
        opened.assembly.elements.iter().map(|element| element.implementation).collect();
    let expected = [Implementation::CoSimulation, Implementation::Any, Implementation::Any];
    assert_eq!(interfaces, expected);
    // An opened assembly, whose FMUs are folders, is written again.
    let third = bench.path("third.ssp");
    write(&opened.assembly, Some(0.5), &third).unwrap();
    for name in ["resources/a.fmu", "resources/a_2.fmu"] {
        assert_eq!(entry(&third, name), entry(&first, name));
    }
    assert_eq!(links(&open(&third).unwrap().assembly), links(&opened.assembly));
}

/// An FMU with libraries for all platforms, and with files that no simulation needs.
fn complete_fmu(bench: &Bench, name: &str) -> PathBuf {
    let mut package = Package::new(description("m", "y output Real"));
    for folder in ["linux64", "win64", "darwin64", "aarch64-linux", "aarch64-darwin"] {
        package.add(format!("binaries/{folder}/m.lib"), folder);
    }
    package.add(format!("binaries/{}/m.so", platforms()[0]), "not a library");
    for path in ["documentation/index.html", "sources/m.c", "model.png", "resources/deep/t.csv"] {
        package.add(path, path);
    }
    let path = bench.path(name);
    package.write(&path).unwrap();
    path
}

/// The entry `name` of an archive.
pub(crate) fn entry(archive: &Path, name: &str) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(fs::File::open(archive).unwrap()).unwrap();
    let mut bytes = Vec::new();
    archive.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn an_fmu_that_was_opened_is_written_with_all_its_files() {
    let bench = Bench::new();
    let fmu = complete_fmu(&bench, "m.fmu");
    let expected = fs::read(&fmu).unwrap();
    let element = Fmu { name: "m".into(), fmu, ..Fmu::default() };
    let packed = bench.path("packed.ssp");
    write(&Assembly { elements: vec![element], ..Assembly::default() }, None, &packed).unwrap();
    let ssd = bench::ssd(&root(&bench::component("m", "m.fmu", "y output", ""), ""), "");
    let osp = r#"<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1"><Simulators><Simulator name="m" source="m.fmu"/></Simulators></OspSystemStructure>"#;
    let (ssd, osp) = (bench.file("m.ssd", ssd), bench.file("m.xml", osp));
    for source in [&packed, &ssd, &osp] {
        let opened = open(source).unwrap();
        let folder = &opened.assembly.elements[0].fmu;
        assert!(folder.is_dir() && !folder.join("documentation").exists());
        let again = bench.path("again.ssp");
        write(&opened.assembly, None, &again).unwrap();
        assert!(entry(&again, "resources/m.fmu") == expected, "{}", source.display());
    }
}

#[test]
fn an_fmu_that_replaces_one_that_was_opened_is_written() {
    let bench = Bench::new();
    complete_fmu(&bench, "m.fmu");
    let elements = bench::component("m", "m.fmu", "y output", "");
    let mut opened = bench.open(&root(&elements, ""), "").unwrap();
    let other = bench.fmu("other.fmu", "y output Real");
    opened.assembly.elements[0].fmu.clone_from(&other);
    let path = bench.path("x.ssp");
    write(&opened.assembly, None, &path).unwrap();
    assert_eq!(entry(&path, "resources/other.fmu"), fs::read(other).unwrap());
}

#[test]
fn a_unit_that_two_fmus_define_differently_is_converted_once_in_what_is_written() {
    let bench = Bench::new();
    bench.fmu("a.fmu", "y output Real unit=\"m\"");
    let text = description("b", "u input Real unit=\"m\"");
    let mut package =
        Package::new(text.replace("<BaseUnit m=\"1\"/>", "<BaseUnit m=\"1\" factor=\"1000\"/>"));
    package.add(format!("binaries/{}/b.so", platforms()[0]), "not a library");
    package.write(&bench.path("b.fmu")).unwrap();
    let elements = bench::component("a", "a.fmu", "y output", "")
        + &bench::component("b", "b.fmu", "u input", "");
    let opened = bench.open(&root(&elements, &connection("a.y", "b.u", "", "")), "").unwrap();
    let path = bench.path("x.ssp");
    write(&opened.assembly, None, &path).unwrap();
    // 1 m is 0.001 of the unit of 1000 m.
    let expected = ["a.y -> b.u * 0.001 + 0.0"];
    assert_eq!(links(&opened.assembly), expected);
    assert_eq!(links(&open(&path).unwrap().assembly), expected);
}

#[test]
fn the_archive_is_as_section_3_demands() {
    let bench = Bench::new();
    let path = bench.path("x.ssp");
    write(&assembly(&bench), None, &path).unwrap();
    let mut archive = zip::ZipArchive::new(fs::File::open(path).unwrap()).unwrap();
    let mut names = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).unwrap();
        let known = [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated];
        assert!(known.contains(&entry.compression()));
        assert!(!entry.encrypted());
        names.push(entry.name().unwrap().into_owned());
    }
    let expected =
        ["SystemStructure.ssd", "resources/a.fmu", "resources/a_2.fmu", "resources/my_b.ssv"];
    assert_eq!(names, expected);
}

#[test]
fn assemblies_that_make_no_sense_are_not_written() {
    let bench = Bench::new();
    let target = bench.path("x.ssp");
    let good = assembly(&bench);
    for (change, expected) in [
        (
            Box::new(|assembly: &mut Assembly| assembly.links[0].to.variable = "w".into())
                as Box<dyn Fn(&mut Assembly)>,
            "my b.w: expected a variable of a, found none of that name",
        ),
        (
            Box::new(|assembly: &mut Assembly| assembly.links[0].to.element = "c".into()),
            "c.u: expected an element of the assembly, found c",
        ),
        (
            Box::new(|assembly: &mut Assembly| assembly.elements[2].name = "a".into()),
            "a: expected a name that no other element has, found a second one",
        ),
        (
            Box::new(|assembly: &mut Assembly| assembly.elements[1].settings[1].value = "3".into()),
            "my b.g: expected an item of its enumeration, found \"3\"",
        ),
        (
            Box::new(|assembly: &mut Assembly| {
                assembly.elements[1].settings[0].value = "NaN".into();
            }),
            "my b.p: expected a finite number, found \"NaN\"",
        ),
    ] {
        let mut wrong = good.clone();
        change(&mut wrong);
        assert_eq!(write(&wrong, None, &target).unwrap_err().to_string(), expected);
        assert!(!target.exists());
    }
}

/// The schemas judge these files in `tests/foreign/test_ssp_files.py`. With `UPDATE_SSP_SAMPLES` set
/// they are written.
#[test]
fn the_samples_for_the_schemas_are_what_is_written() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ssp/data");
    for (name, text) in [
        ("sample.ssd", render_ssd(&structure())),
        ("sample.ssv", render_ssv(&parameters())),
        ("sample.ssm", render_ssm(&mapping())),
        ("sample.ssb", render_ssb(&dictionary())),
    ] {
        let path = folder.join(name);
        if std::env::var_os("UPDATE_SSP_SAMPLES").is_some() {
            fs::create_dir_all(&folder).unwrap();
            fs::write(&path, &text).unwrap();
        }
        assert_eq!(fs::read_to_string(&path).unwrap(), text, "{name} is stale");
    }
}

#[test]
fn functions_which_ssp_does_not_have_are_not_written() {
    let bench = Bench::new();
    let sum = ssp::Function::Sum { inputs: 2 };
    let functions = vec![("s".into(), sum)];
    let with_one = Assembly { functions, ..assembly(&bench) };
    let text = write(&with_one, None, &bench.path("x.ssp")).unwrap_err().to_string();
    assert_eq!(text, "s: expected an FMU, found a function, which SSP does not have");
}
