//! The operations of a CAN bus, which FMUs exchange by clocked binary variables: FMI-LS-BUS 1.0, section "CAN".
//!
//! An operation has a code, its length in bytes and its arguments, little-endian and without gaps. A value of the
//! variable is a sequence of operations.

use serde::{Deserialize, Serialize};

/// `mimeType` of the variables `Tx_Data` and `Rx_Data` of a node.
pub const MIME_TYPE: &str = "application/org.fmi-standard.fmi-ls-bus.can; version=\"1.0\"";
/// `matchingRule` of a terminal of a node.
pub const MATCHING_RULE: &str = "org.fmi-ls-bus.transceiver";

const TRANSMIT: u32 = 0x10;
const FD_TRANSMIT: u32 = 0x11;
const CONFIRM: u32 = 0x20;
const BUS_ERROR: u32 = 0x31;
const CONFIGURATION: u32 = 0x40;
/// Parameter of a configuration: the bit rate of classical CAN.
const BIT_RATE: u8 = 1;
/// Number of bytes of code and length, the start of each operation.
const HEADER: usize = 8;

/// An operation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Operation {
    /// A node sends a frame, or the bus delivers it.
    Transmit(Frame),
    /// The bus has delivered the frame with this identifier.
    Confirm {
        /// Identifier of the frame.
        identifier: u32,
    },
    /// A node states its bit rate, before it sends its first frame.
    Configure {
        /// The bit rate in bit/s.
        bit_rate: u32,
    },
    /// An error on the bus ended the frame with this identifier.
    BusError {
        /// Identifier of the frame.
        identifier: u32,
    },
}

/// A frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// The identifier: of two frames that start at once, the one with the smaller identifier is sent first.
    pub identifier: u32,
    /// Whether the identifier has 29 bits instead of 11.
    pub extended: bool,
    /// The kind of the frame.
    pub kind: FrameKind,
    /// The bytes, at most 8; at most 64 for CAN FD.
    pub data: Vec<u8>,
}

/// The kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameKind {
    /// A data frame.
    Data,
    /// A remote transmission request.
    Remote,
    /// A frame of CAN FD.
    Flexible {
        /// BRS: the data have a higher bit rate.
        bit_rate_switch: bool,
        /// ESI: the sender is error passive.
        error_state: bool,
    },
}

impl Operation {
    /// Reads the operations in `bytes`, in order.
    ///
    /// Skips an operation that [`Operation`] does not have, or whose arguments are too short. An operation that ends
    /// beyond `bytes`, or states a length below 8, ends the sequence.
    pub fn read(bytes: &[u8]) -> impl Iterator<Item = Operation> {
        let mut rest = bytes;
        let next = move || {
            let (code, length) = (number(rest, 0)?, number(rest, 4)?);
            let length = usize::try_from(length).ok().filter(|&length| length >= HEADER)?;
            let (operation, following) = rest.split_at_checked(length)?;
            rest = following;
            Some((code, &operation[HEADER..]))
        };
        std::iter::from_fn(next).filter_map(|(code, arguments)| operation(code, arguments))
    }

    /// Appends the bytes of the operation. A bus error states a wrong CRC, and that another node was the sender.
    ///
    /// # Panics
    ///
    /// If the frame has more than 65,535 bytes of data.
    pub fn append_to(&self, bytes: &mut Vec<u8>) {
        let (code, arguments) = match self {
            Operation::Transmit(frame) => {
                let code = match frame.kind {
                    FrameKind::Flexible { .. } => FD_TRANSMIT,
                    FrameKind::Data | FrameKind::Remote => TRANSMIT,
                };
                (code, [&frame.identifier.to_le_bytes()[..], &frame.arguments()].concat())
            }
            Operation::Confirm { identifier } => (CONFIRM, identifier.to_le_bytes().to_vec()),
            Operation::Configure { bit_rate } => {
                (CONFIGURATION, [&[BIT_RATE][..], &bit_rate.to_le_bytes()].concat())
            }
            // After the identifier: error code, error flag, whether the node is the sender.
            Operation::BusError { identifier } => {
                (BUS_ERROR, [&identifier.to_le_bytes()[..], &[4, 1, 0]].concat())
            }
        };
        let length = u32::try_from(HEADER + arguments.len()).expect("a short frame");
        bytes.extend([code, length].map(u32::to_le_bytes).as_flattened());
        bytes.extend(arguments);
    }
}

impl Frame {
    /// Returns the arguments of the operation that transmits the frame, without the identifier.
    fn arguments(&self) -> Vec<u8> {
        let mut arguments = vec![u8::from(self.extended)];
        match self.kind {
            FrameKind::Data => arguments.push(0),
            FrameKind::Remote => arguments.push(1),
            FrameKind::Flexible { bit_rate_switch, error_state } => {
                arguments.extend([bit_rate_switch, error_state].map(u8::from));
            }
        }
        let length = u16::try_from(self.data.len()).expect("at most 65,535 bytes");
        arguments.extend(length.to_le_bytes());
        arguments.extend(&self.data);
        arguments
    }
}

/// Returns the operation `code` with `arguments`; `None` for too short arguments or an operation unknown to
/// [`Operation`].
fn operation(code: u32, arguments: &[u8]) -> Option<Operation> {
    if code == CONFIGURATION {
        let bit_rate = number(arguments, 1).filter(|_| arguments[0] == BIT_RATE)?;
        return Some(Operation::Configure { bit_rate });
    }
    let identifier = number(arguments, 0)?;
    let flag = |at: usize| arguments.get(at).map(|flag| *flag != 0);
    let data = |at: usize| {
        let length = arguments.get(at..at + 2)?;
        let length = usize::from(u16::from_le_bytes([length[0], length[1]]));
        arguments.get(at + 2..at + 2 + length).map(<[u8]>::to_vec)
    };
    let (kind, data) = match code {
        TRANSMIT => (if flag(5)? { FrameKind::Remote } else { FrameKind::Data }, data(6)?),
        FD_TRANSMIT => {
            let (bit_rate_switch, error_state) = (flag(5)?, flag(6)?);
            (FrameKind::Flexible { bit_rate_switch, error_state }, data(7)?)
        }
        CONFIRM => return Some(Operation::Confirm { identifier }),
        BUS_ERROR => return Some(Operation::BusError { identifier }),
        _ => return None,
    };
    Some(Operation::Transmit(Frame { identifier, extended: flag(4)?, kind, data }))
}

/// Returns the little-endian number in the 4 bytes from `at`.
fn number(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes that the macros of the layered standard's header `fmi3LsBusUtilCan.h` make.
    #[test]
    fn operations_are_read_and_written_as_the_header_of_the_standard_does() {
        let configuration = [0x40, 0, 0, 0, 13, 0, 0, 0, 1, 0xa0, 0x86, 1, 0];
        let transmit = [0x10, 0, 0, 0, 20, 0, 0, 0, 1, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 4];
        let flexible = [0x11, 0, 0, 0, 18, 0, 0, 0, 0xff, 0xff, 0xff, 0x1f, 1, 1, 0, 1, 0, 0x7f];
        let confirm = [0x20, 0, 0, 0, 12, 0, 0, 0, 7, 0, 0, 0];
        let discarded = [0x40, 0, 0, 0, 10, 0, 0, 0, 3, 2];
        let all = [&configuration[..], &transmit, &flexible, &confirm].concat();
        let data =
            Frame { identifier: 1, extended: false, kind: FrameKind::Data, data: vec![1, 2, 3, 4] };
        let kind = FrameKind::Flexible { bit_rate_switch: true, error_state: false };
        let long = Frame { identifier: 0x1fff_ffff, extended: true, kind, data: vec![0x7f] };
        let expected = [
            Operation::Configure { bit_rate: 100_000 },
            Operation::Transmit(data),
            Operation::Transmit(long),
            Operation::Confirm { identifier: 7 },
        ];
        let read = |bytes: &[u8]| Operation::read(bytes).collect::<Vec<_>>();
        assert_eq!(read(&all), expected);
        assert_eq!(read(&all[..40]), expected[..2]);
        assert_eq!(read(&[&discarded[..], &confirm].concat()), expected[3..]);
        assert_eq!(read(&[0; 8]), []);
        let mut written = Vec::new();
        for operation in &expected {
            operation.append_to(&mut written);
        }
        assert_eq!(written, all);
    }
}
