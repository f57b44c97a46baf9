"use strict";
/* Numbers of the page's data, and the runs that they make up. Written by `encode.rs` and `mod.rs`. */

/** Quantities are stored as levels from 0 to MAX_LEVEL, the ends of their axis. */
const MAX_LEVEL = 65534;
const MISSING = 65535;
/** Number of bins of an axis, and the bin of a missing value. */
const BINS = 96;
const NO_BIN = 255;

/** The bytes of a text in base64, decompressed. */
async function inflate(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Numbers of 2 or 4 bytes from their differences, of which all first bytes come first. */
async function decode(text, count, bytesPerNumber) {
  const planes = await inflate(text);
  const numbers = bytesPerNumber === 2 ? new Uint16Array(count) : new Uint32Array(count);
  let previous = 0;
  for (let i = 0; i < count; i++) {
    let folded = planes[i] | (planes[count + i] << 8);
    if (bytesPerNumber === 4) folded |= (planes[2 * count + i] << 16) | (planes[3 * count + i] << 24);
    previous += (folded >>> 1) ^ -(folded & 1);
    numbers[i] = previous;
    previous = numbers[i];
  }
  return numbers;
}

/** The level of a value of an axis. */
function levelOf(axis, value) {
  if (Number.isNaN(value)) return MISSING;
  const share = (value - axis.low) / (axis.high - axis.low);
  return Math.round(Math.min(Math.max(share, 0), 1) * MAX_LEVEL);
}

/** The bins of levels. */
function binsOf(levels) {
  const bins = new Uint8Array(levels.length);
  for (let i = 0; i < levels.length; i++) {
    const level = levels[i];
    bins[i] = level === MISSING ? NO_BIN : (level * BINS) >>> 16;
  }
  return bins;
}

async function loadEpisodes(table) {
  const names = ["agent", "episode", "round", "length", "kept", "return", "terminated"];
  const columns = await Promise.all(names.map((name) => decode(table[name], table.count, 4)));
  const episodes = Object.fromEntries(names.map((name, i) => [name, columns[i]]));
  episodes.count = table.count;
  episodes.return = new Float32Array(episodes.return.buffer);
  return episodes;
}

/** One value per episode of an axis that shows episodes; null for other axes. */
function episodeValues(axis, episodes) {
  return { episode: episodes.episode, return: episodes.return }[axis.kind] ?? null;
}

/** Number of states of the episodes whose value is NaN. */
function statesOfNan(values, episodes) {
  let count = 0;
  values?.forEach((value, e) => (count += Number.isNaN(value) ? episodes.kept[e] : 0));
  return count;
}

/** A run with typed arrays: `levels` and `bins` per axis (null if the run has no such quantity). */
async function loadRun(data, axes) {
  const episodes = await loadEpisodes(data.episodes);
  const starts = new Uint32Array(episodes.count + 1);
  const episodeOf = new Uint32Array(data.kept);
  for (let e = 0; e < episodes.count; e++) {
    starts[e + 1] = starts[e] + episodes.kept[e];
    episodeOf.fill(e, starts[e], starts[e + 1]);
  }
  const levels = await Promise.all(data.columns.map((column) => column && decode(column.levels, data.kept, 2)));
  const episodeLevels = axes.map((axis) => {
    const values = episodeValues(axis, episodes);
    return values && Uint16Array.from(values, (value) => levelOf(axis, value));
  });
  const bins = axes.map((_, a) => {
    if (levels[a]) return binsOf(levels[a]);
    if (!episodeLevels[a]) return null;
    const ofEpisodes = binsOf(episodeLevels[a]);
    return Uint8Array.from(episodeOf, (e) => ofEpisodes[e]);
  });
  const outside = data.columns.map((column) => column?.outside ?? [0, 0]);
  const nan = data.columns.map((column, a) => column?.nan ?? statesOfNan(episodeValues(axes[a], episodes), episodes));
  const run = { ...data, episodes, starts, episodeOf, levels, episodeLevels, bins, outside, nan };
  run.film = data.film && (await loadFilm(run, data, axes));
  return run;
}

/** The filmed states one after the other, with the poses of all bodies and the ground of their episode; `episodes` has the
    index of the first state of each filmed episode and the number of its states. */
async function loadFilm(run, data, axes) {
  const film = { ...data.film, states: [], episodes: [], levels: axes.map(() => []) };
  for (const [f, filmed] of data.filmed.entries()) {
    const e = findEpisode(run.episodes, filmed.agent, filmed.episode);
    const levels = await Promise.all(filmed.levels.map((text) => text && decode(text, filmed.states, 2)));
    const poses = await Promise.all(data.film.poses[f].map((text) => decode(text, filmed.states, 2)));
    const terrain = data.film.terrain[f];
    film.episodes.push({ e, agent: filmed.agent, episode: filmed.episode, first: film.states.length, count: filmed.states });
    for (let step = 0; step < filmed.states; step++) {
      film.states.push({ e, agent: filmed.agent, episode: filmed.episode, step, poses, terrain });
      axes.forEach((_, a) => film.levels[a].push(levels[a]?.[step] ?? run.episodeLevels[a]?.[e] ?? MISSING));
    }
  }
  return film;
}

function findEpisode(episodes, agent, number) {
  for (let e = 0; e < episodes.count; e++) {
    if (episodes.agent[e] === agent && episodes.episode[e] === number) return e;
  }
  return -1;
}
