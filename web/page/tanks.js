"use strict";
// The page of the three tanks: each change computes the whole run again, and the drawing plays it.
(() => {
  const id = (name) => document.getElementById(name);
  const element = (kind, words = {}, ...children) => {
    const node = Object.assign(document.createElement(kind), words);
    node.append(...children);
    return node;
  };
  const STEP = 1; // s between two rows
  const STOP = 1000; // s
  const NAMES = [
    "time", "plant.h_1", "plant.h_2", "plant.h_3", "plant.y_1", "plant.Q_1", "plant.Q_2", "plant.q_01", "plant.q_02", "controller.f_hat[1]", "controller.f_hat[2]",
    "controller.f_hat[3]", "controller.fault_detected", "controller.fault_isolated", "controller.t_detected", "controller.t_onset",
  ];
  const SET_POINTS = [0.4, 0.2, 0.3]; // m
  // `scale`: from the unit of the page to that of the FMU, as the exponent of ten. `sign`: of the value in the FMU.
  const FIELDS = [
    { id: "leak", label: "Leak in the line of pump 1", unit: "mL/s", value: 8, most: 20, step: 0.5, variable: "f_1", sign: "-", scale: -6 },
    { id: "leak_from", label: "The leak starts at", unit: "s", value: 200, most: STOP, step: 10, variable: "t_fault_1" },
    { id: "blocked", label: "Blocked part of pump 2", unit: "%", value: 0, most: 60, step: 1, variable: "E_2", scale: -2 },
    { id: "blocked_from", label: "The blockage starts at", unit: "s", value: 200, most: STOP, step: 10, variable: "t_fault_2" },
    { id: "offset", label: "Sensor 1 reads too much by", unit: "mm", value: 0, least: -40, most: 40, step: 1, variable: "b_1", scale: -3 },
    { id: "offset_from", label: "The offset starts at", unit: "s", value: 200, most: STOP, step: 10, variable: "t_bias" },
    { id: "noise", label: "Noise of each sensor, standard deviation", unit: "mm", value: 2, most: 4, step: 0.5 },
  ];
  const DEFAULTS = { compensate: true, ...Object.fromEntries(FIELDS.map(({ id: name, value }) => [name, value])) };
  const PRESETS = [
    { label: "A leak", values: {}, text: "From 200 s on, 8 mL/s of the 35 mL/s of pump 1 are lost. The estimate follows, pump 1 delivers more, and the test of f_1 gives the alarm." },
    { label: "A blocked pump", values: { leak: 0, blocked: 30 }, text: "Pump 2 delivers 70 % of its command. The levels fall as with a leak, but another test reacts." },
    { label: "A wrong sensor", values: { leak: 0, offset: 20 }, text: "Sensor 1 reads 20 mm too much. Without the estimate the controller would empty a tank that is not too full." },
    { label: "Two faults", values: { blocked: 30, blocked_from: 500 }, text: "A leak, and a blockage 300 s later. Both estimates are right; the decision is that the alarms do not fit one fault." },
    { label: "A small leak", values: { leak: 1 }, text: "1 mL/s is less than the 2.7 mL/s that the design detects within 120 s on average. The cumulative sum finds it all the same, after 255 s." },
    { label: "No fault", values: { leak: 0 }, text: "The estimates are not 0: they carry the noise of the sensors. The thresholds are chosen so that this is no alarm." },
  ];
  const FAULTS = ["Leak, f_1", "Blockage, f_2", "Sensor 1, b_1"];

  let wasm = null;
  let values = { ...DEFAULTS, ...fromLink() };
  let time = 0;
  let next = null; // the next frame, while the drawing plays
  let last = 0; // the time of the last frame in ms
  let table = {}; // the columns of the run, by name
  let ghost = {}; // those of the run without compensation

  // --- The run ---

  // The text of a number times a power of ten; small numbers have an exponent themselves.
  function scaled(number, power = 0) {
    const [digits, exponent = "0"] = `${number}`.split("e");
    const sum = Number(exponent) + power;
    return sum === 0 ? digits : `${digits}e${sum}`;
  }

  function stated({ id: name, sign = "", scale }) {
    return values[name] === 0 ? "0" : `${sign}${scaled(values[name], scale)}`;
  }

  // The variables of both FMUs that are set, and their values.
  function settings(compensate) {
    return [["controller.monitor", "true"], ["controller.compensate", `${compensate}`], ...FIELDS.filter(({ variable }) => variable).map((field) => [`plant.${field.variable}`, stated(field)])];
  }

  const noisy = () => (values.noise > 0 ? [1, 2, 3].map((k) => `controller.y_${k}`) : []);

  function run(compensate) {
    writeText([...settings(compensate).map(([name, value]) => `${name}=${value}`), ...noisy().map((input) => `noise ${input}=${scaled(values.noise, -3)}`)].join("\n"), wasm);
    if (wasm.start(STEP, STOP) !== 0) throw new Error(readText(wasm));
    const first = rowsOf(wasm);
    if (wasm.advance(STOP / STEP, 1) !== 0) throw new Error(readText(wasm));
    const rows = [...first, ...rowsOf(wasm)];
    return Object.fromEntries(NAMES.map((name, column) => [name, rows.filter((_, k) => k % NAMES.length === column)]));
  }

  function systemToml() {
    return [
      '[fmus]\nplant = "dist/ThreeTank.fmu"\ncontroller = "results/TankDetection.fmu"\n',
      `[settings]\n${settings(values.compensate).map(([name, value]) => `"${name}" = ${value}`).join("\n")}\n`,
      `[algorithm]\nstep = ${STEP}\n\n[experiment]\nstop-time = ${STOP}\n`,
      ...noisy().map((input) => `[[scenario.fault]]\nconnection = "${input}"\nnoise = { deviation = ${scaled(values.noise, -3)}, from = 0 }\n`),
    ].join("\n");
  }

  function compute() {
    const begin = performance.now();
    try {
      table = run(values.compensate);
      ghost = run(false);
    } catch (error) {
      play(false);
      Object.assign(id("decision"), { textContent: error.message, className: "bad" });
      return;
    }
    document.body.dataset.spent = performance.now() - begin;
    fillColumns();
    id("native").textContent = systemToml();
    history.replaceState(null, "", toLink());
    show();
  }

  // --- The link ---

  function toLink() {
    const parts = Object.keys(DEFAULTS).filter((name) => values[name] !== DEFAULTS[name]).map((name) => [name, values[name]]);
    return parts.length > 0 ? `#${new URLSearchParams(parts)}` : location.pathname;
  }

  // The values of a link; others than those of the page are left out.
  function fromLink() {
    const result = {};
    for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
      const field = FIELDS.find((known) => known.id === name);
      if (name === "compensate") result.compensate = text !== "false";
      else if (field && NUMBER.test(text)) result[name] = Math.min(Math.max(Number(text), field.least ?? 0), field.most);
    }
    return result;
  }

  // --- The figures ---

  const columns = {};
  const column = (name) => (columns[name] ??= new Column());
  const clock = column("time");
  const KINDS = [
    ["pumps", "mL/s", [["f_1, leak", "f_1", "--ink-1", 4], ["f_1, estimate", "f_hat_1", "--text"], ["f_2, blockage", "f_2", "--ink-2", 4], ["f_2, estimate", "f_hat_2", "--text"]]],
    ["sensor", "mm", [["b_1, offset", "b_1", "--ink-1", 4], ["b_1, estimate", "f_hat_3", "--text"]]],
    ["levels", "mm", [["tank 1", "h_1", "--ink-1"], ["tank 2", "h_2", "--ink-2"], ["tank 3", "h_3", "--good"], ["tank 1 without compensation", "ghost_1", "--soft"]]],
  ];
  let plots = [];
  const axis = thinnedAxis("tanks", () => plots);
  function drawFigures() {
    for (const plot of plots) plot.remove();
    plots = KINDS.map(([place, unit, curves]) => new TimePlot(axis, id(place), clock,
      curves.map(([label, name, ink, width]) => ({ label, ink, width, column: column(name), dash: name === "ghost_1" ? [4, 4] : undefined })), { unit, height: 190, marks: () => [time] }));
  }

  // The faults and their estimates in mL/s and mm, the deviations of the levels in mm.
  function fillColumns() {
    const of = (name) => table[`plant.${name}`];
    const [levels, estimates] = [[1, 2, 3].map((k) => of(`h_${k}`)), [1, 2, 3].map((k) => table[`controller.f_hat[${k}]`])];
    const contents = {
      time: table.time,
      f_1: of("q_01").map((flow, k) => 1e6 * (flow - of("Q_1")[k])),
      f_2: of("q_02").map((flow, k) => 1e6 * (flow - of("Q_2")[k])),
      b_1: of("y_1").map((level, k) => 1e3 * (level - levels[0][k])),
      ...Object.fromEntries(estimates.map((numbers, k) => [`f_hat_${k + 1}`, numbers.map((value) => value * (k < 2 ? 1e6 : 1e3))])),
      ...Object.fromEntries(levels.map((numbers, k) => [`h_${k + 1}`, numbers.map((value) => 1e3 * (value - SET_POINTS[k]))])),
      ghost_1: ghost["plant.h_1"].map((value) => 1e3 * (value - SET_POINTS[0])),
    };
    for (const [name, numbers] of Object.entries(contents)) {
      column(name).cut(0);
      for (const value of numbers) column(name).push(value);
    }
  }

  // --- The drawing ---

  const [FLOOR, HEIGHT, FULL, WIDTH] = [235, 185, 0.62, 110]; // px, px, m, px
  const PLACES = [[1, 40], [3, 250], [2, 460]]; // tanks and their left edges, from left to right
  const shapes = {};
  function shape(name, kind, attributes, text = "") {
    const node = document.createElementNS("http://www.w3.org/2000/svg", kind);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.textContent = text;
    id("drawing").append(node);
    shapes[name] = node;
  }
  const height = (tank, level) => {
    const shown = SET_POINTS[tank - 1] + 5 * (level - SET_POINTS[tank - 1]);
    return (HEIGHT * Math.min(Math.max(shown, 0), FULL)) / FULL;
  };
  for (const [tank, left] of PLACES) {
    const line = { x1: left, x2: left + WIDTH };
    const mark = FLOOR - height(tank, SET_POINTS[tank - 1]);
    shape(`water-${tank}`, "rect", { class: "water", x: left, width: WIDTH });
    shape(`ghost-${tank}`, "line", { class: "ghost", ...line });
    shape(`set-${tank}`, "path", { class: "set", d: `M${left - 8} ${mark}h16M${left + WIDTH - 8} ${mark}h16` });
    shape(`tank-${tank}`, "path", { d: `M${left} ${FLOOR - HEIGHT}V${FLOOR}H${left + WIDTH}V${FLOOR - HEIGHT}` });
    shape(`name-${tank}`, "text", { x: left + WIDTH / 2, y: FLOOR + 18 }, `tank ${tank}`);
  }
  for (const left of [150, 360, 570]) shape(`pipe-${left}`, "line", { class: "flow", x1: left, x2: Math.min(left + 100, 630), y1: FLOOR - 8, y2: FLOOR - 8 });
  for (const [pump, x] of [[1, 95], [2, 515]]) {
    shape(`flow-${pump}`, "line", { class: "flow", x1: x, x2: x, y1: 30, y2: FLOOR - HEIGHT + 12 });
    shape(`lost-${pump}`, "line", { class: "lost", x1: x + 16, x2: x + 16, y1: 30, y2: FLOOR - HEIGHT + 12 });
    shape(`pump-${pump}`, "text", { x, y: 20 });
  }
  shape("reading", "path", { class: "reading", d: "M40 0l-16 -9v18z" });

  const quantity = (value, unit) => `${(Math.round(10 * value) / 10 + 0).toFixed(1).replace("-", "−")} ${unit}`;

  function draw(k) {
    for (const [tank] of PLACES) {
      const tall = height(tank, table[`plant.h_${tank}`][k]);
      shapes[`water-${tank}`].setAttribute("y", FLOOR - tall);
      shapes[`water-${tank}`].setAttribute("height", tall);
      const place = FLOOR - height(tank, ghost[`plant.h_${tank}`][k]);
      for (const end of ["y1", "y2"]) shapes[`ghost-${tank}`].setAttribute(end, place);
    }
    for (const pump of [1, 2]) {
      const flow = 1e6 * table[`plant.q_0${pump}`][k];
      shapes[`flow-${pump}`].style.strokeWidth = flow / 5;
      shapes[`lost-${pump}`].style.strokeWidth = Math.abs(columns[`f_${pump}`].values[k]) / 5;
      shapes[`pump-${pump}`].textContent = `pump ${pump}: ${flow.toFixed(1)} of ${quantity(1e6 * table[`plant.Q_${pump}`][k], "mL/s")}`;
    }
    shapes.reading.setAttribute("transform", `translate(0 ${FLOOR - height(1, table["plant.y_1"][k])})`);
  }

  function decision(k) {
    const at = (name) => table[`controller.${name}`][k];
    if (at("fault_detected") !== 1) return "No fault is detected.";
    const isolated = at("fault_isolated");
    const which = isolated > 0 ? FAULTS[isolated - 1] : "several faults, or one that fits no test";
    return `Fault detected at ${at("t_detected")} s, estimated start ${at("t_onset")} s: ${which}.`;
  }

  // Shows the row at the present time.
  function show() {
    const k = Math.min(Math.round(time / STEP), clock.count - 1);
    draw(k);
    id("clock").textContent = `t = ${table.time[k]} s`;
    id("time").value = time;
    id("acting").textContent = values.compensate ? "the pumps deliver what the faults take away" : "the faults are estimated only";
    const text = decision(k);
    if (id("decision").textContent !== text) id("decision").textContent = text;
    const isolated = table["controller.fault_isolated"][k];
    id("decision").className = table["controller.fault_detected"][k] === 1 ? "alarm" : "";
    [["f_1", "f_hat_1", "mL/s"], ["f_2", "f_hat_2", "mL/s"], ["b_1", "f_hat_3", "mm"]].forEach(([fault, estimate, unit], row) => {
      const cells = id("faults").tBodies[0].rows[row].cells;
      cells[1].textContent = quantity(columns[fault].values[k], unit);
      cells[2].textContent = quantity(columns[estimate].values[k], unit);
      cells[3].textContent = isolated === row + 1 ? "✓ this one" : isolated < 0 && table["controller.fault_detected"][k] === 1 ? "several" : "–";
    });
    for (const plot of plots) if (plot.isInWindow) plot.update();
  }

  // The time of a frame may be a little before the time of the click.
  function frame(now) {
    time = Math.min(time + (Math.max(now - last, 0) / 1000) * Number(id("speed").value), STOP);
    last = now;
    show();
    play(time < STOP);
  }

  function play(go) {
    cancelAnimationFrame(next);
    if (go && next === null) {
      last = performance.now();
      if (time === STOP) time = 0;
    }
    next = go ? requestAnimationFrame(frame) : null;
    id("play").textContent = go ? "Pause" : "Run";
  }

  // --- Controls ---

  function fill() {
    id("set-compensate").checked = values.compensate;
    for (const field of FIELDS) {
      id(`set-${field.id}`).value = values[field.id];
      id(`value-${field.id}`).textContent = `${values[field.id]} ${field.unit}`;
    }
  }

  for (const field of FIELDS) {
    const input = element("input", { type: "range", id: `set-${field.id}`, min: field.least ?? 0, max: field.most, step: field.step });
    const output = element("output", { id: `value-${field.id}` });
    input.addEventListener("input", () => {
      values = { ...values, [field.id]: Number(input.value) };
      id("preset-text").textContent = "";
      fill();
      compute();
    });
    id("fields").append(element("div", { className: "field" }, element("label", { htmlFor: input.id, textContent: field.label }), element("div", { className: "bar" }, input, output)));
  }
  for (const preset of PRESETS) {
    const button = element("button", { type: "button", textContent: preset.label });
    button.addEventListener("click", () => {
      values = { ...DEFAULTS, ...preset.values, compensate: values.compensate };
      id("preset-text").textContent = preset.text;
      time = 0;
      fill();
      compute();
      play(true);
    });
    id("presets").append(button);
  }
  for (const name of FAULTS) id("faults").tBodies[0].append(element("tr", {}, element("th", { scope: "row", textContent: name }), ...[1, 2, 3].map(() => element("td"))));
  if (location.hash === "") id("preset-text").textContent = PRESETS[0].text;
  id("book").hidden = !location.pathname.endsWith("/paper/tanks.html");
  id("play").addEventListener("click", () => play(next === null));
  id("time").addEventListener("input", () => {
    play(false);
    time = Number(id("time").value);
    show();
  });
  id("set-compensate").addEventListener("change", () => {
    values = { ...values, compensate: id("set-compensate").checked };
    compute();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawFigures);
  addEventListener("hashchange", () => {
    values = { ...DEFAULTS, ...fromLink() };
    fill();
    compute();
  });

  loadModule("tanks.wasm").then(({ exports }) => {
    wasm = exports;
    fill();
    compute();
    drawFigures();
    document.body.dataset.ready = "true";
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play(true);
  }).catch((error) => {
    Object.assign(id("decision"), { textContent: `tanks.wasm cannot be started: ${error.message.replace(/\.$/u, "")}. Serve the folder: python3 -m http.server`, className: "bad" });
  });
  window.tanks = {
    get rows() {
      return table;
    },
  };
})();
