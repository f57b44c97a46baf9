"use strict";
/* The part of the page that shows one run: parallel coordinates with brushes, a scatter plot and a film. */

const MARGIN = { top: 46, right: 44, bottom: 26, left: 44 };
/** Minimum distance of axes, in pixels; where there is less room, people scroll. */
const MIN_GAP = 48;
/** Distance from an axis, in pixels, within which a pointer is on it, and from its upper end, above which its title is. */
const REACH = 22;
const TITLE_DISTANCE = 12;

class Panel {
  constructor(run, app) {
    Object.assign(this, { run, app, contextNumber: 0, buffers: [new Uint32Array(run.kept), new Uint32Array(run.kept), new Uint32Array(run.kept)] });
    this.image = document.createElement("canvas");
    this.contextImage = document.createElement("canvas");
    this.element = byId("run").content.firstElementChild.cloneNode(true);
    const find = (selector) => this.element.querySelector(selector);
    [this.counts, this.plot, this.canvas, this.mark] = [".counts", ".parallel", ".lines", ".plot .mark"].map(find);
    find("h2").textContent = run.name;
    find(".film").hidden = !run.film;
    find(".panels").classList.toggle("without-film", !run.film);
    this.scatter = new Scatter(this);
    this.player = run.film && new Player(this);
    this.handles = [];
    this.listen();
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => this.startBrush(event));
    canvas.addEventListener("pointermove", (event) => this.movePointer(event));
    canvas.addEventListener("pointerup", () => this.endBrush());
    canvas.addEventListener("pointercancel", () => this.endBrush());
    canvas.addEventListener("click", (event) => this.openTitle(event));
    const observer = new ResizeObserver(() => this.app.redraw());
    for (const part of this.element.querySelectorAll(".plot, .picture")) observer.observe(part);
  }

  get width() {
    return Math.max(this.plot.clientWidth, 300);
  }

  get height() {
    return Math.max(this.plot.clientHeight, 200);
  }

  /** Horizontal position of the axis at `index` from the left. */
  x(index) {
    const last = Math.max(this.app.view.axes.length - 1, 1);
    return MARGIN.left + (index / last) * (this.width - MARGIN.left - MARGIN.right);
  }

  y(level) {
    return this.height - MARGIN.bottom - (level / MAX_LEVEL) * (this.height - MARGIN.top - MARGIN.bottom);
  }

  levelAt(y) {
    const share = (this.height - MARGIN.bottom - y) / (this.height - MARGIN.top - MARGIN.bottom);
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

  isOnTitle(y) {
    return y < this.y(MAX_LEVEL) - TITLE_DISTANCE;
  }

  /** A click on the title of an axis lets a person type its range. */
  openTitle(event) {
    const [x, y] = this.position(event);
    const index = this.axisAt(x);
    if (index >= 0 && this.isOnTitle(y)) this.app.ranges.open(this.app.view.axes[index]);
  }

  startBrush(event) {
    const [x, y] = this.position(event);
    const index = this.axisAt(x);
    if (event.pointerType === "touch") this.point(x, y);
    if (index < 0 || event.button > 0 || this.isOnTitle(y)) return;
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
      const isOnAxis = this.axisAt(x) >= 0;
      const isOnTitle = isOnAxis && this.isOnTitle(y);
      this.canvas.style.cursor = isOnTitle ? "pointer" : isOnAxis ? "ns-resize" : "crosshair";
      this.canvas.title = isOnTitle ? "Click: type a range" : "";
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

  /** Shows the filmed state that is nearest to the pointer, unless a film is played. */
  point(x, y) {
    const { player } = this;
    if (!player || player.playing) return;
    const last = this.app.view.axes.length - 1;
    const at = Math.min(Math.max(((x - this.x(0)) / (this.x(last) - this.x(0) || 1)) * last, 0), last);
    const nearest = nearestFilmed(this.run, this.app.view, at, this.levelAt(y) / MAX_LEVEL);
    if (nearest >= 0 && !(player.isMarked && nearest === player.state)) player.show(nearest);
  }

  /* ---- drawing ---- */

  draw() {
    const { view, theme } = this.app;
    this.selectStates();
    this.paint(theme);
    this.plot.style.minWidth = `${MARGIN.left + MARGIN.right + MIN_GAP * (view.axes.length - 1)}px`;
    this.drawOn(new CanvasPen(fitCanvas(this.canvas)[0], theme.page), theme);
    this.scatter.draw();
    if (this.player) this.player.draw();
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
    if (this.isContextOld) {
      this.contextNumber++;
      this.context = select(run, view, false, this.buffers[0]);
    }
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
    const lines = new Lines(gaps, !["density", "difference"].includes(this.app.view.color));
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
        const share = Math.sign(count) * Math.sqrt(Math.min(Math.abs(count) / max, 1));
        setPixel(rgba, offset, theme.differenceTable[Math.round(127.5 * (share + 1))], 0.4 + 0.6 * Math.abs(share));
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

  /** Marks the filmed state that is shown: a line here, a dot in the scatter plot. */
  drawMarks() {
    const { theme } = this.app;
    this.drawFilmedLine(new CanvasPen(fitCanvas(this.mark)[0], theme.page), theme);
    this.scatter.drawMark(theme);
  }

  drawFilmedLine(pen, theme) {
    const { film } = this.run;
    const { state, isMarked } = this.player ?? {};
    const points = isMarked ? this.app.view.axes.map((a, index) => [this.x(index), film.levels[a][state]]) : [];
    const known = points.filter(([, level]) => level !== MISSING).map(([x, level]) => [x, this.y(level)]);
    pen.line(known, theme.page, 5);
    pen.line(known, theme.text, 2.5);
  }

  countsText() {
    const { run, selection } = this;
    const agents = selection.ofAgent.reduce((count, states) => count + (states ? 1 : 0), 0);
    const plural = (count, noun) => `${formatCount(count)} ${noun}${count === 1 ? "" : "s"}`;
    const every = run.kept < run.states ? ` (sampled from ${formatCount(run.states)})` : "";
    const states = `${formatCount(selection.count)} of ${plural(run.kept, "state")}${every}`;
    if (!run.has_outcomes) return states;
    const truncated = selection.episodes - selection.terminated;
    const ends = `${formatCount(selection.terminated)} terminated, ${formatCount(truncated)} truncated, `;
    const known = selection.episodes - selection.nanReturns;
    const without = selection.nanReturns ? `, ${formatCount(selection.nanReturns)} NaN left out` : "";
    const mean = `mean return ${known ? formatNumber(selection.returns / known, 4) : "–"}${without}`;
    return `${states}, ${plural(selection.episodes, "episode")} (${ends}${mean}), ${plural(agents, "agent")}`;
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
    else if (event.key === "Enter") this.app.ranges.open(a);
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
