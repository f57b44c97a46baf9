"use strict";
/* The part of the page that shows one run: parallel coordinates with brushes, a scatter plot and a scene. */

const HEIGHT = 380;
const MARGIN = { top: 46, right: 56, bottom: 26, left: 56 };
/** Distance from an axis, in pixels, within which a pointer is on it. */
const REACH = 22;
const SCATTER_SIZE = 230;

class Panel {
  constructor(run, app) {
    Object.assign(this, { run, app, buffers: [new Uint32Array(run.kept), new Uint32Array(run.kept), new Uint32Array(run.kept)] });
    this.image = document.createElement("canvas");
    this.contextImage = document.createElement("canvas");
    this.scatterImage = document.createElement("canvas");
    this.element = document.createElement("section");
    this.element.innerHTML = `<h2></h2><p class="counts"></p><div class="row"><div class="plot"><canvas tabindex="-1"></canvas></div>
      <div class="side"><canvas class="scatter" width="${2 * SCATTER_SIZE}" height="${2 * SCATTER_SIZE}"></canvas>
      <figure hidden><canvas class="scene" width="460" height="300"></canvas><figcaption></figcaption></figure></div></div>`;
    const find = (selector) => this.element.querySelector(selector);
    this.counts = find(".counts");
    this.plot = find(".plot");
    this.canvas = find(".plot canvas");
    this.scatter = find(".scatter");
    this.figure = find("figure");
    find("h2").textContent = run.name;
    this.figure.hidden = !run.film;
    /* The filmed state that is shown; its line is drawn once the pointer chose it. */
    this.filmed = run.film ? Math.min(run.film.states.length - 1, 0) : -1;
    this.isPointed = false;
    this.handles = [];
    this.listen();
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => this.startBrush(event));
    canvas.addEventListener("pointermove", (event) => this.movePointer(event));
    canvas.addEventListener("pointerup", () => this.endBrush());
    canvas.addEventListener("pointercancel", () => this.endBrush());
    new ResizeObserver(() => this.app.redraw()).observe(this.plot);
  }

  get width() {
    return Math.max(this.plot.clientWidth, 300);
  }

  /** Horizontal position of the axis at `index` from the left. */
  x(index) {
    const last = Math.max(this.app.view.axes.length - 1, 1);
    return MARGIN.left + (index / last) * (this.width - MARGIN.left - MARGIN.right);
  }

  y(level) {
    return HEIGHT - MARGIN.bottom - (level / MAX_LEVEL) * (HEIGHT - MARGIN.top - MARGIN.bottom);
  }

  levelAt(y) {
    const share = (HEIGHT - MARGIN.bottom - y) / (HEIGHT - MARGIN.top - MARGIN.bottom);
    return Math.round(Math.min(Math.max(share, 0), 1) * MAX_LEVEL);
  }

  /* ---- pointer ---- */

  position(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** Index, in the view, of the axis at the pointer; -1 if there is none. */
  axisAt(x) {
    const distances = this.app.view.axes.map((_, index) => Math.abs(this.x(index) - x));
    const nearest = distances.indexOf(Math.min(...distances));
    return distances[nearest] <= REACH ? nearest : -1;
  }

  startBrush(event) {
    const [x, y] = this.position(event);
    const index = this.axisAt(x);
    if (index < 0 || event.button > 0) return;
    event.preventDefault();
    this.canvas.setPointerCapture(event.pointerId);
    const axis = this.app.view.axes[index];
    const brush = this.app.view.brushes[axis];
    const level = this.levelAt(y);
    const near = (end) => brush && Math.abs(this.y(brush[end]) - y) < 7;
    const isInside = brush && level > brush[0] && level < brush[1];
    const grip = near(1) ? "high" : near(0) ? "low" : isInside ? "move" : "new";
    this.drag = { axis, grip, brush: brush?.slice(), level, moved: false };
  }

  movePointer(event) {
    const [x, y] = this.position(event);
    if (!this.drag) {
      this.canvas.style.cursor = this.axisAt(x) >= 0 ? "ns-resize" : "crosshair";
      this.point(x, y);
      return;
    }
    const { axis, grip, brush, level } = this.drag;
    const now = this.levelAt(y);
    this.drag.moved ||= Math.abs(this.y(now) - this.y(level)) > 2;
    if (!this.drag.moved) return;
    const ends = { new: [level, now], low: [now, brush?.[1]], high: [brush?.[0], now] }[grip];
    this.app.setBrush(axis, ends ? [Math.min(...ends), Math.max(...ends)] : shifted(brush, now - level));
  }

  /** A click on an axis, without a movement, removes its brush. */
  endBrush() {
    if (this.drag && !this.drag.moved) this.app.setBrush(this.drag.axis, null);
    this.drag = null;
  }

  /** Shows the filmed state that is nearest to the pointer. */
  point(x, y) {
    const last = this.app.view.axes.length - 1;
    const at = Math.min(Math.max(((x - this.x(0)) / (this.x(last) - this.x(0) || 1)) * last, 0), last);
    const nearest = nearestFilmed(this.run, this.app.view, at, this.levelAt(y) / MAX_LEVEL);
    if (nearest < 0 || (this.isPointed && nearest === this.filmed)) return;
    [this.filmed, this.isPointed] = [nearest, true];
    this.app.redraw();
  }

  /* ---- drawing ---- */

  draw() {
    const { view, theme } = this.app;
    this.selectStates();
    this.paint(theme);
    const ratio = Math.min(globalThis.devicePixelRatio || 1, 2);
    this.canvas.width = this.width * ratio;
    this.canvas.height = HEIGHT * ratio;
    this.canvas.style.height = `${HEIGHT}px`;
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    this.drawOn(new CanvasPen(context, theme.page), theme);
    this.drawScatter(theme);
    if (this.filmed >= 0) this.drawFilmed(theme);
    this.placeHandles();
    this.counts.textContent = this.countsText();
    this.canvas.setAttribute("aria-label", `Parallel coordinates of ${view.axes.length} axes. ${this.counts.textContent}`);
  }

  selectStates() {
    const { run } = this;
    const { view } = this.app;
    const key = JSON.stringify([view.from, view.to, view.agents && [...view.agents], view.axes, this.app.isDark]);
    this.isContextOld = key !== this.contextKey;
    this.contextKey = key;
    if (this.isContextOld) this.context = select(run, view, false, this.buffers[0]);
    const hasBrush = view.brushes.some(Boolean);
    this.selection = hasBrush ? select(run, view, true, this.buffers[1]) : this.context;
    /* The difference is that from the whole team, of which chips may hide agents. */
    this.drawn = view.color === "difference" && view.agents ? select(run, { ...view, agents: null }, true, this.buffers[2]) : this.selection;
  }

  /** Paints the lines of all states in gray, and those of the selected states in color. */
  paint(theme) {
    const { axes } = this.app.view;
    const gaps = axes.length - 1;
    const painter = new Painter(this.run, this.app.view, theme);
    this.painter = painter;
    if (this.isContextOld) {
      const context = new Lines(gaps, false);
      for (let gap = 0; gap < gaps; gap++) {
        countPairs(this.run, axes[gap], axes[gap + 1], this.context, painter.weights);
        context.add(gap, painter.weights);
      }
      const max = largest(context.counts);
      paintLines(this.contextImage, gaps, (pixel, rgba, offset) => {
        setPixel(rgba, offset, theme.muted, 0.35 * logShare(context.counts[pixel], max));
      });
    }
    const lines = new Lines(gaps, ["agent", "episode", "return"].includes(this.app.view.color));
    for (let gap = 0; gap < gaps; gap++) {
      const colors = painter.colorsOfPairs(axes[gap], axes[gap + 1], this.drawn);
      lines.add(gap, painter.weights, colors);
    }
    const maxima = lines.maxima();
    this.maxLines = Math.max(...maxima);
    /* Differences have a scale of their own in each gap: those of returns are often much larger. */
    const isDifference = this.app.view.color === "difference";
    const scales = Float64Array.from(maxima, (max) => (isDifference ? max : this.maxLines));
    paintLines(this.image, gaps, this.shader(lines.counts, lines.colors, scales, COLUMNS * ROWS, theme));
  }

  /** A function that sets the color of one pixel. Each gap, of `size` pixels, has its own maximum. */
  shader(counts, colors, maxima, size, theme) {
    const isDifference = this.app.view.color === "difference";
    return (pixel, rgba, offset) => {
      const count = counts[pixel];
      if (count === 0) return;
      const max = maxima[Math.floor(pixel / size)];
      if (isDifference) {
        const share = Math.sign(count) * Math.sqrt(Math.abs(count) / max);
        setPixel(rgba, offset, theme.differenceTable[Math.round(127.5 * (share + 1))], Math.abs(share) ** 0.5);
      } else if (colors) {
        const color = [colors[0][pixel] / count, colors[1][pixel] / count, colors[2][pixel] / count];
        setPixel(rgba, offset, color, 0.25 + 0.75 * logShare(count, max));
      } else {
        setPixel(rgba, offset, theme.densityTable[Math.round(255 * logShare(count, max))], 1);
      }
    };
  }

  /** Draws everything but the handles with a pen, for the screen and for files. */
  drawOn(pen, theme) {
    const { view, axes } = this.app;
    const [left, right] = [this.x(0), this.x(view.axes.length - 1)];
    const [top, bottom] = [this.y(MAX_LEVEL), this.y(0)];
    const hasBrush = view.brushes.some(Boolean);
    if (hasBrush || view.color === "difference") pen.image(this.contextImage, left, top, right - left, bottom - top);
    pen.image(this.image, left, top, right - left, bottom - top);
    if (this.isPointed) this.drawFilmedLine(pen, theme);
    for (const [index, a] of view.axes.entries()) this.drawAxis(pen, theme, this.x(index), axes[a], a);
  }

  drawAxis(pen, theme, x, axis, a) {
    const { brushes, axes } = this.app.view;
    const [top, bottom] = [this.y(MAX_LEVEL), this.y(0)];
    const gap = (this.width - MARGIN.left - MARGIN.right) / Math.max(axes.length - 1, 1);
    pen.line([[x, top], [x, bottom]], theme.axis, 1);
    const brush = brushes[a];
    if (brush) pen.box(x - 6, this.y(brush[1]), 12, this.y(brush[0]) - this.y(brush[1]), theme.brush);
    const isRaised = gap < 90 && axes.indexOf(a) % 2 === 1;
    pen.text(axisTitle(axis), x, top - (isRaised ? 32 : 18), theme.text, 12, "center", Math.max((isRaised || gap < 90 ? 2 : 1) * gap - 8, 40));
    for (const value of ticks(axis, 4)) {
      const y = this.y(((value - axis.low) / (axis.high - axis.low)) * MAX_LEVEL);
      pen.line([[x - 3, y], [x + 3, y]], theme.axis, 1);
      if (gap > 44) pen.text(formatNumber(value), x + 6, y + 3.5, theme.tick, 10, "left", gap);
    }
    this.drawOutside(pen, theme, x, a);
  }

  /** Marks ends beyond which there are values, and axes on which values are NaN. */
  drawOutside(pen, theme, x, a) {
    const [below, above] = this.run.outside[a] ?? [0, 0];
    const [top, bottom] = [this.y(MAX_LEVEL), this.y(0)];
    const isWide = this.width / this.app.view.axes.length > 90;
    const where = (word) => (isWide ? ` ${word}` : "");
    if (above) pen.text(`▲ ${formatCount(above)}${where("above")}`, x, top - 5, theme.warning, 10, "center", 90);
    if (below) pen.text(`▼ ${formatCount(below)}${where("below")}`, x, bottom + 14, theme.warning, 10, "center", 90);
    const nan = this.run.nan[a];
    if (nan) pen.text(`NaN ${formatShare(nan / this.run.kept)}`, x, bottom + (below ? 24 : 14), theme.warning, 10, "center", 90);
  }

  drawFilmedLine(pen, theme) {
    const { film } = this.run;
    const points = this.app.view.axes.map((a, index) => [this.x(index), this.y(film.levels[a][this.filmed])]);
    pen.line(points.filter((_, index) => film.levels[this.app.view.axes[index]][this.filmed] !== MISSING), theme.text, 2);
  }

  drawFilmed(theme) {
    const { film } = this.run;
    const { agent, episode, step } = film.states[this.filmed];
    const accent = theme.categorical[agent % theme.categorical.length];
    drawScene(this.figure.querySelector("canvas"), film, this.filmed, { ...theme, accent });
    this.figure.querySelector("figcaption").textContent = `${this.isPointed ? "filmed state nearest to the pointer" : "filmed states: point at a line"}: agent ${agent}, episode ${episode}, step ${step}`;
  }

  /** The two axes brushed last, or else the first two. */
  scatterAxes() {
    const { view } = this.app;
    const brushed = view.order.filter((a) => view.brushes[a] && view.axes.includes(a));
    const others = view.axes.filter((a) => !brushed.includes(a));
    const [first, second] = [...brushed.slice(-2), ...others];
    return view.axes.indexOf(first) < view.axes.indexOf(second) ? [first, second] : [second, first];
  }

  drawScatter(theme) {
    const [x, y] = this.scatterAxes();
    if (y === undefined) return;
    const weights = new Float32Array(BINS * BINS);
    countPairs(this.run, x, y, this.context, weights);
    const max = largest(weights);
    const colors = this.painter.colorsOfPairs(x, y, this.drawn);
    const selected = this.painter.weights;
    const channels = colors && [0, 1, 2].map((c) => Float32Array.from(selected, (count, pair) => (count ? count * colors[pair][c] : 0)));
    const shade = this.shader(selected, channels, [largest(selected)], BINS * BINS, theme);
    const { scatterImage } = this;
    [scatterImage.width, scatterImage.height] = [BINS, BINS];
    const context = scatterImage.getContext("2d");
    const image = context.createImageData(BINS, BINS);
    for (let pair = 0; pair < BINS * BINS; pair++) {
      const offset = 4 * ((BINS - 1 - (pair % BINS)) * BINS + Math.floor(pair / BINS));
      if (weights[pair]) setPixel(image.data, offset, theme.muted, 0.35 * logShare(weights[pair], max));
      shade(pair, image.data, offset);
    }
    context.putImageData(image, 0, 0);
    const screen = this.scatter.getContext("2d");
    screen.setTransform(2, 0, 0, 2, 0, 0);
    screen.clearRect(0, 0, SCATTER_SIZE, SCATTER_SIZE);
    this.drawScatterOn(new CanvasPen(screen, theme.page), theme, x, y);
  }

  drawScatterOn(pen, theme, x, y) {
    const { axes } = this.app;
    const [left, top, size] = [34, 8, SCATTER_SIZE - 46];
    pen.image(this.scatterImage, left, top, size, size);
    pen.line([[left, top], [left, top + size], [left + size, top + size]], theme.axis, 1);
    pen.text(axisTitle(axes[x]), left + size / 2, top + size + 27, theme.text, 11, "center", size);
    pen.text(axisTitle(axes[y]), 10, top + size / 2, theme.text, 11, "center", size, -90);
    for (const value of ticks(axes[x], 3)) {
      const share = (value - axes[x].low) / (axes[x].high - axes[x].low);
      pen.text(formatNumber(value), left + share * size, top + size + 13, theme.tick, 10, "center", 60);
    }
    for (const value of ticks(axes[y], 3)) {
      const share = (value - axes[y].low) / (axes[y].high - axes[y].low);
      pen.text(formatNumber(value), left - 3, top + (1 - share) * size + 3, theme.tick, 10, "right", 28);
    }
  }

  countsText() {
    const { run, selection } = this;
    const agents = selection.ofAgent.reduce((count, states) => count + (states ? 1 : 0), 0);
    const plural = (count, noun) => `${formatCount(count)} ${noun}${count === 1 ? "" : "s"}`;
    const every = run.kept < run.states ? ` (a sample of ${formatCount(run.states)})` : "";
    if (!run.has_outcomes) {
      return `${formatCount(selection.count)} of ${plural(run.kept, "state")}, a sample of ${formatCount(run.states)}`;
    }
    const truncated = selection.episodes - selection.terminated;
    const ends = `${formatCount(selection.terminated)} terminated, ${formatCount(truncated)} truncated, `;
    const known = selection.episodes - selection.nanReturns;
    const without = selection.nanReturns ? ` without ${formatCount(selection.nanReturns)} NaN` : "";
    const mean = `mean return ${known ? formatNumber(selection.returns / known, 4) : "–"}${without}`;
    return `${formatCount(selection.count)} of ${plural(run.kept, "state")}${every}, ${plural(selection.episodes, "episode")} (${ends}${mean}), ${plural(agents, "agent")}`;
  }

  /* ---- handles, by which the keyboard moves the ends of brushes ---- */

  placeHandles() {
    const { view, axes } = this.app;
    const key = view.axes.join();
    if (key !== this.handleKey) {
      this.handleKey = key;
      this.handles.forEach((handle) => handle.element.remove());
      this.handles = view.axes.flatMap((a, index) => [0, 1].map((end) => this.handle(a, index, end)));
    }
    for (const { element, a, index, end } of this.handles) {
      const level = (view.brushes[a] ?? [0, MAX_LEVEL])[end];
      element.style.left = `${this.x(index)}px`;
      element.style.top = `${this.y(level)}px`;
      element.setAttribute("aria-valuenow", valueAt(axes[a], level).toPrecision(6));
      element.setAttribute("aria-valuetext", formatNumber(valueAt(axes[a], level), 4));
    }
  }

  handle(a, index, end) {
    const axis = this.app.axes[a];
    const element = document.createElement("div");
    element.className = "handle";
    element.tabIndex = this.app.panels[0] === this ? 0 : -1;
    const attributes = { role: "slider", "aria-orientation": "vertical", "aria-label": `${axisTitle(axis)}, ${end ? "upper" : "lower"} end`, "aria-valuemin": axis.low, "aria-valuemax": axis.high };
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.addEventListener("keydown", (event) => this.moveByKey(event, a, end));
    this.plot.append(element);
    return { element, a, index, end };
  }

  moveByKey(event, a, end) {
    const size = event.shiftKey ? MAX_LEVEL / 10 : MAX_LEVEL / 100;
    const steps = { ArrowUp: size, ArrowRight: size, ArrowDown: -size, ArrowLeft: -size, PageUp: MAX_LEVEL / 4, PageDown: -MAX_LEVEL / 4, Home: -MAX_LEVEL, End: MAX_LEVEL };
    const brush = this.app.view.brushes[a] ?? [0, MAX_LEVEL];
    if (event.key === "Delete" || event.key === "Backspace") this.app.setBrush(a, null);
    else if (event.key in steps) this.app.setBrush(a, movedEnd(brush, end, steps[event.key]));
    else return;
    event.preventDefault();
  }
}

/** A brush moved as a whole, within the axis. */
function shifted([low, high], by) {
  const allowed = Math.min(Math.max(by, -low), MAX_LEVEL - high);
  return [low + allowed, high + allowed];
}

/** A brush with one end moved, at most to the other one. */
function movedEnd(brush, end, by) {
  const moved = brush.slice();
  const limits = end ? [brush[0], MAX_LEVEL] : [0, brush[1]];
  moved[end] = Math.round(Math.min(Math.max(brush[end] + by, limits[0]), limits[1]));
  return moved;
}
