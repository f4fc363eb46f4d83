//! The fuzz targets of the exporter. Each panics if a claim does not hold.

use std::ffi::{CString, c_int};
use std::sync::OnceLock;

use fmu_description::location::{file_uri, path_from_uri};
use fmu_description::{ModelDescription, Version};

use crate::array::Array;
use crate::importer::{Importer, Order, Saved, describe};
use crate::machine::real;

const OK: c_int = 0;
const ERROR: c_int = 3;

/// The GUID of the machine.
pub fn guid() -> &'static str {
    static GUID: OnceLock<String> = OnceLock::new();
    GUID.get_or_init(|| {
        let xml = describe().unwrap_or_else(|message| panic!("{message}"));
        ModelDescription::parse(xml).unwrap_or_else(|error| panic!("{error}")).guid
    })
}

/// The text up to its first NUL.
pub fn c_text(bytes: &[u8]) -> CString {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    CString::new(&bytes[..end]).unwrap_or_default()
}

/// The arguments that a well-behaved importer passes to `fmi2Instantiate`.
pub fn order(kind: c_int) -> Order {
    Order {
        name: Some(c"one".to_owned()),
        kind,
        guid: Some(c_text(guid().as_bytes())),
        resources: Some(c"file:///tmp".to_owned()),
        callbacks: true,
        logger: true,
    }
}

/// The present state as bytes.
fn serialized(importer: &Importer, state: &Saved) -> Vec<u8> {
    let mut size = Array::right(vec![0]);
    assert_eq!(importer.serialized_fmu_state_size(state, &mut size), OK);
    let mut bytes = Array::right(vec![0; size.items[0]]);
    assert_eq!(importer.serialize_fmu_state(state, &mut bytes), OK);
    bytes.items
}

/// Continues with an instance in an unknown state; only statuses are checked, and that nothing
/// crashes.
fn go_on(importer: &Importer) {
    let references = Array::right((0..9).collect());
    for k in 0..3 {
        let mut statuses = vec![
            importer.set_real(&Array::right(vec![real::U]), &Array::right(vec![1.0])),
            importer.get_real(&references, &mut Array::right(vec![0.0; 9])),
            importer.get_derivatives(&mut Array::right(vec![0.0])),
            importer.get_event_indicators(&mut Array::right(vec![0.0])),
            importer.get_string(&Array::right(vec![0, 1, 2]), crate::array::Shape::Right).0,
            importer.do_step(0.1 * f64::from(k), 0.1),
            importer.set_time(0.1 * f64::from(k)),
        ];
        statuses.push(importer.get_real_status(2, &mut Array::right(vec![0.0])));
        assert!(statuses.iter().all(|status| (0..=4).contains(status)));
    }
}

/// `fmi2DeSerializeFMUstate`: the bytes alone, then between a valid header and a valid checksum, so
/// that they reach the decoder.
pub fn serialized_state(data: &[u8]) {
    let Some((kind, data)) = data.split_first() else { return };
    let importer = Importer::new(&order(c_int::from(kind % 2)));
    let mut state = Saved::NULL;
    assert_eq!(
        importer.de_serialize_fmu_state(&Array::right(data.to_vec()), Some(&mut state)),
        ERROR
    );
    assert!(state.is_null());
    assert_eq!(importer.get_fmu_state(Some(&mut state)), OK);
    let bytes = serialized(&importer, &state);
    let (guid, layout) = (16, 8);
    let mut forged = [&bytes[.."FMI2ST03".len() + guid + layout], data].concat();
    forged.extend_from_slice(&crc32fast::hash(&forged).to_le_bytes());
    let status = importer.de_serialize_fmu_state(&Array::right(forged), Some(&mut state));
    assert!([OK, ERROR].contains(&status));
    if status == OK {
        let again = serialized(&importer, &state);
        assert_eq!(importer.de_serialize_fmu_state(&Array::right(again), Some(&mut state)), OK);
        importer.set_fmu_state(&state);
        go_on(&importer);
    }
    importer.free_fmu_state(Some(&mut state));
    importer.reset();
}

/// `fmuResourceLocation`: if a URI gives a path, the URI of this path gives the same path again.
pub fn resource_location(data: &[u8]) {
    if let Ok(path) = path_from_uri(&String::from_utf8_lossy(data)) {
        let uri = file_uri(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(path_from_uri(&uri).as_ref(), Ok(&path), "{uri}");
    }
    let location = c_text(data);
    let text = location.to_str().ok();
    let readable = text.is_some_and(|uri| uri.is_empty() || path_from_uri(uri).is_ok());
    let importer = Importer::new(&Order { resources: Some(location), ..order(1) });
    assert_eq!(importer.exists(), readable);
}

/// `modelDescription.xml`: a description that was read is written and read again with the same
/// result, and without a warning if it breaks no rule.
pub fn model_description(data: &[u8]) {
    let Ok((read, _)) = ModelDescription::read(data) else { return };
    if read.version() == Version::V1 {
        // FMI 1.0 is only read.
        return;
    }
    let problems = read.problems();
    let xml = read.to_xml();
    match ModelDescription::read(&xml) {
        Ok((again, warnings)) => {
            assert_eq!(again.to_xml(), xml);
            assert!(warnings.is_empty() || !problems.is_empty(), "{warnings:?}: {xml}");
        }
        Err(error) => assert!(!problems.is_empty(), "{error}: {xml}"),
    }
}

/// An FMU archive: unpacking writes nothing outside of its folder and no more than the limit, and
/// leaves no files behind.
pub fn package(data: &[u8]) {
    use fmu_description::package::{Unpacked, unpack_archive};
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let path = folder.path().join("M.fmu");
    std::fs::write(&path, data).unwrap_or_else(|error| panic!("{error}"));
    if let Ok(unpacked) = Unpacked::open(&path) {
        let inside = unpacked.folder().to_owned();
        assert!(inside.join("modelDescription.xml").is_file());
        let _ = unpacked.library("M");
        drop(unpacked);
        assert!(!inside.exists());
    }
    if let Ok((unpacked, _)) = unpack_archive(&path) {
        let limit = (64 << 20) + 100 * data.len() as u64;
        assert!(size(unpacked.path()) <= limit);
    }
    let beside = std::fs::read_dir(folder.path()).map(Iterator::count);
    assert_eq!(beside.ok(), Some(1));
}

/// Number of bytes in all files of a folder, which may contain only files and folders.
fn size(folder: &std::path::Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let sizes = entries.map(|entry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => size(&entry.path()),
        Ok(kind) if kind.is_file() => entry.metadata().map_or(0, |metadata| metadata.len()),
        other => panic!("{}: {other:?}", entry.path().display()),
    });
    sizes.sum()
}

/// Any sequence of calls: see `sequence.rs`.
pub fn call_sequence(data: &[u8]) {
    if let Err(what) = crate::sequence::run(data) {
        panic!("{what}");
    }
}
