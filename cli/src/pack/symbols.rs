//! The functions that a packed library shows.

use fmu_description::Version;
use object::elf::{FileHeader64, STB_LOCAL, STV_HIDDEN, Sym64};
use object::read::elf::{FileHeader as _, SectionHeader as _, Sym as _};
use object::{LittleEndian, elf};

/// Hides the functions of the other version of FMI in an ELF library; other libraries stay as they are.
///
/// The library has the functions of both versions, and some importers choose the version by the functions
/// that they find. A symbol that is local is found by no importer.
pub(super) fn hide_other_version(library: &mut [u8], version: Version) {
    let prefix: &[u8] = if version == Version::V3 { b"fmi2" } else { b"fmi3" };
    for offset in places(library, prefix).unwrap_or_default() {
        // The fields of Elf64_Sym: st_name (4 bytes), st_info (binding and type), st_other (visibility).
        if let Some([info, other]) = library.get_mut(offset + 4..offset + 6) {
            *info = (STB_LOCAL.0 << 4) | (*info & 0xf);
            *other = STV_HIDDEN.0;
        }
    }
}

/// Returns the offsets of the dynamic symbols whose names begin with `prefix`.
fn places(library: &[u8], prefix: &[u8]) -> object::Result<Vec<usize>> {
    let header = FileHeader64::<LittleEndian>::parse(library)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, library)?;
    let symbols = sections.symbols(endian, library, elf::SHT_DYNSYM)?;
    let section = sections.section(symbols.section())?;
    let start = usize::try_from(section.sh_offset(endian)).unwrap_or(usize::MAX);
    let size = size_of::<Sym64<LittleEndian>>();
    let is_other = |symbol: &Sym64<LittleEndian>| {
        let name = symbol.name(endian, symbols.strings());
        name.is_ok_and(|name| name.starts_with(prefix))
    };
    let found = symbols.iter().enumerate().filter(|(_, symbol)| is_other(symbol));
    Ok(found.map(|(index, _)| start.saturating_add(index * size)).collect())
}
