/* Draws the plots of #curves, each while it is on the screen or near it. */
(async () => {
  const source = document.getElementById("curves");
  if (source === null) return;
  const { grids, bits, plots, block } = JSON.parse(source.textContent);
  const HEIGHT = { time: 230, frequency: 310, large: 460 };
  /* A picture for paper has more pixels than the screen, unless there are so many that they need gigabytes. */
  const PAPER = 200 > plots.length ? 2 : 1;
  const DASHES = [undefined, [8, 4], [2, 4], [9, 4, 2, 4], [4, 4], [12, 3, 2, 3, 2, 3]];
  const INKS = 7;
  const MARKS = {
    at: (x) => ({ x, colour: "--soft", dash: [2, 3] }),
    size: (y) => ({ y, colour: "--ink-2", dash: [7, 4] }),
  };
  const ZERO = { y: 0, colour: "--frame" };

  /* The lists of numbers in the block. A list has all first bytes, then all second bytes and so on. */
  async function unpacked(text) {
    const packed = new Blob([Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0))]);
    const stream = packed.stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    let offset = 0;
    return (count, Numbers) => {
      const width = Numbers.BYTES_PER_ELEMENT;
      const found = new Uint8Array(count * width);
      for (let byte = 0; byte !== width; byte++) {
        for (let k = 0; k !== count; k++) found[k * width + byte] = bytes[offset++];
      }
      return new Numbers(found.buffer);
    };
  }

  const sum = (list) => list.reduce((total, member) => total + member, 0);
  const next = await unpacked(block);
  const grid = { time: next(grids[0], Float64Array), frequency: next(grids[1], Float64Array) };
  const steps = next(sum(plots.map(({ points }) => points)), Int32Array);
  const values = next(sum(plots.map(({ points, curves }) => points * curves.length)), bits === 64 ? Float64Array : Float32Array);
  let [stepsBefore, valuesBefore] = [0, 0];
  for (const plot of plots) {
    plot.steps = steps.subarray(stepsBefore, stepsBefore += plot.points);
    plot.values = plot.curves.map(() => values.subarray(valuesBefore, valuesBefore += plot.points));
  }

  const axes = {
    time: new LinkedAxis({ name: "time", label: "time in s", short: "t in s", isLogarithmic: true }),
    frequency: new LinkedAxis({ name: "frequency", label: "frequency in rad/s", short: "ω in rad/s", isLogarithmic: true }),
  };

  /* Places and values for uPlot: each point says how far its place is from the one before it in the grid. */
  function data(plot) {
    let index = 0;
    const places = Array.from(plot.steps, (step) => grid[plot.axis][index += step]);
    return [places, ...plot.values.map((own) => Array.from(own, (value) => (Number.isFinite(value) ? value : null)))];
  }

  const write = (value) => String(Number(value.toPrecision(bits === 64 ? 9 : 7)));
  const drawn = new Map();
  let isPaper = false;

  function height(element, plot) {
    return element.closest("figure").classList.contains("large") ? HEIGHT.large : HEIGHT[plot.axis];
  }

  function draw(element) {
    if (drawn.has(element)) return;
    const plot = plots[element.dataset.plot];
    const curves = plot.curves.map((name, k) =>
      ({ name, colour: `--ink-${(k % INKS) + 1}`, dash: DASHES[k % DASHES.length], width: 2 }));
    const marks = plot.marks.flatMap((mark) => Object.entries(mark).map(([kind, at]) => MARKS[kind](at)));
    drawn.set(element, axes[plot.axis].plot(element, data(plot), {
      label: plot.label,
      height: height(element, plot),
      curves,
      marks: plot.logarithmic ? marks : [ZERO, ...marks],
      isLogarithmic: plot.logarithmic,
      fromZero: !plot.logarithmic,
      write,
      name: plot.title,
      scale: isPaper ? PAPER : 1,
    }));
    element.style.minHeight = "";
  }

  /* Keeps the height, so that nothing below moves. */
  function erase(element) {
    const own = drawn.get(element);
    if (own === undefined) return;
    element.style.minHeight = `${element.offsetHeight}px`;
    axes[plots[element.dataset.plot].axis].remove(own);
    drawn.delete(element);
  }

  function resize(element) {
    drawn.get(element)?.setSize({ width: element.clientWidth, height: height(element, plots[element.dataset.plot]) });
  }

  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) draw(target);
      else if (!isPaper && !target.contains(document.activeElement)) erase(target);
    }
  }, { rootMargin: "600px" });

  const elements = plots.map((plot, k) => {
    const element = document.getElementById(plot.id);
    element.dataset.plot = k;
    element.style.minHeight = `${HEIGHT[plot.axis] + 24 * (1 + plot.curves.length)}px`;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "enlarge";
    const caption = element.closest("figure").querySelector("figcaption");
    const call = (action) => {
      button.textContent = action;
      button.setAttribute("aria-label", `${action}: ${plot.title.split(".")[0]}`);
    };
    call("Enlarge");
    button.addEventListener("click", () => {
      call(element.closest("figure").classList.toggle("large") ? "Reduce" : "Enlarge");
      resize(element);
    });
    caption.append(" ", button);
    seen.observe(element);
    return element;
  });

  redrawOn(Object.values(axes), (forPaper) => {
    isPaper = forPaper;
    const before = [...drawn.keys()];
    for (const element of before) erase(element);
    for (const element of isPaper ? elements : before) draw(element);
    /* After printing, the observer tells again which plots are on the screen. */
    for (const element of isPaper ? [] : elements) {
      seen.unobserve(element);
      seen.observe(element);
    }
  });
  addEventListener("resize", () => {
    for (const element of drawn.keys()) resize(element);
  });
})();
