//! A node of a CAN bus (FMI-LS-BUS 1.0): packs its inputs into the messages of `resources/network.dbc` that it sends, and
//! unpacks the messages that it receives. The parameter `node` says which node of the file it is.
#![forbid(unsafe_code)]

mod network;

use fmu::description::can::{Frame, FrameKind, MIME_TYPE, Operation};
use fmu::description::unit::Unit;
use fmu::{About, Event, Experiment, Failure, Model, ModelExchange, Variable as V};

use network::{Message, Signal};

#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct CanNode {
    nodes: Vec<String>,
    messages: Vec<Message>,
    /// The node that this FMU is, one of `nodes`.
    node: String,
    /// In bit/s; the node states it before its first frame.
    bit_rate: f64,
    /// Whether the node has stated its bit rate.
    is_configured: bool,
    /// For each message the values of its signals, to send and as received.
    send: Vec<Vec<f64>>,
    received: Vec<Vec<f64>>,
    /// Number of times that each message was sent.
    count: Vec<u32>,
    start_time: f64,
    tx_clock: bool,
    tx_data: Vec<u8>,
    rx_clock: bool,
    rx_data: Vec<u8>,
}

impl CanNode {
    /// Returns the time at which this node sends a message next, in s; infinity for a message of another node.
    fn next_time(&self, message: usize) -> f64 {
        let next_message = &self.messages[message];
        if next_message.transmitter != self.node {
            return f64::INFINITY;
        }
        self.start_time
            + next_message.start_delay
            + f64::from(self.count[message]) * next_message.cycle_time
    }

    /// Whether the time at which this node sends the message is reached, up to 1e-9 of its cycle time.
    fn is_due(&self, message: usize, time: f64) -> bool {
        self.next_time(message) <= time + 1e-9 * self.messages[message].cycle_time
    }

    /// Whether this node sends at `time`: its bit rate, if it has not yet stated it, or a message that is due.
    fn is_sending(&self, time: f64) -> bool {
        !self.is_configured || (0..self.messages.len()).any(|message| self.is_due(message, time))
    }

    /// Composes the bit rate, in the first call only, and the messages that are due. A signal that is not finite is an
    /// error.
    fn compose(&mut self, time: f64) -> Result<(), Failure> {
        self.tx_data.clear();
        if !std::mem::replace(&mut self.is_configured, true) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "its range is 1e3 to 1e6"
            )]
            let bit_rate = self.bit_rate.round() as u32;
            Operation::Configure { bit_rate }.append_to(&mut self.tx_data);
        }
        for (index, message) in self.messages.iter().enumerate() {
            if !self.is_due(index, time) {
                continue;
            }
            let mut data = vec![0; message.length];
            for (signal, &value) in message.signals.iter().zip(&self.send[index]) {
                if !value.is_finite() {
                    let name = &signal.name;
                    return Err(Failure::Error(format!("{name} = {value}, expected a number")));
                }
                signal.pack(value, &mut data);
            }
            let Message { identifier, extended, .. } = *message;
            let frame = Frame { identifier, extended, kind: FrameKind::Data, data };
            Operation::Transmit(frame).append_to(&mut self.tx_data);
            self.count[index] = self.count[index].saturating_add(1);
        }
        Ok(())
    }

    /// Unpacks the messages that have arrived. Messages that the file does not list, messages of this node itself and
    /// messages that are too short are ignored.
    fn receive(&mut self) {
        for operation in Operation::read(&self.rx_data) {
            let Operation::Transmit(frame) = operation else { continue };
            let is_received = |message: &Message| {
                message.identifier == frame.identifier
                    && message.extended == frame.extended
                    && message.length <= frame.data.len()
                    && message.transmitter != self.node
            };
            let Some(index) = self.messages.iter().position(is_received) else { continue };
            let signals = self.messages[index].signals.iter();
            for (value, signal) in self.received[index].iter_mut().zip(signals) {
                *value = signal.unpack(&frame.data);
            }
        }
    }
}

impl Model for CanNode {
    const IDENTIFIER: &'static str = "CanNode";

    fn about(&self) -> About {
        fmu::about!(stop_time: 1.0, step_size: 0.001)
    }

    fn new(resources: &std::path::Path) -> Result<Self, Failure> {
        let failure = |error: String| Failure::Error(format!("network.dbc: {error}"));
        let text = std::fs::read_to_string(resources.join("network.dbc"))
            .map_err(|error| failure(error.to_string()))?;
        let (nodes, messages) = network::read(&text).map_err(failure)?;
        let zeros: Vec<_> =
            messages.iter().map(|message| vec![0.0; message.signals.len()]).collect();
        Ok(Self {
            node: nodes.first().cloned().unwrap_or_default(),
            count: vec![0; messages.len()],
            bit_rate: 5e5,
            is_configured: false,
            nodes,
            messages,
            send: zeros.clone(),
            received: zeros,
            start_time: 0.0,
            tx_clock: false,
            tx_data: Vec::new(),
            rx_clock: false,
            rx_data: Vec::new(),
        })
    }

    fn variables(&self) -> Vec<V<Self>> {
        let names = self.nodes.join(", ");
        let text = format!("The node of the network that this FMU is: {names}");
        let mut all = vec![
            V::string("node", text, |node: &mut Self| &mut node.node).parameter(),
            V::real("bit_rate", "Number of bits in a second", |node: &mut Self| &mut node.bit_rate)
                .unit("1/s")
                .range(1e3, 1e6)
                .parameter(),
        ];
        // A DBC file may state any text as unit; FMI needs a unit that can be parsed.
        let with_unit = |variable: V<Self>, signal: &Signal| match Unit::parse(&signal.unit) {
            Ok(_) if !signal.unit.is_empty() => variable.unit(&signal.unit),
            _ => variable,
        };
        for (index, message) in self.messages.iter().enumerate() {
            for (position, signal) in message.signals.iter().enumerate() {
                let text = |verb| format!("{verb}: {} [{}]", signal.description, signal.unit);
                let name = format!("{}.{}", message.name, signal.name);
                let send = V::real(format!("send.{name}"), text("Sent"), move |node: &mut Self| {
                    &mut node.send[index][position]
                });
                let received = V::real(
                    format!("received.{name}"),
                    text("Received"),
                    move |node: &mut Self| &mut node.received[index][position],
                );
                all.push(with_unit(send.input(), signal));
                all.push(with_unit(received.discrete().output(&[]).exact(), signal));
            }
        }
        let clock = |name: &str, text: &str, field: fn(&mut Self) -> &mut bool| {
            V::triggered_clock(format!("CanChannel.{name}_Clock"), text, field)
        };
        let data = |name: &str, text: &str, field: fn(&mut Self) -> &mut Vec<u8>| {
            let data = V::binary(format!("CanChannel.{name}_Data"), text, field);
            data.mime_type(MIME_TYPE).clocked_by(&[&format!("CanChannel.{name}_Clock")])
        };
        all.extend([
            clock("Tx", "The node sends", |node| &mut node.tx_clock).output(&[]),
            data("Tx", "Operations sent", |node| &mut node.tx_data).output(&[]),
            clock("Rx", "The node receives", |node| &mut node.rx_clock).input(),
            data("Rx", "Operations received", |node| &mut node.rx_data).input(),
        ]);
        all
    }

    fn check(&self) -> Result<(), Failure> {
        if !self.nodes.contains(&self.node) {
            let (names, name) = (self.nodes.join(", "), &self.node);
            return Err(Failure::Error(format!("node: expected one of {names}, found `{name}`")));
        }
        let has_no_cycle =
            |message: &&Message| message.transmitter == self.node && message.cycle_time <= 0.0;
        self.messages.iter().find(has_no_cycle).map_or(Ok(()), |message| {
            let (name, node) = (&message.name, &self.node);
            Err(Failure::Error(format!(
                "network.dbc: message {name} of {node}: expected a GenMsgCycleTime above 0"
            )))
        })
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.start_time = experiment.start_time;
        Ok(())
    }

    fn tick(&mut self, time: f64) {
        self.tx_clock = self.is_sending(time);
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        if self.rx_clock {
            self.receive();
        }
        if self.is_sending(time) {
            self.compose(time)?;
        }
        let next = (0..self.messages.len()).map(|message| self.next_time(message));
        let next = next.fold(f64::INFINITY, f64::min);
        Ok(Event { next_event_time: next.is_finite().then_some(next), ..Event::default() })
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange::default())
    }
}

fmu::export!(CanNode);
#[cfg(test)]
mod tests;
