"use strict";
/* Draws the plots of #data into #figures, first those on the screen. All plots have the same axis of time. */
(async () => {
  const { grids, plots: groups, columns, command } = JSON.parse(document.getElementById("data").textContent);
  const figures = document.getElementById("figures");
  if (!("DecompressionStream" in globalThis)) {
    figures.textContent = "The plots need a browser of 2023 or later; the tables do not.";
    return;
  }
  const field = (id) => document.getElementById(id);
  const HEIGHT = 260;
  const LEGEND_LINE = 24;
  const drawn = new Map(); /* by figure: its plot */
  let shown = "both";
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
    const ends = times.filter((time) => time.length > 0).flatMap((time) => [time[0], time[time.length - 1]]);
    const [low, high] = [Math.min(...ends), Math.max(...ends)];
    return high > low ? [low, high] : [ends.length > 0 ? low : 0, (ends.length > 0 ? low : 0) + 1];
  }

  const times = await Promise.all(grids.map(({ time, rows }) => column(time, rows)));
  const axis = new RowAxis({ name: "time", label: "time in s", short: "t in s", whole: whole(times), changed });

  function changed([low, high]) {
    field("from").value = low;
    field("to").value = high;
    for (const figure of figures.children) note(figure);
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
    const plot = axis.rowPlot(place, rows, count === total, options(group, all));
    drawn.set(figure, plot);
    place.style.minHeight = "";
    if (!isPaper) axis.place(plot, figure.isNear === true);
  }

  async function draw(figure) {
    const view = shown;
    const all = figure.all ?? await series(groups[figure.dataset.group]);
    if (view !== shown) return;
    figure.all = all;
    figure.hidden = all.length === 0;
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

  const onScreen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      target.isNear = isIntersecting;
      if (isIntersecting && !drawn.has(target)) draw(target);
      else axis.place(drawn.get(target), isIntersecting);
    }
  }, { rootMargin: "600px" });

  /* Draws all plots, one after the other, so that the page answers meanwhile. */
  async function drawAll() {
    for (const figure of figures.children) {
      await new Promise((resume) => { setTimeout(resume, 0); });
      await draw(figure);
    }
  }

  groups.forEach((group, k) => {
    const figure = document.createElement("figure");
    figure.dataset.group = k;
    const place = document.createElement("div");
    const lines = 1 + group.curves.length * (group.curves.some(({ other }) => other !== null) ? 2 : 1);
    place.style.minHeight = `${HEIGHT + LEGEND_LINE * Math.ceil(lines / Math.max(1, Math.floor(figures.clientWidth / 208)))}px`;
    figure.append(place);
    if (grids[group.grid].total > grids[group.grid].rows) figure.append(document.createElement("figcaption"));
    figures.append(figure);
    note(figure);
    onScreen.observe(figure);
  });

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
      for (const figure of figures.children) {
        erase(figure);
        figure.all = undefined;
      }
      drawAll();
    });
  }
  redrawOn((forPaper) => {
    isPaper = forPaper;
    for (const figure of figures.children) {
      erase(figure);
      if (figure.all === undefined) draw(figure);
      else drawNow(figure);
    }
  });
  addEventListener("resize", () => {
    for (const plot of drawn.values()) {
      plot.setSize({ width: plot.root.parentElement.clientWidth, height: HEIGHT });
      axis.apply(plot);
    }
  });
  changed(axis.common);
  addEventListener("load", drawAll);
  if (document.readyState === "complete") drawAll();
})();
