"use strict";
// The page: controls, the drawing of the pendulum, the messages of the worker.
(() => {
  const id = (name) => document.getElementById(name);
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

  const worker = new Worker("worker.js");
  const plots = runPlots();
  let { values, left } = fromLink(location.hash);
  let begun = { ...values }; // the values with which the run started
  let gains = "";
  let changes = []; // {variable, at, value} during the run
  let running = false;
  let time = 0;
  let last = null; // the newest row
  let fresh = false;

  // --- Settings ---

  for (const field of FIELDS) {
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.id = `set-${field.id}`;
    input.type = typeof field.value === "boolean" ? "checkbox" : "text";
    if (input.type === "text" && !field.list) input.inputMode = "decimal";
    const unit = field.unit ? ` in ${field.unit}` : "";
    label.append(`${field.label}${unit} `, input);
    if (input.type === "checkbox") label.replaceChildren(input, ` ${field.label}`);
    id(field.at).append(label);
    input.addEventListener("change", () => changed(field, input));
  }

  function fill() {
    for (const field of FIELDS) {
      if (typeof field.value === "boolean") id(`set-${field.id}`).checked = values[field.id];
      else id(`set-${field.id}`).value = values[field.id];
    }
  }

  function changed(field, input) {
    try {
      values[field.id] = checked(field, input.type === "checkbox" ? input.checked : input.value.trim());
    } catch (error) {
      input.setAttribute("aria-invalid", "true");
      say(error.message, true);
      return;
    }
    input.removeAttribute("aria-invalid");
    if (field.at === "begin") restart(running);
    else if (field.variable) set(field.variable, values[field.id]);
    told();
  }

  // Sets a variable now; the worker answers with the time.
  function set(variable, value) {
    worker.postMessage({ kind: "set", settings: [`${variable}=${value}`] });
  }

  // The value that a variable had at the present time of the run.
  function had(field) {
    const made = changes.filter(({ variable }) => variable === field.variable);
    return made.length > 0 ? made[made.length - 1].value : begun[field.id];
  }

  function told() {
    const link = permalink(values);
    history.replaceState(null, "", link === "#" ? location.pathname : link);
    id("link").href = link;
    id("native").textContent = systemToml(begun, gains, changes);
  }

  // --- The run ---

  function restart(go) {
    begun = { ...values };
    changes = [];
    time = 0;
    last = null;
    plots.clear();
    worker.postMessage({ kind: "start", settings: lines(values), eigenvalues: placed(values), step: values.step, stop: values.stop });
    if (go) run();
    else stopped("Ready.");
  }

  function run() {
    running = true;
    id("play").textContent = "Pause";
    say("Running.");
    worker.postMessage({ kind: "run", speed: Number(id("speed").value) });
  }

  function stopped(text, bad = false) {
    running = false;
    id("play").textContent = "Run";
    say(text, bad);
  }

  id("play").addEventListener("click", () => {
    if (running) {
      worker.postMessage({ kind: "pause" });
      stopped("Paused.");
    } else {
      if (last && time >= begun.stop - 1e-9) restart(false);
      run();
    }
  });
  id("speed").addEventListener("change", () => running && run());
  id("step").addEventListener("click", () => {
    worker.postMessage({ kind: "step" });
    stopped("One step of ten communication points.");
  });
  id("back").addEventListener("click", () => {
    worker.postMessage({ kind: "back" });
    stopped("Back.");
  });
  id("restart").addEventListener("click", () => restart(false));
  id("defaults").addEventListener("click", () => {
    values = { ...DEFAULTS };
    fill();
    restart(false);
    told();
  });

  // --- Pushes ---

  let pushed = 0;
  function push(force) {
    if (force === pushed || !running) return;
    pushed = force;
    set("plant.f_a", force);
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

  for (let place = -1; place <= 1.001; place += 0.1) {
    const mark = document.createElementNS("http://www.w3.org/2000/svg", "line");
    for (const [name, value] of Object.entries({ x1: place, x2: place, y1: 0.16, y2: 0.175 })) mark.setAttribute(name, value);
    id("marks").append(mark);
  }

  function showRow(row) {
    last = row;
    time = row[0];
    fresh = true;
  }

  const REGIMES = { 0: "sticks" };
  function draw() {
    if (fresh && last) {
      fresh = false;
      const [t, x, theta, , , force, regime, u, estimate] = last;
      const centre = Math.round(x / 2) * 2; // the rail goes on
      id("cart").setAttribute("transform", `translate(${x - centre} 0)`);
      id("rod").setAttribute("transform", `rotate(${(theta * 180) / Math.PI} 0 0.03)`);
      id("friction").setAttribute("x2", -force / 100);
      id("estimate").setAttribute("x2", -estimate / 100);
      id("clock").textContent = `t = ${t.toFixed(2)} s`;
      id("place").textContent = `x_p = ${(1000 * x).toFixed(2)} mm, theta = ${theta.toFixed(4)} rad`;
      id("forces").textContent = `f_fric = ${force.toFixed(2)} N, f_hat = ${estimate.toFixed(2)} N, u = ${u.toFixed(2)} N`;
      const fallen = Math.abs(theta) > Math.PI / 2 ? "; the pendulum has fallen" : "";
      id("regime").textContent = `the cart ${REGIMES[regime] ?? "slips"}${fallen}`;
      plots.show();
    }
    requestAnimationFrame(draw);
  }

  // The figures that the paper states, of the rows so far.
  function summary() {
    const [times, x] = [plots.rows[0], plots.rows[1]];
    const span = (from, until) => {
      const part = x.filter((_, k) => times[k] >= from && times[k] <= until);
      return part.length > 1 ? 1000 * (Math.max(...part) - Math.min(...part)) : null;
    };
    const end = times[times.length - 1];
    const on = Math.min(begun.t_on, end);
    const parts = [[on / 2, on, "before compensation"], [Math.max(on, end - 20), end, "in the last 20 s"]];
    const found = parts.map(([from, until, when]) => [span(from, until), when]).filter(([size]) => size !== null);
    id("summary").textContent = found.map(([size, when]) => `x_p moves within ${size.toFixed(4)} mm ${when}`).join("; ");
  }

  worker.onmessage = ({ data }) => {
    const did = {
      ready() {
        fill();
        restart(false);
        told();
        if (left.length > 0) say(`Not taken from the link: ${left.join("; ")}`, true);
        document.body.dataset.ready = "true";
      },
      started() {
        gains = data.gains;
        plots.clear(); // of rows of the run before that came late
        told();
      },
      rows() {
        plots.add(data.rows);
        showRow(data.rows.slice(-ROW.length));
      },
      set() {
        const [variable, value] = data.line.split("=");
        changes.push({ variable, at: data.at, value: JSON.parse(value) });
        told();
      },
      back() {
        showRow(plots.cut(data.at));
        changes = changes.filter(({ at }) => at < data.at);
        for (const field of FIELDS.filter((known) => known.at === "now" && known.variable)) {
          if (had(field) !== values[field.id]) set(field.variable, values[field.id]);
        }
        told();
      },
      stopped() {
        stopped(`The run ended at ${time} s after ${(data.spent / 1000).toFixed(2)} s of computation.`);
        summary();
        document.body.dataset.spent = data.spent;
      },
      refused() {
        stopped(data.text, true);
      },
      failed() {
        stopped(data.text, true);
      },
    };
    did[data.kind]();
  };
  worker.onerror = (error) => stopped(`The worker failed: ${error.message}`, true);

  // --- Files ---

  function csv() {
    const names = ["time", "plant.x_p", "plant.theta", "plant.v_p", "plant.omega", "plant.f_fric", "plant.regime", "controller.u", "controller.f_hat"];
    return [names.join(","), ...plots.rows[0].map((_, k) => plots.rows.map((column) => column[k]).join(","))].join("\n");
  }
  id("save").addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${csv()}\n`], { type: "text/csv" }));
    link.download = "paper.csv";
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
  const show = async (file) => file && say(await showFile(file, id("dropped")));
  id("file").addEventListener("change", () => show(id("file").files[0]));
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    show(event.dataTransfer.files[0]);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.redraw());
  addEventListener("hashchange", () => {
    ({ values, left } = fromLink(location.hash));
    fill();
    restart(false);
    told();
  });
  window.paper = { csv, rows: plots.rows };
  requestAnimationFrame(draw);
})();
