//! Hides functions of a packed library from importers.

use fmu_description::Version;
use fmu_description::abi::{DESCRIBE, DESCRIBE_3};
use object::elf::{FileHeader64, STB_LOCAL, STV_HIDDEN, Sym64};
use object::read::elf::{FileHeader as _, SectionHeader as _, Sym as _};
use object::{LittleEndian, elf};

/// Hides the functions in a 64-bit ELF library that an FMU of `version` does not need; does not change other libraries.
///
/// The library has the functions of both versions, and some importers choose the version by the functions
/// that they find. No importer finds a symbol that is local. If `describes`, the function that returns the description
/// of `version` is not hidden: `aso-ftc design` calls it in an archive whose resources it has replaced.
pub(super) fn hide_unneeded(library: &mut [u8], version: Version, describes: bool) {
    let (prefix, describe) =
        if version == Version::V3 { ("fmi3", DESCRIBE_3) } else { ("fmi2", DESCRIBE) };
    let needed = |name: &[u8]| {
        name.starts_with(prefix.as_bytes()) || describes && name == describe.as_bytes()
    };
    for offset in places(library, needed).unwrap_or_default() {
        // The fields of Elf64_Sym: st_name (4 bytes), st_info (binding and type), st_other (visibility).
        if let Some([info, other]) = library.get_mut(offset + 4..offset + 6) {
            *info = (STB_LOCAL.0 << 4) | (*info & 0xf);
            *other = STV_HIDDEN.0;
        }
    }
}

/// Returns the offsets in the file of the dynamic symbols that are functions of FMI or of the exporter and not
/// `needed`. Returns an error if `library` is no 64-bit ELF library.
fn places(library: &[u8], needed: impl Fn(&[u8]) -> bool) -> object::Result<Vec<usize>> {
    let header = FileHeader64::<LittleEndian>::parse(library)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, library)?;
    let symbols = sections.symbols(endian, library, elf::SHT_DYNSYM)?;
    let section = sections.section(symbols.section())?;
    let start = usize::try_from(section.sh_offset(endian)).unwrap_or(usize::MAX);
    let size = size_of::<Sym64<LittleEndian>>();
    let is_unneeded = |symbol: &Sym64<LittleEndian>| {
        let name = symbol.name(endian, symbols.strings());
        let is_of_fmu =
            |name: &[u8]| name.starts_with(b"fmi") || name.starts_with(DESCRIBE.as_bytes());
        name.is_ok_and(|name| is_of_fmu(name) && !needed(name))
    };
    let unneeded = symbols.iter().enumerate().filter(|(_, symbol)| is_unneeded(symbol));
    Ok(unneeded.map(|(index, _)| start.saturating_add(index * size)).collect())
}
