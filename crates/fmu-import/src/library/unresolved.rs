//! Functions that a library calls and that no library defines.
//!
//! The dynamic linker of glibc ends the process by `_exit` when such a function is called; no handler runs. Here
//! [`undefined_function`] replaces such functions. It aborts, which is reported as a crash with FMU, function and
//! time.
#![expect(unsafe_code, reason = "the tables of the dynamic linker")]

use std::collections::BTreeSet;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::{Mutex, PoisonError};

use crate::crash::call_of_this_thread;

/// `struct link_map` of `<link.h>`, as far as it is public.
#[repr(C)]
struct LinkMap {
    /// Difference between the addresses of the library in memory and in the file.
    address: usize,
    name: *const c_char,
    dynamic: *const Dynamic,
}

/// `Elf64_Dyn`.
#[repr(C)]
struct Dynamic {
    tag: i64,
    value: usize,
}

/// `Elf64_Rela`.
#[repr(C)]
struct Relocation {
    offset: usize,
    info: u64,
    addend: i64,
}

/// `Elf64_Sym`.
#[repr(C)]
struct Symbol {
    name: u32,
    info: u8,
    other: u8,
    section: u16,
    value: u64,
    size: u64,
}

const RTLD_DI_LINKMAP: c_int = 2;
const DT_PLTRELSZ: i64 = 2;
const DT_STRTAB: i64 = 5;
const DT_SYMTAB: i64 = 6;
const DT_RELA: usize = 7;
const DT_PLTREL: i64 = 20;
const DT_JMPREL: i64 = 23;
const DT_VERSYM: i64 = 0x6fff_fff0;
const STB_GLOBAL: u8 = 1;
/// The type of a relocation for a function that is bound at its first call.
const JUMP_SLOT: u64 = if cfg!(target_arch = "x86_64") { 7 } else { 1026 };

/// The names of all functions replaced in this process.
static REPLACED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Replaces the functions that the library calls and that no library defines by [`undefined_function`]; returns their
/// names. Does nothing on processors other than x86-64 and 64-bit ARM.
///
/// # Safety
///
/// `handle` is the handle of a library that `dlopen` has loaded with `RTLD_LAZY` and that is not in use.
pub(super) unsafe fn replace(handle: *mut c_void) -> Vec<String> {
    if !cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) {
        return Vec::new();
    }
    let mut map: *const LinkMap = std::ptr::null();
    // SAFETY: an open library; the request fills a pointer.
    let failed = unsafe { libc::dlinfo(handle, RTLD_DI_LINKMAP, (&raw mut map).cast()) } != 0;
    // SAFETY: the dynamic linker returns a valid map of an open library.
    let Some(map) = (if failed { None } else { unsafe { map.as_ref() } }) else {
        return Vec::new();
    };
    // SAFETY: the dynamic section of a loaded library ends with a tag of 0.
    let entry = |tag: i64| unsafe {
        let mut at = map.dynamic;
        while (*at).tag != 0 && (*at).tag != tag {
            at = at.add(1);
        }
        ((*at).tag == tag).then(|| (*at).value)
    };
    // On these processors the dynamic linker has replaced offsets in the file by addresses in memory.
    let (Some(table), Some(bytes), Some(DT_RELA)) =
        (entry(DT_JMPREL), entry(DT_PLTRELSZ), entry(DT_PLTREL))
    else {
        return Vec::new();
    };
    let (Some(symbols), Some(texts)) = (entry(DT_SYMTAB), entry(DT_STRTAB)) else {
        return Vec::new();
    };
    let table = std::ptr::with_exposed_provenance::<Relocation>(table);
    let symbols = std::ptr::with_exposed_provenance::<Symbol>(symbols);
    let texts = std::ptr::with_exposed_provenance::<c_char>(texts);
    let versions = entry(DT_VERSYM).map(std::ptr::with_exposed_provenance::<u16>);
    let mut names = BTreeSet::new();
    for index in 0..bytes / size_of::<Relocation>() {
        // SAFETY: the tables of a loaded library; its relocations name valid symbols, texts and slots,
        // which are writable as long as functions are bound at their first call.
        unsafe {
            let relocation = &*table.add(index);
            let number = (relocation.info >> 32) as usize;
            let symbol = &*symbols.add(number);
            // A symbol with a version is defined in the library that states the version.
            let versioned = versions.is_some_and(|versions| *versions.add(number) & 0x7fff > 1);
            let open = symbol.section == 0 && symbol.info >> 4 == STB_GLOBAL && !versioned;
            if !open || relocation.info & 0xffff_ffff != JUMP_SLOT {
                continue;
            }
            let name = texts.add(symbol.name as usize);
            let is_defined = !libc::dlsym(handle, name).is_null()
                || !libc::dlsym(libc::RTLD_DEFAULT, name).is_null();
            if !is_defined {
                let slot = map.address.wrapping_add(relocation.offset);
                let function: extern "C" fn() = undefined_function;
                std::ptr::with_exposed_provenance_mut::<extern "C" fn()>(slot).write(function);
                names.insert(CStr::from_ptr(name).to_string_lossy().into_owned());
            }
        }
    }
    REPLACED.lock().unwrap_or_else(PoisonError::into_inner).extend(names.iter().cloned());
    names.into_iter().collect()
}

/// Stands in for every function that no library defines.
extern "C" fn undefined_function() {
    let names = REPLACED.lock().unwrap_or_else(PoisonError::into_inner);
    let names = names.iter().map(String::as_str).collect::<Vec<_>>().join(" or ");
    let call = call_of_this_thread();
    let instance = call.as_ref().map_or("", |call| &*call.instance);
    tracing::error!(
        target: "fmu", instance,
        "the FMU calls a function that no library defines: {names}"
    );
    std::process::abort();
}
