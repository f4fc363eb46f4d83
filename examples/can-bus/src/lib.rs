//! A CAN bus for four nodes (FMI-LS-BUS 1.0): arbitration, durations of frames, acknowledgement.
#![forbid(unsafe_code)]

mod frame;

use fmu::description::can::{Frame, FrameKind, MIME_TYPE, Operation};
use fmu::{About, Event, Experiment, Failure, Model, ModelExchange, Variable as V};

/// Number of terminals, `Node1` to `Node4`; they need not all be connected.
const NODES: usize = 4;

#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct CanBus {
    /// The parameter, in bit/s; 0 leaves the bit rate to the nodes.
    bit_rate: f64,
    /// The bit rate of the bus; 0 until the parameter or a node has stated it.
    rate: f64,
    nodes: [Node; NODES],
    sending: Option<Transmission>,
    /// Time in s from which on the bus is free, unless a frame is on it.
    free: f64,
    start_time: f64,
    frames: i32,
    lost: i32,
    /// Time in s in which the bus was not free.
    busy: f64,
    load: f64,
}

/// A terminal: what the bus sends to a node and receives from it.
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct Node {
    tx_clock: bool,
    tx_data: Vec<u8>,
    rx_clock: bool,
    rx_data: Vec<u8>,
    /// The frames that the node has not yet sent, in the order of their arrival; also the frame on the bus.
    waiting: Vec<Frame>,
}

/// The transmission of a frame.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Transmission {
    node: usize,
    /// The index of the frame in `waiting`.
    index: usize,
    /// Start and end in s, without the intermission.
    start: f64,
    end: f64,
}

impl CanBus {
    /// Returns the duration of a number of bits in s.
    #[expect(clippy::cast_precision_loss, reason = "a frame has few bits")]
    fn duration(&self, bits: usize) -> f64 {
        bits as f64 / self.rate
    }

    /// Whether `time` has reached `end`, up to a hundredth of a bit.
    fn is_reached(&self, end: f64, time: f64) -> bool {
        end <= time + if self.rate > 0.0 { 0.01 * self.duration(1) } else { 0.0 }
    }

    /// Whether the frame on the bus has ended by `time`; false without a frame.
    fn is_complete(&self, time: f64) -> bool {
        self.sending.as_ref().is_some_and(|frame| self.is_reached(frame.end, time))
    }

    /// Queues the frames that the nodes send, and adopts the bit rate that they state. As in a mailbox of a CAN
    /// controller, a frame replaces the waiting frame with the same identifier from an earlier event, unless that one is
    /// on the bus. A different or missing bit rate and frames of CAN FD are errors.
    fn receive(&mut self) -> Result<(), Failure> {
        let sending = self.sending.as_ref().map(|frame| (frame.node, frame.index));
        for (node, node_state) in
            self.nodes.iter_mut().enumerate().filter(|(_, node)| node.rx_clock)
        {
            let before = node_state.waiting.len();
            for operation in Operation::read(&node_state.rx_data) {
                let number = node + 1;
                let frame = match operation {
                    Operation::Transmit(frame) => frame,
                    Operation::Configure { bit_rate } => {
                        let (stated, rate) = (f64::from(bit_rate), &mut self.rate);
                        if *rate == 0.0 {
                            *rate = stated;
                        } else if (stated - *rate).abs() > 0.5 {
                            return Err(Failure::Error(format!(
                                "Node{number} has {stated} bit/s, expected that of the bus, {rate} bit/s"
                            )));
                        }
                        continue;
                    }
                    _ => continue,
                };
                if self.rate == 0.0 {
                    return Err(Failure::Error(format!(
                        "Node{number} sends before a node has stated its bit rate; set bit_rate"
                    )));
                }
                if matches!(frame.kind, FrameKind::Flexible { .. }) || frame.data.len() > 8 {
                    return Err(Failure::Error(format!(
                        "Node{number} sends a frame of CAN FD; this bus simulates classical CAN"
                    )));
                }
                let is_same = |(index, waiting): (usize, &Frame)| {
                    waiting.identifier == frame.identifier
                        && waiting.extended == frame.extended
                        && sending != Some((node, index))
                };
                match node_state.waiting[..before].iter().enumerate().position(is_same) {
                    Some(index) => {
                        node_state.waiting[index] = frame;
                        self.lost = self.lost.saturating_add(1);
                    }
                    None => node_state.waiting.push(frame),
                }
            }
        }
        Ok(())
    }

    /// Ends the frame on the bus: its sender gets a confirmation, the other nodes get the frame. Without a frame nothing
    /// happens.
    fn finish(&mut self) {
        let Some(Transmission { node: sender, index, start, end }) = self.sending.take() else {
            return;
        };
        let frame = self.nodes[sender].waiting.remove(index);
        for (node, member) in self.nodes.iter_mut().enumerate() {
            member.tx_data.clear();
            let identifier = frame.identifier;
            let operation = if node == sender {
                Operation::Confirm { identifier }
            } else {
                Operation::Transmit(frame.clone())
            };
            operation.append_to(&mut member.tx_data);
        }
        self.free = end + self.duration(frame::INTERMISSION);
        self.frames = self.frames.saturating_add(1);
        self.busy += self.free - start;
        self.load = self.busy / (self.free - self.start_time);
    }

    /// Starts the frame that wins the arbitration, if the bus is free. If a frame has started at this instant, the
    /// arbitration is repeated with the frames that have arrived since.
    fn start(&mut self, time: f64) {
        let start = self.sending.as_ref().map(|frame| frame.start.to_bits());
        if start.is_some_and(|start| start != time.to_bits()) || !self.is_reached(self.free, time) {
            return;
        }
        let first = |(node, member): (usize, &Node)| {
            let place = |(index, frame)| (frame::arbitration(frame), node, index);
            member.waiting.iter().enumerate().map(place).min()
        };
        let next = self.nodes.iter().enumerate().filter_map(first).min();
        self.sending = next.map(|(_, node, index)| {
            let length = frame::length(&self.nodes[node].waiting[index]);
            Transmission { node, index, start: time, end: time + self.duration(length) }
        });
    }
}

impl Model for CanBus {
    const IDENTIFIER: &'static str = "CanBus";

    fn about(&self) -> About {
        fmu::about!(stop_time: 1.0, step_size: 0.001)
    }

    fn new(_: &std::path::Path) -> Result<Self, Failure> {
        Ok(Self::default())
    }

    fn variables(&self) -> Vec<V<Self>> {
        let mut all = vec![
            V::real("bit_rate", "Bits in a second; 0: as the nodes state it", |bus: &mut Self| {
                &mut bus.bit_rate
            })
            .unit("1/s")
            .range(0.0, 1e6)
            .parameter(),
            V::integer("frames", "Number of frames", |bus: &mut Self| &mut bus.frames)
                .output(&[])
                .exact(),
            V::integer(
                "lost",
                "Number of frames replaced before they were sent",
                |bus: &mut Self| &mut bus.lost,
            )
            .output(&[])
            .exact(),
            V::real("load", "Part of the time in which the bus is not free", |bus: &mut Self| {
                &mut bus.load
            })
            .discrete()
            .output(&[])
            .exact(),
        ];
        for node in 0..NODES {
            let name = |member: &str| format!("Node{}.{member}", node + 1);
            let clock = |member: &str, text: &str, field: fn(&mut Node) -> &mut bool| {
                V::triggered_clock(name(member), text, move |bus: &mut Self| {
                    field(&mut bus.nodes[node])
                })
            };
            let data = |member: &str, text: &str, field: fn(&mut Node) -> &mut Vec<u8>| {
                let clock = name(&member.replace("Data", "Clock"));
                V::binary(name(member), text, move |bus: &mut Self| field(&mut bus.nodes[node]))
                    .mime_type(MIME_TYPE)
                    .clocked_by(&[&clock])
            };
            all.extend([
                clock("Tx_Clock", "The bus sends", |bus| &mut bus.tx_clock).output(&[]),
                data("Tx_Data", "Operations of the bus", |bus| &mut bus.tx_data).output(&[]),
                clock("Rx_Clock", "The node sends", |bus| &mut bus.rx_clock).input(),
                data("Rx_Data", "Operations of the node", |bus| &mut bus.rx_data).input(),
            ]);
        }
        all
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        (self.start_time, self.free) = (experiment.start_time, experiment.start_time);
        self.rate = self.bit_rate;
        Ok(())
    }

    fn tick(&mut self, time: f64) {
        let is_complete = self.is_complete(time);
        self.nodes.iter_mut().for_each(|node| node.tx_clock = is_complete);
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        self.receive()?;
        if self.is_complete(time) {
            self.finish();
        }
        self.start(time);
        let is_waiting = self.nodes.iter().any(|node| !node.waiting.is_empty());
        let end = self.sending.as_ref().map(|frame| frame.end);
        Ok(Event { next_event_time: end.or(is_waiting.then_some(self.free)), ..Event::default() })
    }

    fn model_exchange(&self) -> Option<ModelExchange> {
        Some(ModelExchange::default())
    }
}

fmu::export!(CanBus);
