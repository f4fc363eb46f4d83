"use strict";
// The page: controls, the drawing of the pendulum, the messages of the workers.
(() => {
  const id = (name) => document.getElementById(name);
  const element = (kind, words = {}, ...children) => {
    const node = Object.assign(document.createElement(kind), words);
    node.append(...children);
    return node;
  };
  const seconds = (value) => Number(value.toFixed(6));
  const say = (text, bad = false) => {
    id("status").textContent = text;
    id("status").className = bad ? "bad" : "";
  };
  if (typeof Worker === "undefined" || typeof WebAssembly === "undefined") {
    say("This browser has no Web Workers or no WebAssembly, which the simulation needs.", true);
    return;
  }
  if (location.protocol === "file:") {
    say("Browsers start no simulation from a file. Serve the folder: python3 -m http.server", true);
    return;
  }
  // In the book, this page is in the folder paper.
  id("book").hidden = !/\/paper\/(index\.html)?$/.test(location.pathname);

  const worker = new Worker("worker.js");
  const follower = new Worker("worker.js"); // the cart without compensation
  let { values, changes: plan, left } = fromLink(location.hash);
  let begun = { ...values }; // the values with which the run started
  let gains = "";
  let changes = []; // {variable, at, value} during the run
  let number = 0; // of the run
  let state = "starting"; // "ready", "running", "ended" or "refused"
  let isToRun = false; // once it is started
  let every = 10; // communication steps between two rows
  let time = 0;
  let last = null; // the newest row
  let fresh = false;
  const plots = runPlots(() => [begun.t_on, ...changes.filter(({ variable }) => variable !== "plant.f_a").map(({ at }) => at)]);

  // --- Settings ---

  for (const field of FIELDS) {
    if (field.part) id(`${field.part}-fields`).append(fieldElement(field));
    const input = id(`set-${field.id}`);
    input.addEventListener("change", () => edit(field, input.type === "checkbox" ? input.checked : input.value.trim()));
  }

  function fieldElement(field) {
    const input = element("input", { id: `set-${field.id}`, type: typeof field.value === "boolean" ? "checkbox" : "text" });
    const error = element("p", { id: `error-${field.id}`, className: "error", hidden: true });
    input.setAttribute("aria-errormessage", error.id);
    input.setAttribute("aria-describedby", error.id);
    if (input.type === "checkbox") return element("div", { className: "field" }, element("label", {}, input, ` ${field.label}`), error);
    if (field.list) input.className = "list";
    else input.inputMode = "decimal";
    const bar = element("div", { className: "bar" }, input, element("span", { textContent: field.unit ?? "" }));
    if (field.slide) {
      const [min, max, step] = field.slide;
      const slider = element("input", { type: "range", id: `slide-${field.id}`, min, max, step });
      slider.setAttribute("aria-label", `${field.label}, slider`);
      slider.addEventListener("input", () => { input.value = slider.value; });
      slider.addEventListener("change", () => edit(field, slider.value));
      bar.append(slider);
    }
    return element("div", { className: "field" }, element("label", { htmlFor: input.id, textContent: field.label }), bar, error);
  }

  function showError(field, text) {
    const [input, error] = [id(`set-${field.id}`), id(`error-${field.id}`)];
    if (text) input.setAttribute("aria-invalid", "true");
    else input.removeAttribute("aria-invalid");
    if (error) Object.assign(error, { textContent: text, hidden: !text });
  }

  // Shows the values, in place of texts that were refused.
  function fill() {
    for (const field of FIELDS) {
      const input = id(`set-${field.id}`);
      if (typeof field.value === "boolean") input.checked = values[field.id];
      else input.value = values[field.id];
      if (field.slide) id(`slide-${field.id}`).value = values[field.id];
      showError(field, "");
    }
    showActing();
    showPreset();
  }

  function refuse(field, text) {
    showError(field, text);
    say(text, true);
  }

  function edit(field, text) {
    try {
      values = changed(values, field, text);
    } catch (error) {
      refuse(field, error.message);
      return;
    }
    const texts = FIELDS.filter((other) => other !== field && id(`set-${other.id}`).getAttribute("aria-invalid"));
    showError(field, "");
    if (field.slide) id(`slide-${field.id}`).value = values[field.id];
    if (id("status").className === "bad" && texts.length === 0) say("");
    if (field.at === "begin") restart(state === "running" || isToRun);
    else if (field.variable) set(field.variable, values[field.id]);
    showActing();
    showPreset();
    write();
  }

  // Sets a variable now; the worker answers with the time. The changes of a link after it no longer apply.
  function set(variable, value) {
    if (state === "refused") return;
    if (plan.some(({ at }) => at > time)) say(`The later changes of the link are left out: you changed the run at t = ${time.toFixed(2)} s.`);
    plan = [];
    worker.postMessage({ kind: "set", line: `${variable}=${value}` });
  }

  // The value that a variable has at the present time of the run.
  function present(field) {
    return changes.findLast(({ variable }) => variable === field.variable)?.value ?? begun[field.id];
  }

  // The link and the system.toml: the values at the start, the changes so far and those that a link still plans.
  function write() {
    const all = [...changes, ...plan.filter(({ at }) => at > (changes.at(-1)?.at ?? -1))];
    const { link, without } = permalink({ ...begun, push: values.push }, all);
    history.replaceState(null, "", link === "#" ? location.pathname : link);
    id("link").href = link;
    id("link-text").textContent = without > 0 ? `It leaves out the ${without} changes made during the run: they are too many for a link.`
      : all.length > 0 ? `It restores the ${all.length} changes made during the run, too.` : "";
    id("native").textContent = systemToml(begun, gains, changes);
  }

  // What the experiment is that has these values.
  function showPreset() {
    id("preset-text").textContent = PRESETS.find((preset) => FIELDS.every((field) => ["compensate", "push", "stop"].includes(field.id)
      || values[field.id] === (preset.values[field.id] ?? field.value)))?.text ?? "";
  }

  function showActing() {
    id("acting").textContent = !values.compensate ? "off" : time < begun.t_on ? `from t_on = ${begun.t_on} s` : "acts";
  }

  // --- The run ---

  function restart(go, moves = []) {
    number += 1;
    begun = { ...values };
    [changes, plan, isToRun, time, last, pushed] = [[], moves, go, 0, null, 0];
    rms = { next: 0, sum: 0, count: 0 };
    plots.clear();
    showState("starting");
    say("Starting …");
    worker.postMessage({
      kind: "start", number, settings: lines(values), ...observer(values), step: values.step, stop: values.stop,
      plan: moves.map(({ variable, at, value }) => ({ at, line: `${variable}=${value}` })),
    });
  }

  function showState(next) {
    state = next;
    id("play").textContent = state === "running" ? "Pause" : "Run";
  }

  const run = () => worker.postMessage({ kind: "run", speed: Number(id("speed").value) });

  // Starts the second run, up to the time of the first.
  function follow() {
    follower.postMessage({
      kind: "start", number, settings: `${lines(begun)}\ncontroller.compensate=false`, eigenvalues: null, gains, step: begun.step, stop: begun.stop, plan: [],
    });
    for (const change of changes) followChange(change);
    follower.postMessage({ kind: "until", at: time });
  }

  function followChange({ variable, at, value }) {
    follower.postMessage({ kind: "until", at });
    if (variable !== "controller.compensate") follower.postMessage({ kind: "set", line: `${variable}=${value}` });
  }

  id("play").addEventListener("click", () => {
    if (state === "running") {
      worker.postMessage({ kind: "pause" });
      showState("ready");
      say("Paused.");
    } else if (state === "ready") run();
    else restart(true);
  });
  id("speed").addEventListener("change", () => state === "running" && run());
  id("step").addEventListener("click", () => {
    if (state === "ended" || state === "refused") {
      say(state === "ended" ? `The run has ended at t = ${seconds(time)} s. Restart starts it again.` : "There is no run: a setting was refused.", state === "refused");
      return;
    }
    worker.postMessage({ kind: "step" });
    showState("ready");
    say(`One step of ${every} communication points.`);
  });
  id("back").addEventListener("click", () => worker.postMessage({ kind: "back" }));
  id("restart").addEventListener("click", () => {
    fill();
    restart(false);
    write();
  });
  const load = (next) => {
    values = { ...DEFAULTS, ...next, push: values.push };
    fill();
    restart(true);
    write();
  };
  id("defaults").addEventListener("click", () => {
    values = { ...DEFAULTS };
    fill();
    restart(false);
    write();
  });
  for (const preset of PRESETS) {
    const button = element("button", { type: "button", textContent: preset.label });
    button.addEventListener("click", () => load(preset.values));
    id("presets").append(button);
  }

  // --- The tour ---

  const TOUR = [
    ["A controller balances the pendulum, but friction holds the cart until the force breaks it loose: it sticks and jumps and never comes to rest.", "scene"],
    ["The observer sees only x_p and theta, yet its estimate of the friction lies on the friction itself, before anybody uses it.", "force"],
    ["From t = 40 s on the controller adds the estimate to its command; this switch turns that on and off at any time.", "acting"],
    ["The friction acts as before, but the cart now stays within 1 mm; the dashed cart, without compensation, jumps on.", "motion"],
    ["Now break it: choose another experiment, push the cart, or change the friction below.", "presets"],
  ];
  let place = 0;
  function tour(next) {
    id(TOUR[place][1]).classList.remove("here");
    place = (next + TOUR.length) % TOUR.length;
    id("tour").textContent = `${place + 1} of ${TOUR.length}. ${TOUR[place][0]}`;
    id("tour-next").textContent = place + 1 < TOUR.length ? "Next" : "Again";
    id("tour-back").disabled = place === 0;
  }
  for (const [name, by] of [["tour-back", -1], ["tour-next", 1]]) {
    id(name).addEventListener("click", () => {
      tour(place + by);
      id(TOUR[place][1]).classList.add("here");
    });
  }
  tour(0);
  for (const sign of document.querySelectorAll("math mo")) sign.setAttribute("stretchy", "false");

  // --- Pushes ---

  let pushed = 0;
  function push(force) {
    if (force !== 0 && state !== "running") say("A push acts while the run goes on.");
    else if (force !== pushed) {
      pushed = force;
      if (state !== "ended") set("plant.f_a", force);
    }
  }
  for (const [name, sign] of [["left", -1], ["right", 1]]) {
    const button = id(name);
    const begin = () => push(sign * values.push);
    const end = () => push(0);
    button.addEventListener("pointerdown", begin);
    for (const event of ["pointerup", "pointerleave", "blur"]) button.addEventListener(event, end);
    button.addEventListener("keydown", (event) => {
      if (event.key === " " || event.key === "Enter") begin();
    });
    button.addEventListener("keyup", end);
  }
  const scene = id("scene");
  scene.addEventListener("pointerdown", (event) => {
    scene.setPointerCapture(event.pointerId);
    const from = event.clientX;
    const move = (now) => push(Math.round(Math.max(-1, Math.min(1, (now.clientX - from) / 120)) * values.push));
    const end = () => {
      push(0);
      scene.removeEventListener("pointermove", move);
    };
    scene.addEventListener("pointermove", move);
    scene.addEventListener("pointerup", end, { once: true });
    scene.addEventListener("pointercancel", end, { once: true });
  });

  // --- The drawing ---

  for (let at = -1; at <= 1.001; at += 0.1) {
    const mark = document.createElementNS("http://www.w3.org/2000/svg", "line");
    for (const [name, value] of Object.entries({ x1: at, x2: at, y1: 0.16, y2: 0.175 })) mark.setAttribute(name, value);
    id("marks").append(mark);
  }

  function showRow(row) {
    last = row;
    time = row[0];
    fresh = true;
  }

  function showCart(name, x, theta, centre) {
    id(name).setAttribute("transform", `translate(${x - centre} 0)`);
    id(name).querySelector("g").setAttribute("transform", `rotate(${(theta * 180) / Math.PI} 0 0.03)`);
  }

  const quantity = (value, unit, places) => `${(Number(value.toFixed(places)) + 0).toFixed(places).replace("-", "−")} ${unit}`;
  function draw(now) {
    if (fresh && last) {
      fresh = false;
      const [t, x, theta, , , force, regime, u, estimate] = last;
      const centre = Math.round(x / 2) * 2; // the rail goes on
      showCart("cart", x, theta, centre);
      const { x_p: ghost, theta: lean } = plots.ghost;
      if (ghost.count > 0) showCart("ghost", ghost.values[ghost.count - 1], lean.values[ghost.count - 1], centre);
      id("friction").setAttribute("x2", -force / 100);
      id("estimate").setAttribute("x2", -estimate / 100);
      const fallen = Math.abs(theta) > Math.PI / 2 ? "; the pendulum has fallen" : "";
      const motion = `the cart ${regime === 0 ? "sticks" : "slips"}${fallen}`;
      id("clock").textContent = `t = ${t.toFixed(2)} s`;
      id("place").textContent = `x_p = ${quantity(1000 * x, "mm", 2)}, theta = ${quantity(1000 * theta, "mrad", 1)}`;
      id("regime").textContent = motion;
      id("now-friction").textContent = `f_fric = ${quantity(force, "N", 2)}: ${motion}`;
      id("now-estimate").textContent = `f_hat = ${quantity(estimate, "N", 2)}, f_fric − f_hat = ${quantity(force - estimate, "N", 2)}`;
      id("now-command").textContent = `u = ${quantity(u, "N", 2)}`;
      showActing();
      plots.show();
      if (state === "ended" || now - shown > 500) claims(now);
    }
    requestAnimationFrame(draw);
  }

  // --- The claims ---

  let shown = 0; // when the claims were shown last, in ms
  let rms = { next: 0, sum: 0, count: 0 };

  // Half of peak to peak between two times; null before there are rows.
  function amplitude(column, from, until) {
    const times = plots.rows.time;
    const [first, after] = [times.find(from), times.find(until + 1e-9)];
    if (after - first < 2) return null;
    const [least, greatest] = column.extremes(first, after);
    return (column.values[greatest] - column.values[least]) / 2;
  }

  // The root of the mean square of f_fric - f_hat after a time.
  function error(from) {
    const { time: times, f_fric: friction, f_hat: estimate } = plots.rows;
    if (rms.next > times.count) rms = { next: 0, sum: 0, count: 0 };
    for (rms.next = Math.max(rms.next, times.find(from)); rms.next < times.count; rms.next += 1) {
      rms.sum += (friction.values[rms.next] - estimate.values[rms.next]) ** 2;
      rms.count += 1;
    }
    return rms.count > 1 ? Math.sqrt(rms.sum / rms.count) : null;
  }

  function claims(now) {
    shown = now;
    const { x_p: x, theta } = plots.rows;
    const [early, on, late] = [begun.t_on / 4, begun.t_on, begun.t_on + 20];
    const [cart, lean] = [amplitude(x, late, Infinity), amplitude(theta, late, Infinity)];
    const before = `${early} to ${on} s`;
    const after = `t > ${late} s`;
    const figure = (value, digits, unit) => (value === null ? null : `${Number(value.toPrecision(digits))} ${unit}`);
    const rows = [
      [`limit cycle of the cart, ${before}`, "a limit cycle", figure(amplitude(x, early, on), 4, "m")],
      [`limit cycle of the pendulum, ${before}`, "a limit cycle", figure(amplitude(theta, early, on), 3, "rad")],
      [`cart after compensation, ${after}`, "below 1 mm", figure(cart && 1000 * cart, 3, "mm"), cart < 0.001],
      [`pendulum after compensation, ${after}`, "below 2 mrad", figure(lean && 1000 * lean, 3, "mrad"), lean < 0.002],
      [`rms of f_fric − f_hat, ${after}`, "accurate", figure(error(late), 2, "N")],
    ];
    id("claims").tBodies[0].replaceChildren(...rows.map(([claim, paper, here, holds]) => {
      const cell = element("td", { textContent: here ?? "–" });
      if (here && holds !== undefined) {
        cell.className = holds ? "holds" : "fails";
        cell.textContent += holds ? " ✓ holds" : " ✗ does not hold";
      }
      return element("tr", {}, element("th", { scope: "row", textContent: claim }), element("td", { textContent: paper }), cell);
    }));
    id("summary").textContent = `Amplitudes are half of the peak-to-peak value.${cart === null ? "" : ` After compensation (${after}) the amplitude of x_p is ${rows[2][2]}, that of theta ${rows[3][2]}.`}`;
  }

  // --- Messages ---

  const answers = {
    started(data) {
      [gains, every] = [data.gains, data.every];
      showState("ready");
      follow();
      write();
      if (left.length > 0) say(`Not restored from the link: ${left.join("; ")}`, true);
      else if (isToRun) run();
      else say("Ready.");
      left = [];
      isToRun = false;
      document.body.dataset.ready = "true";
    },
    running() {
      showState("running");
      if (!id("status").textContent.startsWith("The later changes")) say("Running.");
    },
    rows(data) {
      plots.add(data.rows);
      showRow(data.rows.slice(-ROW.length));
      follower.postMessage({ kind: "until", at: time });
    },
    set(data) {
      const [variable, text] = data.line.split("=");
      const value = JSON.parse(text);
      const change = { variable, at: data.at, value };
      changes.push(change);
      followChange(change);
      const field = FIELDS.find((known) => known.variable === variable);
      if (field && values[field.id] !== value) { // of a link
        values = { ...values, [field.id]: value };
        fill();
      }
      write();
    },
    back(data) {
      showState("ready");
      showRow(plots.cut(data.at));
      changes = changes.filter(({ at }) => at < data.at);
      if (plan.length === 0) { // nobody presses a button
        pushed = present({ variable: "plant.f_a" }) ?? 0;
        push(0);
      }
      for (const field of FIELDS.filter(({ at, variable }) => at === "now" && variable)) values = { ...values, [field.id]: present(field) };
      rms.next = Infinity;
      for (const column of Object.values(plots.ghost)) column.cut(0);
      follow();
      fill();
      write();
      say(`Back at t = ${data.at.toFixed(2)} s.`);
    },
    stopped(data) {
      showState("ended");
      say(`The run ended at t = ${seconds(time)} s after ${(data.spent / 1000).toFixed(2)} s of computation.`);
      fresh = true;
      document.body.dataset.spent = data.spent;
    },
    // A setting before the run, or a change during it; then the run goes on.
    refused(data) {
      const field = FIELDS.find(({ id: name, variable }) => name === data.setting || (data.line && variable === data.line.split("=")[0]));
      if (data.setting !== undefined) {
        showState("refused");
        isToRun = false;
        document.body.dataset.ready = "true";
      } else if (field) {
        values = { ...values, [field.id]: present(field) };
      }
      if (field) refuse(field, data.text);
      else say(data.text, true);
    },
    failed(data) {
      showState("ended");
      say(time > 0 ? `The run ended at t = ${seconds(time)} s: ${data.text}` : data.text, true);
    },
  };
  worker.onmessage = ({ data }) => {
    if (data.kind === "ready") {
      follower.postMessage({ kind: "load", module: data.module });
      fill();
      claims(0);
      restart(left.length === 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches, plan);
    } else if (data.run === number || data.run === undefined) answers[data.kind](data);
  };
  follower.onmessage = ({ data }) => {
    if (data.kind === "rows" && data.run === number) {
      plots.follow(data.rows);
      fresh = true;
    }
  };
  worker.onerror = (error) => {
    showState("ended");
    say(`The worker failed: ${error.message}`, true);
  };
  worker.postMessage({ kind: "load" });

  // --- Files ---

  // The rows in parts, so that no string is longer than a browser allows.
  function csvParts() {
    const names = ["time", "plant.x_p", "plant.theta", "plant.v_p", "plant.omega", "plant.f_fric", "plant.regime", "controller.u", "controller.f_hat"];
    const columns = ROW.map((name) => plots.rows[name]);
    const parts = [`${names.join(",")}\n`];
    for (let from = 0; from < columns[0].count; from += 10000) {
      let part = "";
      for (let k = from; k < Math.min(from + 10000, columns[0].count); k += 1) part += `${columns.map(({ values: numbers }) => numbers[k]).join(",")}\n`;
      parts.push(part);
    }
    return parts;
  }
  id("save").addEventListener("click", () => {
    const link = element("a", { href: URL.createObjectURL(new Blob(csvParts(), { type: "text/csv" })), download: "paper.csv" });
    link.click();
    URL.revokeObjectURL(link.href);
  });
  id("copy").addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(id("native").textContent);
      say("Copied.");
    } catch {
      getSelection().selectAllChildren(id("native"));
      say("Selected; copy it with the keyboard.");
    }
  });
  let file = null; // the module that shows files
  const show = async (chosen) => {
    if (!chosen) return;
    try {
      file ??= await import("./file.js");
      await file.showFile(chosen, id("dropped"), id("file-status"));
    } catch (failure) {
      Object.assign(id("file-status"), { textContent: `${chosen.name}: ${failure.message}`, className: "bad" });
    }
  };
  id("file").addEventListener("change", () => show(id("file").files[0]));
  // The same file can be chosen again, when it is written anew; Firefox keeps the file when the page is loaded again.
  id("file").addEventListener("click", () => { id("file").value = ""; });
  show(id("file").files[0]);
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    id("file-title").scrollIntoView();
    show(event.dataTransfer.files[0]);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    plots.redraw();
    file?.redraw();
  });
  addEventListener("hashchange", () => {
    ({ values, changes: plan, left } = fromLink(location.hash));
    fill();
    restart(left.length === 0 && state === "running", plan);
  });
  window.paper = {
    csv: () => csvParts().join("").trimEnd(),
    get rows() {
      return ROW.map((name) => plots.rows[name].values.subarray(0, plots.rows[name].count));
    },
    get ghost() {
      return ROW.map((name) => plots.ghost[name].values.subarray(0, plots.ghost[name].count));
    },
  };
  requestAnimationFrame(draw);
})();
