// From what the page carries to a scene; `pack.rs` says how it is written.

/** Returns the bytes behind base64. */
function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** Inflates bytes. */
async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Reads the free cells: a byte for each, 0 or 1. */
function readFree(blob, at, cells) {
  const free = new Uint8Array(cells);
  for (let i = 0; i < cells; i++) free[i] = (blob[at + (i >> 3)] >> (i & 7)) & 1;
  return free;
}

/** Reads the codes of a raster. */
function readCodes(blob, at, cells) {
  const codes = new Uint16Array(cells);
  let last = 0;
  for (let i = 0; i < cells; i++) {
    const zigzag = blob[at + i] | (blob[at + cells + i] << 8);
    last = (last + ((zigzag >>> 1) ^ -(zigzag & 1))) & 0xffff;
    codes[i] = last;
  }
  return codes;
}

/** Returns the value that a code stands for; NaN for none. */
function valueOf(raster, code) {
  if (code === 0) return NaN;
  const { as, high } = raster.coding;
  if (as === "root") return high * ((code - 1) / 4095) ** 2;
  return as === "count" ? code - 1 : code;
}

/** Returns the code that is nearest to a value, at least 1. */
function codeOf(raster, value) {
  return 1 + Math.round(raster.coding.as === "root" ? 4095 * Math.sqrt(value / raster.coding.high) : value);
}

/** Sums of a block: the passages in eight directions, those in all, and by them weighted its column and row in cells. */
const SUMS = 11;

/** Reads directions. */
function readFlow(blob, about) {
  const blocks = about.rows * about.cols;
  const sums = new Float32Array(SUMS * blocks);
  for (let i = 0; i < blocks; i++) {
    const weight = (blob[about.at + 8 * blocks + i] / 255) ** 2;
    for (let d = 0; d < 8; d++) sums[SUMS * i + d] = (weight * blob[about.at + d * blocks + i]) / 255;
    const row = Math.floor(i / about.cols);
    sums.set([weight, weight * (i - row * about.cols + 0.5) * about.block, weight * (row + 0.5) * about.block], SUMS * i + 8);
  }
  const levels = [{ block: about.block, rows: about.rows, cols: about.cols, sums }];
  while (levels.at(-1).rows > 4 && levels.at(-1).cols > 4) levels.push(coarser(levels.at(-1)));
  return { name: about.name, levels };
}

/** Adds up two by two blocks. */
function coarser(fine) {
  const rows = (fine.rows + 1) >> 1, cols = (fine.cols + 1) >> 1;
  const sums = new Float32Array(SUMS * rows * cols);
  for (let row = 0; row < fine.rows; row++) {
    for (let col = 0; col < fine.cols; col++) {
      const from = SUMS * (row * fine.cols + col), to = SUMS * ((row >> 1) * cols + (col >> 1));
      for (let k = 0; k < SUMS; k++) sums[to + k] += fine.sums[from + k];
    }
  }
  return { block: 2 * fine.block, rows, cols, sums };
}

/** Reads the tracks of an episode, in meters of the local frame. */
function readEpisode(blob, about) {
  let at = about.at;
  const next = () => {
    let value = 0, shift = 0, byte;
    do {
      byte = blob[at++];
      value |= (byte & 0x7f) << shift;
      shift += 7;
    } while (byte & 0x80);
    return (value >>> 1) ^ -(value & 1);
  };
  const axis = (count) => {
    const values = new Float32Array(count);
    for (let i = 0, last = 0, change = 0; i < count; i++) {
      change = (change + next()) | 0;
      last = (last + change) | 0;
      values[i] = last / 100;
    }
    return values;
  };
  const tracks = about.tracks.map(([robot, start, count]) => ({ robot, start, count, x: axis(count), y: axis(count) }));
  const { name, rate, radius, frames } = about;
  return { name, rate, radius, frames, tracks, seconds: Math.max(0, frames - 1) / rate };
}

/** The most pixels along an edge of a picture that every browser has. */
const LARGEST_SHEET = 16384;

/** Unpacks the scene of a view. */
async function readScene(root) {
  const about = JSON.parse(root.querySelector("script[type='application/json']").textContent);
  const { rows, cols } = about.frame;
  if (Math.max(rows, cols) > LARGEST_SHEET) throw new Error(`a map of ${cols} × ${rows} cells is too large for a browser`);
  const packed = root.querySelector("script[type='text/plain']");
  const blob = await inflate(bytesOf(packed.textContent));
  packed.remove();
  const { frame } = about;
  const cells = rows * cols;
  const colors = blob.subarray(about.colors, about.colors + 768);
  return {
    title: about.title,
    frame: { ...frame, cos: Math.cos(frame.yaw), sin: Math.sin(frame.yaw) },
    colors,
    free: readFree(blob, about.free, cells),
    rasters: about.rasters.map((raster) => ({ ...raster, codes: readCodes(blob, raster.at, cells) })),
    flows: about.flows.map((flow) => readFlow(blob, flow)),
    lines: about.lines,
    episodes: about.episodes.map((episode) => readEpisode(blob, episode)),
  };
}

/** Returns the point of the map's frame at a place of the grid, in cells from its upper left corner. */
function mapPoint(frame, col, row) {
  const x = col * frame.resolution, y = (frame.rows - row) * frame.resolution;
  return [frame.x + frame.cos * x - frame.sin * y, frame.y + frame.sin * x + frame.cos * y];
}

