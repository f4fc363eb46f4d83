"use strict";
// Draws the plots of #data into #figures. All plots share the range of time and the cursor.
(() => {
  const groups = JSON.parse(document.getElementById("data").textContent);
  const figures = document.getElementById("figures");
  const field = (id) => document.getElementById(id);
  const HEIGHT = 260;
  let plots = [];
  let shown = "both";
  let range = whole();

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

  function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  function plot(group, figure) {
    const all = series(group);
    const axis = { stroke: colour("--text"), grid: { stroke: colour("--grid") }, ticks: { stroke: colour("--grid") } };
    const cell = (self, value) => (value === null || value === undefined ? "–" : String(value));
    const options = {
      width: figure.clientWidth || 800,
      height: HEIGHT,
      scales: { x: { time: false, range: (self, low, high) => [low, high] } },
      axes: [{ ...axis, label: "time in s", labelSize: 22 }, { ...axis, size: 80, label: group.unit || undefined }],
      cursor: { sync: { key: "time", setSeries: false }, drag: { x: true, y: false }, dataIdx: closest },
      series: [
        { label: "t in s", value: cell },
        ...all.map((curve) => ({
          label: curve.name,
          stroke: colour(`--ink-${curve.ink + 1}`),
          width: 1.6,
          dash: curve.dashed ? [7, 5] : undefined,
          spanGaps: false,
          points: { show: false },
          paths: curve.holds ? uPlot.paths.stepped({ align: 1 }) : uPlot.paths.linear(),
          value: cell,
        })),
      ],
      hooks: {
        setScale: [(self, key) => {
          if (key === "x" && self.scales.x.min !== null) {
            show([self.scales.x.min, self.scales.x.max]);
          }
        }],
        ready: [(self) => self.over.addEventListener("dblclick", () => show(whole()))],
      },
    };
    return new uPlot(options, merged(all.map((curve) => curve.points)), figure);
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

  // The closest time at which the curve has a value.
  function closest(self, curve, index) {
    const values = self.data[curve];
    for (let away = 0; away < values.length; away++) {
      if (values[index - away] !== undefined) return index - away;
      if (values[index + away] !== undefined) return index + away;
    }
    return index;
  }

  let showing = false;
  function show([low, high]) {
    if (showing || !(high > low)) return;
    showing = true;
    range = [low, high];
    for (const one of plots) one.setScale("x", { min: low, max: high });
    field("from").value = low;
    field("to").value = high;
    showing = false;
  }

  function draw() {
    const kept = range;
    for (const one of plots) one.destroy();
    plots = [];
    figures.replaceChildren();
    for (const group of groups) {
      if (series(group).length === 0) continue;
      const figure = document.createElement("figure");
      const names = group.curves.map((curve) => curve.name).join(", ");
      figure.setAttribute("role", "group");
      figure.setAttribute("aria-label", `${shown === "difference" ? "Difference of " : ""}${names} over time`);
      figures.append(figure);
      plots.push(plot(group, figure));
    }
    show(kept);
  }

  function shifted(by, size) {
    const [low, high] = range;
    const [middle, half] = [(low + high) / 2 + by * (high - low), ((high - low) / 2) * size];
    show([middle - half, middle + half]);
  }

  field("controls").addEventListener("submit", (event) => {
    event.preventDefault();
    show([Number(field("from").value), Number(field("to").value)]);
  });
  field("all").addEventListener("click", () => show(whole()));
  field("earlier").addEventListener("click", () => shifted(-0.5, 1));
  field("later").addEventListener("click", () => shifted(0.5, 1));
  field("closer").addEventListener("click", () => shifted(0, 0.5));
  field("wider").addEventListener("click", () => shifted(0, 2));
  for (const choice of document.getElementsByName("shown")) {
    choice.addEventListener("change", () => {
      shown = choice.value;
      draw();
    });
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  addEventListener("resize", () => {
    for (const one of plots) one.setSize({ width: one.root.parentElement.clientWidth, height: HEIGHT });
  });
  draw();
})();
