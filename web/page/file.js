// Shows a results file: a list of its variables, and plots of the chosen ones. Loaded when the first file is dropped.
const MOST_AT_FIRST = 6; // plots

let reader = null; // the worker
let shown = null; // {axis, plots, times, redraw}

// Asks the worker; `progress` gets parts from 0 to 1.
function ask(message, progress = () => {}) {
  return new Promise((done, failed) => {
    reader.onmessage = ({ data }) => {
      if (data.kind === "progress") progress(data.part);
      else if (data.kind === "refused") failed(new Error(data.text));
      else done(data);
    };
    reader.onerror = (error) => failed(new Error(error.message));
    reader.postMessage(message);
  });
}

// One question after the other.
let last = Promise.resolve();
function read(name) {
  const answer = last.then(() => ask({ kind: "read", name }));
  last = answer.catch(() => {});
  return answer;
}

export async function showFile(file, place, status) {
  const say = (text, bad = false) => Object.assign(status, { textContent: text, className: bad ? "bad" : "" });
  reader?.terminate();
  last = Promise.resolve(); // the answers to what was asked before do not come
  reader = new Worker("file-worker.js", { type: "module" });
  for (const { plot } of shown?.plots.values() ?? []) plot?.remove();
  shown = null;
  place.replaceChildren();
  say(`${file.name}: reading …`);
  let answer;
  try {
    answer = await ask({ kind: "open", file }, (part) => say(`${file.name}: ${Math.round(100 * part)} % read …`));
  } catch (error) {
    say(`${file.name}: ${error.message}`, true);
    return;
  }
  const { names, units, time } = answer;
  const times = new Column((await read(time)).values, answer.count);
  const plots = new Map(); // name to its element and plot
  const axis = thinnedAxis("file", () => [...plots.values()].flatMap(({ plot }) => plot ?? []));
  const figures = document.createElement("div");
  shown = { plots, times, redraw };

  function draw(name) {
    const entry = plots.get(name);
    const label = units[name] ? `${name} in ${units[name]}` : name;
    entry.plot = new TimePlot(axis, entry.element, times, [{ label, ink: "--ink-1", column: entry.column }]);
  }

  function redraw() {
    for (const [name, { plot, column }] of plots) {
      plot?.remove();
      if (column) draw(name);
    }
  }

  async function choose(name, isChosen) {
    if (!isChosen) {
      plots.get(name)?.plot?.remove();
      plots.get(name)?.element.remove();
      plots.delete(name);
      return;
    }
    const element = document.createElement("div");
    element.className = "figure";
    element.tabIndex = 0;
    element.setAttribute("role", "group");
    element.setAttribute("aria-label", `${name} over time; arrow keys move the cursor, plus and minus zoom, 0 shows everything`);
    figures.append(element);
    plots.set(name, { element });
    try {
      const { values } = await read(name);
      if (plots.get(name)?.element !== element) return;
      // No place of a plot is infinite: a gap.
      plots.get(name).column = new Column(values.map((value) => (Number.isFinite(value) ? value : NaN)), values.length);
      draw(name);
    } catch (error) {
      say(`${file.name}, ${name}: ${error.message}`, true);
    }
  }

  // The variables, with a filter; names that have its text are shown.
  const filter = document.createElement("input");
  filter.type = "search";
  filter.placeholder = "filter";
  filter.setAttribute("aria-label", "Show variables whose name has this text");
  const choice = document.createElement("div");
  choice.className = "choice";
  choice.tabIndex = 0;
  choice.setAttribute("role", "group");
  choice.setAttribute("aria-label", "Variables to draw");
  const boxes = names.map((name, k) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    Object.assign(box, { type: "checkbox", checked: k < MOST_AT_FIRST });
    box.addEventListener("change", () => choose(name, box.checked));
    label.append(box, ` ${name}`);
    return label;
  });
  choice.append(...boxes);
  filter.addEventListener("input", () => boxes.forEach((label, k) => {
    label.hidden = !names[k].toLowerCase().includes(filter.value.toLowerCase());
  }));
  place.append(filter, choice, figures);
  const drawn = Math.min(names.length, MOST_AT_FIRST);
  say(`${file.name}: ${times.count} rows, ${names.length} variables${drawn < names.length ? `; ${drawn} are drawn, choose others below` : ""}.${answer.remark}`);
  for (const name of names.slice(0, MOST_AT_FIRST)) await choose(name, true);
  place.dataset.shown = file.name;
}

export const redraw = () => shown?.redraw();

// The numbers of a variable of the file that is shown.
export const values = async (name) => (await read(name)).values;
