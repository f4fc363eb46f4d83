//! The system as a graph: a box for each FMU, an arrow for all connections between two of them.

use std::collections::BTreeMap;

use maud::{Markup, html};

use crate::{Connection, Run};

/// Sizes in units of the drawing: a box, the gaps between columns and rows of boxes, the margin.
const WIDTH: usize = 170;
const HEIGHT: usize = 48;
const ACROSS: usize = 110;
const DOWN: usize = 64;
const EDGE: usize = 12;
/// Largest number of characters of a name in a box.
const LETTERS: usize = 20;

/// Draws the system. Each FMU is to the right of the FMUs on which it depends; arrows that close a loop return below
/// the boxes. The tooltip of an arrow lists the connections of the arrow.
pub(crate) fn graph(run: &Run) -> Markup {
    let mut arrows: BTreeMap<(usize, usize), Vec<&Connection>> = BTreeMap::new();
    for connection in &run.connections {
        arrows.entry((connection.from, connection.to)).or_default().push(connection);
    }
    let columns = columns(run.fmus.len(), &arrows);
    let mut rows = vec![0; run.fmus.len()];
    let mut used = vec![0; run.fmus.len() + 1];
    for (fmu, &column) in columns.iter().enumerate() {
        rows[fmu] = used[column];
        used[column] += 1;
    }
    let corner =
        |fmu: usize| (EDGE + columns[fmu] * (WIDTH + ACROSS), EDGE + rows[fmu] * (HEIGHT + DOWN));
    let across = columns.iter().max().map_or(0, |last| last + 1);
    let down = used.iter().max().copied().unwrap_or(0);
    let width = 2 * EDGE + across * WIDTH + across.saturating_sub(1) * ACROSS;
    let height = EDGE + down * (HEIGHT + DOWN);
    html! {
        svg.graph viewBox=(format!("0 0 {width} {height}")) width=(width) height=(height) role="img"
            aria-label={ "The system: " (run.fmus.len()) " FMUs, " (run.connections.len()) " connections" } {
            defs {
                marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto-start-reverse" {
                    path.tip d="M0,0 L8,4 L0,8 z" {}
                }
            }
            @for ((from, to), connections) in &arrows {
                (arrow(corner(*from), corner(*to), connections))
            }
            @for (fmu, place) in run.fmus.iter().zip((0..).map(corner)) {
                g {
                    title { (fmu.name) @for detail in &fmu.details { ", " (detail) } }
                    rect.box x=(place.0) y=(place.1) width=(WIDTH) height=(HEIGHT) rx="6" {}
                    text.name x=(place.0 + WIDTH / 2) y=(place.1 + HEIGHT / 2 + 5) { (short(&fmu.name)) }
                }
            }
        }
    }
}

type Corner = (usize, usize);

fn arrow(from: Corner, to: Corner, connections: &[&Connection]) -> Markup {
    let (path, label) = if to.0 > from.0 {
        let (x, y) = (from.0 + WIDTH, from.1 + HEIGHT / 2);
        let (end_x, end_y) = (to.0, to.1 + HEIGHT / 2);
        let (leaving, arriving) = (x + ACROSS / 2, end_x - ACROSS / 2);
        (
            format!("M{x} {y} C{leaving} {y} {arriving} {end_y} {end_x} {end_y}"),
            (usize::midpoint(x, end_x), usize::midpoint(y, end_y)),
        )
    } else {
        // An arrow that closes a loop returns to the left below the boxes, from lower edge to lower edge.
        let (x, y) = (from.0 + WIDTH * 2 / 3, from.1 + HEIGHT);
        let (end_x, end_y) = (to.0 + WIDTH / 3, to.1 + HEIGHT);
        let below = y.max(end_y) + DOWN * 3 / 4;
        (
            format!("M{x} {y} C{x} {below} {end_x} {below} {end_x} {end_y}"),
            (usize::midpoint(x, end_x), below - DOWN / 5),
        )
    };
    html! {
        g {
            title {
                @for (at, connection) in connections.iter().enumerate() {
                    @if at > 0 { "\n" }
                    (connection.output) " to " (connection.input)
                }
            }
            path.wire d=(path) marker-end="url(#tip)" {}
            text.count x=(label.0) y=(label.1.saturating_sub(5)) { (label_of(connections)) }
        }
    }
}

/// Returns the label of an arrow: the name that a single connection has at both ends, or the number of connections.
fn label_of(connections: &[&Connection]) -> String {
    match connections {
        [only] if only.output == only.input => short(&only.output),
        [_] => "1 connection".to_owned(),
        more => format!("{} connections", more.len()),
    }
}

/// Shortens a name to at most [`LETTERS`] characters, the last one an ellipsis.
fn short(name: &str) -> String {
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    name.chars().take(LETTERS - 1).chain(['…']).collect()
}

/// Returns the column of each FMU: the length of the longest path to the FMU from an FMU without predecessors, over
/// connections that close no loop in a depth-first search.
fn columns(count: usize, arrows: &BTreeMap<(usize, usize), Vec<&Connection>>) -> Vec<usize> {
    let mut order =
        Order { arrows, state: vec![State::New; count], forward: Vec::new(), done: Vec::new() };
    for fmu in 0..count {
        order.visit(fmu);
    }
    let mut columns = vec![0; count];
    for from in order.done.into_iter().rev() {
        for (_, to) in order.forward.iter().filter(|(begin, _)| *begin == from) {
            columns[*to] = columns[*to].max(columns[from] + 1);
        }
    }
    columns
}

/// The state of an FMU in the depth-first search: not visited, on the path to the present FMU, or completed.
#[derive(Clone, Copy, PartialEq)]
enum State {
    New,
    Open,
    Done,
}

struct Order<'a> {
    arrows: &'a BTreeMap<(usize, usize), Vec<&'a Connection>>,
    state: Vec<State>,
    /// The arrows that close no loop.
    forward: Vec<(usize, usize)>,
    /// The FMUs, each after all FMUs that depend on it.
    done: Vec<usize>,
}

impl Order<'_> {
    fn visit(&mut self, fmu: usize) {
        // An explicit stack, because recursion over a chain of thousands of FMUs could exhaust the stack of the thread.
        // Each FMU is pushed again below its successors, to be completed after them.
        let mut open = vec![(fmu, false)];
        while let Some((fmu, is_visited)) = open.pop() {
            if is_visited {
                self.state[fmu] = State::Done;
                self.done.push(fmu);
            } else if self.state[fmu] == State::New {
                self.state[fmu] = State::Open;
                open.push((fmu, true));
                let successors = self.arrows.range((fmu, 0)..=(fmu, usize::MAX));
                for (arrow, _) in successors.filter(|((from, to), _)| from != to) {
                    if self.state[arrow.1] != State::Open {
                        self.forward.push(*arrow);
                    }
                    open.push((arrow.1, false));
                }
            }
        }
    }
}
