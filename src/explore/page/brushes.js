"use strict";
/* Brushes are ranges of levels [low, high]. In texts they are ranges of values, whose ends are half a level
   outside, so that a value is in the range exactly if its level is in the brush. */

/** The value at a level, which may be fractional. */
function valueAt(axis, level) {
  return axis.low + (level / MAX_LEVEL) * (axis.high - axis.low);
}

/** Lower and upper end of a brush as values, half way between two levels, or as whole numbers on axes of such;
    ±Infinity at an end of the axis, beyond which values count too. */
function brushValues(axis, [low, high]) {
  const isWhole = axis.kind === "step" || axis.kind === "episode";
  const [first, last] = [valueAt(axis, low - 0.5), valueAt(axis, high + 0.5)];
  return [
    low <= 0 ? -Infinity : isWhole ? Math.ceil(first) : first,
    high >= MAX_LEVEL ? Infinity : isWhole ? Math.floor(last) : last,
  ];
}

/** Error of computed levels. */
const ROUNDING = 1e-6;

/** The brush of a range of values: the levels of both ends and all between. An end half way between two levels is that
    of the inner level. */
function brushOf(axis, low, high) {
  const position = (value) => ((value - axis.low) / (axis.high - axis.low)) * MAX_LEVEL;
  const clamp = (level) => Math.min(Math.max(level, 0), MAX_LEVEL);
  const brush = [
    low === -Infinity ? 0 : clamp(Math.floor(position(low) + 0.5 + ROUNDING)),
    high === Infinity ? MAX_LEVEL : clamp(Math.ceil(position(high) - 0.5 - ROUNDING)),
  ];
  return brush[0] <= brush[1] ? brush : null;
}

/** A brush without one that covers the whole axis; it would only exclude missing values. */
function withoutFull(brush) {
  return brush[0] <= 0 && brush[1] >= MAX_LEVEL ? null : brush;
}

/** A number with at most `digits` significant digits. */
function formatNumber(value, digits = 3) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e6 || size < 1e-4 ? value.toExponential(digits - 1) : value.toPrecision(digits);
  return String(Number(text)).replace("-", "−");
}

function formatCount(count) {
  return count.toLocaleString("en-US");
}

/** Round values inside the range of an axis, about `count` of them. */
function ticks({ low, high }, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= raw);
  const first = Math.ceil(low / step);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(last - first + 1, 0) }, (_, i) => (first + i) * step);
}

/** Name of an axis with its unit. */
function axisTitle(axis) {
  return axis.unit ? `${axis.name} (${axis.unit})` : axis.name;
}

/** A list such as 0-2,5 of a set of numbers. */
function formatList(numbers) {
  const sorted = [...numbers].sort((one, other) => one - other);
  const parts = [];
  for (const number of sorted) {
    const last = parts.at(-1);
    if (last && last[1] === number - 1) last[1] = number;
    else parts.push([number, number]);
  }
  return parts.map(([first, last]) => (first === last ? `${first}` : `${first}-${last}`)).join(",");
}

/** The numbers below `end` of a list such as 0-2,5; null if it is no such list. */
function parseList(text, end) {
  const numbers = new Set();
  for (const part of text.split(",").map((piece) => piece.trim()).filter(Boolean)) {
    const match = /^(\d+)(?:-(\d+))?$/.exec(part);
    if (!match) return null;
    for (let i = Number(match[1]); i <= Math.min(Number(match[2] ?? match[1]), end - 1); i++) numbers.add(i);
  }
  return numbers;
}
