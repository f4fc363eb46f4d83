//! The bits of a frame on a CAN bus (ISO 11898-1): their number, and those that decide the arbitration.

use fmu::description::can::{Frame, FrameKind};

/// Bits after the CRC: its delimiter, acknowledgement with delimiter, end of frame.
const TAIL: usize = 1 + 2 + 7;
/// Bits between two frames.
pub(crate) const INTERMISSION: usize = 3;
/// Number of equal bits after which a sender inserts a bit.
const RUN: usize = 5;

/// Returns the number of bits of a classical frame from its start to its end, with stuff bits and without the
/// intermission.
pub(crate) fn length(frame: &Frame) -> usize {
    let mut bits = head(frame);
    for byte in &frame.data {
        push(&mut bits, u32::from(*byte), 8);
    }
    let checksum = crc(&bits);
    push(&mut bits, checksum, 15);
    bits.len() + stuff_bits(&bits) + TAIL
}

/// Returns the bits that decide the arbitration; the smaller sequence wins, as a dominant bit is 0.
pub(crate) fn arbitration(frame: &Frame) -> Vec<bool> {
    let mut bits = head(frame);
    bits.truncate(if frame.extended { 33 } else { 14 });
    bits
}

/// Returns the start of frame, the identifier and the control field.
fn head(frame: &Frame) -> Vec<bool> {
    let remote = u32::from(frame.kind == FrameKind::Remote);
    let mut bits = vec![false];
    if frame.extended {
        push(&mut bits, frame.identifier >> 18, 11);
        // Substitute remote request, identifier extension.
        push(&mut bits, 0b11, 2);
        push(&mut bits, frame.identifier, 18);
        push(&mut bits, remote, 1);
        push(&mut bits, 0, 2);
    } else {
        push(&mut bits, frame.identifier, 11);
        push(&mut bits, remote, 1);
        push(&mut bits, 0, 2);
    }
    push(&mut bits, u32::try_from(frame.data.len()).unwrap_or(u32::MAX), 4);
    bits
}

/// Appends the lowest `count` bits of `value`, the most significant one first.
fn push(bits: &mut Vec<bool>, value: u32, count: u32) {
    bits.extend((0..count).rev().map(|bit| value >> bit & 1 == 1));
}

/// Returns the checksum with the polynomial x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
fn crc(bits: &[bool]) -> u32 {
    bits.iter().fold(0, |crc, &bit| {
        let next = crc << 1 & 0x7fff;
        if bit == (crc >> 14 & 1 == 1) { next } else { next ^ 0x4599 }
    })
}

/// Returns the number of bits that the sender inserts: after five equal bits their opposite, which counts as the first
/// of the next five.
fn stuff_bits(bits: &[bool]) -> usize {
    let (mut stuffed, mut last, mut run) = (0, true, 0);
    for &bit in bits {
        run = if bit == last { run + 1 } else { 1 };
        last = bit;
        if run == RUN {
            (stuffed, last, run) = (stuffed + 1, !bit, 1);
        }
    }
    stuffed
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(identifier: u32, extended: bool, data: &[u8]) -> Frame {
        Frame { identifier, extended, kind: FrameKind::Data, data: data.to_vec() }
    }

    /// Entry CRC-15/CAN of the catalogue of G. Cook: the checksum of the text 123456789.
    #[test]
    fn the_checksum_is_that_of_the_catalogue() {
        let mut bits = Vec::new();
        b"123456789".iter().for_each(|byte| push(&mut bits, u32::from(*byte), 8));
        assert_eq!(crc(&bits), 0x059e);
    }

    /// R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien: Controller Area Network (CAN) schedulability analysis, Real-Time
    /// Systems 35 (2007), equations (1) and (2): at most 55 + 10 s bits with s bytes and 11 bits of identifier, 80 + 10 s
    /// with 29, the intermission included; without stuff bits 47 + 8 s and 67 + 8 s.
    #[test]
    fn frames_are_as_long_as_the_published_bounds_allow() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 16
        };
        for extended in [false, true] {
            let mut longest = 0;
            for _ in 0..20_000 {
                let size = (random() % 9) as usize;
                let pattern = [0x00, 0xff, 0xf0, 0x0f, 0xc3, 0x1f];
                let byte = |number: u32| pattern.get(number as usize % 8).copied();
                let byte = |number: u32| byte(number).unwrap_or(number.to_le_bytes()[0]);
                let data: Vec<u8> = (0..size).map(|_| byte(random())).collect();
                let identifier =
                    (random() << 16 | random()) & if extended { 0x1fff_ffff } else { 0x7ff };
                let bits = length(&frame(identifier, extended, &data)) + INTERMISSION;
                let [least, most] = if extended { [67, 80] } else { [47, 55] };
                assert!((least + 8 * size..=most + 10 * size).contains(&bits), "{bits} {data:?}");
                longest = longest.max(bits.saturating_sub(least + 8 * size));
            }
            assert!(longest >= 15, "no frame with many stuff bits: {longest}");
        }
    }

    /// 0, 0, 0, 0, 0, 1, 1, 1, 1, 1 becomes 0, 0, 0, 0, 0, (1), 1, 1, 1, 1, (0), 1: two of eleven.
    #[test]
    fn a_stuff_bit_counts_for_the_next_five() {
        let bits = [false, false, false, false, false, true, true, true, true, true];
        assert_eq!(stuff_bits(&bits), 2);
    }

    #[test]
    fn the_smaller_identifier_wins_and_an_extended_one_loses_to_its_base() {
        let of = |identifier, extended| arbitration(&frame(identifier, extended, &[]));
        assert!(of(0x100, false) < of(0x101, false));
        assert!(of(0x100, false) < of(0x100 << 18, true));
        assert!(of(0xff << 18 | 5, true) < of(0x100, false));
        let remote = Frame { kind: FrameKind::Remote, ..frame(0x100, false, &[]) };
        assert!(of(0x100, false) < arbitration(&remote));
    }
}
