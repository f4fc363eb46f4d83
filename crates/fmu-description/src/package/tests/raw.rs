//! A ZIP writer and reader after APPNOTE.TXT 6.3.10, independent of the crate that the code uses.

/// An entry of the central directory (section 4.3.12).
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) made_by_system: u8,
    pub(super) version_needed: u16,
    pub(super) flags: u16,
    pub(super) method: u16,
    pub(super) time: u16,
    pub(super) date: u16,
    pub(super) extra_length: u16,
    pub(super) external_attributes: u32,
    /// Checksum and both sizes.
    sums: [u32; 3],
    offset: u32,
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap())
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// Reads the central directory of an archive without comment.
pub(super) fn directory(bytes: &[u8]) -> Vec<Entry> {
    let end = bytes.len() - 22;
    assert_eq!(&bytes[end..end + 4], b"PK\x05\x06");
    let mut at = u32_at(bytes, end + 16) as usize;
    let mut entries = Vec::new();
    while at < end {
        assert_eq!(&bytes[at..at + 4], b"PK\x01\x02");
        let length = usize::from(u16_at(bytes, at + 28));
        let extra_length = u16_at(bytes, at + 30);
        entries.push(Entry {
            name: String::from_utf8(bytes[at + 46..at + 46 + length].to_vec()).unwrap(),
            made_by_system: bytes[at + 5],
            version_needed: u16_at(bytes, at + 6),
            flags: u16_at(bytes, at + 8),
            method: u16_at(bytes, at + 10),
            time: u16_at(bytes, at + 12),
            date: u16_at(bytes, at + 14),
            extra_length,
            external_attributes: u32_at(bytes, at + 38),
            sums: [16, 20, 24].map(|field| u32_at(bytes, at + field)),
            offset: u32_at(bytes, at + 42),
        });
        at += 46 + length + usize::from(extra_length) + usize::from(u16_at(bytes, at + 32));
    }
    assert_eq!(entries.len(), usize::from(u16_at(bytes, end + 10)));
    entries
}

/// Whether the local header (section 4.3.7) agrees with the central directory.
pub(super) fn local_header_agrees(bytes: &[u8], entry: &Entry) -> bool {
    let header = &bytes[entry.offset as usize..];
    header.starts_with(b"PK\x03\x04")
        && u16_at(header, 4) == entry.version_needed
        && u16_at(header, 6) == entry.flags
        && u16_at(header, 8) == entry.method
        && u16_at(header, 10) == entry.time
        && u16_at(header, 12) == entry.date
        && [14, 18, 22].map(|field| u32_at(header, field)) == entry.sums
        && usize::from(u16_at(header, 26)) == entry.name.len()
        && u16_at(header, 28) == 0
        && header[30..].starts_with(entry.name.as_bytes())
}

/// Packs stored entries: name, content, mode. Any name is accepted.
pub(super) fn archive(entries: &[(&str, &str, u32)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut directory = Vec::new();
    for (name, content, mode) in entries {
        let offset = u32::try_from(bytes.len()).unwrap();
        let size = u32::try_from(content.len()).unwrap().to_le_bytes();
        let name_length = u16::try_from(name.len()).unwrap().to_le_bytes();
        let mut shared = vec![10, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        shared.extend(checksum(content.as_bytes()).to_le_bytes());
        shared.extend(size);
        shared.extend(size);
        shared.extend(name_length);
        shared.extend([0, 0]);

        bytes.extend(b"PK\x03\x04");
        bytes.extend(&shared);
        bytes.extend(name.bytes());
        bytes.extend(content.bytes());

        directory.extend(b"PK\x01\x02\x14\x03");
        directory.extend(&shared);
        directory.extend([0; 6]);
        directory.extend((mode << 16).to_le_bytes());
        directory.extend(offset.to_le_bytes());
        directory.extend(name.bytes());
    }
    let count = u16::try_from(entries.len()).unwrap().to_le_bytes();
    let start = u32::try_from(bytes.len()).unwrap().to_le_bytes();
    let size = u32::try_from(directory.len()).unwrap().to_le_bytes();
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend(count);
    bytes.extend(count);
    bytes.extend(size);
    bytes.extend(start);
    bytes.extend([0, 0]);
    bytes
}

/// CRC-32 of section 4.4.7, bit by bit.
fn checksum(bytes: &[u8]) -> u32 {
    let mut sum = u32::MAX;
    for byte in bytes {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 };
        }
    }
    !sum
}
