//! Shared memory that describes the results file of this process to a supervising process: its path, the length that is
//! written, and the rows that are not written yet. The supervisor completes the file by this memory if this process
//! dies.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use super::identity::Identity;

/// Least number of words of the memory that [`share`] needs.
pub const WORDS: usize = ROWS + (1 << 16);

// Positions in the shared memory, in words: the numbers, then the bytes of the path, then the bytes of the rows.

/// State of the file: 0 without a file, [`OPEN`] or [`COMPLETE`].
const STATE: usize = 0;
const DEVICE: usize = 1;
const INODE: usize = 2;
/// Length of the file in bytes; the file ends with a whole row.
const LENGTH: usize = 3;
/// Number of bytes of the pending rows: whole rows that are not in the file yet.
const PENDING: usize = 4;
const PATH_LENGTH: usize = 5;
const PATH: usize = 6;
/// Room for the longest path of the system, in words.
const PATH_WORDS: usize = 512;
const ROWS: usize = PATH + PATH_WORDS;

const OPEN: u64 = 1;
const COMPLETE: u64 = 2;

/// Number of bytes of a word.
const WORD: usize = size_of::<u64>();

static SHARED: OnceLock<&'static [AtomicU64]> = OnceLock::new();

/// Describes the next results file in `memory`, which a supervising process shares and whose words are zero. Ignores
/// `memory` if it has fewer than [`WORDS`] words, or if an earlier call has set the shared memory.
pub fn share(memory: &'static [AtomicU64]) {
    if memory.len() >= WORDS {
        let _ = SHARED.set(memory);
    }
}

/// The shared memory in the process that writes the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ledger(&'static [AtomicU64]);

impl Ledger {
    /// Enters a new file at this absolute path; `None` if there is no shared memory, another file uses the memory, or
    /// the path is too long.
    pub(crate) fn enter(path: &Path, identity: Identity) -> Option<Self> {
        let memory = SHARED.get()?;
        let path = path.as_os_str().as_encoded_bytes();
        if path.len() > PATH_WORDS * WORD || memory[STATE].load(Ordering::Relaxed) != 0 {
            return None;
        }
        let ledger = Self(memory);
        ledger.set(DEVICE, identity.device);
        ledger.set(INODE, identity.inode);
        put(&memory[PATH..ROWS], 0, path);
        ledger.set(PATH_LENGTH, path.len() as u64);
        ledger.set(STATE, OPEN);
        Some(ledger)
    }

    fn set(self, place: usize, value: u64) {
        self.0[place].store(value, Ordering::Release);
    }

    /// Records that the file has this length and that no rows are pending, and with `is_complete` that no row follows.
    pub(crate) fn written(self, length: u64, is_complete: bool) {
        self.set(PENDING, 0);
        self.set(LENGTH, length);
        if is_complete {
            self.set(STATE, COMPLETE);
        }
    }

    /// Stores the pending `rows`, of which the memory already has the bytes before `start`. Returns false if the rows
    /// do not fit and must therefore be written to the file.
    #[inline]
    pub(crate) fn keep(self, rows: &[u8], start: usize) -> bool {
        let fits = rows.len() <= (self.0.len() - ROWS) * WORD;
        if fits {
            put(&self.0[ROWS..], start, rows);
            self.set(PENDING, rows.len() as u64);
        }
        fits
    }
}

/// Stores the bytes from `start` on, by whole words; the bytes before `start` are stored already.
#[inline]
fn put(words: &[AtomicU64], start: usize, bytes: &[u8]) {
    let first = start / WORD;
    let (whole, rest) = bytes[first * WORD..].as_chunks::<WORD>();
    for (word, bytes) in words[first..].iter().zip(whole) {
        word.store(u64::from_le_bytes(*bytes), Ordering::Relaxed);
    }
    if !rest.is_empty() {
        let mut last = [0; WORD];
        last[..rest.len()].copy_from_slice(rest);
        words[first + whole.len()].store(u64::from_le_bytes(last), Ordering::Relaxed);
    }
}

/// Returns the first `length` bytes of the words, or all if there are fewer.
fn bytes(words: &[AtomicU64], length: u64) -> Vec<u8> {
    let length = usize::try_from(length).unwrap_or(usize::MAX);
    let words = words.iter().take(length.div_ceil(WORD));
    let mut bytes: Vec<u8> =
        words.flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()).collect();
    bytes.truncate(length);
    bytes
}

/// A results file after the end of the process that wrote it.
#[derive(Debug)]
pub struct LeftFile {
    /// The absolute path of the file.
    pub path: PathBuf,
    /// Whether the process had completed the file.
    pub was_complete: bool,
    /// Description of the damage; `None` if the file has all rows.
    pub damage: Option<String>,
}

/// Completes the file that the ended process wrote: appends the rows that the process had stored and not written.
/// Returns `None` if the process wrote no file. `memory` has at least [`WORDS`] words.
#[must_use]
pub fn complete(memory: &[AtomicU64]) -> Option<LeftFile> {
    let value = |place: usize| memory[place].load(Ordering::Acquire);
    let state = value(STATE);
    if state != OPEN && state != COMPLETE {
        return None;
    }
    let path = path_of(bytes(&memory[PATH..ROWS], value(PATH_LENGTH)));
    let rows = bytes(&memory[ROWS..], value(PENDING));
    let identity = Identity { device: value(DEVICE), inode: value(INODE) };
    let was_complete = state == COMPLETE;
    let damage = match append(&path, identity, was_complete, value(LENGTH), &rows) {
        Ok(damage) => damage,
        Err(error) => Some(format!("its last rows cannot be written: {error}")),
    };
    Some(LeftFile { path, was_complete, damage })
}

#[cfg(unix)]
fn path_of(bytes: Vec<u8>) -> PathBuf {
    use std::os::unix::ffi::OsStringExt as _;
    std::ffi::OsString::from_vec(bytes).into()
}

#[cfg(not(unix))]
fn path_of(bytes: Vec<u8>) -> PathBuf {
    String::from_utf8_lossy(&bytes).into_owned().into()
}

/// Appends `rows`, or their missing part, to the file at `path`, which must still have this identity and the `length`
/// bytes that were written. Returns a description of the damage; `None` if the file has all rows.
fn append(
    path: &Path,
    identity: Identity,
    was_complete: bool,
    length: u64,
    rows: &[u8],
) -> io::Result<Option<String>> {
    let mut file = match File::options().read(true).write(true).open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Some("it was removed during the run".to_owned()));
        }
        Err(error) => return Err(error),
    };
    let metadata = file.metadata()?;
    if Identity::new(&metadata) != identity {
        return Ok(Some("another file took its place during the run".to_owned()));
    }
    let (size, whole) = (metadata.len(), length + rows.len() as u64);
    // A Parquet file never has pending rows. If its last write is unfinished, it has the rows of the write before.
    let is_unfinished = size > whole && rows.is_empty() && !was_complete;
    if size < length || size > whole && !is_unfinished {
        return Ok(Some(format!(
            "it has {size} bytes where the run wrote {length}: something else wrote to it"
        )));
    }
    if rows.is_empty() {
        return Ok(None);
    }
    // The process may have ended while it wrote the rows.
    let (present, missing) = rows.split_at(usize::try_from(size - length).unwrap_or(0));
    let mut written = vec![0; present.len()];
    file.seek(SeekFrom::Start(length))?;
    file.read_exact(&mut written)?;
    if written != present {
        return Ok(Some("its last rows are not those of the run".to_owned()));
    }
    file.write_all(missing)?;
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn memory() -> Vec<AtomicU64> {
        std::iter::repeat_with(|| AtomicU64::new(0)).take(ROWS + 64).collect()
    }

    /// Returns the memory of an ended process that wrote `length` bytes to a file and had `rows` pending.
    fn left(path: &Path, length: u64, rows: &[u8]) -> Vec<AtomicU64> {
        let memory = memory();
        let Identity { device, inode } = Identity::new(&std::fs::metadata(path).unwrap());
        let name = path.to_str().unwrap().as_bytes();
        put(&memory[PATH..ROWS], 0, name);
        put(&memory[ROWS..], 0, rows);
        let numbers = [
            (STATE, OPEN),
            (DEVICE, device),
            (INODE, inode),
            (LENGTH, length),
            (PENDING, rows.len() as u64),
            (PATH_LENGTH, name.len() as u64),
        ];
        for (place, number) in numbers {
            memory[place].store(number, Ordering::Relaxed);
        }
        memory
    }

    #[test]
    fn bytes_are_kept_from_any_start() {
        let rows = b"time,x\n0,1\n0.5,22\n1,333\n";
        let memory = memory();
        for (start, end) in [(0, 7), (7, 11), (11, 18), (18, 24)] {
            put(&memory[ROWS..], start, &rows[..end]);
            assert_eq!(bytes(&memory[ROWS..], end as u64), &rows[..end]);
        }
    }

    #[test]
    fn the_rows_that_a_file_lacks_are_appended_even_if_a_part_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        for there in ["", "1,", "1,2\n", "1,2\n3,4\n"] {
            std::fs::write(&path, format!("a,b\n{there}")).unwrap();
            let left = complete(&left(&path, 4, b"1,2\n3,4\n")).unwrap();
            assert_eq!((left.damage, left.was_complete), (None, false), "{there:?}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "a,b\n1,2\n3,4\n");
        }
    }

    #[test]
    fn a_file_that_something_else_changed_is_named_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        for (text, reason) in
            [("a,", "has 2 bytes"), ("a,b\n9,9\n", "not those"), ("a,b\n1,2\n3,4\n5", "13 bytes")]
        {
            std::fs::write(&path, text).unwrap();
            let damage = complete(&left(&path, 4, b"1,2\n3,4\n")).unwrap().damage.unwrap();
            assert!(damage.contains(reason), "{damage}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        let memory = left(&path, 4, b"1,2\n");
        std::fs::remove_file(&path).unwrap();
        assert!(complete(&memory).unwrap().damage.unwrap().contains("removed"));
        assert!(complete(&self::memory()).is_none());
    }
}
