"use strict";
/* The view as a link, as a command and as a picture. */

/** Draws on a canvas. Texts have a rim in the color of the page, to be read on dark lines. */
class CanvasPen {
  constructor(context, page) {
    Object.assign(this, { context, page });
  }

  image(canvas, x, y, width, height, isPixelated = false) {
    this.context.imageSmoothingEnabled = !isPixelated;
    this.context.drawImage(canvas, x, y, width, height);
  }

  line(points, color, width) {
    const { context } = this;
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.strokeStyle = `rgb(${color})`;
    context.lineWidth = width;
    context.stroke();
  }

  /** A closed shape, or a line of this thickness with round ends. */
  shape(points, thickness, color) {
    const { context } = this;
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.fillStyle = context.strokeStyle = `rgb(${color})`;
    [context.lineCap, context.lineWidth] = ["round", Math.max(thickness ?? 1, 1)];
    if (thickness === null) context.fill();
    else context.stroke();
  }

  /** Leaves out what `draw` draws outside a rectangle. */
  clip({ left, top, width, height }, draw) {
    this.context.save();
    this.context.beginPath();
    this.context.rect(left, top, width, height);
    this.context.clip();
    draw();
    this.context.restore();
  }

  box(x, y, width, height, color) {
    this.context.fillStyle = `rgba(${color},.35)`;
    this.context.fillRect(x, y, width, height);
    for (const [stroke, lineWidth] of [[this.page, 4], [color, 2]]) {
      Object.assign(this.context, { strokeStyle: `rgb(${stroke})`, lineWidth });
      this.context.strokeRect(x, y, width, height);
    }
  }

  text(text, x, y, color, size, align, maxWidth, angle = 0) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate((angle * Math.PI) / 180);
    context.font = `${size}px system-ui, sans-serif`;
    context.fillStyle = `rgb(${color})`;
    context.textAlign = align;
    context.strokeStyle = `rgba(${this.page},.8)`;
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeText(text, 0, 0, maxWidth);
    context.fillText(text, 0, 0, maxWidth);
    context.restore();
  }
}

/** Writes the elements of an SVG file. */
class SvgPen {
  constructor(page) {
    Object.assign(this, { page, elements: [] });
  }

  image(canvas, x, y, width, height, isPixelated = false) {
    const rendering = isPixelated ? ' image-rendering="pixelated"' : "";
    this.elements.push(
      `<image x="${x}" y="${y}" width="${width}" height="${height}" preserveAspectRatio="none"${rendering} href="${canvas.toDataURL()}"/>`,
    );
  }

  shape(points, thickness, color) {
    const list = points.map((point) => point.map((value) => value.toFixed(1)).join()).join(" ");
    const style = thickness === null ? `fill="rgb(${color})"` : `fill="none" stroke="rgb(${color})" stroke-linecap="round" stroke-width="${Math.max(thickness, 1)}"`;
    this.elements.push(`<polyline points="${list}" ${style}/>`);
  }

  /** An inner picture, of which browsers show nothing outside. */
  clip({ left, top, width, height }, draw) {
    this.elements.push(`<svg x="${left}" y="${top}" width="${width}" height="${height}" viewBox="${left} ${top} ${width} ${height}">`);
    draw();
    this.elements.push("</svg>");
  }

  line(points, color, width) {
    const list = points.map((point) => point.map((value) => value.toFixed(1)).join()).join(" ");
    this.elements.push(`<polyline points="${list}" fill="none" stroke="rgb(${color})" stroke-width="${width}"/>`);
  }

  box(x, y, width, height, color) {
    const place = `x="${x}" y="${y}" width="${width}" height="${height}"`;
    this.elements.push(
      `<rect ${place} fill="none" stroke="rgb(${this.page})" stroke-width="4"/>`,
      `<rect ${place} fill="rgb(${color})" fill-opacity=".35" stroke="rgb(${color})" stroke-width="2"/>`,
    );
  }

  text(text, x, y, color, size, align, _maxWidth, angle = 0) {
    const anchor = { left: "start", center: "middle", right: "end" }[align];
    const escaped = xmlText(text);
    this.elements.push(
      `<text transform="translate(${x} ${y}) rotate(${angle})" font-family="sans-serif" font-size="${size}" fill="rgb(${color})" stroke="rgb(${this.page})" stroke-opacity=".8" stroke-width="3" stroke-linejoin="round" paint-order="stroke" text-anchor="${anchor}">${escaped}</text>`,
    );
  }
}

/** A text in XML, without characters that XML does not allow. */
function xmlText(text) {
  const allowed = text.replace(/[^\P{C}\p{Cf}\p{Co}]/gu, "");
  return allowed.replace(/[&<>]/g, (character) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[character]);
}

/** Name of an axis in the address: those after the first of a name have a number. */
function addressName(axes, a) {
  const before = axes.slice(0, a).filter((axis) => axis.name === axes[a].name).length;
  return encodeURIComponent(axes[a].name) + (before ? `;${before}` : "");
}

/** The view after `#` in the address: names of axes are encoded, so that they may contain any character. */
function toHash(app) {
  const { view, axes } = app;
  const name = (a) => addressName(axes, a);
  const parts = [];
  const brushes = view.brushes.flatMap((brush, a) => (brush ? [`${name(a)}:${rangeTexts(axes[a], brush).join(":")}`] : []));
  if (brushes.length) parts.push(`brush=${brushes.join(",")}`);
  if (view.agents) parts.push(`agents=${formatList(view.agents)}`);
  if (view.from > view.first || view.to < view.last) parts.push(`episodes=${view.from}-${view.to}`);
  if (view.color !== "density") parts.push(`color=${view.color}`);
  if (view.color === "difference") parts.push(`compared=${view.compared}`);
  if (view.scatter.join() !== app.firstPair().join()) parts.push(`scatter=${view.scatter.map(name).join(",")}`);
  if (view.isPerAgent) parts.push("per=agent");
  if (view.axes.join() !== app.shownAxes().join()) parts.push(`axes=${view.axes.map(name).join(",")}`);
  return parts.join("&");
}

/** Both ends of a brush as texts, empty at an end of the axis: the shortest numbers between which the same values are. */
function rangeTexts(axis, brush) {
  return brushValues(axis, brush).map((value, end) => {
    if (!Number.isFinite(value)) return "";
    const inner = end ? valueAtMost : valueAtLeast;
    for (let digits = 1; digits < 17; digits++) {
      const number = Number(value.toPrecision(digits));
      if (inner(axis, number) === value) return String(number);
    }
    return String(value);
  });
}

/** What a hash may say. */
const HASH_KEYS = ["brush", "agents", "episodes", "color", "compared", "scatter", "per", "axes"];

/** Changes the view to that of a hash. Returns the parts that it does not understand, which change nothing. */
function fromHash(app, hash) {
  const { view, axes } = app;
  const ignored = hash.split("&").filter((part) => part && !HASH_KEYS.includes(part.split("=")[0]));
  const parameters = new URLSearchParams(hash.replace(/\+/g, "%2B"));
  const raw = new Map(hash.split("&").map((part) => [part.split("=")[0], part.slice(part.indexOf("=") + 1)]));
  const axisNamed = (text) => axes.findIndex((_, a) => decoded(text) === decoded(addressName(axes, a)));
  view.brushes = axes.map(() => null);
  for (const part of (raw.get("brush") ?? "").split(",").filter(Boolean)) {
    const [name, low, high] = part.split(":");
    const a = axisNamed(name);
    const isRange = a >= 0 && high !== undefined;
    const brush = isRange && brushOf(axes[a], low === "" ? -Infinity : Number(low), high === "" ? Infinity : Number(high));
    if (brush && brush.every(Number.isFinite)) view.brushes[a] = withoutFull(brush);
    else ignored.push(`brush=${part}`);
  }
  const agents = parameters.get("agents");
  view.agents = agents === null ? null : parseList(agents, app.agentCount);
  if (agents && !view.agents?.size) ignored.push(`agents=${agents}`);
  const episodes = /^(\d+)-(\d+)$/.exec(parameters.get("episodes") ?? "");
  [view.from, view.to] = episodes ? [Number(episodes[1]), Number(episodes[2])] : [view.first, view.last];
  if (parameters.has("episodes") && !episodes) ignored.push(`episodes=${parameters.get("episodes")}`);
  const color = parameters.get("color");
  view.color = app.colors().includes(color) ? color : "density";
  if (color && view.color !== color) ignored.push(`color=${color}`);
  view.compared = Math.min(Number(parameters.get("compared")) || 0, app.agentCount - 1);
  const axesOf = (key) => {
    const names = (raw.get(key) ?? "").split(",").filter(Boolean);
    ignored.push(...names.filter((name) => axisNamed(name) < 0).map((name) => `${key}=${name}`));
    return names.map(axisNamed).filter((a) => a >= 0);
  };
  const scatter = axesOf("scatter");
  view.scatter = scatter.length === 2 ? scatter : app.firstPair();
  view.isPerAgent = parameters.get("per") === "agent";
  const shown = axesOf("axes");
  view.axes = shown.length > 1 ? shown : app.shownAxes();
  return ignored.map(decoded);
}

/** An encoded text; as it is if it cannot be decoded. */
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** A word of a shell; with control characters, one of bash and zsh. */
function shellWord(word) {
  if (/\p{Cc}/u.test(word)) {
    const hex = (character) => `\\u${character.charCodeAt(0).toString(16).padStart(4, "0")}`;
    return `$'${word.replace(/[\\']/g, "\\$&").replace(/\p{Cc}/gu, hex)}'`;
  }
  return /^[\w./:=,@%+-]+$/.test(word) ? word : `'${word.replace(/'/g, "'\\''")}'`;
}

/** Name of an axis in a command: with its kind, such as `action:x`, if axes of several kinds have its name. */
function commandName(axes, a) {
  const { name, kind } = axes[a];
  return axes.some((axis) => axis.name === name && axis.kind !== kind) ? `${kind}:${name}` : name;
}

/** The command that draws the selected states, as far as `seedbed plot` can. */
function toCommand(app) {
  const { view, axes } = app;
  const what = view.color === "difference" ? "difference" : "visitation";
  const words = ["seedbed", "plot", ...app.runs.map((run) => run.path), "--what", what];
  if (["agent", "outcome", "episode", "return"].includes(view.color)) words.push("--color", view.color);
  if (view.agents) words.push("--agents", [...view.agents].sort((one, other) => one - other).join(","));
  if (view.from > view.first || view.to < view.last) words.push("--episodes", `${view.from}..${view.to + 1}`);
  for (const [a, brush] of view.brushes.entries()) {
    if (brush) words.push("--where", `${commandName(axes, a)}=${rangeTexts(axes[a], brush).join("..")}`);
  }
  words.push("--out", "states.svg");
  return words.map(shellWord).join(" ");
}

/** Height of the title and the counts above a panel in a picture. */
const PICTURE_TITLE = 50;

/** Parts of a picture: all panels, one below the other, each with its scatter plot at the right. */
function pictureParts(app) {
  let bottom = 0;
  return app.panels.map((panel) => {
    const [top, width] = [bottom, panel.scatter.canvas.clientWidth];
    bottom += PICTURE_TITLE + panel.height;
    return { panel, top, bottom, right: panel.width + width, scatterSize: [width, panel.height] };
  });
}

/** Draws all parts. `penOf(x, y)` is a pen whose origin is there. */
function drawPicture(app, penOf) {
  for (const { panel, top, scatterSize } of pictureParts(app)) {
    const pen = penOf(0, top);
    pen.text(panel.run.name, 12, 22, app.theme.text, 15, "left", panel.width);
    pen.text(panel.counts.textContent, 12, 40, app.theme.tick, 11, "left", panel.width);
    const plot = penOf(0, top + PICTURE_TITLE);
    panel.drawOn(plot, app.theme);
    panel.drawFilmedLine(plot, app.theme);
    panel.scatter.drawOn(penOf(panel.width, top + PICTURE_TITLE), app.theme, scatterSize);
  }
  /* On the screen, plots have other places. */
  app.redraw();
}

function pictureSize(app) {
  const parts = pictureParts(app);
  return [Math.max(...parts.map(({ right }) => right)), parts.at(-1).bottom];
}

function toSvg(app) {
  const [width, height] = pictureSize(app);
  const groups = [];
  drawPicture(app, (x, y) => {
    const pen = new SvgPen(app.theme.page);
    groups.push({ x, y, pen });
    return pen;
  });
  const contents = groups.map(({ x, y, pen }) => `<g transform="translate(${x} ${y})">${pen.elements.join("\n")}</g>`).join("\n");
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"><rect width="100%" height="100%" fill="rgb(${app.theme.page})"/>\n${contents}\n</svg>\n`;
}

function toPng(app) {
  const [width, height] = pictureSize(app);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [2 * width, 2 * height];
  const context = canvas.getContext("2d");
  context.fillStyle = `rgb(${app.theme.page})`;
  context.fillRect(0, 0, canvas.width, canvas.height);
  drawPicture(app, (x, y) => {
    context.setTransform(2, 0, 0, 2, 2 * x, 2 * y);
    return new CanvasPen(context, app.theme.page);
  });
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
