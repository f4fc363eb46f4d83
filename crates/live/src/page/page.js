"use strict";
// The live view: asks the server for the state of the run, draws it, and sends requests.
(async () => {
  const PERIOD = 200; // ms between two questions
  const HIDDEN_PERIOD = 1000;
  const MOST = 20000; // rows kept
  const CURVES = 7; // colours
  const MESSAGES = 300;
  const SHOWN = 32;
  // Kinds of faults: members that they usually have, and whether these are needed.
  const KINDS = {
    bias: "value = 0.1", gain: "factor = 0.5", drift: "rate = 0.01", delay: "seconds = 0.01", stuck: "", dropout: "",
    noise: "deviation = 0.01", quantisation: "step = 0.1", saturation: "min = -1, max = 1", inversion: "",
  };
  const field = (id) => document.getElementById(id);
  const say = (id, text) => {
    if (field(id).textContent !== text) field(id).textContent = text;
  };
  const element = (name, text) => Object.assign(document.createElement(name), { textContent: text });
  const digits = (value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(6))));
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  const facts = await (await fetch("facts")).json();
  let shown = [];
  let data = []; // times, then the values of each shown signal
  let rows = 0; // number of the last row
  let messages = 0;
  const horizontal = new GrowingAxis("run");
  let plots = [];
  let phase = "";
  let asked = []; // times of the last questions: wall-clock seconds and simulated time

  const campaign = facts.subject === "campaign";
  const AXIS = campaign ? "finished runs" : "time in s";
  if (campaign) {
    const names = {
      kind: "Live view of a campaign", "run-title": "Campaign", "time-name": "finished runs", "factor-name": "runs per second, now",
      "mean-name": "runs per second, mean", "signals-title": "Measures", "messages-title": "Runs",
      "signals-note": "One point for each run, in the order in which they end. Drag over a plot to zoom, double-click to show all.",
    };
    for (const [id, text] of Object.entries(names)) say(id, text);
    field("progress").setAttribute("aria-label", "Finished runs");
    for (const id of ["steps-part", "fallbacks-part", "step", "change"]) field(id).hidden = true;
  }
  document.title = `${facts.system}: live view`;
  say("system", facts.system);
  say("file", facts.file);
  say("repeat", facts.repeat);
  field("late-part").hidden = facts.pace === null;

  // --- signals and plots

  function choose() {
    const boxes = [...field("signals").querySelectorAll("input")];
    shown = boxes.filter((box) => box.checked).map((box) => Number(box.value));
    for (const box of boxes) box.disabled = !box.checked && shown.length >= SHOWN;
    // The server repeats the rows that it still has.
    rows = 0;
    data = [[], ...shown.map(() => [])];
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
    figure.setAttribute("role", "img");
    figure.setAttribute("aria-label", `${members.map(({ signal }) => facts.signals[signal].name).join(", ")} over time; the values are below`);
    field("figures").append(figure);
    const axis = { stroke: colour("--text"), grid: { stroke: colour("--grid") }, ticks: { stroke: colour("--grid") } };
    const width = () => Math.max(figure.clientWidth, 200);
    const options = {
      width: width(),
      height: 220,
      scales: { x: { time: false } },
      axes: [{ ...axis, label: AXIS, labelSize: 22 }, { ...axis, size: 75, label: unit || undefined }],
      series: [
        { label: campaign ? "runs" : "t in s", value: (self, value) => digits(value) },
        ...members.map(({ signal }, k) => ({
          label: facts.signals[signal].name,
          stroke: colour(`--ink-${k + 1}`),
          width: 1.5,
          points: { show: campaign, size: 4, fill: colour(`--ink-${k + 1}`) },
          paths: campaign ? () => null : facts.signals[signal].kind === "Real" ? uPlot.paths.linear() : uPlot.paths.stepped({ align: 1 }),
          value: (self, value) => digits(value),
        })),
      ],
    };
    const plot = horizontal.plot(options, [[], ...members.map(() => [])], figure);
    const observer = new ResizeObserver(() => plot.setSize({ width: width(), height: 220 }));
    observer.observe(figure);
    return { plot, members, observer };
  }

  function refresh() {
    for (const { plot, members } of plots) horizontal.update(plot, [data[0], ...members.map(({ place }) => data[place + 1])]);
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
  for (const box of boxes.slice(0, 4)) box.checked = true;
  field("signals").addEventListener("change", choose);
  field("choice").open = facts.signals.length > 4;
  field("filter").addEventListener("input", () => {
    const sought = field("filter").value.toLowerCase();
    for (const label of field("signals").querySelectorAll("label")) label.hidden = !label.dataset.name.includes(sought);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  // --- the state

  function show(state) {
    const { time, steps, seconds } = state;
    const length = facts.stop - facts.start;
    field("progress").value = length > 0 ? (time - facts.start) / length : 0;
    say("time", campaign ? `${time} of ${facts.stop}` : `${digits(time)} of ${digits(facts.stop)} s`);
    say("steps", String(steps));
    say("mean", seconds > 0 ? ((time - facts.start) / seconds).toPrecision(3) : "–");
    asked.push([seconds, time]);
    asked = asked.slice(-10);
    const [[before, from], [after, to]] = [asked[0], asked.at(-1)];
    say("factor", after > before ? ((to - from) / (after - before)).toPrecision(3) : "–");
    field("fallbacks-part").hidden = campaign || state.fallbacks === null;
    say("fallbacks", String(state.fallbacks));
    say("late", String(state.late ?? "–"));
    change(state.outcome === null ? state.phase : "ended", state.outcome);
    report(state);
    const entries = state.interventions.map(({ text }) => text);
    const list = field("interventions");
    for (const text of entries.slice(list.childElementCount)) list.append(element("li", text));
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
      for (const control of document.querySelectorAll("main button, main form input, main form select, main textarea")) control.disabled = true;
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

  function lost() {
    if (phase === "ended") return;
    change("ended", "The command has ended, or does not answer any more.");
    field("status").classList.add("failed");
  }

  let failures = 0;
  async function ask() {
    const asking = shown;
    try {
      const answer = await fetch(`state?rows=${rows}&messages=${messages}&show=${asking.join(",")}`);
      const state = await answer.json();
      failures = 0;
      messages = state.message;
      if (asking === shown) {
        rows = state.row;
        keep(state);
      }
      show(state);
      if (state.outcome !== null) return;
    } catch {
      failures += 1;
      if (failures > 10) return lost();
    }
    setTimeout(ask, document.hidden ? HIDDEN_PERIOD : PERIOD);
  }

  // --- requests

  function answered(text, failed) {
    const place = field("answer");
    place.hidden = false;
    place.classList.toggle("failed", failed);
    place.textContent = text;
  }

  async function send(path, body) {
    try {
      const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/toml" }, body: body ?? "" });
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
  field("set-variable").addEventListener("input", () => say("set-unit", setting()?.unit ? `in ${setting().unit}` : ""));
  field("set").addEventListener("submit", (event) => {
    event.preventDefault();
    const value = literal(field("set-value").value, setting()?.kind);
    send("scenario", `[[set]]\nvariable = ${quoted(field("set-variable").value)}\nvalue = ${value}\n`);
  });

  for (const { input, output } of facts.inputs) {
    field("fault-input").append(Object.assign(document.createElement("option"), { value: input.name, textContent: `${output} → ${input.name}` }));
  }
  for (const kind of Object.keys(KINDS)) field("fault-kind").append(element("option", kind));
  const proposed = () => {
    field("fault-members").value = KINDS[field("fault-kind").value];
    const { input } = facts.inputs.find(({ input: { name } }) => name === field("fault-input").value) ?? {};
    say("fault-unit", input?.unit ? `in ${input.unit}` : "");
  };
  field("fault-kind").addEventListener("change", proposed);
  field("fault-input").addEventListener("change", proposed);
  proposed();
  field("fault").addEventListener("submit", (event) => {
    event.preventDefault();
    const until = field("fault-until").value.trim();
    const members = [field("fault-members").value.trim(), until ? `until = ${until}` : ""].filter((part) => part !== "");
    send("scenario", `[[fault]]\nconnection = ${quoted(field("fault-input").value)}\n${field("fault-kind").value} = { ${members.join(", ")} }\n`);
  });
  field("entries").addEventListener("submit", (event) => {
    event.preventDefault();
    send("scenario", field("text").value);
  });

  choose();
  document.body.dataset.ready = "true";
  ask();
})();
