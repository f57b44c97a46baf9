"use strict";
/* The bodies of a filmed state, ropes between them, and the ground of its episode. */

/** Radius in pixels below which a body is small. */
const SMALL = 4;

/** Draws the bodies in the state `s` of the film on a canvas of `width` by `height` pixels. */
function drawScene(context, [width, height], film, s, colors) {
  const [left, right, top, bottom] = film.bounds;
  const scale = Math.min(width / (right - left), height / (bottom - top));
  const middle = [width / 2 - (scale * (left + right)) / 2, height / 2 - (scale * (top + bottom)) / 2];
  const poses = film.bodies.map((_, body) => poseOf(film, s, body));
  const camera = film.tracked === null ? { x: 0, y: 0 } : poses[film.tracked];
  const inWorld = ([px, py]) => [middle[0] + scale * (px - camera.x), middle[1] - scale * (py - camera.y)];
  for (const points of film.states[s].terrain) {
    drawShape(context, { points, thickness: 0 }, inWorld, colors.muted, scale);
  }
  for (const ends of film.ropes) {
    const points = ends.map(({ body, at }) => (body === null ? at : placeOf(poses[body])(at)));
    drawShape(context, { points, thickness: 0 }, inWorld, colors.muted, scale);
  }
  let moving = 0;
  for (const [b, body] of film.bodies.entries()) {
    const inBody = placeOf(poses[b]);
    const color = colorOf(body, () => [colors.accent, colors.text][moving++ % 2], colors);
    const place = (point) => inWorld(inBody(point));
    for (const shape of body.shapes) drawShape(context, shape, place, color, scale);
    if (!body.fixed && radiusOf(body) * scale < SMALL) ring(context, place([0, 0]), color);
  }
}

/** The color that the task gives, gray for what does not move, or the next one of two. */
function colorOf({ color, fixed }, next, colors) {
  if (color) return color;
  return fixed ? colors.muted : next();
}

/** Largest distance of a point of a body from its origin. */
function radiusOf({ shapes }) {
  return Math.max(...shapes.flatMap(({ points }) => points.map(([x, y]) => Math.hypot(x, y))), 0);
}

/** A ring around a body that would be overlooked. */
function ring(context, [x, y], color) {
  context.beginPath();
  context.arc(x, y, 2 * SMALL, 0, 2 * Math.PI);
  context.strokeStyle = `rgb(${color})`;
  context.lineWidth = 1.5;
  context.stroke();
}

/** Where points of a body at this pose are in the world. */
function placeOf({ x, y, angle }) {
  const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  return ([px, py]) => [x + cos * px - sin * py, y + sin * px + cos * py];
}

function poseOf(film, s, body) {
  const { poses, step } = film.states[s];
  const [x, y, angle] = film.ranges.map(
    ([low, high], component) => low + (poses[3 * body + component][step] / MAX_LEVEL) * (high - low),
  );
  return { x, y, angle };
}

function drawShape(context, { points, thickness }, place, color, scale) {
  context.beginPath();
  for (const point of points) context.lineTo(...place(point));
  const style = `rgb(${color})`;
  if (thickness === null) {
    context.fillStyle = style;
    context.fill();
    return;
  }
  context.strokeStyle = style;
  context.lineCap = "round";
  context.lineWidth = Math.max(thickness * scale, 1.5);
  context.stroke();
}
