"use strict";
// The live view: asks the server for the state of the run, draws it, and sends requests.
(async () => {
  const PERIOD = 200; // ms between two questions
  const HIDDEN_PERIOD = 1000;
  const LOST_PERIOD = 2000;
  const LIMIT = 5000; // ms for an answer
  const MOST = 20000; // rows kept
  const CURVES = 7; // colours
  const MESSAGES = 300;
  const SHOWN = 32;
  // Kinds of faults and their values: name in the scenario, label, proposed value, whether it has the unit of the input.
  const KINDS = {
    bias: [["value", "Value", "0.1", true]],
    gain: [["factor", "Factor", "0.5"]],
    drift: [["rate", "Rate per s", "0.01", true]],
    delay: [["seconds", "Delay, in s", "0.01"]],
    stuck: [["value", "Value (empty: the present one)", "", true]],
    dropout: [["value", "Value (empty: the last one)", "", true]],
    noise: [["deviation", "Standard deviation", "0.01", true]],
    quantisation: [["step", "Distance of the levels", "0.1", true]],
    saturation: [["min", "Lowest value", "-1", true], ["max", "Highest value", "1", true]],
    inversion: [],
  };
  const field = (id) => document.getElementById(id);
  const say = (id, text) => {
    if (field(id).textContent !== text) field(id).textContent = text;
  };
  const element = (name, text) => Object.assign(document.createElement(name), { textContent: text });
  const digits = (value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(6))));

  // A time in s with all digits down to 1 µs, also of seconds since 1970.
  const instant = (time) => (time === null || Math.abs(time) < 1 ? digits(time) : String(Number(time.toFixed(6))));

  // Numbers in a sentence, without the rounding errors of sums.
  const rounded = (text) => text.replace(/\d+\.\d{9,}/gu, (number) => String(Number(Number(number).toPrecision(9))));

  async function asked(path, options) {
    return fetch(path, { ...options, signal: AbortSignal.timeout(LIMIT) });
  }
  const pause = (length) => new Promise((resume) => { setTimeout(resume, length); });

  let since = null; // when the last question without an answer was put
  /* Says since when there is no answer, and holds the controls until there is one. */
  function lost() {
    since ??= new Date();
    const length = Math.round((Date.now() - since) / 1000);
    field("lost").hidden = false;
    say("lost", `No answer since ${since.toLocaleTimeString()} (${length} s). The command has ended, or the connection is broken, such as a tunnel; `
      + "then the run goes on. The page asks again every 2 s.");
    for (const control of controls()) control.disabled = true;
  }

  function reached() {
    if (since === null) return;
    since = null;
    field("lost").hidden = true;
    for (const control of controls()) control.disabled = false;
  }
  const controls = () => document.querySelectorAll("main .bar button, main form button, main form input, main form select, main textarea");

  let facts = null;
  while (facts === null) {
    try {
      facts = await (await asked("facts")).json();
    } catch {
      lost();
      await pause(LOST_PERIOD);
    }
  }
  reached();
  let shown = [];
  let watched = []; // the signals shown, and the one that is being set
  let data = []; // times, then the values of each watched signal
  let rows = 0; // number of the last row
  let messages = 0;
  const interventions = []; // marks in all plots

  // An axis whose data grow: it shows everything or the last seconds, unless it is zoomed.
  class RunAxis extends LinkedAxis {
    whole({ data: [times] }) {
      const [low, high] = [times[0] ?? 0, times.at(-1) ?? 1];
      const start = Math.max(low, high - (Number(field("length").value) || Infinity));
      return high > start ? [start, high] : [start, start + 1];
    }

    // Gives a plot new data; it keeps a range that is zoomed.
    update(plot, rows) {
      plot.setData(rows, false);
      this.apply(plot);
    }
  }

  let plots = [];
  let phase = "";
  let speeds = []; // times of the last questions: wall-clock seconds and simulated time

  const campaign = facts.subject === "campaign";
  const horizontal = campaign
    ? new RunAxis({ name: "runs", label: "finished runs", short: "runs" })
    : new RunAxis({ name: "run", label: "time in s", short: "t in s" });
  if (campaign) {
    const names = {
      kind: "Live view of a campaign", "run-title": "Campaign", "time-name": "finished runs", "factor-name": "runs per second, now",
      "mean-name": "runs per second, mean", "signals-title": "Measures", "messages-title": "Runs",
      "signals-note": "One point for each run, in the order in which they end.",
    };
    for (const [id, text] of Object.entries(names)) say(id, text);
    field("progress").setAttribute("aria-label", "Finished runs");
    for (const id of ["steps-part", "fallbacks-part", "step", "change"]) field(id).hidden = true;
    for (const option of field("length").options) option.textContent = option.textContent.replace("run", "campaign").replace(" s", " runs");
  }
  document.title = `${facts.system}: live view`;
  say("system", facts.system);
  say("file", facts.file);
  say("repeat", facts.repeat);
  field("late-part").hidden = facts.pace === null;
  field("usage").append(...USAGE.map((sentence) => element("p", sentence)));
  field("length").addEventListener("change", () => horizontal.show(null));

  // --- signals and plots

  function choose() {
    const boxes = [...field("signals").querySelectorAll("input")];
    shown = boxes.filter((box) => box.checked).map((box) => Number(box.value));
    for (const box of boxes) box.disabled = !box.checked && shown.length >= SHOWN;
    // The server repeats the rows that it still has.
    rows = 0;
    watched = [...shown];
    const setting = facts.signals.findIndex(({ name }) => name === field("set-variable").value);
    if (setting >= 0 && !shown.includes(setting) && shown.length < SHOWN) watched.push(setting);
    data = [[], ...watched.map(() => [])];
    draw();
  }

  function draw() {
    for (const { plot, observer } of plots) {
      observer.disconnect();
      horizontal.remove(plot);
    }
    const groups = new Map();
    shown.forEach((signal, place) => {
      const unit = facts.signals[signal].unit;
      const key = [...groups.keys()].find((known) => known.unit === unit && groups.get(known).length < CURVES) ?? { unit };
      groups.set(key, [...(groups.get(key) ?? []), { signal, place }]);
    });
    field("figures").replaceChildren();
    plots = [...groups].map(([{ unit }, members]) => onePlot(unit, members));
    refresh();
  }

  function onePlot(unit, members) {
    const figure = element("div", "");
    figure.className = "figure";
    field("figures").append(figure);
    const names = members.map(({ signal }) => facts.signals[signal].name);
    const plot = horizontal.plot(figure, [[], ...members.map(() => [])], {
      label: unit,
      height: 220,
      curves: members.map(({ signal }, k) =>
        ({ name: names[k], colour: `--ink-${k + 1}`, dots: campaign, holds: facts.signals[signal].kind !== "Real" })),
      marks: interventions,
      write: (value, curve) => (curve === 0 ? instant : digits)(value),
      name: `${names.join(", ")} over ${campaign ? "the runs" : "time"}`,
    });
    const observer = new ResizeObserver(() => plot.setSize({ width: Math.max(figure.clientWidth, 200), height: 220 }));
    observer.observe(figure);
    return { plot, members, observer };
  }

  function refresh() {
    for (const { plot, members } of plots) horizontal.update(plot, [data[0], ...members.map(({ place }) => data[place + 1])]);
    present();
    const last = shown.map((signal, place) => {
      const { name, unit } = facts.signals[signal];
      return `${name} = ${digits(data[place + 1].at(-1))}${unit ? ` ${unit}` : ""}`;
    });
    say("values", last.join("; "));
  }

  function keep(state) {
    if (state.times.length === 0) return;
    data[0].push(...state.times);
    state.values.forEach((column, k) => data[k + 1].push(...column));
    // The older a row, the more of its neighbours are gone.
    if (data[0].length > MOST) data = data.map((column) => column.filter((_, k) => k % 2 === 0 || k > MOST / 2));
    refresh();
  }

  facts.signals.forEach(({ name, unit }, k) => {
    const box = Object.assign(document.createElement("input"), { type: "checkbox", value: k, checked: false });
    const label = element("label", "");
    label.append(box, ` ${name}${unit ? ` in ${unit}` : ""}`);
    label.dataset.name = name.toLowerCase();
    field("signals").append(label);
  });
  const boxes = [...field("signals").querySelectorAll("input")];
  // First the outputs that are connected.
  const sources = new Set(facts.inputs.map(({ output }) => output));
  const connected = boxes.filter((box) => sources.has(facts.signals[box.value].name));
  for (const box of connected.length > 0 ? connected.slice(0, 8) : boxes.slice(0, 4)) box.checked = true;
  field("signals").addEventListener("change", choose);
  field("filter").addEventListener("input", () => {
    const sought = field("filter").value.toLowerCase();
    for (const label of field("signals").querySelectorAll("label")) label.hidden = !label.dataset.name.includes(sought);
  });
  redrawOn([horizontal], draw);

  // --- the state

  function show(state) {
    const { time, steps, seconds } = state;
    const length = facts.stop - facts.start;
    field("progress").value = length > 0 ? (time - facts.start) / length : 0;
    say("time", campaign ? `${time} of ${facts.stop}` : `${instant(time)} of ${instant(facts.stop)} s`);
    say("steps", String(steps));
    say("mean", seconds > 0 ? ((time - facts.start) / seconds).toPrecision(3) : "–");
    speeds.push([seconds, time]);
    speeds = speeds.slice(-10);
    const [[before, from], [after, to]] = [speeds[0], speeds.at(-1)];
    say("factor", after > before ? ((to - from) / (after - before)).toPrecision(3) : "–");
    field("fallbacks-part").hidden = campaign || state.fallbacks === null;
    say("fallbacks", String(state.fallbacks));
    say("late", String(state.late ?? "–"));
    change(state.outcome === null ? state.phase : "ended", state.outcome);
    report(state);
    for (const { time: accepted, text } of state.interventions.slice(interventions.length)) {
      const x = Number(/\b(?:at|from) = ([\d.eE+-]+)/u.exec(text)?.[1] ?? accepted);
      interventions.push({ x, colour: "--good", dash: [3, 3], flag: true });
      field("interventions").append(element("li", rounded(text)));
      for (const { plot } of plots) plot.redraw(false);
    }
    document.body.dataset.time = time;
  }

  function change(now, outcome) {
    if (now === phase) return;
    phase = now;
    document.body.dataset.phase = now;
    const it = campaign ? "The campaign" : "The run";
    const running = { running: `${it} goes on.`, paused: `${it} is paused.`, ended: outcome ?? `${it} has ended.` };
    say("status", running[now]);
    say("hold", now === "paused" ? "Go on" : "Pause");
    if (now === "ended") {
      for (const control of controls()) control.disabled = true;
    }
  }

  function report({ counts, dropped, messages: more }) {
    const named = Object.entries(counts).map(([fmu, count]) => `${fmu || "aso-ftc"}: ${count}`);
    if (dropped > 0) named.push(`lost on the way to this page: ${dropped}`);
    say("counts", named.length > 0 ? named.join("; ") : "None.");
    const list = field("messages");
    for (const { fmu, text } of more) {
      const entry = element("li", text);
      entry.dataset.fmu = fmu;
      list.prepend(entry); // the newest one is at the top
    }
    while (list.childElementCount > MESSAGES) list.lastChild.remove();
  }

  async function ask() {
    for (;;) {
      const asking = watched;
      try {
        const answer = await asked(`state?rows=${rows}&messages=${messages}&show=${asking.join(",")}`);
        const state = await answer.json();
        reached();
        messages = state.message;
        if (asking === watched) {
          rows = state.row;
          keep(state);
        }
        show(state);
        if (state.outcome !== null) return;
      } catch {
        lost();
      }
      await pause(since !== null ? LOST_PERIOD : document.hidden ? HIDDEN_PERIOD : PERIOD);
    }
  }

  // --- requests

  function answered(text, failed) {
    const place = field("answer");
    place.hidden = false;
    place.classList.toggle("failed", failed);
    place.textContent = rounded(text);
  }

  async function send(path, body) {
    try {
      const answer = await asked(path, { method: "POST", headers: { "Content-Type": "application/toml" }, body: body ?? "" });
      const { answer: sentence, error } = await answer.json();
      answered(error ?? sentence, !answer.ok);
      return answer.ok;
    } catch {
      answered("The command does not answer.", true);
      return false;
    }
  }

  field("hold").addEventListener("click", () => send(phase === "paused" ? "continue" : "pause"));
  field("step").addEventListener("click", () => send("step"));
  let armed = 0;
  field("stop").addEventListener("click", () => {
    clearTimeout(armed);
    if (field("stop").dataset.armed) {
      disarm();
      send("stop");
      return;
    }
    field("stop").dataset.armed = "true";
    say("stop", "Stop now and keep the results");
    armed = setTimeout(disarm, 5000);
  });
  function disarm() {
    delete field("stop").dataset.armed;
    say("stop", "Stop");
  }

  const quoted = (text) => JSON.stringify(text);
  // A number, true, false, or a text: texts of Strings get quotes.
  function literal(text, kind) {
    const plain = text.trim();
    const bare = plain === "true" || plain === "false" || (plain !== "" && Number.isFinite(Number(plain)));
    if (kind === "String" || !(bare || plain.startsWith('"'))) return quoted(text);
    // TOML wants a digit on both sides of a point.
    return bare && plain !== "true" && plain !== "false" ? String(Number(plain)) : plain;
  }

  for (const { name, description } of facts.settings) {
    field("settings").append(Object.assign(document.createElement("option"), { value: name, label: description }));
  }
  field("set-none").hidden = facts.settings.length > 0;
  const setting = () => facts.settings.find(({ name }) => name === field("set-variable").value);
  field("set-variable").addEventListener("input", () => {
    say("set-unit", setting()?.unit ? `in ${setting().unit}` : "");
    if (setting() !== undefined) choose();
    present();
  });

  // Says the present value of the variable that is being set.
  function present() {
    const place = watched.findIndex((signal) => facts.signals[signal].name === field("set-variable").value);
    const value = place < 0 ? undefined : data[place + 1].at(-1);
    const unit = setting()?.unit ? ` ${setting().unit}` : "";
    say("set-now", value === undefined || value === null ? "The present value appears here." : `Present value: ${digits(value)}${unit}`);
  }
  field("set").addEventListener("submit", (event) => {
    event.preventDefault();
    const text = field("set-value").value.trim();
    const kind = setting()?.kind;
    // The page shows Booleans as 0 and 1.
    const value = (kind === "Boolean" && { 0: "false", 1: "true" }[text]) || literal(text, kind);
    send("scenario", `[[set]]\nvariable = ${quoted(field("set-variable").value)}\nvalue = ${value}\n`);
  });

  for (const { input, output } of facts.inputs) {
    field("fault-input").append(Object.assign(document.createElement("option"), { value: input.name, textContent: `${output} → ${input.name}` }));
  }
  for (const kind of Object.keys(KINDS)) field("fault-kind").append(element("option", kind));
  const members = () => KINDS[field("fault-kind").value];
  function proposed() {
    const { input } = facts.inputs.find(({ input: { name } }) => name === field("fault-input").value) ?? {};
    field("fault-values").replaceChildren(...members().map(([name, text, value, hasUnit]) => {
      const label = element("label", hasUnit && input?.unit ? `${text}, in ${input.unit} ` : `${text} `);
      label.append(Object.assign(document.createElement("input"), { id: `fault-${name}`, value, inputMode: "decimal", autocomplete: "off" }));
      return label;
    }));
  }
  field("fault-kind").addEventListener("change", proposed);
  field("fault-input").addEventListener("change", proposed);
  proposed();
  field("fault").addEventListener("submit", (event) => {
    event.preventDefault();
    const kind = facts.inputs.find(({ input: { name } }) => name === field("fault-input").value)?.input.kind;
    const values = [...members().map(([name]) => name), "from", "until"].flatMap((name) => {
      const value = field(`fault-${name}`).value.trim();
      return value === "" ? [] : [`${name} = ${literal(value, kind)}`];
    });
    send("scenario", `[[fault]]\nconnection = ${quoted(field("fault-input").value)}\n${field("fault-kind").value} = { ${values.join(", ")} }\n`);
  });
  field("entries").addEventListener("submit", (event) => {
    event.preventDefault();
    send("scenario", field("text").value);
  });

  choose();
  document.body.dataset.ready = "true";
  ask();
})();
