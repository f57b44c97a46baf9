"use strict";
/* The bodies of a filmed state, ropes between them, and the ground of its episode. */

/** Draws the bodies in the state `s` of the film. */
function drawScene(canvas, film, s, colors) {
  const context = canvas.getContext("2d");
  const ratio = canvas.width / canvas.clientWidth || 1;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  const [left, right, top, bottom] = film.bounds;
  const scale = Math.min(canvas.width / (right - left), canvas.height / (bottom - top));
  const middle = [canvas.width / 2 - (scale * (left + right)) / 2, canvas.height / 2 - (scale * (top + bottom)) / 2];
  const poses = film.bodies.map((_, body) => poseOf(film, s, body));
  const camera = film.tracked === null ? { x: 0, y: 0 } : poses[film.tracked];
  const inWorld = ([px, py]) => [middle[0] + scale * (px - camera.x), middle[1] - scale * (py - camera.y)];
  for (const points of film.states[s].terrain) {
    drawShape(context, { points, thickness: 0 }, inWorld, colors.muted, scale, ratio);
  }
  for (const ends of film.ropes) {
    const points = ends.map(({ body, at }) => (body === null ? at : placeOf(poses[body])(at)));
    drawShape(context, { points, thickness: 0 }, inWorld, colors.muted, scale, ratio);
  }
  let moving = 0;
  for (const [b, body] of film.bodies.entries()) {
    const inBody = placeOf(poses[b]);
    const color = body.fixed ? colors.muted : [colors.accent, colors.text][moving++ % 2];
    const place = (point) => inWorld(inBody(point));
    for (const shape of body.shapes) drawShape(context, shape, place, color, scale, ratio);
  }
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

function drawShape(context, { points, thickness }, place, color, scale, ratio) {
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
  context.lineWidth = Math.max(thickness * scale, 1.5 * ratio);
  context.stroke();
}
