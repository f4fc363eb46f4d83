"use strict";
// Runs the WebAssembly module. Messages in: {kind: "start" | "run" | "pause" | "step" | "back" | "set" | "until", ..}.
// Messages out: {kind: "ready" | "started" | "running" | "rows" | "set" | "back" | "refused" | "failed" | "stopped", ..},
// with the number of the run.
importScripts("module.js");

const EVERY = 10; // steps between two rows
const MOST_ROWS = 1e6;
const COLUMNS = 9; // of a row: time, x_p, ..
const FARTHEST = 1000; // m; a lost cart is not computed farther
const FRAME = 16; // ms between two turns
const SAVE_EVERY = 0.5; // s of simulated time between two saved states

let wasm = null;
let timer = null;
let run = null; // {number, step, every, moves, plan, speed, batch, saved, due, spent, last, ended}

let observer = null; // the module that places eigenvalues, loaded when they are set

function answer(message, transfer = []) {
  postMessage({ ...message, run: run?.number }, transfer);
}

function pause() {
  clearTimeout(timer);
  timer = null;
}

// Sends the rows that the module keeps; whether the cart is still near.
function send() {
  const rows = rowsOf(wasm);
  const isNear = rows.length === 0 || Math.abs(rows.at(1 - COLUMNS)) < FARTHEST;
  if (rows.length > 0) answer({ kind: "rows", rows }, [rows.buffer]);
  return isNear;
}

function change(line) {
  writeText(line, wasm);
  if (wasm.set() !== 0) answer({ kind: "refused", text: readText(wasm), line });
  else answer({ kind: "set", line, at: wasm.time() });
}

// Whether a time is reached, as the command compares times.
function reached(at) {
  const time = wasm.time();
  return time >= at - 1e-9 * Math.max(Math.abs(time), Math.abs(at));
}

// Makes `count` steps, with the changes that are planned, and sends their rows.
function advance(count) {
  let left = count;
  while (left > 0 && !run.ended) {
    while (run.plan.length > 0 && reached(run.plan[0].at)) change(run.plan.shift().line);
    const next = run.plan.length > 0 ? Math.ceil((run.plan[0].at - wasm.time()) / run.step - 1e-6) : Infinity;
    const part = Math.max(1, Math.min(left, next));
    const status = wasm.advance(part, run.every);
    left -= part;
    const isNear = send();
    if (status !== 0 || wasm.is_finished() || !isNear) {
      pause();
      run.ended = true;
      if (status !== 0) answer({ kind: "failed", text: readText(wasm) });
      else if (wasm.is_finished()) answer({ kind: "stopped", spent: run.spent });
      else answer({ kind: "failed", text: `the cart is ${FARTHEST} m away.` });
    }
  }
}

function save() {
  if (wasm.time() >= run.saved + SAVE_EVERY) {
    run.saved = wasm.time();
    wasm.save();
  }
}

// One turn: the steps of the time that has passed, at most for the length of a few frames.
function turn() {
  timer = setTimeout(turn, FRAME);
  const begin = performance.now();
  const whole = run.speed === Infinity;
  const due = whole ? Infinity : ((begin - run.last) / 1000) * run.speed / run.step + run.due;
  run.last = begin;
  let left = due;
  const budget = whole ? 40 : 12;
  while (timer !== null && left >= 1 && performance.now() - begin < budget) {
    const count = Math.floor(Math.min(left, run.batch));
    const started = performance.now();
    save();
    advance(count);
    left -= count;
    // Steps of a lost cart are slow.
    run.batch = performance.now() - started < 6 ? 500 : 20;
  }
  // A machine that is too slow does not save up steps.
  run.due = Number.isFinite(left) ? Math.min(left, 1) : 0;
  run.spent += performance.now() - begin;
  if (timer !== null && whole) {
    clearTimeout(timer);
    timer = setTimeout(turn, 0);
  }
}

const actions = {
  // The second worker gets the module that the first one compiled.
  async load({ module }) {
    const loaded = await loadModule(module ?? "paper.wasm");
    wasm = loaded.exports;
    answer({ kind: "ready", module: loaded.module });
  },
  async start({ number, settings, eigenvalues, gains, step, stop, plan }) {
    pause();
    run = { number, step, every: EVERY * Math.ceil(stop / step / EVERY / MOST_ROWS), moves: plan, plan: [...plan], speed: 1, batch: 500, saved: 0, due: 0, spent: 0, last: 0, ended: true };
    let placed = gains;
    if (eigenvalues !== null) {
      observer ??= (await loadModule("observer.wasm")).exports;
      writeText(eigenvalues, observer);
      const refused = observer.place() !== 0;
      placed = readText(observer);
      if (refused) {
        answer({ kind: "refused", text: placed, setting: "eigenvalues" });
        return;
      }
    }
    writeText(`${settings}\n${placed}`, wasm);
    if (wasm.start(step, stop) !== 0) {
      answer({ kind: "refused", text: readText(wasm), setting: "" });
      return;
    }
    run.ended = false;
    answer({ kind: "started", gains: placed, every: run.every });
    send();
    wasm.save();
  },
  run({ speed }) {
    if (!run || run.ended) return;
    pause();
    run.speed = speed;
    run.last = performance.now();
    answer({ kind: "running" });
    turn();
  },
  pause,
  step() {
    pause();
    if (run && !run.ended) {
      save();
      advance(run.every);
    }
  },
  // Follows another run.
  until({ at }) {
    while (run && !run.ended && !reached(at)) advance(run.every);
  },
  back() {
    pause();
    if (!run) return;
    const from = wasm.time();
    if (wasm.back() !== 0) {
      answer({ kind: "refused", text: readText(wasm) });
      return;
    }
    // A change, also the end of a push after a step back, saves the state of its time again.
    if (wasm.time() === from) wasm.back();
    run.saved = -Infinity;
    run.ended = false;
    run.plan = run.moves.filter(({ at }) => at >= wasm.time());
    answer({ kind: "back", at: wasm.time() });
  },
  // A change by hand ends the plan.
  set({ line }) {
    if (!run) return;
    run.moves = run.plan = [];
    // A state of this time is one without the change, as those of the plan.
    if (!run.ended) save();
    change(line);
  },
};

async function act(data) {
  try {
    await actions[data.kind](data);
  } catch (error) {
    pause();
    run = null;
    answer({ kind: "failed", text: wasm ? `The module stopped: ${error.message}. Reload the page to go on.` : `paper.wasm cannot be loaded: ${error.message}` });
  }
}

// One after the other: a start waits for a module.
let last = Promise.resolve();
onmessage = ({ data }) => {
  last = last.then(() => act(data));
};
