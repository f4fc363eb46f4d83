"use strict";
// Plots of a run as it grows, and of a results file.

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// A plot of `curves` ({label, ink}) over time, with the horizontal axis `horizontal`; `data`: [times, ...values].
function linePlot(horizontal, place, unit, curves, data) {
  const axis = { stroke: colour("--text"), grid: { stroke: colour("--grid") }, ticks: { stroke: colour("--grid") } };
  const digits = (self, value) => (value === null || value === undefined ? "–" : Number(value.toPrecision(6)).toString());
  const options = {
    width: Math.max(place.clientWidth, 200),
    height: 220,
    scales: { x: { time: false } },
    axes: [{ ...axis, label: "time in s", labelSize: 22 }, { ...axis, size: 70, label: unit || undefined }],
    series: [
      { label: "t in s", value: digits },
      ...curves.map(({ label, ink }) => ({ label, stroke: colour(`--ink-${ink}`), width: 1.5, points: { show: false }, value: digits })),
    ],
  };
  const plot = horizontal.plot(options, data, place);
  new ResizeObserver(() => plot.setSize({ width: Math.max(place.clientWidth, 200), height: 220 })).observe(place);
  return plot;
}

const ROW = ["time", "x_p", "theta", "v_p", "omega", "f_fric", "regime", "u", "f_hat"];

// The three plots of a run.
function runPlots() {
  const kinds = [
    ["motion", "m, rad", [["x_p", "cart position x_p in m"], ["theta", "pendulum angle theta in rad"]]],
    ["force", "N", [["f_fric", "friction force f_fric in N"], ["f_hat", "estimate f_hat in N"]]],
    ["command", "N", [["u", "command u in N"]]],
  ];
  const rows = ROW.map(() => []);
  const horizontal = new GrowingAxis("run");
  const draw = () => kinds.map(([id, unit, curves]) => {
    const place = document.getElementById(id);
    place.replaceChildren();
    const data = [rows[0], ...curves.map(([name]) => rows[ROW.indexOf(name)])];
    return linePlot(horizontal, place, unit, curves.map(([, label], k) => ({ label, ink: k + 1 })), data);
  });
  let plots = draw();
  return {
    rows,
    clear() {
      for (const column of rows) column.length = 0;
      this.show();
    },
    // Drops the rows after `time`; returns the last one that stays.
    cut(time) {
      const first = rows[0].findIndex((value) => value > time);
      if (first >= 0) for (const column of rows) column.length = first;
      return rows.map((column) => column.at(-1));
    },
    add(numbers) {
      for (let k = 0; k < numbers.length; k += 1) rows[k % ROW.length].push(numbers[k]);
    },
    show() {
      for (const [k, [, , curves]] of kinds.entries()) {
        horizontal.update(plots[k], [rows[0], ...curves.map(([name]) => rows[ROW.indexOf(name)])]);
      }
    },
    redraw() {
      for (const plot of plots) horizontal.remove(plot);
      plots = draw();
    },
  };
}

// Reads a results file in CSV: a header, rows of numbers, the first column is the time.
function parseCsv(text) {
  const all = text.split(/\r?\n/).filter((line) => line.trim() !== "");
  // A comma inside of quotes is part of a name.
  const cells = (line) => (line.match(/("([^"]|"")*"|[^,]*)(,|$)/g) ?? []).slice(0, -1)
    .concat([]).map((cell) => cell.replace(/,$/, "").trim().replace(/^"|"$/g, "").replace(/""/g, '"'));
  const names = cells(`${all[0]},`);
  if (names.length < 2 || all.length < 2) throw new Error("expected a header with time and variables, and rows of numbers");
  const columns = names.map(() => []);
  const word = { true: 1, false: 0 };
  all.slice(1).forEach((line, k) => {
    const values = cells(`${line},`);
    if (values.length !== names.length) throw new Error(`line ${k + 2}: expected ${names.length} values, found ${values.length}`);
    values.forEach((value, j) => columns[j].push(value === "" ? null : word[value] ?? Number(value)));
  });
  if (columns[0].some((value) => value === null || Number.isNaN(value))) throw new Error(`the column "${names[0]}" is not a time`);
  return { names, columns: columns.map((column) => column.map((value) => (Number.isNaN(value) ? null : value))) };
}

// Reads a results file in Parquet, as parseCsv; variables that are no numbers are left out.
async function parseParquet(bytes) {
  const { parquetReadObjects } = await import("./hyparquet.min.js");
  const all = await parquetReadObjects({ file: bytes });
  if (all.length === 0) throw new Error("expected rows, found none");
  const plain = (value) => ["number", "bigint", "boolean"].includes(typeof value);
  const names = Object.keys(all[0]).filter((name, k) => k === 0 || all.some((row) => plain(row[name])));
  const columns = names.map((name) => all.map((row) => (plain(row[name]) ? Number(row[name]) : null)));
  if (names.length < 2) throw new Error("expected a column of times and variables that are numbers");
  if (columns[0].includes(null)) throw new Error(`the column "${names[0]}" is not a time`);
  return { names, columns };
}

// Shows a results file below `place`; answers with a sentence.
async function showFile(file, place) {
  place.replaceChildren();
  let table;
  try {
    table = file.name.endsWith(".parquet") ? await parseParquet(await file.arrayBuffer()) : parseCsv(await file.text());
  } catch (error) {
    return `${file.name}: ${error.message}`;
  }
  const most = 12;
  const shown = table.names.slice(1, 1 + most);
  const horizontal = new GrowingAxis("file");
  shown.forEach((name, k) => {
    const figure = document.createElement("div");
    figure.className = "figure";
    figure.setAttribute("role", "img");
    figure.setAttribute("aria-label", `${name} over time`);
    place.append(figure);
    linePlot(horizontal, figure, "", [{ label: name, ink: 1 }], [table.columns[0], table.columns[k + 1]]);
  });
  const left = table.names.length - 1 - shown.length;
  return `${file.name}: ${table.columns[0].length} rows${left > 0 ? `; ${left} more variables are not drawn` : ""}.`;
}
