"use strict";
// A WebAssembly module of a closed loop: numbers, texts and rows in and out.

const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;

// The functions of a module, a file or a compiled one. It reads numbers by the imported one.
async function loadModule(source) {
  let memory = null;
  const number = (place, length) => {
    const text = new TextDecoder().decode(new Uint8Array(memory.buffer, place, length)).trim();
    return NUMBER.test(text) ? Number(text) : NaN;
  };
  // A server that does not name the type of the file needs the second way.
  const module = source instanceof WebAssembly.Module ? source : await WebAssembly.compileStreaming(fetch(source))
    .catch(async () => WebAssembly.compile(await (await fetch(source)).arrayBuffer()));
  const { exports } = await WebAssembly.instantiate(module, { page: { number } });
  memory = exports.memory;
  return { exports, module };
}

function writeText(text, to) {
  const bytes = new TextEncoder().encode(text);
  const place = to.text(bytes.length);
  new Uint8Array(to.memory.buffer, place, bytes.length).set(bytes);
}

function readText(from) {
  const length = from.text_length();
  return new TextDecoder().decode(new Uint8Array(from.memory.buffer, from.text(length), length));
}

// The rows that a module keeps, one after the other.
function rowsOf(module) {
  return new Float64Array(module.memory.buffer, module.rows(), module.rows_length()).slice();
}
