"use strict";
/* Zooms the horizontal axis of plots by uPlot. */

/* Zooms by touch: two fingers scale and move the range below them, a double tap shows everything. One finger
   scrolls the page. `ends` and `whole` return the ends of the axis now and when everything is shown, on a scale on
   which all pixels are equally long; `show` takes new ends, or null for everything. */
function zoomByTouch(over, { ends, whole, show }) {
  const fingers = new Map(); /* by identifier: the place as a part of the width */
  let held = null; /* the ends and both places when two fingers touched the plot */
  let touched = null; /* the event of a finger that may become a tap */
  let tapped = null; /* the event of the last tap */
  over.style.touchAction = "pan-y";

  const part = (event) => {
    const { left, width } = over.getBoundingClientRect();
    return (event.clientX - left) / width;
  };
  const hold = () => {
    const now = ends();
    held = fingers.size === 2 && now.every(Number.isFinite) ? { now, places: [...fingers.values()] } : null;
  };
  const isNear = (event, other, time, distance) => other !== null && event.timeStamp - other.timeStamp < time
    && Math.hypot(event.clientX - other.clientX, event.clientY - other.clientY) < distance;

  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch") return;
    fingers.set(event.pointerId, part(event));
    touched = fingers.size === 1 ? event : null;
    hold();
  });
  over.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    fingers.set(event.pointerId, part(event));
    if (held !== null) show(limited(spread(held.now, held.places, [...fingers.values()]), whole()));
  });
  const leave = (event) => {
    fingers.delete(event.pointerId);
    hold();
  };
  over.addEventListener("pointercancel", leave);
  over.addEventListener("pointerup", (event) => {
    if (!fingers.has(event.pointerId)) return;
    leave(event);
    const isTap = isNear(event, touched, 300, 10);
    const isSecond = isTap && isNear(event, tapped, 500, 30);
    tapped = isTap && !isSecond ? event : null;
    if (isSecond) show(null);
  });
}

/* The ends of an axis after two fingers moved `from` two places `to` others, parts of its width. */
function spread([low, high], from, to) {
  const middle = ([first, second]) => (first + second) / 2;
  const distance = ([first, second]) => Math.max(Math.abs(second - first), 0.02);
  const length = (high - low) * (distance(from) / distance(to));
  const start = low + (high - low) * middle(from) - length * middle(to);
  return [start, start + length];
}

/* The ends moved into those of everything; null if they are as far apart. */
function limited([low, high], [least, most]) {
  const length = high - low;
  if (length >= most - least) return null;
  const start = Math.min(Math.max(low, least), most - length);
  return [start, start + length];
}

/* The range of a linear horizontal axis of plots whose data grow. It is kept until everything is shown again. */
class GrowingAxis {
  /* `name` tells axes apart. */
  constructor(name) {
    this.name = name;
    this.range = null; /* null: everything */
    this.plots = new Set();
  }

  /* Draws a plot into an element; a drag over it, or two fingers, zooms all plots. */
  plot(options, data, element) {
    const cursor = {
      sync: { key: this.name, filters: { pub: (kind) => ["mousemove", "mouseleave"].includes(kind) } },
      drag: { x: true, y: false, setScale: false, dist: 3 },
      bind: { dblclick: () => () => this.show(null) },
    };
    const select = (self) => {
      const { left, width } = self.select;
      if (width > 2) this.show([left, left + width].map((place) => self.posToVal(place, "x")));
      self.setSelect({ left: 0, width: 0 }, false);
    };
    const plot = new uPlot({ ...options, cursor, hooks: { setSelect: [select] } }, data, element);
    this.plots.add(plot);
    this.apply(plot);
    zoomByTouch(plot.over, {
      ends: () => [plot.scales.x.min, plot.scales.x.max],
      whole: () => [plot.data[0][0], plot.data[0].at(-1)],
      show: (range) => this.show(range),
    });
    return plot;
  }

  /* Shows a range in all plots; null: everything. */
  show(range) {
    this.range = range;
    for (const plot of this.plots) this.apply(plot);
  }

  /* Gives a plot new data; it keeps a range that is zoomed. */
  update(plot, data) {
    plot.setData(data);
    if (this.range !== null) this.apply(plot);
  }

  apply(plot) {
    const [low, high] = this.range ?? [plot.data[0][0], plot.data[0].at(-1)];
    if (high > low) plot.setScale("x", { min: low, max: high });
  }

  remove(plot) {
    this.plots.delete(plot);
    plot.destroy();
  }
}
