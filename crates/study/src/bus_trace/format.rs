//! The formats of traces: the log of candump (can-utils), ASC (Vector), and PCAPNG with the link type of `SocketCAN`.

use std::io::{self, Write};
use std::path::Path;

use fmu_description::can::{Frame, FrameKind, Operation};

use crate::error::Error;

/// The link type of `SocketCAN`, `LINKTYPE_CAN_SOCKETCAN`.
const LINK_TYPE: u16 = 227;
/// Flags of `SocketCAN` in the identifier.
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;
/// Error classes of `SocketCAN`: violation of the protocol on the bus (`CAN_ERR_PROT`, `CAN_ERR_BUSERROR`),
/// with 8 bytes of data.
const PROTOCOL: u32 = 0x88;
/// Flags of CAN FD in `SocketCAN`: bit rate switch, error state indicator, and the format CAN FD.
const SWITCH: u8 = 1;
const STATE: u8 = 2;
const FLEXIBLE: u8 = 4;

/// A format of a trace.
#[derive(Clone, Copy, Debug)]
pub(super) enum Format {
    Candump,
    Asc,
    /// Times count from `origin`, a whole number of seconds, because the format has no times below 0.
    Pcapng {
        origin: f64,
    },
}

impl Format {
    /// Returns the format for the extension of a file; an error if it is not `log`, `asc` or `pcapng`. `start`: the
    /// start of the run in s.
    pub(super) fn of(path: &Path, start: f64) -> Result<Self, Error> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("log") => Ok(Self::Candump),
            Some("asc") => Ok(Self::Asc),
            Some("pcapng") => Ok(Self::Pcapng { origin: start.floor().min(0.0) }),
            _ => Err(Error::Invalid(format!(
                "{}: a bus trace is written as .log (candump), .asc or .pcapng",
                path.display()
            ))),
        }
    }

    /// Writes the part of the file before the frames: nothing for candump.
    pub(super) fn write_start(self, file: &mut impl Write, buses: usize) -> io::Result<()> {
        match self {
            Self::Candump => Ok(()),
            // 0 s of the simulation is the epoch.
            Self::Asc => file.write_all(
                b"date Thu Jan 1 12:00:00.000 am 1970\nbase hex timestamps absolute\nno internal events logged\n",
            ),
            Self::Pcapng { origin } => {
                // Section header: byte order, version 1.0, unknown length.
                let mut section = 0x1a2b_3c4d_u32.to_le_bytes().to_vec();
                section.extend([1, 0, 0, 0]);
                section.extend((-1_i64).to_le_bytes());
                block(file, 0x0a0d_0d0a, &section)?;
                for bus in 0..buses {
                    let mut interface = LINK_TYPE.to_le_bytes().to_vec();
                    interface.extend([0; 6]);
                    option(&mut interface, 2, name(bus).as_bytes());
                    // if_tsresol: 10^-9 s.
                    option(&mut interface, 9, &[9]);
                    if origin < 0.0 {
                        // if_tsoffset, in s.
                        #[expect(clippy::cast_possible_truncation, reason = "a whole number")]
                        option(&mut interface, 14, &(origin as i64).to_le_bytes());
                    }
                    option(&mut interface, 0, &[]);
                    block(file, 1, &interface)?;
                }
                Ok(())
            }
        }
    }

    /// Writes an operation on a bus at `time` in s: a frame or a bus error. Writes nothing for other operations.
    pub(super) fn write_operation(
        self,
        file: &mut impl Write,
        time: f64,
        bus: usize,
        operation: &Operation,
    ) -> io::Result<()> {
        match (self, operation) {
            (Self::Candump, Operation::Transmit(frame)) => candump(file, time, bus, frame),
            (Self::Asc, Operation::Transmit(frame)) => asc(file, time, bus, frame),
            (Self::Pcapng { origin }, Operation::Transmit(frame)) => {
                let mut identifier = frame.identifier | if frame.extended { EXTENDED } else { 0 };
                let mut flags = flags(frame.kind);
                match frame.kind {
                    FrameKind::Remote => identifier |= REMOTE,
                    FrameKind::Flexible { .. } => flags |= FLEXIBLE,
                    FrameKind::Data => {}
                }
                packet(file, time - origin, bus, [identifier, u32::from(flags)], &frame.data)
            }
            (Self::Candump, Operation::BusError { .. }) => {
                let (name, error) = (name(bus), ERROR | PROTOCOL);
                writeln!(file, "({time:.6}) {name} {error:08X}#{}", "00".repeat(8))
            }
            (Self::Asc, Operation::BusError { .. }) => {
                writeln!(file, "{time:11.6} {}  ErrorFrame", bus + 1)
            }
            (Self::Pcapng { origin }, Operation::BusError { .. }) => {
                packet(file, time - origin, bus, [ERROR | PROTOCOL, 0], &[0; 8])
            }
            // Other operations, such as a confirmation, are not frames on the bus.
            _ => Ok(()),
        }
    }
}

fn candump(file: &mut impl Write, time: f64, bus: usize, frame: &Frame) -> io::Result<()> {
    let Frame { identifier, extended, kind, data } = frame;
    let width = if *extended { 8 } else { 3 };
    write!(file, "({time:.6}) {} {identifier:0width$X}#", name(bus))?;
    match kind {
        FrameKind::Remote => return writeln!(file, "R"),
        FrameKind::Flexible { .. } => write!(file, "#{:X}", flags(*kind))?,
        FrameKind::Data => {}
    }
    digits(file, data, "")?;
    writeln!(file)
}

fn asc(file: &mut impl Write, time: f64, bus: usize, frame: &Frame) -> io::Result<()> {
    let Frame { identifier, extended, kind, data } = frame;
    let suffix = if *extended { "x" } else { "" };
    let (channel, length) = (bus + 1, data.len());
    match kind {
        FrameKind::Remote => {
            writeln!(file, "{time:11.6} {channel}  {identifier:X}{suffix:<8} Rx   r")
        }
        FrameKind::Data => {
            write!(file, "{time:11.6} {channel}  {identifier:X}{suffix:<8} Rx   d {length}")?;
            digits(file, data, " ")?;
            writeln!(file)
        }
        FrameKind::Flexible { bit_rate_switch, error_state } => {
            let (switch, state) = (u8::from(*bit_rate_switch), u8::from(*error_state));
            let code = length_code(length);
            write!(
                file,
                "{time:11.6} CANFD {channel} Rx {identifier:X}{suffix} {switch} {state} {code:x} {length}"
            )?;
            digits(file, data, " ")?;
            let flags = 0x1000 | u32::from(switch) << 13 | u32::from(state) << 14;
            writeln!(file, " 0 0 {flags:x} 0 0 0 0 0")
        }
    }
}

fn name(bus: usize) -> String {
    format!("can{bus}")
}

fn digits(file: &mut impl Write, data: &[u8], before: &str) -> io::Result<()> {
    data.iter().try_for_each(|byte| write!(file, "{before}{byte:02X}"))
}

/// Returns the flags of a CAN FD frame; 0 for other frames.
fn flags(kind: FrameKind) -> u8 {
    match kind {
        FrameKind::Flexible { bit_rate_switch, error_state } => {
            u8::from(bit_rate_switch) * SWITCH + u8::from(error_state) * STATE
        }
        _ => 0,
    }
}

/// Returns the data length code of a CAN FD frame (ISO 11898-1). The lengths above 8 bytes are 12, 16, 20, 24, 32, 48
/// and 64.
fn length_code(length: usize) -> usize {
    match length {
        0..=8 => length,
        9..=24 => 8 + (length - 5) / 4,
        _ => 13 + (length.saturating_sub(17)) / 16,
    }
}

/// Writes an enhanced packet block with a frame of `SocketCAN`: identifier and flags, data.
fn packet(
    file: &mut impl Write,
    time: f64,
    bus: usize,
    [identifier, flags]: [u32; 2],
    data: &[u8],
) -> io::Result<()> {
    let length = u8::try_from(data.len()).map_err(io::Error::other)?;
    let mut packet = identifier.to_be_bytes().to_vec();
    packet.extend([length, u8::try_from(flags).map_err(io::Error::other)?, 0, 0]);
    packet.extend(data);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "simulated time")]
    let nanoseconds = (time * 1e9).round() as u64;
    let mut content = u32::try_from(bus).map_err(io::Error::other)?.to_le_bytes().to_vec();
    let (high, low) = (nanoseconds >> 32, nanoseconds & 0xffff_ffff);
    for half in [high, low, packet.len() as u64, packet.len() as u64] {
        content.extend(u32::try_from(half).map_err(io::Error::other)?.to_le_bytes());
    }
    content.extend(&packet);
    pad(&mut content);
    block(file, 6, &content)
}

/// Writes a block of PCAPNG: the type, the length, the content, and the length again.
fn block(file: &mut impl Write, kind: u32, content: &[u8]) -> io::Result<()> {
    let length = u32::try_from(content.len() + 12).map_err(io::Error::other)?.to_le_bytes();
    file.write_all(&kind.to_le_bytes())?;
    file.write_all(&length)?;
    file.write_all(content)?;
    file.write_all(&length)
}

fn option(content: &mut Vec<u8>, code: u16, value: &[u8]) {
    content.extend(code.to_le_bytes());
    content.extend(u16::try_from(value.len()).unwrap_or_default().to_le_bytes());
    content.extend(value);
    pad(content);
}

/// Fills up to a multiple of four bytes.
fn pad(content: &mut Vec<u8>) {
    content.resize(content.len().next_multiple_of(4), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pcapng_counts_times_from_a_whole_second_before_a_negative_start() {
        let format = Format::of(Path::new("a.pcapng"), -1.5).unwrap();
        let (identifier, extended, kind, data) = (1, false, FrameKind::Data, vec![1]);
        let frame = Operation::Transmit(Frame { identifier, extended, kind, data });
        let mut bytes = Vec::new();
        format.write_start(&mut bytes, 1).unwrap();
        assert_eq!(bytes.len(), 28 + 52, "section and interface");
        // if_tsoffset is option 14 with 8 bytes: -2 s.
        assert_eq!(bytes[60..72], [14, 0, 8, 0, 254, 255, 255, 255, 255, 255, 255, 255]);
        format.write_operation(&mut bytes, -1.25, 0, &frame).unwrap();
        let time = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!([time(80 + 12), time(80 + 16)], [0, 750_000_000]);
    }

    #[test]
    fn a_line_of_can_fd_in_asc_has_the_flags_that_python_can_writes() {
        let flags = |bit_rate_switch, error_state| {
            let kind = FrameKind::Flexible { bit_rate_switch, error_state };
            let frame = Frame { identifier: 0x1a, extended: true, kind, data: vec![7; 12] };
            let mut line = Vec::new();
            asc(&mut line, 0.5, 0, &frame).unwrap();
            let line = String::from_utf8(line).unwrap();
            let fields: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(fields[..5], ["0.500000", "CANFD", "1", "Rx", "1Ax"]);
            assert_eq!(fields[7..9], ["9", "12"]);
            // Behind the 12 data bytes, the fields are the duration and the length of the message.
            [fields[5], fields[6], fields[23]].map(str::to_owned)
        };
        assert_eq!(flags(false, false), ["0", "0", "1000"]);
        assert_eq!(flags(true, false), ["1", "0", "3000"]);
        assert_eq!(flags(false, true), ["0", "1", "5000"]);
        assert_eq!(flags(true, true), ["1", "1", "7000"]);
    }
}
