"use strict";
/* Pictures of pairs of bins: each pair is a line from its bin of one axis to its bin of the next. */

/** Rows of a picture, and its columns between two axes; the page stretches it. */
const ROWS = 2 * BINS;
const COLUMNS = 64;

/** The color of a share, between evenly spaced colors. */
function mixStops(stops, share) {
  const position = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const below = Math.min(Math.floor(position), stops.length - 2);
  return stops[below].map((channel, c) => channel + (position - below) * (stops[below + 1][c] - channel));
}

/** Lines of all gaps between axes: numbers of lines per pixel and, if colored, sums of their colors. */
class Lines {
  constructor(gaps, isColored) {
    const size = gaps * COLUMNS * ROWS;
    this.gaps = gaps;
    this.counts = new Float32Array(size);
    this.colors = isColored ? [0, 1, 2].map(() => new Float32Array(size)) : null;
  }

  /** Adds the lines of gap `gap`. `colors`: one color per pair. */
  add(gap, weights, colors) {
    for (let from = 0; from < BINS; from++) {
      for (let to = 0; to < BINS; to++) {
        const weight = weights[from * BINS + to];
        if (weight) this.addLine(gap, from, to, weight, colors?.[from * BINS + to]);
      }
    }
  }

  addLine(gap, from, to, weight, color) {
    const { counts, colors } = this;
    let y = ROWS - 2 * from - 2 + 0.5;
    const step = (2 * (from - to)) / (COLUMNS - 1);
    let start = gap * COLUMNS * ROWS;
    for (let column = 0; column < COLUMNS; column++, start += ROWS, y += step) {
      const pixel = start + (y | 0);
      counts[pixel] += weight;
      counts[pixel + 1] += weight;
      if (!colors) continue;
      for (let c = 0; c < 3; c++) {
        colors[c][pixel] += weight * color[c];
        colors[c][pixel + 1] += weight * color[c];
      }
    }
  }

  /** Maximum number of lines of a pixel in each gap. */
  maxima() {
    const size = COLUMNS * ROWS;
    return Array.from({ length: this.gaps }, (_, gap) => largest(this.counts.subarray(gap * size, (gap + 1) * size)));
  }
}

/** The largest absolute value. */
function largest(values) {
  let max = 0;
  for (const value of values) max = Math.max(max, Math.abs(value));
  return max;
}

/** The number that a given share of all numbers but zeros does not exceed, without signs; 0 without such numbers. */
function quantile(lists, share) {
  const sizes = Float32Array.from(lists.flatMap((values) => [...values].filter(Boolean).map(Math.abs))).sort();
  return sizes.length ? sizes[Math.floor(share * (sizes.length - 1))] : 0;
}

/** 0 for 0, above 0 for 1, 1 for `max`, on a logarithmic scale. */
function logShare(count, max) {
  return count <= 0 ? 0 : 0.15 + (0.85 * Math.log1p(count)) / Math.log1p(max);
}

/** Paints lines on a canvas of one pixel per pixel of the lines. `paint(pixel, rgba, offset)` sets a color. */
function paintLines(canvas, gaps, paint) {
  canvas.width = gaps * COLUMNS;
  canvas.height = ROWS;
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, ROWS);
  for (let column = 0; column < canvas.width; column++) {
    for (let row = 0; row < ROWS; row++) {
      paint(column * ROWS + row, image.data, 4 * (row * canvas.width + column));
    }
  }
  context.putImageData(image, 0, 0);
}

/** Sets a color and an opacity of 0 to 1. */
function setPixel(rgba, offset, color, opacity) {
  rgba[offset] = color[0];
  rgba[offset + 1] = color[1];
  rgba[offset + 2] = color[2];
  rgba[offset + 3] = 255 * opacity;
}

/** Table of 256 colors, because a color per pixel is needed often. */
function colorTable(stops) {
  return Array.from({ length: 256 }, (_, i) => mixStops(stops, i / 255));
}

/** The colors of a theme. */
function themeColors(palette, isDark) {
  const colors = isDark ? palette.dark : palette.light;
  return { ...colors, densityTable: colorTable(colors.density), sequentialTable: colorTable(colors.sequential), differenceTable: colorTable(colors.difference) };
}

/** What the lines of one view of a run look like: per gap, weights and colors of pairs. */
class Painter {
  constructor(run, view, theme) {
    Object.assign(this, { run, view, theme });
    this.weights = new Float32Array(BINS * BINS);
    this.others = new Float32Array(BINS * BINS);
    this.nans = new Float32Array(BINS * BINS);
    const { classes, colors } = classesOf(run, view, theme);
    this.classes = classes;
    this.classTables = colors.map((color) => colorTable([theme.muted, color]));
    this.classCounts = classes && new Float32Array((colors.length + 1) * BINS * BINS);
  }

  /** Weights (in `this.weights`) and colors of the pairs of two axes. */
  colorsOfPairs(first, second, selection) {
    const { run, view } = this;
    switch (view.color) {
      case "agent":
      case "outcome":
        return this.classColors(first, second, selection);
      case "episode":
        return this.valueColors(first, second, selection, run.episodes.episode, [view.from, view.to]);
      case "return":
        return this.valueColors(first, second, selection, run.episodes.return, view.returns);
      case "difference":
        this.differences(first, second, selection);
        return null;
      default:
        countPairs(run, first, second, selection, this.weights);
        return null;
    }
  }

  /** The mean over the states of each pair as a color; gray if all values are NaN. */
  valueColors(first, second, selection, values, [low, high]) {
    sumPairs(this.run, first, second, selection, values, this.weights, this.others, this.nans);
    return Array.from(this.weights, (weight, pair) => {
      if (!weight) return null;
      const known = weight - this.nans[pair];
      if (!known) return this.theme.muted;
      const share = (this.others[pair] / known - low) / (high - low || 1);
      return this.theme.sequentialTable[Math.round(255 * Math.min(Math.max(share, 0), 1))];
    });
  }

  /** Sets weights to the number of states of all classes. */
  sumClasses() {
    const { weights, classCounts } = this;
    weights.set(classCounts.subarray(0, weights.length));
    for (let start = weights.length; start < classCounts.length; start += weights.length) {
      for (let pair = 0; pair < weights.length; pair++) weights[pair] += classCounts[start + pair];
    }
  }

  /** The color of the class with most states of a pair, grayer the more others share them. */
  classColors(first, second, selection) {
    countClasses(this.run, first, second, selection, this.classes, this.classCounts);
    this.sumClasses();
    const { weights, classCounts, classTables: tables } = this;
    const even = 1 / Math.max(tables.length, 2);
    const colors = new Array(weights.length).fill(null);
    for (let pair = 0; pair < weights.length; pair++) {
      if (!weights[pair]) continue;
      let most = 0;
      for (let c = 1; c <= tables.length; c++) {
        if (classCounts[c * weights.length + pair] > classCounts[most * weights.length + pair]) most = c;
      }
      const share = classCounts[most * weights.length + pair] / weights[pair];
      const purity = Math.max((share - even) / (1 - even), 0);
      colors[pair] = most === tables.length ? this.theme.muted : tables[most][Math.round(255 * (0.25 + 0.75 * purity))];
    }
    return colors;
  }

  /** Replaces weights by the share of the compared agent's states minus that of the team's. */
  differences(first, second, selection) {
    const { run, view } = this;
    const own = selection.ofAgent[view.compared];
    const isCompared = Float32Array.from(run.episodes.agent, (agent) => (agent === view.compared ? 1 : 0));
    sumPairs(run, first, second, selection, isCompared, this.weights, this.others, this.nans);
    const team = this.weights.slice();
    this.weights.set(this.others);
    subtractShares(this.weights, own, team, selection.count);
  }
}

/** Replaces numbers by their share of `sum` minus the share of the team's numbers. */
function subtractShares(numbers, sum, team, teamSum) {
  for (let i = 0; i < numbers.length; i++) numbers[i] = numbers[i] / (sum || 1) - team[i] / (teamSum || 1);
}

/** Classes of episodes that have a color, and these colors. The class after the last one is gray. */
function classesOf(run, view, theme) {
  const { agent, terminated } = run.episodes;
  if (view.color === "outcome") return { classes: Uint8Array.from(terminated, (is) => 1 - is), colors: outcomeColors(theme) };
  if (view.color !== "agent") return { classes: null, colors: [] };
  const highlighted = highlightedAgents(run, view);
  const classOf = Array.from({ length: run.agents }, (_, a) => (highlighted.includes(a) ? highlighted.indexOf(a) : highlighted.length));
  return { classes: Uint8Array.from(agent, (a) => classOf[a]), colors: highlighted.map((a) => agentColor(theme, a)) };
}

function agentColor({ categorical }, agent) {
  return categorical[agent % categorical.length];
}

/** Colors of terminated and of truncated episodes, as in figures. */
function outcomeColors({ categorical }) {
  return [categorical[0], categorical[3]];
}

/** At most eight agents that have a color: those chosen by chips, or the first ones. */
function highlightedAgents(run, view) {
  const agents = Array.from({ length: run.agents }, (_, agent) => agent);
  return agents.filter((agent) => !view.agents || view.agents.has(agent)).slice(0, 8);
}
