//! The functions that a packed library shows.

use fmu_description::Version;
use fmu_description::abi::{DESCRIBE, DESCRIBE_3};
use object::elf::{FileHeader64, STB_LOCAL, STV_HIDDEN, Sym64};
use object::read::elf::{FileHeader as _, SectionHeader as _, Sym as _};
use object::{LittleEndian, elf};

/// Hides the functions in an ELF library that an FMU of `version` does not need; other libraries stay as they
/// are.
///
/// The library has the functions of both versions, and some importers choose the version by the functions
/// that they find. It also describes itself, which `describes` keeps for `version`: `aso-ftc design` asks a
/// library in an archive whose resources it has replaced. A symbol that is local is found by no importer.
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

/// Returns the offsets of the dynamic symbols that are functions of FMI or of the exporter and not `needed`.
fn places(library: &[u8], needed: impl Fn(&[u8]) -> bool) -> object::Result<Vec<usize>> {
    let header = FileHeader64::<LittleEndian>::parse(library)?;
    let endian = header.endian()?;
    let sections = header.sections(endian, library)?;
    let symbols = sections.symbols(endian, library, elf::SHT_DYNSYM)?;
    let section = sections.section(symbols.section())?;
    let start = usize::try_from(section.sh_offset(endian)).unwrap_or(usize::MAX);
    let size = size_of::<Sym64<LittleEndian>>();
    let is_other = |symbol: &Sym64<LittleEndian>| {
        let name = symbol.name(endian, symbols.strings());
        let is_own =
            |name: &[u8]| name.starts_with(b"fmi") || name.starts_with(DESCRIBE.as_bytes());
        name.is_ok_and(|name| is_own(name) && !needed(name))
    };
    let undefined = symbols.iter().enumerate().filter(|(_, symbol)| is_other(symbol));
    Ok(undefined.map(|(index, _)| start.saturating_add(index * size)).collect())
}
