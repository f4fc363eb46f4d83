/* A cursor in the figures with curves: shows the values below the pointer, or at the arrow keys, in all figures with
   the same horizontal axis. A click, or Enter, enlarges a figure. */
(() => {
  const charts = [];

  /* The value at a share of an axis, between 0 and 1. */
  function valueAt({ low, high, log }, share) {
    return log ? low * (high / low) ** share : low + share * (high - low);
  }

  function axis(text) {
    const [low, high, log] = text.split(" ");
    return { low: Number(low), high: Number(high), log: log === "log" };
  }

  /* The strokes of a path as the page draws it, "M" and pairs of coordinates, as lists of points; a gap is between two. */
  function strokes(path) {
    return path.getAttribute("d").split("M").slice(1).map((stroke) => {
      const numbers = stroke.trim().split(" ").map(Number);
      return Array.from({ length: numbers.length / 2 }, (_, k) => [numbers[2 * k], numbers[2 * k + 1]]);
    });
  }

  /* The height of a curve at `x`; undefined outside of it and in its gaps. */
  function heightAt(curve, x) {
    for (const points of curve) {
      const after = points.findIndex((point) => point[0] >= x);
      if (after === -1) continue;
      const [x2, y2] = points[after];
      if (after === 0) return 1 > x2 - x ? y2 : undefined;
      const [x1, y1] = points[after - 1];
      return x2 > x1 ? y1 + ((x - x1) / (x2 - x1)) * (y2 - y1) : y2;
    }
    return undefined;
  }

  const said = (value) => (value === undefined ? "–" : String(Number(value.toPrecision(3))));

  /* Shows the cursor at a share of the horizontal axis `range`; null hides it. */
  function show(range, share) {
    for (const { svg, frame, line, text, y, label, curves } of charts) {
      if (svg.dataset.x !== range) continue;
      line.style.display = share === null ? "none" : "";
      if (share === null) {
        text.textContent = "";
        continue;
      }
      const at = frame.left + share * (frame.right - frame.left);
      line.setAttribute("x1", at);
      line.setAttribute("x2", at);
      const heights = curves.map((curve) => heightAt(curve, at));
      const values = heights.map((height) =>
        height === undefined ? undefined : valueAt(y, (frame.bottom - height) / (frame.bottom - frame.top)));
      text.textContent = `${label} ${said(valueAt(axis(range), share))}: ${values.map(said).join(", ")}`;
    }
  }

  for (const svg of document.querySelectorAll("svg[data-x]")) {
    const paths = [...svg.querySelectorAll("path.curve")];
    const figure = svg.closest("figure");
    if (paths.length === 0 || figure === null) continue;
    const box = svg.querySelector("rect.frame");
    const [left, top, width, height] = ["x", "y", "width", "height"].map((name) => Number(box.getAttribute(name)));
    const frame = { left, top, right: left + width, bottom: top + height };
    const line = document.createElementNS(svg.namespaceURI, "line");
    line.classList.add("cursor");
    line.setAttribute("y1", frame.top);
    line.setAttribute("y2", frame.bottom);
    line.style.display = "none";
    svg.append(line);
    const text = document.createElement("p");
    text.className = "said read";
    svg.after(text);
    const label = svg.querySelector("text.label").textContent;
    charts.push({ svg, frame, line, text, y: axis(svg.dataset.y), label, curves: paths.map(strokes) });
    const range = svg.dataset.x;
    let share = 0.5;
    const move = (to) => {
      share = Math.min(Math.max(to, 0), 1);
      show(range, share);
    };
    const enlarge = () => figure.classList.toggle("large");
    svg.addEventListener("pointermove", (event) => {
      const { left: edge, width: shown } = svg.getBoundingClientRect();
      const x = ((event.clientX - edge) / shown) * svg.viewBox.baseVal.width;
      move((x - frame.left) / width);
    });
    svg.addEventListener("pointerleave", () => show(range, null));
    svg.addEventListener("click", enlarge);
    figure.tabIndex = 0;
    figure.addEventListener("blur", () => show(range, null));
    figure.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (way !== undefined) move(share + way * (event.shiftKey ? 0.05 : 0.005));
      else if (event.key === "Enter") enlarge();
      else return;
      event.preventDefault();
      text.setAttribute("aria-live", "polite");
    });
  }
})();
