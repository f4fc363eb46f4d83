"use strict";
/* Plots by uPlot with linked horizontal axes: all plots of an axis are zoomed together and share the cursor. */

/* Labels and places of the ticks of an axis. */
const ticks = (() => {
  const minus = (text) => text.replaceAll("-", "−");

  /* The multiples of a round step within a range, at most about `most` of them. The step is never so small that a
     multiple and the next one are equal. */
  function linear(low, high, most) {
    const least = Math.max((high - low) / most, 1e-14 * Math.max(Math.abs(low), Math.abs(high)));
    const power = 10 ** Math.floor(Math.log10(least));
    const step = power * ([1, 2, 5].find((factor) => factor * power >= 0.999 * least) ?? 10);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found;
  }

  /* The powers of ten, with multiples between them where there is room. */
  function logarithmic(low, high, most) {
    const decades = Math.log10(high / low);
    if (decades < 0.7) return linear(low, high, most);
    const factors = decades < 7 ? [1, 2, 3, 4, 5, 6, 7, 8, 9] : [1];
    const stride = Math.ceil(decades / (2 * most));
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      if (power % stride !== 0) continue;
      found.push(...factors.map((factor) => Number(`${factor}e${power}`)).filter((at) => at >= low && high >= at));
    }
    return found;
  }

  /* Texts with the digits that tell each tick from its neighbours. */
  function linearLabels(places) {
    if (places.length < 3) return places.map((place) => minus(String(Number(place.toPrecision(15)))));
    const step = places[1] - places[0];
    const largest = Math.max(...places.map(Math.abs));
    return places.map((value) => {
      if (Math.abs(value) < 0.5 * step) return "0";
      /* All digits of seconds since 1970 are shorter than a power of ten with as many. */
      if ((largest >= 1e6 && step >= 1e5) || step < 1e-4) {
        const digits = Math.floor(Math.log10(Math.abs(value))) - Math.floor(Math.log10(step));
        return minus(value.toExponential(Math.min(Math.max(digits, 0), 15)));
      }
      return minus(value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))));
    });
  }

  const raised = (power) => [...String(power)].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("");

  /* Texts of powers of ten; those between are empty unless there are few decades. */
  function logarithmicLabels(places, low, high, most) {
    const decades = Math.log10(high / low);
    if (decades < 0.7) return linearLabels(places);
    const shown = decades < 1.5 ? [1, 2, 5] : [1];
    const stride = Math.ceil(decades / most);
    return places.map((value) => {
      const [factor, power] = value.toExponential().split("e").map(Number);
      if (!shown.includes(factor) || (factor === 1 && power % stride !== 0)) return "";
      if (Math.abs(power) > 3) return factor === 1 ? `10${raised(power)}` : `${factor}·10${raised(power)}`;
      return value.toFixed(Math.max(0, -power));
    });
  }

  return {
    places: (low, high, most, isLogarithmic) => (isLogarithmic ? logarithmic : linear)(low, high, most),
    labels: (places, low, high, most, isLogarithmic) =>
      isLogarithmic ? logarithmicLabels(places, low, high, most) : linearLabels(places),
  };
})();

/* The value of a custom property of the page: a colour. */
function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/* Whether an axis can show a range: the range has a length, and that of a logarithmic axis does not reach 0. */
function isRange([low, high], isLogarithmic) {
  return high - low > 1e-12 * Math.max(Math.abs(low), Math.abs(high)) && (low > 0 || !isLogarithmic);
}

/* A horizontal axis that several plots have in common. */
class LinkedAxis {
  /* `name` tells axes apart; `whole` is the range of all plots, by default each plot shows its own;
     `changed` is called with a new range. */
  constructor({ name, label, short, isLogarithmic = false, whole = null, changed = () => undefined }) {
    Object.assign(this, { name, label, short, isLogarithmic, common: whole, changed });
    this.range = null;
    this.plots = new Set();
    this.heights = new Map(); /* by plot: the range of its vertical axis, if it is zoomed */
    this.second = null; /* the place of the second cursor */
  }

  /* Shows a range in all plots, if an axis can; null: everything, and the whole vertical axes. */
  show(range) {
    if (range === null) this.heights.clear();
    if (range === null || isRange(range, this.isLogarithmic)) {
      this.range = range;
      for (const plot of this.plots) this.apply(plot);
    }
    this.changed(this.range ?? this.common);
  }

  /* Zooms a plot to the common range. */
  apply(plot) {
    const [min, max] = this.range ?? this.whole(plot);
    plot.setScale("x", { min, max });
  }

  /* The range of a plot that shows everything. */
  whole(plot) {
    if (this.common !== null) return this.common;
    const [places] = plot.data;
    const [low, high] = [places[0] ?? 1, places[places.length - 1] ?? 1];
    return high > low ? [low, high] : [low, this.isLogarithmic ? 10 * low : low + 1];
  }

  /* The functions from values to a scale on which all pixels are equally long, and back. */
  scale() {
    return this.isLogarithmic ? [Math.log10, (value) => 10 ** value] : [Number, Number];
  }

  /* A range that is moved by a part of its length and then scaled about `centre`. */
  moved(range, by, size, centre = null) {
    const [to, from] = this.scale();
    const [low, high] = range.map(to);
    const middle = centre === null ? (low + high) / 2 : to(centre);
    return [low, high].map((end) => from(middle + (end - middle) * size + by * (high - low)));
  }

  /* Zooms the vertical axis of a plot; null: all values. */
  showVertical(plot, range) {
    if (range === null) this.heights.delete(plot);
    else if (isRange(range, plot.scales.y.distr === 3)) this.heights.set(plot, range);
    this.apply(plot);
  }

  /* Moves the vertical range of a plot by a part of its length, and scales it about `at`, by default its middle. */
  moveVertical(plot, by, size, at = null) {
    const { min, max, distr } = plot.scales.y;
    const [to, from] = distr === 3 ? [Math.log10, (value) => 10 ** value] : [Number, Number];
    const [low, high] = [min, max].map(to);
    const middle = at === null ? (low + high) / 2 : to(at);
    this.showVertical(plot, [low, high].map((end) => from(middle + (end - middle) * size + by * (high - low))));
  }

  /* Puts the second cursor of all plots at a place, from where the legends state differences; null: removes it. */
  setSecond(at) {
    this.second = at;
    for (const plot of this.plots) {
      plot.root.classList.toggle("has-second", at !== null);
      plot.redraw(false);
      this.write(plot);
    }
  }

  /* Puts the second cursor at the cursor of a plot, or removes it from there. */
  toggleSecond(plot) {
    const at = this.readingPlace(plot);
    if (at === null) return;
    const isThere = this.second !== null && 3 > Math.abs(plot.valToPos(at, "x") - plot.valToPos(this.second, "x"));
    this.setSecond(isThere ? null : at);
  }

  /* The place whose values the legend of a plot shows; null without a cursor. */
  readingPlace(plot) {
    const { idx } = plot.cursor;
    return idx === null || idx === undefined ? null : plot.data[0][idx];
  }

  /* Writes the legend of a plot again. */
  write(plot) {
    plot.setLegend({ idxs: plot.cursor.idxs }, false);
  }

  remove(plot) {
    this.plots.delete(plot);
    this.heights.delete(plot);
    plot.destroy();
  }

  /* Draws a plot into an element. `data`: the places, then the values of each curve; null is a gap, undefined is
     bridged. `curves`: name, colour, and optionally width, dash, `holds`, `dots`. `marks`: `x` or `y`, colour, dash;
     with `flag` a mark at `x` has a triangle at the top, with `end` it has a bar up to there, and with `tick` it is a
     short line at the axis.
     `scale` enlarges lines and text, for a picture that is shown smaller. `reader` is for data that are thinned: its
     function `text` returns what the legend shows of a curve (0: the place), `points` the indices of points that are
     drawn without a line, `isLine` whether lines are drawn, and `follow` is called when the cursor moves. */
  plot(element, data, { label, height, curves, marks = [], isLogarithmic = false, fromZero = false, write = String,
    name = "", scale = 1, reader = null }) {
    const text = (size) => `${size * scale}px system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif`;
    const grid = { stroke: colour("--grid"), width: scale };
    const common = { stroke: colour("--text"), grid, ticks: { ...grid, size: 5 * scale }, font: text(12),
      labelFont: text(12), gap: 4 * scale, filter: (self, places) => places };
    let beyond = 0; /* the room that the last label of the horizontal axis takes beyond its end */
    const axis = (isX, isLog) => {
      const room = (self) => (isX ? self.bbox.width / (isLog ? 45 : 70) : self.bbox.height / 28);
      const most = (self) => Math.max(2, Math.floor(room(self) / scale / devicePixelRatio));
      const ends = (self) => [self.scales[isX ? "x" : "y"].min, self.scales[isX ? "x" : "y"].max];
      return { ...common,
        incrs: [Number.MAX_VALUE], /* by default there are no ticks above 1e32 */
        splits: (self, index, low, high) => {
          const places = ticks.places(low, high, most(self), isLog);
          if (!isX || isLog) return places;
          const widest = this.breadth(self, ticks.labels(places), index);
          const count = self.bbox.width / devicePixelRatio / Math.max(1, widest);
          if (count >= places.length) return places;
          const few = ticks.places(low, high, Math.min(most(self), count));
          /* A single label shows no scale. */
          return few.length > 1 || 2 > count ? few : [places[0], places.at(-1)];
        },
        values: (self, places, index) => {
          const texts = ticks.labels(places, ...ends(self), most(self), isLog);
          if (isX && places.length > 0) {
            const rest = self.bbox.width / devicePixelRatio - self.valToPos(places.at(-1), "x");
            beyond = Math.ceil(this.breadth(self, texts.slice(-1), index) / 2 - rest);
          }
          return texts;
        } };
    };
    const second = (self, curve) => {
      const index = self.valToIdx(this.second);
      return self.data[curve][curve === 0 ? index : closest(self, curve, index)];
    };
    const cell = reader === null
      ? (self, value, curve) => (value === null || value === undefined
        ? "–" : write(value, curve) + (this.second === null ? "" : difference(value, second(self, curve))))
      : (self, value, curve) => reader.text(self, curve);
    const line = ({ dots, holds }) => {
      if (dots) return () => null;
      const paths = holds ? uPlot.paths.stepped({ align: 1 }) : uPlot.paths.linear();
      return reader === null ? paths : (self, ...rest) => (reader.isLine(self) ? paths(self, ...rest) : null);
    };
    const options = {
      width: (element.clientWidth || 800) * scale,
      height: height * scale,
      padding: [8 * scale, () => Math.max(12 * scale, beyond), 0, 0],
      scales: {
        x: { time: false, distr: this.isLogarithmic ? 3 : 1, range: (self, low, high) => [low, high] },
        /* 100 is a scale of these functions: lengths of a quarter do not overflow. */
        y: { distr: isLogarithmic ? 3 : 100, fwd: (value) => value / 4, bwd: (value) => value * 4, range: (self, low, high) => this.heights.get(self) ?? this.vertical(low, high, isLogarithmic, fromZero, self) },
      },
      axes: [
        { ...axis(true, this.isLogarithmic), label: this.label, labelSize: 20 * scale, size: 30 * scale },
        { ...axis(false, isLogarithmic), label: label || undefined, labelSize: 22 * scale,
          size: (self, texts, index) => Math.max(58 * scale, this.breadth(self, texts, index)) },
      ],
      cursor: {
        y: false,
        sync: { key: this.name, setSeries: false, filters: { pub: (kind) => ["mousemove", "mouseleave"].includes(kind) } },
        drag: { x: true, y: true, uni: 40, setScale: false, dist: 3 },
        bind: { dblclick: () => () => this.show(null) },
        move: (self, left, top) => (left > self.over.clientWidth + 1 ? [-10, -10] : [left, top]),
        ...(reader === null ? { dataIdx: closest } : { points: { show: false } }),
      },
      legend: { markers: { dash: (self, k) => (curves[k - 1].dash === undefined ? "solid" : "dashed") } },
      series: [
        { label: this.short, value: cell },
        ...curves.map((curve) => ({
          label: curve.name,
          stroke: colour(curve.colour),
          width: (curve.width ?? 1.6) * scale,
          dash: curve.dash?.map((length) => length * scale),
          spanGaps: false,
          points: { show: curve.dots ?? false, size: 5 * scale, fill: colour(curve.dash === undefined ? curve.colour : "--page"),
            filter: reader === null || curve.dots ? null : reader.points },
          paths: line(curve),
          value: cell,
        })),
      ],
      hooks: {
        drawAxes: [(self) => {
          drawMarks(self, marks, scale);
          if (this.second !== null) drawMarks(self, [{ x: this.second, colour: "--text", dash: [6, 3] }], scale);
        }],
        setCursor: reader === null ? [] : [reader.follow],
        setSelect: [(self) => {
          const { left, top, width, height } = self.select;
          /* A drag along one axis selects all of the other one. */
          const isWide = width > 2 && self.over.clientWidth > width + 1;
          const isHigh = height > 2 && self.over.clientHeight > height + 1;
          if (isHigh) this.showVertical(self, [top + height, top].map((place) => self.posToVal(place, "y")));
          if (isWide) this.show([left, left + width].map((place) => self.posToVal(place, "x")));
          self.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
      },
    };
    const plot = new uPlot(options, data, element);
    this.plots.add(plot);
    this.apply(plot);
    plot.root.classList.toggle("has-second", this.second !== null);
    this.keys(plot, name);
    this.mouse(plot);
    const [to, from] = this.scale();
    zoomByTouch(plot.over, {
      ends: () => [plot.scales.x.min, plot.scales.x.max].map(to),
      whole: () => this.whole(plot).map(to),
      show: (ends) => this.show(ends === null ? null : ends.map(from)),
    });
    return plot;
  }

  /* The range of the vertical axis for visible values between `low` and `high`; with zero while everything is shown. */
  vertical(low, high, isLogarithmic, fromZero) {
    if (low === null || low === undefined) return isLogarithmic ? [0.1, 10] : [0, 1];
    if (isLogarithmic) {
      /* Below this part of the largest value are rounding errors. */
      const least = Math.max(low, 1e-16 * high);
      return [Math.min(least / 1.6, high / 20), 1.6 * high];
    }
    const [bottom, top] = fromZero && this.range === null ? [Math.min(low, 0), Math.max(high, 0)] : [low, high];
    const size = Math.max(Math.abs(bottom), Math.abs(top));
    const air = top - bottom > 1e-12 * size ? 0.06 * (top - bottom) : 0.1 * size || 1;
    const cut = (ends, most) => ends.map((end) => Math.min(Math.max(end, -most), most));
    const ends = cut([bottom - air, top + air], Number.MAX_VALUE);
    /* An axis whose length overflows has no ticks. */
    return Number.isFinite(ends[1] - ends[0]) ? ends : cut(ends, Number.MAX_VALUE / 2);
  }

  /* The room that the labels of an axis take. */
  breadth(self, texts, index) {
    if (!texts) return 0;
    const axis = self.axes[index];
    self.ctx.save();
    self.ctx.font = axis.font[0];
    const widest = Math.max(0, ...texts.map((text) => self.ctx.measureText(text).width));
    self.ctx.restore();
    return Math.ceil(widest / devicePixelRatio) + axis.ticks.size + axis.gap;
  }

  /* A click puts the second cursor; the wheel zooms the vertical axis while Shift is held. */
  mouse(plot) {
    const { over } = plot;
    let pressed = null;
    over.addEventListener("mousedown", (event) => { pressed = event; });
    over.addEventListener("click", (event) => {
      const isDrag = pressed === null || Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) > 3;
      if (event.pointerType !== "touch" && !isDrag) this.toggleSecond(plot);
    });
    over.addEventListener("wheel", (event) => {
      if (!event.shiftKey) return;
      event.preventDefault();
      const at = plot.posToVal(event.clientY - over.getBoundingClientRect().top, "y");
      this.moveVertical(plot, 0, (event.deltaY || event.deltaX) > 0 ? 1.25 : 0.8, at);
    }, { passive: false });
  }

  /* Left and right move the cursor, plus and minus zoom, up and down zoom the vertical axis and with Shift move it, 0
     shows everything, the space bar puts the second cursor, Escape removes it. */
  keys(plot, name) {
    const { root } = plot;
    root.tabIndex = 0;
    root.setAttribute("role", "group");
    root.setAttribute("aria-label", name);
    root.setAttribute("aria-keyshortcuts", "ArrowLeft ArrowRight Shift+ArrowLeft Shift+ArrowRight Plus - ArrowUp ArrowDown Shift+ArrowUp Shift+ArrowDown 0 Space Escape");
    const legend = root.querySelector(".u-legend");
    root.addEventListener("blur", () => {
      legend.removeAttribute("aria-live");
      plot.setCursor({ left: -10, top: -10 }, true, true);
    });
    root.addEventListener("keydown", (event) => {
      if (event.target !== root || event.ctrlKey || event.altKey || event.metaKey) return;
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      const size = { "+": 0.5, "=": 0.5, "-": 2 }[event.key];
      const up = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (way !== undefined) this.step(plot, way * (event.shiftKey ? 0.05 : 0.005));
      else if (size !== undefined) this.zoomAbout(plot, size);
      else if (up !== undefined && event.shiftKey) this.moveVertical(plot, 0.1 * up, 1);
      else if (up !== undefined) this.moveVertical(plot, 0, up > 0 ? 0.8 : 1.25);
      else if (event.key === " ") this.toggleSecond(plot);
      else if (event.key === "Escape") this.setSecond(null);
      else if (event.key === "0") this.show(null);
      else return;
      event.preventDefault();
      legend.setAttribute("aria-live", "polite");
    });
  }

  /* The place of the cursor; the middle if there is none. */
  cursor(plot) {
    const { left } = plot.cursor;
    return plot.posToVal(left >= 0 ? left : plot.over.clientWidth / 2, "x");
  }

  /* Scales the range about the cursor, at most to everything. */
  zoomAbout(plot, size) {
    const at = this.cursor(plot);
    const next = this.moved([plot.scales.x.min, plot.scales.x.max], 0, size, at);
    /* With the cursor at one end, this end is rounded. */
    const [low, high] = this.moved(this.whole(plot), 0, 1 - 1e-9);
    this.show(low >= next[0] && next[1] >= high ? null : next);
    this.moveCursor(plot, at);
  }

  /* Moves the cursor by a part of the range, but at least to the next point. */
  step(plot, by) {
    const [places] = plot.data;
    const range = [plot.scales.x.min, plot.scales.x.max];
    const at = this.cursor(plot);
    const [low] = this.moved(range, by, 1);
    const found = plot.valToIdx(this.isLogarithmic ? at * (low / range[0]) : at + (low - range[0]));
    const here = plot.valToIdx(at);
    const index = found === here ? here + Math.sign(by) : found;
    const next = places[Math.min(Math.max(index, 0), places.length - 1)];
    if (next > range[1] || range[0] > next) {
      const past = this.isLogarithmic ? Math.log(next / at) / Math.log(range[1] / range[0]) : (next - at) / (range[1] - range[0]);
      this.show(this.moved(range, past, 1));
    }
    this.moveCursor(plot, next);
  }

  /* Moves the cursor of all plots to a place, after uPlot has drawn a new range. */
  moveCursor(plot, at) {
    Promise.resolve().then(() => {
      plot.setCursor({ left: plot.valToPos(at, "x"), top: plot.over.clientHeight / 2 }, true, true);
    });
  }
}

/* The closest place at which a curve has a value. */
function closest(self, curve, index) {
  const values = self.data[curve];
  for (let away = 0; values.length > away; away++) {
    if (values[index - away] !== undefined) return index - away;
    if (values[index + away] !== undefined) return index + away;
  }
  return index;
}

/* The difference of a value to that at the second cursor, for a legend; null is a gap. */
function difference(value, other) {
  const text = other !== null && Number.isFinite(value - other) ? String(Number((value - other).toPrecision(6))) : "–";
  return ` (Δ ${text})`;
}

/* Draws vertical marks at `x` and horizontal lines at `y`. */
function drawMarks({ ctx, bbox, valToPos }, marks, scale) {
  const ratio = devicePixelRatio * scale;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.lineWidth = 1.4 * ratio;
  for (const mark of marks) {
    ctx.strokeStyle = ctx.fillStyle = colour(mark.colour);
    ctx.setLineDash((mark.dash ?? []).map((length) => length * ratio));
    ctx.beginPath();
    if (mark.x !== undefined) {
      const x = valToPos(mark.x, "x", true);
      if (mark.end !== undefined) ctx.fillRect(x, bbox.top, valToPos(mark.end, "x", true) - x, 4 * ratio);
      if (mark.flag) {
        ctx.moveTo(x - 5 * ratio, bbox.top);
        ctx.lineTo(x + 5 * ratio, bbox.top);
        ctx.lineTo(x, bbox.top + 8 * ratio);
        ctx.fill();
        ctx.beginPath();
      }
      ctx.moveTo(x, mark.tick ? bbox.top + bbox.height - 7 * ratio : bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
    } else {
      const y = valToPos(mark.y, "y", true);
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
    }
    ctx.stroke();
  }
  ctx.restore();
}

/* Draws the plots of some axes again when colours or pixels change: another scheme of the system, another zoom of the
   browser, or paper, which is light. */
function redrawOn(axes, draw) {
  const { classList } = document.documentElement;
  const paper = (isPaper) => {
    classList.toggle("printing", isPaper);
    draw(isPaper);
    /* uPlot draws in a microtask, and Firefox prints before it. */
    for (const { plots } of axes) for (const plot of plots) plot.batch(() => undefined);
  };
  const again = () => draw(classList.contains("printing"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  addEventListener("dppxchange", again);
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));
}
