"use strict";
/* Draws the plots of #data, first those on the screen: the first ones into #figures, the others into #more, where those of
   each FMU are folded and drawn when they are opened. All plots have the same axis of time. */
(async () => {
  const { grids, plots: groups, marks, events, span, columns, command } = JSON.parse(document.getElementById("data").textContent);
  if (!("DecompressionStream" in globalThis)) {
    document.getElementById("figures").textContent = "The plots need a browser of 2023 or later; the tables do not.";
    return;
  }
  const field = (id) => document.getElementById(id);
  const HEIGHT = 220;
  const LEGEND_LINE = 24;
  const COLOURS = { change: "--link", fault: "--bad", intervention: "--good", message: "--warn" };
  const figures = []; /* those that the page has so far */
  const drawn = new Map(); /* by figure: its plot */
  let shown = document.querySelector("[name=shown]:checked")?.value ?? "both"; /* Firefox keeps a choice when a page is loaded again */
  let isPaper = false;

  /* The bytes of a text in base64. */
  function bytes(text) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const signs = atob(text);
    const list = new Uint8Array(signs.length);
    for (let k = 0; signs.length > k; k++) list[k] = signs.charCodeAt(k);
    return list;
  }

  /* The numbers of a column: a block has all first bytes, then all second bytes and so on. */
  async function unpacked({ block, constant }, rows) {
    if (block === undefined) return new Float64Array(rows).fill(constant ?? NaN);
    const stream = new Blob([bytes(block)]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const list = new Uint8Array(8 * rows);
    for (let byte = 0; 8 > byte; byte++) {
      for (let k = 0; rows > k; k++) list[8 * k + byte] = planes[byte * rows + k];
    }
    return new Float64Array(list.buffer);
  }

  const numbers = new Map(); /* by column and number of rows: the promise of its numbers */
  function column(index, rows) {
    const key = `${index} ${rows}`;
    if (!numbers.has(key)) numbers.set(key, unpacked(columns[index], rows));
    return numbers.get(key);
  }

  /* The curves of a plot: those of both runs, or their differences. */
  async function series({ grid, curves }) {
    const { rows } = grids[grid];
    const all = await Promise.all(curves.map(async (curve, ink) => {
      const values = await column(curve.values, rows);
      const other = curve.other === null ? null : await column(curve.other, rows);
      if (shown === "difference") {
        if (other === null) return [];
        /* Infinity minus itself is no number. */
        return [{ ...curve, ink, list: values.map((value, row) => (value === other[row] ? 0 : value - other[row])) }];
      }
      const here = { ...curve, ink, list: values };
      return other === null ? [here] : [here, { ...here, name: `${curve.name}, other run`, list: other, dashed: true }];
    }));
    return all.flat();
  }

  function whole(times) {
    const ends = [...span, ...times.filter((time) => time.length > 0).flatMap((time) => [time[0], time[time.length - 1]])];
    const [low, high] = ends.length > 0 ? [Math.min(...ends), Math.max(...ends)] : [0, 0];
    return high > low ? [low, high] : [low, low + Math.max(1, 1e-9 * Math.abs(low))];
  }

  const times = await Promise.all(grids.map(({ time, rows }) => column(time, rows)));
  const axis = new RowAxis({ name: "time", label: "time in s", short: "t in s", whole: whole(times), changed });

  function changed([low, high]) {
    field("from").value = low;
    field("to").value = high;
    for (const figure of figures) note(figure);
  }

  /* The marks of what happened, for all plots. */
  const lines = [
    ...events.map((x) => ({ x, colour: "--soft", tick: true })),
    ...marks.map(({ kind, time, end }) =>
      ({ x: time, end: end ?? undefined, colour: COLOURS[kind], dash: [3, 3], flag: true, tick: kind === "message" })),
  ];

  /* Says below a plot what happened at the cursor. */
  function say(figure, plot, at) {
    const place = figure.querySelector(".happening");
    if (place === null) return;
    const isNear = (time) => 6 > Math.abs(plot.valToPos(time, "x") - plot.valToPos(at, "x"));
    const near = at === null ? [] : marks.filter(({ time, end }) => isNear(time) || (end !== null && at >= time && end >= at));
    const shown = near.slice(0, 3).map(({ kind, time, text }) => `t = ${time} s, ${kind}: ${text}`);
    place.textContent = [...shown, ...(near.length > 3 ? [`and ${near.length - 3} more`] : [])].join("; ");
  }

  /* Says how many rows a plot does not have, and the command for all rows of the range. */
  function note(figure) {
    const caption = figure.querySelector("figcaption");
    if (caption === null) return;
    const { rows, total } = grids[groups[figure.dataset.group].grid];
    const range = axis.range === null ? "--from START --to END" : `--from ${axis.range[0]} --to ${axis.range[1]}`;
    caption.replaceChildren(
      `This plot has ${rows.toLocaleString("en")} of ${total.toLocaleString("en")} rows: those with the extremes of its curves, as points where rows are missing. All rows of a range: `,
      Object.assign(document.createElement("code"), { textContent: `${command} ${range} --out part.html` }));
  }

  function options(group, all) {
    const names = group.curves.map((curve) => curve.name).join(", ");
    return {
      label: group.unit,
      height: HEIGHT,
      curves: all.map(({ name, ink, holds, dots, dashed }) =>
        ({ name, colour: `--ink-${ink + 1}`, holds, dots, dash: dashed ? [7, 5] : undefined })),
      marks: lines,
      name: `${shown === "difference" ? "Difference of " : ""}${names} over time`,
      scale: isPaper ? 2 : 1,
    };
  }

  /* Draws a plot whose numbers are unpacked. */
  function drawNow(figure) {
    const group = groups[figure.dataset.group];
    const { all } = figure;
    if (drawn.has(figure) || all.length === 0) return;
    const place = figure.querySelector("div");
    const rows = new Rows(times[group.grid], all.map(({ list }) => list), all.map(({ holds }) => holds));
    const { rows: count, total } = grids[group.grid];
    const plot = axis.rowPlot(place, rows, count === total, { ...options(group, all), followed: (self, at) => say(figure, self, at) });
    drawn.set(figure, plot);
    choose(figure);
    place.style.minHeight = "";
    if (!isPaper) axis.place(plot, figure.isNear === true);
  }

  async function draw(figure) {
    const view = shown;
    const all = figure.all ?? await series(groups[figure.dataset.group]);
    if (view !== shown) return;
    figure.all = all;
    choose(figure);
    drawNow(figure);
  }

  /* Keeps the height, so that nothing below moves. */
  function erase(figure) {
    const plot = drawn.get(figure);
    if (plot === undefined) return;
    const place = figure.querySelector("div");
    place.style.minHeight = `${place.offsetHeight}px`;
    axis.remove(plot);
    drawn.delete(figure);
  }

  /* Gives a plot the width of its place. */
  function fit(plot) {
    const width = plot?.root.parentElement.clientWidth;
    if (!width || width === plot.width) return;
    plot.setSize({ width, height: HEIGHT });
    axis.apply(plot);
  }

  const onScreen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      target.isNear = isIntersecting;
      if (isIntersecting) fit(drawn.get(target));
      if (isIntersecting && !drawn.has(target)) draw(target);
      else axis.place(drawn.get(target), isIntersecting);
    }
  }, { rootMargin: "600px" });

  /* Draws all plots, one after the other, so that the page answers meanwhile. */
  async function drawAll() {
    for (const figure of figures) {
      await new Promise((resume) => { setTimeout(resume, 0); });
      await draw(figure);
    }
  }

  /* Adds the empty figure of a plot. */
  function add(k, parent) {
    const group = groups[k];
    const figure = document.createElement("figure");
    figure.dataset.group = k;
    if (group.fmu !== "") figure.append(Object.assign(document.createElement("h3"), { textContent: group.fmu }));
    const place = document.createElement("div");
    figure.append(place);
    if (marks.length > 0) figure.append(Object.assign(document.createElement("p"), { className: "happening said" }));
    if (grids[group.grid].total > grids[group.grid].rows) figure.append(document.createElement("figcaption"));
    parent.append(figure);
    figures.push(figure);
    const count = 1 + group.curves.length * (group.curves.some(({ other }) => other !== null) ? 2 : 1);
    place.style.minHeight = `${HEIGHT + LEGEND_LINE * Math.ceil(count / Math.max(1, Math.floor(figure.clientWidth / 208)))}px`;
    note(figure);
    choose(figure);
    onScreen.observe(figure);
    return figure;
  }

  const many = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

  /* Adds the folded plots of an FMU. */
  function fold(fmu, members) {
    const details = document.createElement("details");
    const place = Object.assign(document.createElement("div"), { className: "figures" });
    const count = members.reduce((sum, k) => sum + groups[k].curves.length, 0);
    const title = `${fmu === "" ? "" : `${fmu}: `}${many(count, "more signal")} in ${many(members.length, "plot")}`;
    details.className = "stays";
    details.members = members;
    details.append(Object.assign(document.createElement("summary"), { textContent: title }), place);
    details.fill = () => {
      if (!details.open || place.childElementCount > 0) return;
      for (const k of members) add(k, place);
      drawAll();
    };
    details.addEventListener("toggle", details.fill);
    field("more").append(details);
  }

  let words = []; /* of the filter */
  const matches = (name) => words.every((word) => name.toLowerCase().includes(word));

  /* Shows the curves of a figure that the filter leaves. */
  function choose(figure) {
    const { curves } = groups[figure.dataset.group];
    figure.hidden = figure.all?.length === 0 || !curves.some(({ name }) => matches(name));
    const plot = drawn.get(figure);
    if (plot === undefined || figure.hidden) return;
    figure.all.forEach(({ ink }, k) => {
      const isShown = matches(curves[ink].name);
      if (isShown !== plot.series[k + 1].show && (words.length > 0 || figure.isFiltered)) plot.setSeries(k + 1, { show: isShown });
    });
    figure.isFiltered = words.length > 0;
  }

  /* Shows what has the words of the filter in its name, in plots and tables. */
  function filter() {
    words = field("filter").value.toLowerCase().split(/\s+/u).filter((word) => word !== "");
    for (const details of field("more").children) {
      const isThere = details.members.some((k) => groups[k].curves.some(({ name }) => matches(name)));
      details.hidden = !isThere;
      if (words.length > 0) {
        details.before ??= details.open;
        details.open = isThere;
      } else if (details.before !== undefined) {
        details.open = details.before;
        details.before = undefined;
      }
      details.fill();
    }
    figures.forEach(choose);
    for (const row of document.querySelectorAll("main .scroll tbody tr")) row.hidden = !matches(row.querySelector("th").textContent);
    const all = [...groups.flatMap(({ curves }) => curves.map(({ name }) => name)),
      ...Array.from(document.querySelectorAll("#unchanged tbody th"), (cell) => cell.textContent)];
    field("found").textContent = words.length === 0 ? "" : `${all.filter(matches).length} of ${many(all.length, "signal")}`;
  }

  const folded = new Map(); /* by FMU */
  groups.forEach(({ shown: isFirst, fmu }, k) => {
    if (isFirst) add(k, field("figures"));
    else folded.set(fmu, [...(folded.get(fmu) ?? []), k]);
  });
  for (const [fmu, members] of folded) fold(fmu, members);
  field("filter").addEventListener("input", filter);

  const moved = (by, size) => axis.show(axis.moved(axis.range ?? axis.common, by, size));
  field("controls").addEventListener("submit", (event) => {
    event.preventDefault();
    axis.show([Number(field("from").value), Number(field("to").value)]);
  });
  field("all").addEventListener("click", () => axis.show(null));
  field("earlier").addEventListener("click", () => moved(-0.5, 1));
  field("later").addEventListener("click", () => moved(0.5, 1));
  field("closer").addEventListener("click", () => moved(0, 0.5));
  field("wider").addEventListener("click", () => moved(0, 2));
  for (const choice of document.getElementsByName("shown")) {
    choice.addEventListener("change", () => {
      shown = choice.value;
      for (const figure of figures) {
        erase(figure);
        figure.all = undefined;
      }
      drawAll();
    });
  }
  redrawOn([axis], (forPaper) => {
    isPaper = forPaper;
    for (const figure of figures) {
      erase(figure);
      if (figure.all === undefined) draw(figure);
      else drawNow(figure);
    }
  });
  addEventListener("resize", () => {
    for (const plot of drawn.values()) fit(plot);
  });
  changed(axis.common);
  addEventListener("load", drawAll);
  if (document.readyState === "complete") drawAll();
})();
