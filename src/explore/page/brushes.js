"use strict";
/* Brushes are ranges of levels [low, high]. In texts they are ranges of values: those between the smallest and the
   largest value whose level is in the brush. Values are numbers in single precision, or whole numbers. */

/** The value at a level, which may be fractional. */
function valueAt(axis, level) {
  return axis.low + (level / MAX_LEVEL) * (axis.high - axis.low);
}

function isWhole(axis) {
  return axis.kind === "step" || axis.kind === "episode";
}

const SINGLE = new Float32Array(1);
const SINGLE_BITS = new Int32Array(SINGLE.buffer);
/** The bits of -0. */
const MINUS_ZERO = -0x80000000;

/** Number of a value among all values of an axis, in their order. */
function orderOf(axis, value) {
  if (isWhole(axis)) return value;
  SINGLE[0] = value;
  return SINGLE_BITS[0] < 0 ? MINUS_ZERO - SINGLE_BITS[0] : SINGLE_BITS[0];
}

/** The value with a number of `orderOf`. */
function valueOfOrder(axis, order) {
  if (isWhole(axis)) return order;
  SINGLE_BITS[0] = order < 0 ? MINUS_ZERO - order : order;
  return SINGLE[0];
}

/** The smallest value that is not below a number. */
function valueAtLeast(axis, number) {
  const value = isWhole(axis) ? Math.ceil(number) : Math.fround(number);
  return value < number ? valueOfOrder(axis, orderOf(axis, value) + 1) : value;
}

/** The largest value that is not above a number. */
function valueAtMost(axis, number) {
  const value = isWhole(axis) ? Math.floor(number) : Math.fround(number);
  return value > number ? valueOfOrder(axis, orderOf(axis, value) - 1) : value;
}

/** The smallest value on an axis whose level is at least `level`. */
function firstValue(axis, level) {
  let before = orderOf(axis, valueAtLeast(axis, axis.low)) - 1;
  let first = orderOf(axis, valueAtMost(axis, axis.high)) + 1;
  while (first - before > 1) {
    const middle = Math.floor((before + first) / 2);
    if (levelOf(axis, valueOfOrder(axis, middle)) < level) before = middle;
    else first = middle;
  }
  return valueOfOrder(axis, first);
}

/** Smallest and largest value of a brush; ±Infinity at an end of the axis, beyond which values count too. */
function brushValues(axis, [low, high]) {
  const last = (level) => valueOfOrder(axis, orderOf(axis, firstValue(axis, level + 1)) - 1);
  return [low <= 0 ? -Infinity : firstValue(axis, low), high >= MAX_LEVEL ? Infinity : last(high)];
}

/** The brush of a range of values: the levels of its smallest and largest value, and all between; null without values. */
function brushOf(axis, low, high) {
  const [first, last] = [valueAtLeast(axis, low), valueAtMost(axis, high)];
  if (!(first <= last)) return null;
  return [low === -Infinity ? 0 : levelOf(axis, first), high === Infinity ? MAX_LEVEL : levelOf(axis, last)];
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

/** A share in percent, such as 30 % or 0.02 %. */
function formatShare(share) {
  return `${formatNumber(100 * share, share < 0.1 ? 1 : 2)} %`;
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
  return axis.unit ? `${axis.name} [${axis.unit}]` : axis.name;
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
