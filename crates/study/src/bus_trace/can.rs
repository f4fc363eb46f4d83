//! The operations of a CAN bus (FMI-LS-BUS 1.0, section "CAN"): little-endian, without gaps.

/// Operation codes.
const CAN_TRANSMIT: u32 = 0x10;
const CAN_FD_TRANSMIT: u32 = 0x11;
const BUS_ERROR: u32 = 0x31;
/// Length of the header of an operation: code and length of the whole operation.
const HEADER: usize = 8;

/// A frame on the bus.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame {
    pub(super) identifier: u32,
    /// Whether the identifier has 29 bits.
    pub(super) extended: bool,
    pub(super) kind: FrameKind,
    pub(super) data: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameKind {
    Data,
    /// Remote transmission request.
    Remote,
    /// CAN FD, with bit rate switch and error state indicator.
    Flexible {
        bit_rate_switch: bool,
        error_state: bool,
    },
    /// A bus error that ended the frame with this identifier.
    Error,
}

/// Returns the frames among the operations. An operation that ends beyond `bytes` ends the list.
pub(super) fn frames(bytes: &[u8]) -> Vec<Frame> {
    let mut all = Vec::new();
    let mut rest = bytes;
    while let (Some(code), Some(length)) = (number(rest, 0), number(rest, 4)) {
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let Some((operation, following)) = rest.split_at_checked(length) else { break };
        if length < HEADER {
            break;
        }
        all.extend(frame(code, &operation[HEADER..]));
        rest = following;
    }
    all
}

/// Returns the frame of an operation with these arguments.
fn frame(code: u32, arguments: &[u8]) -> Option<Frame> {
    let identifier = number(arguments, 0)?;
    let flag = |at: usize| arguments.get(at).map(|flag| *flag != 0);
    let data = |at: usize| {
        let length = arguments.get(at..at + 2)?;
        let length = usize::from(u16::from_le_bytes([length[0], length[1]]));
        arguments.get(at + 2..at + 2 + length).map(<[u8]>::to_vec)
    };
    let (extended, kind, data) = match code {
        CAN_TRANSMIT => {
            let kind = if flag(5)? { FrameKind::Remote } else { FrameKind::Data };
            (flag(4)?, kind, data(6)?)
        }
        CAN_FD_TRANSMIT => {
            let (bit_rate_switch, error_state) = (flag(5)?, flag(6)?);
            (flag(4)?, FrameKind::Flexible { bit_rate_switch, error_state }, data(7)?)
        }
        BUS_ERROR => (false, FrameKind::Error, Vec::new()),
        _ => return None,
    };
    Some(Frame { identifier, extended, kind, data })
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes that the macros of the layered standard's header `fmi3LsBusUtilCan.h` make.
    #[test]
    fn frames_are_found_among_other_operations() {
        let configuration = [0x40, 0, 0, 0, 13, 0, 0, 0, 1, 0xa0, 0x86, 1, 0];
        let transmit = [0x10, 0, 0, 0, 20, 0, 0, 0, 1, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 4];
        let flexible = [0x11, 0, 0, 0, 18, 0, 0, 0, 0xff, 0xff, 0xff, 0x1f, 1, 1, 0, 1, 0, 0x7f];
        let all = [&configuration[..], &transmit, &flexible].concat();
        let data =
            Frame { identifier: 1, extended: false, kind: FrameKind::Data, data: vec![1, 2, 3, 4] };
        let kind = FrameKind::Flexible { bit_rate_switch: true, error_state: false };
        let long = Frame { identifier: 0x1fff_ffff, extended: true, kind, data: vec![0x7f] };
        assert_eq!(frames(&all), [data.clone(), long]);
        assert_eq!(frames(&all[..40]), [data]);
        assert_eq!(frames(&[0; 8]), []);
    }
}
