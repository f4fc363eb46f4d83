//! Traces of buses: the frames that FMUs send by the layered standard for networks, FMI-LS-BUS 1.0, at their times.

mod format;

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use fmu_description::Kind;
use fmu_description::can::{MATCHING_RULE, Operation};
use master::{CallError, Slave, System};

use crate::error::Error;
use format::Format;

/// Part of the `mimeType` of the operations of a CAN bus.
const CAN: &str = "fmi-ls-bus.can";

/// The variables through which a terminal of a CAN bus sends frames.
#[derive(Clone, Copy, Debug)]
struct Sender {
    slave: usize,
    clock: u32,
    data: u32,
    /// Number of the bus of the terminal.
    bus: usize,
}

/// A trace to which frames are added during the run.
pub(crate) struct BusTrace(Arc<Mutex<Writer>>);

struct Writer {
    path: PathBuf,
    /// The file; `None` until the FMUs are initialised.
    file: Option<File>,
    /// Bytes to write to the file: at once if the file exists, so that a killed run loses no frame.
    bytes: Vec<u8>,
    format: Format,
    /// The present time in s, and the frames of this instant with their bus. A frame that several terminals of a bus
    /// send at the same instant is written once.
    time: f64,
    frames: Vec<(usize, Operation)>,
    /// The first error of a write, after which no frame is written.
    failed: Option<std::io::Error>,
}

impl BusTrace {
    /// Starts a trace for the file at `path`, which [`BusTrace::create`] creates; the extension `.asc`, `.log` or
    /// `.pcapng` selects the format. During the run, the trace gets the frames of all CAN buses of `system`: the frames
    /// that an FMU which simulates the bus passes on or, without such an FMU, the frames that the nodes send. Returns
    /// an error if the file has another extension, or if there is no CAN bus. `from`: the start of the run in s.
    pub(crate) fn start(path: &Path, system: &mut System, from: f64) -> Result<Self, Error> {
        let format = Format::of(path, from)?;
        let senders = senders(system);
        if senders.is_empty() {
            return Err(Error::Invalid(format!(
                "{}: no FMU has a terminal of a CAN bus, with matchingRule {MATCHING_RULE} and the mimeType {CAN}",
                path.display()
            )));
        }
        let buses = 1 + senders.iter().map(|sender| sender.bus).max().unwrap_or_default();
        let mut bytes = Vec::new();
        format.write_start(&mut bytes, buses).map_err(Error::file("write", path))?;
        let (path, time, frames) = (path.to_owned(), f64::NAN, Vec::new());
        let writer = Writer { path, file: None, bytes, format, time, frames, failed: None };
        let writer = Arc::new(Mutex::new(writer));
        let shared = writer.clone();
        let mut bytes = [Vec::new()];
        system.observe_events(Box::new(move |slave, time, instance| {
            for sender in senders.iter().filter(|sender| sender.slave == slave) {
                if read_operations(sender, instance, &mut bytes)? {
                    let mut writer = shared.lock().unwrap_or_else(PoisonError::into_inner);
                    writer.add(time, sender.bus, &bytes[0]);
                }
            }
            Ok(())
        }));
        Ok(Self(writer))
    }

    /// Creates the file and its folder, and writes the frames so far. Call it after the initialisation, so that a run
    /// whose initialisation fails keeps the trace of an earlier run.
    pub(crate) fn create(&self) -> Result<(), Error> {
        let mut writer = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let path = writer.path.clone();
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        folder.map_or(Ok(()), std::fs::create_dir_all).map_err(Error::file("create", &path))?;
        writer.file = Some(File::create(&path).map_err(Error::file("create", &path))?);
        writer.write().map_err(Error::file("write", &path))
    }

    /// Checks that all frames so far were written; each error is returned once.
    pub(crate) fn finish(&self) -> Result<(), Error> {
        let mut writer = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let failed = writer.failed.take();
        failed.map_or(Ok(()), |source| Err(Error::file("write", &writer.path)(source)))
    }
}

/// Reads the operations that a terminal sends in this event into `bytes`; returns whether there are any.
fn read_operations(
    sender: &Sender,
    instance: &mut dyn Slave,
    bytes: &mut [Vec<u8>; 1],
) -> Result<bool, CallError> {
    let mut ticks = [0];
    instance.get_boolean(&[sender.clock], &mut ticks)?;
    if ticks[0] == 0 {
        return Ok(false);
    }
    instance.get_binary(&[sender.data], bytes)?;
    Ok(!bytes[0].is_empty())
}

impl Writer {
    /// Writes the operations in `bytes`, of one terminal, that `bus` has not had at `time` from another terminal.
    fn add(&mut self, time: f64, bus: usize, bytes: &[u8]) {
        if self.time.to_bits() != time.to_bits() {
            self.time = time;
            self.frames.clear();
        }
        let others = self.frames.len();
        for operation in Operation::read(bytes) {
            let frame = (bus, operation);
            if self.failed.is_some() || self.frames[..others].contains(&frame) {
                continue;
            }
            let result = self.format.write_operation(&mut self.bytes, time, bus, &frame.1);
            self.failed = result.and_then(|()| self.write()).err();
            self.frames.push(frame);
        }
    }

    /// Moves `bytes` to the file, if there is one.
    fn write(&mut self) -> std::io::Result<()> {
        if let Some(file) = &mut self.file {
            file.write_all(&self.bytes)?;
            self.bytes.clear();
        }
        Ok(())
    }
}

/// A terminal of a CAN bus, with the names of its variables `Tx_Data` and `Rx_Data`, which are connected.
struct Node {
    sender: Sender,
    output: String,
    input: Option<String>,
}

/// Returns the terminals whose frames are traced: the terminals of the FMU that simulates the bus or, without such an
/// FMU, all terminals of the bus. The buses are numbered from 0.
fn senders(system: &System) -> Vec<Sender> {
    let nodes = nodes(system);
    let links = links(system, &nodes);
    let mut senders: Vec<Sender> = nodes.into_iter().map(|node| node.sender).collect();
    // Linked terminals get the same bus number, the smaller one.
    let mut changed = true;
    while std::mem::take(&mut changed) {
        for &(one, other) in &links {
            let least = senders[one].bus.min(senders[other].bus);
            changed |= senders[one].bus != senders[other].bus;
            (senders[one].bus, senders[other].bus) = (least, least);
        }
    }
    let mut buses: Vec<usize> = senders.iter().map(|sender| sender.bus).collect();
    buses.sort_unstable();
    buses.dedup();
    let simulations = senders.iter().filter(|sender| is_simulation(system, sender.slave));
    let simulated: Vec<usize> = simulations.map(|sender| sender.bus).collect();
    senders
        .retain(|sender| !simulated.contains(&sender.bus) || is_simulation(system, sender.slave));
    for sender in &mut senders {
        sender.bus = buses.iter().position(|bus| *bus == sender.bus).unwrap_or_default();
    }
    senders
}

fn is_simulation(system: &System, slave: usize) -> bool {
    system.slaves[slave].1.description().is_bus_simulation
}

/// Returns all terminals of CAN buses, each with a different bus number.
fn nodes(system: &System) -> Vec<Node> {
    let mut nodes = Vec::new();
    for (slave, (_, instance)) in system.slaves.iter().enumerate() {
        let description = instance.description();
        for terminal in &description.terminals {
            let variable = |name: &str| {
                let member = terminal.members.iter().find(|member| member.name == name)?;
                let element = format!("{}[1]", member.variable);
                description.variable(&member.variable).or_else(|| description.variable(&element))
            };
            if let (Some(clock), Some(data)) = (variable("Tx_Clock"), variable("Tx_Data"))
                && terminal.matching_rule == MATCHING_RULE
                && let Kind::Binary(binary) = &data.kind
                && binary.mime_type.as_ref().is_some_and(|mime| mime.contains(CAN))
            {
                let (clock, reference) = (clock.value_reference, data.value_reference);
                nodes.push(Node {
                    sender: Sender { slave, clock, data: reference, bus: nodes.len() },
                    output: data.name.clone(),
                    input: variable("Rx_Data").map(|variable| variable.name.clone()),
                });
            }
        }
    }
    nodes
}

/// Returns pairs of terminals on the same bus, as positions in `nodes`: terminals that are connected, and terminals of
/// the same FMU if the FMU simulates a bus.
fn links(system: &System, nodes: &[Node]) -> Vec<(usize, usize)> {
    let mut links = Vec::new();
    for connection in &system.connections {
        let (from, to) = (connection.from, connection.to);
        let (source, target) = (&system.variable(from).name, &system.variable(to).name);
        let is_source = |node: &Node| node.sender.slave == from.slave && node.output == *source;
        let is_target =
            |node: &Node| node.sender.slave == to.slave && node.input.as_ref() == Some(target);
        links.extend(nodes.iter().position(is_source).zip(nodes.iter().position(is_target)));
    }
    for (one, node) in nodes.iter().enumerate() {
        let slave = node.sender.slave;
        let others = nodes[..one].iter().enumerate();
        let same = others.filter(|(_, other)| other.sender.slave == slave);
        if is_simulation(system, slave) {
            links.extend(same.map(|(other, _)| (one, other)));
        }
    }
    links
}

#[cfg(test)]
mod tests {
    use fmu_description::can::{Frame, FrameKind};

    use super::*;

    /// The second call has the frames of another terminal of the bus.
    #[test]
    fn two_equal_frames_of_a_terminal_are_both_in_the_trace() {
        let (kind, data) = (FrameKind::Data, vec![1]);
        let frame = Operation::Transmit(Frame { identifier: 5, extended: false, kind, data });
        let mut sent = Vec::new();
        frame.append_to(&mut sent);
        frame.append_to(&mut sent);
        let (path, bytes, time, frames) = (PathBuf::new(), Vec::new(), f64::NAN, Vec::new());
        let format = Format::Candump;
        let mut writer = Writer { path, file: None, bytes, format, time, frames, failed: None };
        writer.add(0.5, 0, &sent);
        writer.add(0.5, 0, &sent);
        assert_eq!(writer.bytes, "(0.500000) can0 005#01\n".repeat(2).as_bytes());
    }
}
