"use strict";
/* States on two axes: those of all agents in one plot, or one plot per agent. */

/** Maximum number of agents with a plot of their own. */
const MAX_PLOTS = 16;
const SCATTER_MARGIN = { top: 10, right: 14, bottom: 36, left: 50 };
/** Largest ratio of two lengths on whose axes meters have one length without scenery, as in figures. */
const MAX_ASPECT = 4;
/** Distance between plots, and height of their titles. */
const PLOT_GAP = 8;

/** Width of a digit of a tick, in pixels. */
const LETTER_WIDTH = 6;
const TITLE_HEIGHT = 16;
/** Share of cells with a difference that are not beyond the end of the scale of colors. */
const SHARE_OF_DIFFERENCES = 0.95;
/** Maximum size of a cell of the grid of two axes, in bins. */
const MAX_CELL = 12;

class Scatter {
  constructor(panel) {
    Object.assign(this, { panel, images: [], plots: [], cellSizes: [], buffers: [[], []] });
    const find = (selector) => panel.element.querySelector(`.pair ${selector}`);
    [this.canvas, this.mark, this.label, this.output] = [".scatter", ".mark", ".each", "output"].map(find);
    this.menus = [".x", ".y"].map(find);
    const { app, run } = panel;
    for (const [index, menu] of this.menus.entries()) {
      menu.replaceChildren(...app.axes.map((axis, a) => new Option(axisTitle(axis), a)));
      menu.onchange = () => app.change({ scatter: app.view.scatter.with(index, Number(menu.value)) });
    }
    this.label.hidden = run.agents < 2;
    this.box = this.label.querySelector("input");
    this.box.onchange = () => app.change({ isPerAgent: this.box.checked });
  }

  /** Agents with a plot of their own; [null] for one plot of all agents. */
  agents() {
    const { run, app } = this.panel;
    if (!app.view.isPerAgent || run.agents < 2) return [null];
    const all = Array.from({ length: run.agents }, (_, agent) => agent);
    return all.filter((agent) => !app.view.agents || app.view.agents.has(agent)).slice(0, MAX_PLOTS);
  }

  draw() {
    const { view, theme } = this.panel.app;
    this.countStates();
    const [context, size] = fitCanvas(this.canvas);
    this.drawOn(new CanvasPen(context, theme.page), theme, size);
    this.menus.forEach((menu, index) => (menu.value = view.scatter[index]));
    this.box.checked = view.isPerAgent;
    this.panel.element.querySelector(".panels").classList.toggle("per-agent", this.plots.length > 1);
    const names = view.scatter.map((a) => axisTitle(this.panel.app.axes[a]));
    this.canvas.setAttribute("aria-label", `Scatter plot of ${names.join(" and ")}${view.isPerAgent ? ", one per agent" : ""}`);
  }

  /** Paints the image of each plot. All plots have one scale of numbers. */
  countStates() {
    const { panel } = this;
    const agents = this.agents();
    this.countContext(agents);
    const pairs = this.selectedPairs(agents);
    const max = Math.max(...pairs.map(({ weights }) => largest(weights)), 0);
    const isDifference = panel.app.view.color === "difference";
    /* A few cells where agents begin or stay differ far more than all others, which would be pale. */
    const end = isDifference ? quantile(pairs.map(({ weights }) => weights), SHARE_OF_DIFFERENCES) : max;
    const scale = [isDifference ? `colors up to ±${formatShare(end)} of the states per cell, √ scale; largest ±${formatShare(max)}` : `max ${formatCount(max)} per cell`];
    const first = agents.length === MAX_PLOTS && panel.run.agents > MAX_PLOTS ? [`first ${MAX_PLOTS} shown agents`] : [];
    this.output.textContent = [...scale, ...first].join(", ");
    const grayMax = Math.max(...this.context.map(largest), 0);
    this.plots = agents.map((agent, index) => {
      const image = (this.images[index] ??= document.createElement("canvas"));
      const shade = panel.shader(pairs[index].weights, pairs[index].channels, [end], BINS * BINS, panel.app.theme);
      const gray = (pair, rgba, offset) => setPixel(rgba, offset, panel.app.theme.muted, 0.35 * logShare(this.context[index][pair], grayMax));
      paintPairs(image, [[this.context[index], gray], [pairs[index].weights, shade]], panel.app.view.scatter.map((a) => this.cellSize(a)));
      return { agent, image, count: pairs[index].count };
    });
  }

  /** Number of bins between neighboring values of an axis, if it has few values: the size of a cell. */
  cellSize(a) {
    this.cellSizes[a] ??= Math.min(smallestGap(this.panel.run.bins[a] ?? []), MAX_CELL);
    return this.cellSizes[a];
  }

  /** Counts the states of each plot without regard to brushes, which are gray. */
  countContext(agents) {
    const { run, app, context, contextNumber } = this.panel;
    const key = [contextNumber, agents, app.view.scatter].join(";");
    if (key === this.contextKey) return;
    this.contextKey = key;
    this.context = this.parts(context, agents, 0).map((part) => {
      const weights = new Float32Array(BINS * BINS);
      countPairs(run, ...app.view.scatter, part, weights);
      return weights;
    });
  }

  /** A selection as one per agent. */
  parts(selection, agents, buffer) {
    if (agents[0] === null) return [selection];
    this.buffers[buffer] = this.buffers[buffer].length ? this.buffers[buffer] : new Uint32Array(this.panel.run.kept);
    return splitByAgent(this.panel.run, selection, agents, this.buffers[buffer]);
  }

  /** Numbers of selected states of the pairs of bins of each plot, and sums of their colors. */
  selectedPairs(agents) {
    const { painter, drawn, run, app } = this.panel;
    const { scatter, color } = app.view;
    const isDifference = color === "difference" && agents[0] !== null;
    const team = new Float32Array(BINS * BINS);
    if (isDifference) countPairs(run, ...scatter, drawn, team);
    return this.parts(drawn, agents, 1).map((part) => {
      const colors = isDifference ? null : painter.colorsOfPairs(...scatter, part);
      const weights = isDifference ? new Float32Array(BINS * BINS) : painter.weights.slice();
      if (isDifference) {
        countPairs(run, ...scatter, part, weights);
        subtractShares(weights, part.count, team, drawn.count);
      }
      const channels = colors && [0, 1, 2].map((c) => weights.map((count, pair) => (count ? count * colors[pair][c] : 0)));
      return { weights, channels, count: part.count };
    });
  }

  /* ---- drawing ---- */

  /** The fixed bodies of the task, if the axes are its coordinates. */
  scenery() {
    const names = this.panel.app.view.scatter.map((a) => axisTitle(this.panel.app.axes[a]));
    return names.join() === "x [m],y [m]" ? this.panel.run.scenery : [];
  }

  /** Places the plots in a grid in which they are as large as possible. */
  placePlots([width, height]) {
    const { top, right, bottom, left } = SCATTER_MARGIN;
    const { plots } = this;
    const titleHeight = plots[0]?.agent === null ? 0 : TITLE_HEIGHT;
    const sizes = plots.map((_, index) => {
      const [columns, rows] = [index + 1, Math.ceil(plots.length / (index + 1))];
      return [columns, (width - left - right + PLOT_GAP) / columns - PLOT_GAP, (height - top - bottom) / rows - titleHeight];
    });
    const smaller = ([, one, other]) => Math.min(one, other);
    const [columns, cellWidth, cellHeight] = sizes.reduce((best, size) => (smaller(size) > smaller(best) ? size : best), sizes[0] ?? []);
    plots.forEach((plot, index) => {
      const [column, row] = [index % columns, Math.floor(index / columns)];
      const cell = { left: left + column * (cellWidth + PLOT_GAP), top: top + row * (cellHeight + titleHeight) + titleHeight, width: cellWidth, height: cellHeight };
      Object.assign(plot, this.toScale(cell), { isLeft: column === 0, isRight: column === columns - 1, isBottom: index + columns >= plots.length });
    });
  }

  /** Of two lengths, the middle part of a cell in which meters have one length on both axes; with scenery also if one is much shorter. */
  toScale(cell) {
    const axes = this.panel.app.view.scatter.map((a) => this.panel.app.axes[a]);
    const lengths = axes.map((axis) => axis.high - axis.low);
    const areSimilar = axes.every((axis) => axis.unit === "m") && Math.max(...lengths) <= MAX_ASPECT * Math.min(...lengths);
    if (!areSimilar && !this.scenery().length) return cell;
    const scale = Math.min(cell.width / lengths[0], cell.height / lengths[1]);
    const [width, height] = lengths.map((length) => scale * length);
    return { left: cell.left + (cell.width - width) / 2, top: cell.top + (cell.height - height) / 2, width, height };
  }

  drawOn(pen, theme, size) {
    this.placePlots(size);
    const [x, y] = this.panel.app.view.scatter.map((a) => this.panel.app.axes[a]);
    for (const plot of this.plots) this.drawPlot(pen, theme, plot, x, y);
    if (!this.plots.length) return;
    const left = Math.min(...this.plots.map((plot) => plot.left));
    const right = Math.max(...this.plots.map((plot) => plot.left + plot.width));
    const top = Math.min(...this.plots.map((plot) => plot.top));
    const bottom = Math.max(...this.plots.map((plot) => plot.top + plot.height));
    pen.text(axisTitle(x), (left + right) / 2, bottom + 29, theme.text, 12, "center", size[0]);
    pen.text(axisTitle(y), left - 38, (top + bottom) / 2, theme.text, 12, "center", bottom - top, -90);
  }

  drawPlot(pen, theme, plot, x, y) {
    const { left, top, width, height } = plot;
    pen.clip(plot, () => {
      for (const shape of this.scenery()) {
        const scale = width / (x.high - x.low);
        const place = ([px, py]) => [left + scale * (px - x.low), top + height - scale * (py - y.low)];
        pen.shape(shape.points.map(place), shape.thickness === null ? null : shape.thickness * scale, mixStops([theme.page, theme.muted], 0.4));
      }
    });
    pen.image(plot.image, left, top, width, height, true);
    pen.line([[left, top], [left, top + height], [left + width, top + height]], theme.axis, 1);
    if (plot.agent !== null) {
      const word = width < 110 ? "" : "agent ";
      pen.text(`${word}${plot.agent} · ${formatCount(plot.count)}`, left + width / 2, top - 4, theme.text, 11, "center", width);
    }
    this.drawTicks(pen, theme, plot, x, y);
  }

  /** Ticks of the plots at the left and at the bottom. */
  drawTicks(pen, theme, { left, top, width, height, isLeft, isRight, isBottom }, x, y) {
    const share = (axis, value) => (value - axis.low) / (axis.high - axis.low);
    const isSmall = (length) => length < 150;
    const values = (axis, length) => ticks(axis, isSmall(length) ? 2 : 4);
    /* A number at the right end of a plot would touch the one at the left end of the next plot. */
    const touchesNext = (value) => !isRight && (1 - share(x, value)) * width + PLOT_GAP < LETTER_WIDTH * (formatNumber(value).length / 2 + 2);
    const below = isBottom ? values(x, width).filter((value) => !touchesNext(value)) : [];
    for (const value of below) {
      pen.text(formatNumber(value), left + share(x, value) * width, top + height + 13, theme.tick, 10, "center", 60);
    }
    /* So would numbers at the ends of small plots one above the other. */
    const isNearEnd = (value) => isSmall(height) && Math.abs(share(y, value) - 0.5) >= 0.45;
    const beside = isLeft ? values(y, height).filter((value) => !isNearEnd(value)) : [];
    for (const value of beside) {
      pen.text(formatNumber(value), left - 4, top + (1 - share(y, value)) * height + 3, theme.tick, 10, "right", 30);
    }
  }

  /** Where a filmed state is in a plot; null without a value on one of the axes. */
  placeOfFilmed({ left, top, width, height }, s) {
    const [x, y] = this.panel.app.view.scatter.map((a) => this.panel.run.film.levels[a][s]);
    return x === MISSING || y === MISSING ? null : [left + (x / MAX_LEVEL) * width, top + (1 - y / MAX_LEVEL) * height];
  }

  /** The path of the filmed episode up to the state that is shown, and a dot there. */
  drawMark(theme) {
    const [context] = fitCanvas(this.mark);
    const { state, filmed, isMarked } = this.panel.player ?? {};
    const plot = isMarked && this.plots.find(({ agent }) => agent === null || agent === filmed.agent);
    if (!plot) return;
    const states = Array.from({ length: state - filmed.first + 1 }, (_, step) => filmed.first + step);
    const places = states.map((s) => this.placeOfFilmed(plot, s));
    new CanvasPen(context, theme.page).line(places.filter(Boolean), theme.text, 1);
    if (!places.at(-1)) return;
    context.beginPath();
    context.arc(...places.at(-1), Math.min(5, plot.width / 20), 0, 2 * Math.PI);
    context.fillStyle = `rgb(${agentColor(theme, filmed.agent)})`;
    context.strokeStyle = `rgb(${theme.text})`;
    context.lineWidth = 2;
    context.fill();
    context.stroke();
  }
}

/** Paints pairs of bins as cells of this size. `layers`: numbers of states, and a function that sets the color of a pixel. */
function paintPairs(canvas, layers, [width, height]) {
  [canvas.width, canvas.height] = [BINS, BINS];
  const context = canvas.getContext("2d");
  const image = context.createImageData(BINS, BINS);
  for (const [weights, paint] of layers) {
    for (let pair = 0; pair < BINS * BINS; pair++) {
      if (weights[pair]) paintCell(Math.floor(pair / BINS), pair % BINS, width, height, (offset) => paint(pair, image.data, offset));
    }
  }
  context.putImageData(image, 0, 0);
}

/** Calls `paint` with the offsets of the pixels of a cell around the bins `x` and `y`. */
function paintCell(x, y, width, height, paint) {
  const [left, low] = [x - Math.floor(width / 2), y - Math.floor(height / 2)];
  for (let column = Math.max(left, 0); column < Math.min(left + width, BINS); column++) {
    for (let row = Math.max(low, 0); row < Math.min(low + height, BINS); row++) paint(4 * ((BINS - 1 - row) * BINS + column));
  }
}

/** Smallest distance between two bins that have states; plus 1 if there are also such distances, which rounding causes. */
function smallestGap(bins) {
  const isUsed = new Uint8Array(256);
  for (let i = 0; i < bins.length; i++) isUsed[bins[i]] = 1;
  const used = Array.from({ length: BINS }, (_, bin) => bin).filter((bin) => isUsed[bin]);
  const gaps = used.slice(1).map((bin, k) => bin - used[k]);
  const smallest = Math.min(...gaps, BINS);
  return smallest > 1 && gaps.includes(smallest + 1) ? smallest + 1 : smallest;
}
