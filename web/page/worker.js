"use strict";
// Runs the WebAssembly module. Messages in: {kind: "start" | "run" | "pause" | "step" | "back" | "set", ..}.
// Messages out: {kind: "ready" | "started" | "rows" | "set" | "back" | "refused" | "failed" | "stopped", ..}.
const EVERY = 10; // steps between two rows
const FRAME = 16; // ms between two turns
const SAVE_EVERY = 0.5; // s of simulated time between two kept states

let wasm = null;
let timer = null;
let run = null; // {step, speed, saved, due, spent, last}

const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;

// The functions of a module. It reads numbers by the imported one.
async function load(file) {
  let memory = null;
  const number = (place, length) => {
    const text = new TextDecoder().decode(new Uint8Array(memory.buffer, place, length)).trim();
    return NUMBER.test(text) ? Number(text) : NaN;
  };
  const imports = { page: { number } };
  const { instance } = await WebAssembly.instantiateStreaming(fetch(file), imports).catch(async () =>
    // A server that does not name the type of the file.
    WebAssembly.instantiate(await (await fetch(file)).arrayBuffer(), imports));
  memory = instance.exports.memory;
  return instance.exports;
}

const loaded = load("paper.wasm");
let observer = null; // the module that places eigenvalues, loaded when they are set

function write(text, to = wasm) {
  const bytes = new TextEncoder().encode(text);
  const place = to.text(bytes.length);
  new Uint8Array(to.memory.buffer, place, bytes.length).set(bytes);
}

function read(from = wasm) {
  const length = from.text_length();
  return new TextDecoder().decode(new Uint8Array(from.memory.buffer, from.text(length), length));
}

function pause() {
  clearTimeout(timer);
  timer = null;
}

// Sends the rows that the module keeps.
function send() {
  const rows = new Float64Array(wasm.memory.buffer, wasm.rows(), wasm.rows_length()).slice();
  if (rows.length > 0) postMessage({ kind: "rows", rows }, [rows.buffer]);
}

// Makes `count` steps and sends their rows.
function advance(count) {
  const status = wasm.advance(count, EVERY);
  send();
  if (status !== 0) {
    pause();
    postMessage({ kind: "failed", text: read() });
  } else if (wasm.is_finished()) {
    pause();
    postMessage({ kind: "stopped", spent: run.spent });
  }
}

function save() {
  if (wasm.time() >= run.saved + SAVE_EVERY) {
    run.saved = wasm.time();
    if (wasm.save() !== 0) postMessage({ kind: "refused", text: read() });
  }
}

// One turn: the steps of the time that has passed, at most for the length of a few frames.
function turn() {
  timer = setTimeout(turn, FRAME);
  const begin = performance.now();
  const whole = run.speed === Infinity;
  const wanted = whole ? Infinity : ((begin - run.last) / 1000) * run.speed / run.step + run.due;
  run.last = begin;
  let left = wanted;
  const budget = whole ? 40 : 12;
  while (timer !== null && left >= 1 && performance.now() - begin < budget) {
    const count = Math.min(left, 500);
    save();
    advance(Math.floor(count));
    left -= Math.floor(count);
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
  async start({ settings, eigenvalues, step, stop }) {
    pause();
    run = null;
    let gains = "";
    if (eigenvalues !== null) {
      observer ??= await load("observer.wasm");
      write(eigenvalues, observer);
      const refused = observer.place() !== 0;
      gains = read(observer);
      if (refused) {
        postMessage({ kind: "refused", text: gains });
        return;
      }
    }
    write(`${settings}\n${gains}`);
    if (wasm.start(step, stop) !== 0) {
      postMessage({ kind: "refused", text: read() });
      return;
    }
    run = { step, speed: 1, saved: 0, due: 0, spent: 0, last: 0 };
    postMessage({ kind: "started", gains });
    send();
    wasm.save();
  },
  run({ speed }) {
    if (!run || wasm.is_finished()) return;
    pause();
    run.speed = speed;
    run.last = performance.now();
    turn();
  },
  pause,
  step() {
    pause();
    if (run && !wasm.is_finished()) {
      save();
      advance(EVERY);
    }
  },
  back() {
    pause();
    if (!run) return;
    if (wasm.back() !== 0) {
      postMessage({ kind: "refused", text: read() });
      return;
    }
    run.saved = -Infinity;
    postMessage({ kind: "back", at: wasm.time() });
  },
  set({ settings }) {
    if (!run) return;
    for (const line of settings) {
      write(line);
      if (wasm.set() !== 0) postMessage({ kind: "refused", text: read() });
      else postMessage({ kind: "set", line, at: wasm.time() });
    }
  },
};

async function act(data) {
  try {
    wasm ??= await loaded;
    await actions[data.kind](data);
  } catch (error) {
    pause();
    run = null;
    wasm = null;
    observer = null;
    postMessage({ kind: "failed", text: `The module stopped: ${error.message}. Reload the page to go on.` });
  }
}

// One after the other: a start waits for a module.
let acted = Promise.resolve();
onmessage = ({ data }) => {
  acted = acted.then(() => act(data));
};

loaded.then(() => postMessage({ kind: "ready" }), (error) =>
  postMessage({ kind: "failed", text: `paper.wasm cannot be loaded: ${error.message}` }));
