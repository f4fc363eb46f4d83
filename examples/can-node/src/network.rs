//! The messages of a DBC file, and the signals in their bytes.

use can_dbc::{AttributeValue, ByteOrder, Dbc, MessageId, MultiplexIndicator};
use can_dbc::{SignalExtendedValueType as Float, ValueType};

/// A message.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Message {
    pub(crate) name: String,
    pub(crate) identifier: u32,
    pub(crate) extended: bool,
    /// Number of bytes.
    pub(crate) length: usize,
    /// The node that sends it.
    pub(crate) transmitter: String,
    /// `GenMsgCycleTime` in s; 0 is none.
    pub(crate) cycle_time: f64,
    /// `GenMsgStartDelayTime` in s: time of the first message after the start.
    pub(crate) start_delay: f64,
    pub(crate) signals: Vec<Signal>,
}

/// A signal: value = factor * raw + offset.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Signal {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) description: String,
    factor: f64,
    offset: f64,
    raw: Raw,
    /// The places of the bits in the message from the most to the least significant one: byte * 8 + bit.
    bits: Vec<usize>,
}

/// The type of the raw value.
#[derive(Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
enum Raw {
    Signed,
    Unsigned,
    Float32,
    Float64,
}

/// Returns the nodes and the messages of a DBC file. Multiplexed signals and messages of more than 8 bytes are errors.
pub(crate) fn read(text: &str) -> Result<(Vec<String>, Vec<Message>), String> {
    let file = Dbc::try_from(text).map_err(|error| error.to_string())?;
    let nodes = file.nodes.iter().map(|node| node.0.clone()).collect();
    // A message of no bytes holds the signals that are in no message (VECTOR__INDEPENDENT_SIG_MSG).
    let messages = file.messages.iter().filter(|message| message.size > 0);
    let messages = messages.map(|entry| message(&file, entry));
    Ok((nodes, messages.collect::<Result<_, _>>()?))
}

fn message(file: &Dbc, message: &can_dbc::Message) -> Result<Message, String> {
    let milliseconds =
        |attribute: &str| match file.resolved_message_attribute(message.id, attribute) {
            None => Ok(0.0),
            #[expect(clippy::cast_precision_loss, reason = "far below 2^53 ms")]
            Some(AttributeValue::Uint(number)) => Ok(*number as f64 / 1e3),
            Some(AttributeValue::Double(number)) if *number >= 0.0 => Ok(number / 1e3),
            Some(other) => Err(format!(
                "message {}: {attribute}: expected a time in ms, found {other:?}",
                message.name
            )),
        };
    let (identifier, extended) = match message.id {
        MessageId::Standard(identifier) => (u32::from(identifier), false),
        MessageId::Extended(identifier) => (identifier, true),
    };
    let length = usize::try_from(message.size).ok().filter(|&length| length <= 8);
    let length = length.ok_or_else(|| {
        format!("message {}: expected at most 8 bytes, found {}", message.name, message.size)
    })?;
    let signals = message.signals.iter().map(|signal| {
        Signal::new(file, message.id, signal, length)
            .map_err(|error| format!("message {}: signal {}: {error}", message.name, signal.name))
    });
    Ok(Message {
        name: message.name.clone(),
        identifier,
        extended,
        length,
        transmitter: message.transmitter.clone().unwrap_or_default(),
        cycle_time: milliseconds("GenMsgCycleTime")?,
        start_delay: milliseconds("GenMsgStartDelayTime")?,
        signals: signals.collect::<Result<_, _>>()?,
    })
}

impl Signal {
    fn new(
        file: &Dbc,
        message: MessageId,
        signal: &can_dbc::Signal,
        length: usize,
    ) -> Result<Self, String> {
        if signal.multiplexer_indicator != MultiplexIndicator::Plain {
            return Err("multiplexed signals are not supported".to_owned());
        }
        let float = file.extended_value_type_for_signal(message, &signal.name);
        let (raw, width) = match (float, signal.value_type) {
            (Some(Float::IEEEfloat32Bit), _) => (Raw::Float32, Some(32)),
            (Some(Float::IEEEdouble64bit), _) => (Raw::Float64, Some(64)),
            (_, ValueType::Signed) => (Raw::Signed, None),
            (_, ValueType::Unsigned) => (Raw::Unsigned, None),
        };
        let size = usize::try_from(signal.size).unwrap_or(usize::MAX);
        if !(1..=64).contains(&size) || width.is_some_and(|width| width != size) {
            return Err(format!("expected 1 to 64 bits (32 or 64 for a float), found {size}"));
        }
        if signal.factor == 0.0 || !signal.factor.is_finite() || !signal.offset.is_finite() {
            return Err(format!("expected a finite factor other than 0, found {}", signal.factor));
        }
        let start = usize::try_from(signal.start_bit).unwrap_or(usize::MAX);
        let bits = bits(signal.byte_order, start, size);
        if bits.iter().any(|&place| place >= 8 * length) {
            return Err(format!("its bits do not fit into {length} bytes"));
        }
        Ok(Self {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            description: file.signal_comment(message, &signal.name).unwrap_or_default().to_owned(),
            factor: signal.factor,
            offset: signal.offset,
            raw,
            bits,
        })
    }

    /// Writes a value into the message, limited to the range of the bits and rounded to the nearest value that they can
    /// state. `value` is not NaN.
    pub(crate) fn pack(&self, value: f64, bytes: &mut [u8]) {
        let scaled = (value - self.offset) / self.factor;
        let size = self.bits.len();
        let ones = u64::MAX >> (64 - size);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_possible_wrap,
            reason = "casts saturate, and the raw value is limited to its bits"
        )]
        let raw = match self.raw {
            Raw::Signed => {
                let most = (ones >> 1) as i64;
                (scaled.round_ties_even() as i64).clamp(-most - 1, most) as u64
            }
            Raw::Unsigned => (scaled.round_ties_even() as u64).min(ones),
            Raw::Float32 => u64::from((scaled as f32).to_bits()),
            Raw::Float64 => scaled.to_bits(),
        };
        for (position, place) in self.bits.iter().rev().enumerate() {
            let bit = 1 << (place % 8);
            let byte = &mut bytes[place / 8];
            *byte = if raw >> position & 1 == 1 { *byte | bit } else { *byte & !bit };
        }
    }

    /// Reads the value from the message, which has at least the length that the file states.
    pub(crate) fn unpack(&self, bytes: &[u8]) -> f64 {
        let bit = |place: &usize| u64::from(bytes[place / 8] >> (place % 8) & 1);
        let raw = self.bits.iter().fold(0, |raw, place| raw << 1 | bit(place));
        let unused = 64 - self.bits.len();
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_wrap,
            clippy::cast_possible_truncation,
            reason = "a raw value of more than 53 bits is rounded; a float is as wide as its type"
        )]
        let raw = match self.raw {
            Raw::Signed => ((raw << unused) as i64 >> unused) as f64,
            Raw::Unsigned => raw as f64,
            Raw::Float32 => f64::from(f32::from_bits(raw as u32)),
            Raw::Float64 => f64::from_bits(raw),
        };
        self.factor * raw + self.offset
    }
}

/// Returns the places of the bits of a signal from the most to the least significant one. The start bit of a DBC file
/// is the least significant bit in Intel's order, the most significant one in Motorola's.
fn bits(order: ByteOrder, start: usize, size: usize) -> Vec<usize> {
    match order {
        ByteOrder::LittleEndian => (0..size).rev().map(|bit| start.saturating_add(bit)).collect(),
        ByteOrder::BigEndian => {
            let next = |place: &usize| {
                Some(if place.is_multiple_of(8) { place.saturating_add(15) } else { place - 1 })
            };
            std::iter::successors(Some(start), next).take(size).collect()
        }
    }
}
