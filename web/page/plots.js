"use strict";
// Numbers of a run or a file, thinned for the screen, and their plots.

const BLOCK = 64; // values of which the places of the least and the greatest are stored

// A growing column of numbers.
class Column {
  constructor(values = new Float64Array(1024), count = 0) {
    this.values = values;
    this.count = 0;
    this.least = []; // of each full block
    this.greatest = [];
    this.hasGaps = false;
    while (this.count < count) this.push(values[this.count]);
  }

  push(value) {
    if (this.count === this.values.length) {
      const longer = new Float64Array(2 * this.count);
      longer.set(this.values);
      this.values = longer;
    }
    this.values[this.count] = value;
    if (value !== value) this.hasGaps = true;
    this.count += 1;
    if (this.count % BLOCK === 0) {
      const [least, greatest] = this.scan(this.count - BLOCK, this.count);
      this.least.push(least);
      this.greatest.push(greatest);
    }
  }

  cut(count) {
    this.count = Math.min(this.count, count);
    this.least.length = this.greatest.length = Math.floor(this.count / BLOCK);
  }

  // Where the least and the greatest value are; gaps (NaN) are passed over.
  scan(from, until) {
    const { values } = this;
    let [least, greatest] = [from, from];
    for (let k = from + 1; k < until; k += 1) {
      if (!(values[k] >= values[least])) { if (values[k] === values[k]) least = k; }
      if (!(values[k] <= values[greatest])) { if (values[k] === values[k]) greatest = k; }
    }
    return [least, greatest];
  }

  // The same, by whole blocks where it can be.
  extremes(from, until) {
    const { values, least: lows, greatest: highs } = this;
    let least = from;
    let greatest = from;
    const take = (low, high) => {
      if (!(values[low] >= values[least]) && values[low] === values[low]) least = low;
      if (!(values[high] <= values[greatest]) && values[high] === values[high]) greatest = high;
    };
    const first = Math.ceil(from / BLOCK);
    const last = Math.floor(until / BLOCK);
    if (first >= last) return this.scan(from, until);
    take(...this.scan(from, first * BLOCK));
    for (let block = first; block < last; block += 1) take(lows[block], highs[block]);
    if (last * BLOCK < until) take(...this.scan(last * BLOCK, until));
    return [least, greatest];
  }

  // The first place with a value of at least `value`; the values rise.
  find(value) {
    let [low, high] = [0, this.count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.values[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

// The places of the rows to draw: all in the range, or of each pixel those with the least and the greatest values, so
// that every point is a row. The first and the last of all rows are among them.
function thinned(times, columns, range, pixels) {
  const count = times.count;
  const from = range ? Math.max(times.find(range[0]) - 1, 0) : 0;
  const until = range ? Math.min(times.find(range[1]) + 2, count) : count;
  const places = from > 0 ? [0] : [];
  let size = Math.ceil((until - from) / pixels);
  if (size <= 2 * columns.length) size = 1;
  else if (size > BLOCK) size = Math.ceil(size / BLOCK) * BLOCK;
  for (let k = from; k < until;) {
    const end = Math.min(until, size === 1 ? k + 1 : k - (k % size) + size);
    if (size === 1) places.push(k);
    else {
      const part = [k];
      for (const column of columns) if (end <= column.count) part.push(...column.extremes(k, end));
      part.sort((a, b) => a - b);
      for (const place of part) if (place !== places.at(-1)) places.push(place);
    }
    k = end;
  }
  if (count > 0 && places.at(-1) !== count - 1) places.push(count - 1);
  return places;
}

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

const digits = (value, count = 6) => (value === null || value === undefined ? "–" : `${Number(value.toPrecision(count))}`);
// All digits, as of seconds since 1970 and of a narrow range; uPlot's own labels have three decimals, and its places for
// those of an axis of time are 50 px wide.
const exact = (value) => digits(value, 15);
const labels = (self, places) => places.map((place) => (place === null ? "" : exact(place || 0)));

// The ticks of an axis. uPlot's own are rounded to 0.3 from 0.29999999 on, and have no end in a range without length.
function splits(self, index, low, high, step) {
  const first = Math.ceil(low / step);
  return step > 0 ? Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => (first + k) * step) : [];
}

// Whether an axis can tell the places of a range apart.
const isLong = (low, high) => high - low > 1e-12 * Math.max(Math.abs(low), Math.abs(high));

// The range of a vertical axis for values; null: there are none.
function padded(low, high) {
  const air = isLong(low, high) ? 0.1 * (high - low) : 0.1 * Math.abs(high) || 1;
  return [low - air, high + air];
}

// A plot over time. `curves`: {label, ink, column, scale, dash}; `band`: a range to shade; `marks`: a function that
// returns times to mark; `wide`: the vertical axis is wide near 0.
class TimePlot {
  constructor(axis, place, times, curves, { unit = "", height = 200, band = null, marks = () => [], wide = false } = {}) {
    Object.assign(this, { axis, place, times, curves, height });
    const style = { stroke: colour("--text"), grid: { stroke: colour("--grid") }, ticks: { stroke: colour("--grid") } };
    const decades = (self, index, low, high) => [-1000, -100, -10, -1, 0, 1, 10, 100, 1000].filter((value) => value >= low && value <= high);
    const shade = (self) => {
      if (!band) return;
      const { left, top, width, height: tall } = self.bbox;
      const [high, low] = [band[1], band[0]].map((value) => Math.min(Math.max(self.valToPos(value, "y", true), top), top + tall));
      self.ctx.fillStyle = colour("--claim");
      self.ctx.fillRect(left, high, width, low - high);
    };
    const mark = (self) => {
      const { left, top, width, height: tall } = self.bbox;
      self.ctx.fillStyle = colour("--good");
      for (const place of marks().map((at) => self.valToPos(at, "x", true))) {
        if (place >= left && place <= left + width) self.ctx.fillRect(place - 1, top, 2, tall);
      }
    };
    const options = {
      width: this.width(),
      height,
      padding: [null, (self) => 10 + 3.5 * exact(Math.trunc(self.scales.x.max ?? 0)).length, null, null], // half of the last label
      plugins: [{ hooks: { drawClear: shade, drawAxes: mark } }],
      scales: { x: { time: false }, y: wide ? { distr: 4, asinh: 1, range: (self, low, high) => [Math.min(low ?? 0, -2) * 1.3, Math.max(high ?? 0, 2) * 1.3] } : { range: (self, low, high) => padded(low, high) } },
      axes: [
        { ...style, size: 34, splits, values: labels, space: (self, index, low, high) => Math.max(50, 28 + 7 * exact(Math.trunc(Math.max(-low, high))).length) },
        {
          ...style, splits, values: labels, size: (self, texts) => Math.max(52, 17 + 7 * Math.max(0, ...(texts ?? []).map((text) => text.length))),
          label: unit || undefined, labelSize: 20, ...(wide ? { splits: decades, filter: (self, places) => places } : {}),
        },
      ],
      series: [
        { label: "t in s", value: (self, value) => exact(value) },
        ...curves.map(({ label, ink, dash, column, width = 1.5 }) => ({
          label, dash, stroke: colour(ink), width, value: (self, value) => digits(value),
          // A value between gaps is a point.
          points: { show: (self, k, from, until) => until - from < 2000 && column.hasGaps, size: 4 },
        })),
      ],
    };
    this.plot = axis.plot(options, this.data(), place);
    this.observer = new ResizeObserver(() => {
      if (this.width() !== this.plot.width) {
        this.plot.setSize({ width: this.width(), height });
        this.update();
      }
    });
    this.observer.observe(place);
    this.isInWindow = true;
    this.watcher = new IntersectionObserver((entries) => {
      this.isInWindow = entries.at(-1).isIntersecting;
      if (this.isInWindow) this.update();
    });
    this.watcher.observe(place);
    this.useKeys();
  }

  width() {
    return Math.max(this.place.clientWidth, 200);
  }

  data() {
    const places = thinned(this.times, this.curves.map(({ column }) => column), this.axis.range, this.width());
    const values = ({ column, scale = 1 }) => places.map((k) => (k < column.count && column.values[k] === column.values[k] ? scale * column.values[k] : null));
    return [places.map((k) => this.times.values[k]), ...this.curves.map(values)];
  }

  update() {
    this.axis.update(this.plot, this.data());
  }

  // Arrows move the cursor, plus and minus zoom around it, 0 shows everything; the names of the curves are buttons.
  useKeys() {
    const { plot, place, axis } = this;
    place.onkeydown = (event) => {
      if (event.target !== place) return;
      const { min, max } = plot.scales.x;
      const width = plot.over.clientWidth;
      const left = plot.cursor.left >= 0 ? plot.cursor.left : width / 2;
      const centre = plot.posToVal(left, "x");
      const zoom = (factor) => axis.show(limited([centre - (centre - min) * factor, centre + (max - centre) * factor], [this.times.values[0], this.times.values[this.times.count - 1]]));
      const moves = { ArrowLeft: -1, ArrowRight: 1, PageUp: -20, PageDown: 20 };
      if (event.key in moves) plot.setCursor({ left: Math.min(width - 1, Math.max(0, left + moves[event.key] * (event.shiftKey ? 10 : 2))), top: 10 }, true);
      else if (event.key === "+") zoom(0.5);
      else if (event.key === "-") zoom(2);
      else if (event.key === "0" || event.key === "Escape") axis.show(null);
      else return;
      event.preventDefault();
    };
    place.querySelectorAll(".u-legend .u-series:not(:first-child) .u-label").forEach((label, k) => {
      const press = () => label.setAttribute("aria-pressed", plot.series[k + 1].show);
      label.setAttribute("role", "button");
      label.tabIndex = 0;
      press();
      label.addEventListener("click", () => setTimeout(press));
      label.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        plot.setSeries(k + 1, { show: !plot.series[k + 1].show });
        press();
      });
    });
  }

  remove() {
    this.observer.disconnect();
    this.watcher.disconnect();
    this.axis.remove(this.plot);
  }
}

// An axis whose plots are thinned anew when its range changes; `plots` returns them.
function thinnedAxis(name, plots) {
  const axis = new GrowingAxis(name);
  axis.show = (range) => {
    if (range !== null && !isLong(...range)) return;
    axis.range = range;
    for (const plot of plots()) plot.update();
    GrowingAxis.prototype.show.call(axis, range);
  };
  // Plots outside of the window are old; Firefox prints before uPlot's microtasks.
  addEventListener("beforeprint", () => {
    for (const plot of plots()) plot.plot.batch(() => plot.update());
  });
  return axis;
}

const ROW = ["time", "x_p", "theta", "v_p", "omega", "f_fric", "regime", "u", "f_hat"];

// The plots of a run; `marks` returns times to mark.
function runPlots(marks) {
  const rows = Object.fromEntries(ROW.map((name) => [name, new Column()]));
  const ghost = Object.fromEntries(ROW.map((name) => [name, new Column()]));
  const columns = (table) => ROW.map((name) => table[name]);
  const kinds = [
    ["motion", { unit: "mm", band: [-1, 1], wide: true }, [
      { label: "x_p in mm", ink: "--ink-1", column: rows.x_p, scale: 1000 },
      { label: "without compensation", ink: "--soft", dash: [4, 4], column: ghost.x_p, scale: 1000 },
    ]],
    ["force", { unit: "N" }, [
      { label: "f_fric in N", ink: "--ink-1", column: rows.f_fric, width: 4 },
      { label: "f_hat in N, its estimate", ink: "--ink-2", column: rows.f_hat },
    ]],
    ["angle", { unit: "mrad", band: [-2, 2], wide: true }, [{ label: "theta in mrad", ink: "--ink-1", column: rows.theta, scale: 1000 }]],
    ["command", { unit: "N" }, [{ label: "u in N", ink: "--ink-1", column: rows.u }]],
  ];
  let plots = [];
  const axis = thinnedAxis("run", () => plots);
  const draw = () => {
    for (const plot of plots) plot.remove();
    plots = kinds.map(([id, options, curves]) => new TimePlot(axis, document.getElementById(id), rows.time, curves, { ...options, marks, height: 215 }));
  };
  draw();
  const add = (table, numbers) => {
    const order = columns(table);
    for (let k = 0; k < numbers.length; k += 1) order[k % ROW.length].push(numbers[k]);
  };
  return {
    rows,
    ghost,
    clear() {
      for (const column of [...columns(rows), ...columns(ghost)]) column.cut(0);
      axis.range = null;
      this.show();
    },
    // Drops the rows after `time`; returns the last one that stays.
    cut(time) {
      const count = rows.time.find(time + 1e-9);
      for (const column of [...columns(rows), ...columns(ghost)]) column.cut(count);
      return columns(rows).map(({ values }) => values[count - 1]);
    },
    add: (numbers) => add(rows, numbers),
    follow: (numbers) => add(ghost, numbers),
    show() {
      for (const plot of plots) if (plot.isInWindow) plot.update();
    },
    redraw: draw,
  };
}
