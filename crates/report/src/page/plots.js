"use strict";
// Draws the plots of #data into #figures. All plots have the same axis of time.
(() => {
  const groups = JSON.parse(document.getElementById("data").textContent);
  const figures = document.getElementById("figures");
  const field = (id) => document.getElementById(id);
  const HEIGHT = 260;
  let plots = [];
  let shown = "both";
  const axis = new LinkedAxis({ name: "time", label: "time in s", short: "t in s", whole: whole(), changed: fill });

  function whole() {
    let [low, high] = [Infinity, -Infinity];
    for (const { curves } of groups) {
      for (const { own: [times] } of curves) {
        if (times.length > 0) {
          low = Math.min(low, times[0]);
          high = Math.max(high, times[times.length - 1]);
        }
      }
    }
    return high > low ? [low, high] : [low, low + 1];
  }

  function fill([low, high]) {
    field("from").value = low;
    field("to").value = high;
  }

  // The curves of a plot: those of both runs, or their differences.
  function series({ curves }) {
    if (shown === "difference") {
      return curves.flatMap((curve, ink) =>
        curve.difference ? [{ ...curve, ink, points: curve.difference }] : []);
    }
    return curves.flatMap((curve, ink) => [
      { ...curve, ink, points: curve.own },
      ...(curve.other ? [{ ...curve, ink, name: `${curve.name}, other run`, points: curve.other, dashed: true }] : []),
    ]);
  }

  // One list of times for all curves. Where a curve has no value at a time, it is undefined, which uPlot
  // bridges; null is a gap. Equal times, as at events, keep their order.
  function merged(tables) {
    const places = tables.map(() => 0);
    const data = [[], ...tables.map(() => [])];
    for (;;) {
      const time = Math.min(...tables.map(([times], table) => times[places[table]] ?? Infinity));
      if (time === Infinity) return data;
      data[0].push(time);
      tables.forEach(([times, values], table) => {
        data[table + 1].push(times[places[table]] === time ? values[places[table]++] : undefined);
      });
    }
  }

  function draw(isPaper = false) {
    for (const one of plots) axis.remove(one);
    plots = [];
    figures.replaceChildren();
    for (const group of groups) {
      const all = series(group);
      if (all.length === 0) continue;
      const figure = document.createElement("figure");
      figures.append(figure);
      const names = group.curves.map((curve) => curve.name).join(", ");
      plots.push(axis.plot(figure, merged(all.map((curve) => curve.points)), {
        label: group.unit,
        height: HEIGHT,
        curves: all.map(({ name, ink, holds, dots, dashed }) =>
          ({ name, colour: `--ink-${ink + 1}`, holds, dots, dash: dashed ? [7, 5] : undefined })),
        name: `${shown === "difference" ? "Difference of " : ""}${names} over time`,
        scale: isPaper ? 2 : 1,
      }));
    }
  }

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
      draw();
    });
  }
  redrawOn(draw);
  addEventListener("resize", () => {
    for (const one of plots) one.setSize({ width: one.root.parentElement.clientWidth, height: HEIGHT });
  });
  fill(axis.common);
  draw();
})();
