//! Strings behind pointers that an FMU passes and that may be invalid.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::c_char;

/// Maximum number of bytes read from a string of an FMU.
const MOST: usize = 1024;

/// Returns the text at `pointer`, up to the first unreadable page; `None` if `pointer` is null or
/// unreadable.
pub(super) fn text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    let bytes = read(pointer.cast());
    bytes.map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
}

/// Lets the kernel copy the bytes, page by page: the kernel reports an unreadable page instead of raising SIGSEGV.
#[cfg(target_os = "linux")]
fn read(pointer: *const u8) -> Option<Vec<u8>> {
    const PAGE: usize = 4096;
    let mut bytes = [0_u8; MOST];
    let mut length = 0;
    while length < MOST {
        let start = pointer.wrapping_add(length);
        let count = (PAGE - start.addr() % PAGE).min(MOST - length);
        let local = libc::iovec { iov_base: bytes[length..].as_mut_ptr().cast(), iov_len: count };
        let remote = libc::iovec { iov_base: start.cast_mut().cast(), iov_len: count };
        // SAFETY: `count` bytes to write to; the kernel checks those that are read.
        let done = unsafe {
            libc::process_vm_readv(libc::getpid(), &raw const local, 1, &raw const remote, 1, 0)
        };
        let copied = usize::try_from(done).ok().filter(|copied| *copied > 0);
        let Some(copied) = copied else { break };
        if let Some(end) = bytes[length..length + copied].iter().position(|byte| *byte == 0) {
            return Some(bytes[..length + end].to_vec());
        }
        length += copied;
    }
    (length > 0).then(|| bytes[..length].to_vec())
}

/// Trusts the pointer: this platform has no checked copy.
#[cfg(not(target_os = "linux"))]
fn read(pointer: *const u8) -> Option<Vec<u8>> {
    // SAFETY: the standard requires a terminated string.
    let text = unsafe { std::ffi::CStr::from_ptr(pointer.cast()) }.to_bytes();
    Some(text[..text.len().min(MOST)].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_read_to_their_end_and_invalid_pointers_give_none() {
        assert_eq!(text(c"tank".as_ptr()), Some("tank".to_owned()));
        assert_eq!(text(c"".as_ptr()), Some(String::new()));
        assert_eq!(text(std::ptr::null()), None);
        let long = std::ffi::CString::new("x".repeat(5000)).unwrap();
        assert_eq!(text(long.as_ptr()).map(|text| text.len()), Some(MOST));
        #[cfg(target_os = "linux")]
        for address in [1_usize, 8, 0xffff_ffff_ffff_0000] {
            assert_eq!(text(std::ptr::without_provenance(address)), None);
        }
    }
}
