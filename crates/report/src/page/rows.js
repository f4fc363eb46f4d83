"use strict";
/* Plots of rows: what is drawn is thinned for the present range, what is read is always a row. */

/* Returns the first index at which a sorted list is at least `value`, or more than it if `isAfter`. */
function bound(list, value, isAfter = false) {
  let [low, high] = [0, list.length];
  while (high > low) {
    const middle = (low + high) >> 1;
    if (value > list[middle] || (isAfter && list[middle] === value)) low = middle + 1;
    else high = middle;
  }
  return low;
}

/* Rows of some curves: the times in s, which do not decrease, and a list of values for each curve. */
class Rows {
  /* `holds`: for each curve, whether a value is held until the next one. */
  constructor(time, curves, holds) {
    Object.assign(this, { time, curves, holds });
  }

  /* Returns the row closest to a time. Of rows with the same time, as at an event, it is the first one before that
     time, and the last one from it on. */
  closest(at) {
    const { time } = this;
    const next = bound(time, at);
    if (next === time.length) return next - 1;
    if (next > 0 && at - time[next - 1] < time[next] - at) return next - 1;
    return time[next] > at ? next : bound(time, at, true) - 1;
  }

  /* Returns the rows that a picture of a range needs: of each curve the first, lowest, highest and last value of each
     column of pixels, and the first and last row without a value there; beside the range the next row of each end, and
     the last value that is held. */
  drawn(low, high, pixels) {
    const { time, curves, holds } = this;
    const [start, end] = [bound(time, low), bound(time, high, true)];
    const before = [];
    if (start > 0) before.push(start - 1);
    curves.forEach((values, k) => {
      let row = start - 1;
      while (holds[k] && row >= 0 && !Number.isFinite(values[row])) row--;
      if (row >= 0) before.push(row);
    });
    const rows = [...new Set(before)].sort((one, other) => one - other);
    if (4 * pixels >= end - start) {
      for (let row = start; end > row; row++) rows.push(row);
    } else {
      const isDrawn = new Uint8Array(end - start);
      const column = (k) => (k === pixels ? end : Math.max(start, bound(time, low + ((high - low) * k) / pixels)));
      const ends = Array.from({ length: pixels + 1 }, (_, k) => column(k));
      for (const values of curves) {
        for (let k = 0; pixels > k; k++) mark(isDrawn, start, values, ends[k], ends[k + 1]);
      }
      for (let row = start; end > row; row++) if (isDrawn[row - start]) rows.push(row);
    }
    if (time.length > end) rows.push(end);
    return rows;
  }

  /* Returns the times and values of some rows for uPlot: null is a gap. */
  data(rows) {
    const pick = (values, k) => {
      let held = null;
      return rows.map((row) => {
        const value = Number.isFinite(values[row]) ? values[row] : held;
        if (this.holds[k]) held = value;
        return value;
      });
    };
    return [rows.map((row) => this.time[row]), ...this.curves.map(pick)];
  }
}

/* Marks the rows from `first` to before `end` that a column of pixels needs of a curve. */
function mark(isDrawn, start, values, first, end) {
  let [opening, lowest, highest, closing, gap, lastGap] = [-1, -1, -1, -1, -1, -1];
  for (let row = first; end > row; row++) {
    const value = values[row];
    if (!Number.isFinite(value)) {
      if (gap < 0) gap = row;
      lastGap = row;
      continue;
    }
    if (opening < 0) opening = lowest = highest = row;
    if (values[lowest] > value) lowest = row;
    if (value > values[highest]) highest = row;
    closing = row;
  }
  for (const row of [opening, lowest, highest, closing, gap, lastGap]) if (row >= 0) isDrawn[row - start] = 1;
}

/* The axis of plots of rows. */
class RowAxis extends LinkedAxis {
  constructor(options) {
    super(options);
    this.states = new WeakMap(); /* by plot */
    this.target = null; /* the row to which a key has moved the cursor, and the times of its rows */
  }

  /* Draws a plot of rows into an element. `isComplete`: whether no row is missing between two of these. */
  rowPlot(element, rows, isComplete, options) {
    const { curves, holds } = rows;
    const marks = curves.map((_, k) => {
      const mark = document.createElement("div");
      mark.className = "at-cursor";
      mark.style.background = colour(options.curves[k].colour);
      return mark;
    });
    const state = { rows, marks, drawn: [], isNear: true, isStale: false, followed: options.followed };
    const text = (list, row) => {
      const value = list[row];
      if (value === undefined || Number.isNaN(value)) return "–";
      return String(value) + (this.second === null ? "" : difference(value, list[this.secondRow(rows)]));
    };
    const isAlone = (values, row) => !Number.isFinite(values[row - 1]) && !Number.isFinite(values[row + 1]);
    const isLine = (self) => isComplete || !this.isSparse(self, state);
    const plot = this.plot(element, [[], ...curves.map(() => [])], { ...options, reader: {
      text: (self, k) => text(k === 0 ? rows.time : curves[k - 1], this.row(self, state)),
      /* Values without neighbours have no line. Where rows are missing, lines would invent shapes. */
      points: (self, k) => {
        const values = curves[k - 1];
        const isPoint = (row) => Number.isFinite(values[row])
          && (!isLine(self) || (!holds[k - 1] && isAlone(values, row)));
        return state.drawn.flatMap((row, index) => (isPoint(row) ? [index] : []));
      },
      isLine,
      follow: (self) => this.follow(self, state),
    } });
    this.states.set(plot, state);
    plot.over.append(...marks);
    plot.over.addEventListener("mouseenter", () => this.place(plot, true));
    plot.root.addEventListener("focusin", () => this.place(plot, true));
    this.apply(plot);
    return plot;
  }

  /* Whether there are fewer rows than pixels in the range. */
  isSparse(plot, { drawn }) {
    return plot.over.clientWidth > drawn.length;
  }

  /* Notes whether a plot is on the screen or near it; others are zoomed later. */
  place(plot, isNear) {
    const state = this.states.get(plot);
    if (state === undefined) return;
    state.isNear = isNear;
    if (isNear && state.isStale) this.apply(plot);
    else this.follow(plot, state);
  }

  /* Zooms a plot, and chooses the rows that it draws. */
  apply(plot) {
    const state = this.states.get(plot);
    if (state?.isNear === false) {
      state.isStale = true;
      return;
    }
    if (state !== undefined) {
      state.isStale = false;
      const [low, high] = this.range ?? this.whole(plot);
      state.drawn = state.rows.drawn(low, high, Math.ceil(plot.over.clientWidth * devicePixelRatio) || 800);
      plot.setData(state.rows.data(state.drawn), false);
    }
    super.apply(plot);
    if (state !== undefined) this.follow(plot, state);
  }

  /* Returns the row at the cursor; -1 if there is none. */
  row(plot, { rows }) {
    const { left } = plot.cursor;
    if (!(left >= 0)) return -1;
    const { target } = this;
    const isThere = target?.time === rows.time && 1e-3 > Math.abs(plot.valToPos(target.time[target.row], "x") - left);
    return isThere ? target.row : rows.closest(plot.posToVal(left, "x"));
  }

  /* The time of the row at the cursor; of rows with the same time, as at an event, the second cursor keeps the row. */
  readingPlace(plot) {
    const state = this.states.get(plot);
    const row = this.row(plot, state);
    if (row < 0) return null;
    this.secondTarget = { time: state.rows.time, row };
    return state.rows.time[row];
  }

  /* The row at the second cursor. */
  secondRow(rows) {
    const { time, row } = this.secondTarget;
    return time === rows.time && time[row] === this.second ? row : rows.closest(this.second);
  }

  write(plot) {
    this.follow(plot, this.states.get(plot));
  }

  /* The range of the vertical axis; if no row is in the range of time, that of the rows beside it. */
  vertical(low, high, isLogarithmic, fromZero, plot) {
    if (low !== null && low !== undefined) return super.vertical(low, high, isLogarithmic, fromZero);
    const values = plot.data.slice(1).flat().filter(Number.isFinite);
    const [least, most] = values.length > 0 ? [Math.min(...values), Math.max(...values)] : [null, null];
    return super.vertical(least, most, isLogarithmic, fromZero);
  }

  /* Writes the values of the row at the cursor, and marks them in the plot. */
  follow(plot, state) {
    if (!state.isNear) return;
    const row = this.row(plot, state);
    const { time, curves } = state.rows;
    const [low, high] = [plot.scales.x.min, plot.scales.x.max];
    state.marks.forEach((mark, k) => {
      const value = curves[k][row];
      const isShown = row >= 0 && plot.series[k + 1].show && Number.isFinite(value) && time[row] >= low && high >= time[row];
      mark.style.visibility = isShown ? "visible" : "hidden";
      if (isShown) mark.style.translate = `${plot.valToPos(time[row], "x")}px ${plot.valToPos(value, "y")}px`;
    });
    plot.setLegend({ idx: row >= 0 ? plot.cursor.idx ?? 0 : null }, false);
    state.followed?.(plot, row >= 0 ? time[row] : null);
  }

  /* Moves the cursor by a part of the range, but at least to the next row. */
  step(plot, by) {
    const state = this.states.get(plot);
    const { time } = state.rows;
    const range = [plot.scales.x.min, plot.scales.x.max];
    const row = this.row(plot, state);
    const here = row >= 0 ? row : state.rows.closest((range[0] + range[1]) / 2);
    const there = state.rows.closest(time[here] + by * (range[1] - range[0]));
    /* Rows with the same time, as at an event, follow each other. */
    const isFar = (there - here) * by > 0 && time[there] !== time[here];
    const index = isFar ? there : here + Math.sign(by);
    this.target = { time, row: Math.min(Math.max(index, 0), time.length - 1) };
    const next = time[this.target.row];
    if (next > range[1] || range[0] > next) this.show(this.moved(range, (next - time[here]) / (range[1] - range[0]), 1));
    this.moveCursor(plot, next);
  }
}
