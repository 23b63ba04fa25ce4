// What is drawn anew each time: arrows, lines, people, scale. Places are in cells until they are drawn.

/** Least edge of a block of arrows, and the edge at which arrows stop growing, in pixels of the page. */
const BLOCK = 36, LARGEST_BLOCK = 64;
/** Least edge of a block in meters: people are about so wide. */
const SHOULDERS = 0.35;
/** Share of a direction above which it has an arrow: each of eight has 0.125 where people go everywhere alike. */
const GUESS = 0.125, TOLD = 0.16;
/** How long a trail is, in seconds. */
const TRAIL = 3;

/** Draws lines in a color with a rim around them, so that they stand out from whatever lies below. */
function rimmed(context, path, color, rim, width) {
  context.lineCap = context.lineJoin = "round";
  context.strokeStyle = rim;
  context.lineWidth = width + 2;
  context.stroke(path);
  context.strokeStyle = color;
  context.lineWidth = width;
  context.stroke(path);
}

/** Draws for each block an arrow into every direction that is taken more often than by a guess. */
function drawFlow(view, flow) {
  const { context, zoom, left, top, width, height, palette } = view;
  const { levels } = flow;
  const { resolution } = view.scene.frame;
  const level = levels.find(({ block }) => block * zoom >= BLOCK && block * resolution >= SHOULDERS) ?? levels.at(-1);
  const edge = level.block * zoom;
  const longest = 0.46 * Math.min(edge, LARGEST_BLOCK);
  const first = (from, side) => Math.max(0, Math.floor(-from / side));
  const [row0, col0] = [first(top, edge), first(left, edge)];
  const row1 = Math.min(level.rows, Math.ceil((height - top) / edge));
  const col1 = Math.min(level.cols, Math.ceil((width - left) / edge));
  const most = (level.most ??= level.sums.reduce((most, sum, i) => (i % SUMS === 8 ? Math.max(most, sum) : most), 0));
  for (let row = row0; row < row1; row++) {
    for (let col = col0; col < col1; col++) {
      const at = SUMS * (row * level.cols + col), weight = level.sums[at + 8];
      if (weight < 0.002 * most) continue;
      // Where people are in the block, so that no arrow stands in a wall.
      const x = left + (level.sums[at + 9] / weight) * zoom, y = top + (level.sums[at + 10] / weight) * zoom;
      const path = new Path2D();
      for (let d = 0; d < 8; d++) {
        const share = level.sums[at + d] / weight;
        if (share >= TOLD) arrow(path, x, y, d, longest * (0.4 + 0.6 * Math.min(1, (share - GUESS) / 0.4)));
      }
      // Few passages faint, many strong. Many small paths are drawn sooner than a large one.
      context.globalAlpha = clamp(0.35 + 0.9 * Math.sqrt(weight / most), 0, 1);
      rimmed(context, path, palette.arrow, palette.arrowRim, 1.4);
    }
  }
  context.globalAlpha = 1;
}

/** Adds an arrow from a point into one of eight directions, counter-clockwise from the right. */
function arrow(path, x, y, direction, length) {
  const angle = (direction * Math.PI) / 4;
  const dx = Math.cos(angle), dy = -Math.sin(angle);
  const head = Math.min(5, 0.45 * length);
  const [tipX, tipY] = [x + length * dx, y + length * dy];
  path.moveTo(x, y);
  path.lineTo(tipX, tipY);
  path.moveTo(tipX - head * (dx - 0.6 * dy), tipY - head * (dy + 0.6 * dx));
  path.lineTo(tipX, tipY);
  path.lineTo(tipX - head * (dx + 0.6 * dy), tipY - head * (dy - 0.6 * dx));
}

/** Returns what takes meters of the local frame to pixels. */
function placer({ scene: { frame }, zoom, left, top }) {
  const scale = zoom / frame.resolution, bottom = top + frame.rows * zoom;
  return [(x) => left + x * scale, (y) => bottom - y * scale];
}

/** Draws a line with a dot where it begins and a ring where it ends. */
function drawLine(view, { points, color }) {
  if (points.length === 0) return;
  const [toX, toY] = placer(view);
  const path = new Path2D();
  points.forEach(([x, y], i) => (i ? path.lineTo(toX(x), toY(y)) : path.moveTo(toX(x), toY(y))));
  rimmed(view.context, path, color, view.palette.rim, 3);
  disc(view.context, toX(points[0][0]), toY(points[0][1]), 5.5, color, view.palette.rim);
  const [x, y] = points.at(-1);
  disc(view.context, toX(x), toY(y), 5.5, view.palette.rim, color);
}

function disc(context, x, y, radius, fill, rim) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  context.lineWidth = 1.5;
  context.strokeStyle = rim;
  context.stroke();
}

/** Returns where somebody is at a time, in frames, or nothing. */
function positionAt(track, time) {
  const at = time - track.start;
  if (at < 0 || at > track.count - 1) return null;
  const before = Math.floor(at), after = Math.min(before + 1, track.count - 1), share = at - before;
  const between = (axis) => axis[before] + share * (axis[after] - axis[before]);
  return [between(track.x), between(track.y), track.x[after] - track.x[before], track.y[after] - track.y[before]];
}

/** Draws all tracks of an episode, faintly, those of robots on top. */
function drawTracks(view, episode) {
  const { context, palette } = view;
  const [toX, toY] = placer(view);
  for (const robots of [false, true]) {
    const path = new Path2D();
    for (const track of episode.tracks.filter((track) => track.robot === robots)) {
      for (let i = 0; i < track.count; i++) path[i ? "lineTo" : "moveTo"](toX(track.x[i]), toY(track.y[i]));
    }
    context.globalAlpha = robots ? 0.95 : 0.75;
    rimmed(context, path, robots ? palette.robot : palette.person, palette.rim, robots ? 2.5 : 1.5);
  }
  context.globalAlpha = 1;
}

/** Draws everybody of an episode where they are, with a fading trail. */
function drawPeople(view, episode, seconds) {
  const { context, palette, scene, zoom } = view;
  const [toX, toY] = placer(view);
  const time = seconds * episode.rate;
  const radius = Math.max(4, (episode.radius / scene.frame.resolution) * zoom);
  for (const robots of [false, true]) {
    const color = robots ? palette.robot : palette.person;
    for (const track of episode.tracks.filter((track) => track.robot === robots)) {
      const here = positionAt(track, time);
      if (!here) continue;
      drawTrail(view, track, time, episode.rate, color);
      const [x, y, dx, dy] = here, speed = Math.hypot(dx, dy);
      disc(context, toX(x), toY(y), radius, color, palette.rim);
      if (speed > 0.02) {
        context.beginPath();
        context.moveTo(toX(x), toY(y));
        context.lineTo(toX(x) + (radius * dx) / speed, toY(y) - (radius * dy) / speed);
        context.stroke();
      }
    }
  }
}

function drawTrail(view, track, time, rate, color) {
  const { context, palette } = view;
  const [toX, toY] = placer(view);
  const parts = 6, length = TRAIL * rate;
  context.lineCap = "butt";
  for (let part = 0; part < parts; part++) {
    const path = new Path2D();
    let begun = false;
    for (let k = 0; k <= 4; k++) {
      const point = positionAt(track, time - length * (1 - (part + k / 4) / parts));
      if (!point) continue;
      path[begun ? "lineTo" : "moveTo"](toX(point[0]), toY(point[1]));
      begun = true;
    }
    context.globalAlpha = (part + 1) / parts;
    for (const [ink, width] of [[palette.rim, 4.5], [color, 2.5]]) {
      context.strokeStyle = ink;
      context.lineWidth = width;
      context.stroke(path);
    }
  }
  context.globalAlpha = 1;
}

/** Draws lines of round meters along the grid, with numbers at the edges; a turned grid has meters of its own. */
function drawGrid(view) {
  const { context, scene: { frame }, zoom, left, top, width, height, palette } = view;
  const scale = zoom / frame.resolution, bottom = top + frame.rows * zoom;
  const turned = Math.abs(frame.yaw) > 1e-9;
  const [originX, originY] = turned ? [0, 0] : [frame.x, frame.y];
  const step = roundStep(70 / scale);
  context.font = palette.font;
  const lines = (from, to, draw) => {
    for (let i = Math.ceil(from / step); i <= to / step; i++) draw(i * step);
  };
  const path = new Path2D();
  const labels = [];
  const edge = { low: Math.max(0, left), high: Math.min(height, bottom) };
  lines(originX, originX + frame.cols * frame.resolution, (x) => {
    const at = Math.round(left + (x - originX) * scale) + 0.5;
    path.moveTo(at, Math.max(0, top));
    path.lineTo(at, edge.high);
    if (at > 24 && at < width - 12) labels.push([number(x), at, edge.high - 5, "center"]);
  });
  lines(originY, originY + frame.rows * frame.resolution, (y) => {
    const at = Math.round(bottom - (y - originY) * scale) + 0.5;
    path.moveTo(edge.low, at);
    path.lineTo(Math.min(width, left + frame.cols * zoom), at);
    if (at > 12 && at < height - 16) labels.push([number(y), edge.low + 5, at + 4, "left"]);
  });
  context.strokeStyle = palette.grid;
  context.lineWidth = 1;
  context.stroke(path);
  for (const [text, x, y, align] of labels) haloed(view, text, x, y, align);
  context.textAlign = "left";
}

/** Writes text with a rim of the page's color. */
function haloed({ context, palette }, text, x, y, align) {
  context.textAlign = align;
  context.lineJoin = "round";
  context.lineWidth = 3;
  context.strokeStyle = palette.halo;
  context.strokeText(text, x, y);
  context.fillStyle = palette.ink;
  context.fillText(text, x, y);
}

/** Draws how long a round number of meters is. */
function drawScale(view) {
  const { context, scene: { frame }, zoom, width, height, palette } = view;
  const scale = zoom / frame.resolution;
  const meters = roundStep(60 / scale);
  const long = meters * scale, x = width - 16 - long, y = height - 16;
  context.fillStyle = palette.halo;
  context.beginPath();
  context.roundRect(x - 8, y - 21, long + 16, 28, 6);
  context.fill();
  context.strokeStyle = context.fillStyle = palette.ink;
  context.lineJoin = "miter";
  context.lineCap = "butt";
  context.lineWidth = 1.5;
  context.stroke(new Path2D(`M${x} ${y - 5}v5h${long}v-5`));
  context.font = palette.font;
  context.textAlign = "center";
  context.fillText(meters < 1 ? `${number(100 * meters)} cm` : `${number(meters)} m`, x + long / 2, y - 7);
  context.textAlign = "left";
}

/** Draws a frame around a cell. */
function drawMark({ context, zoom, left, top, palette }, { row, col }) {
  const size = Math.max(zoom, 7), x = left + (col + 0.5) * zoom - size / 2, y = top + (row + 0.5) * zoom - size / 2;
  context.lineJoin = "miter";
  for (const [color, width] of [[palette.rim, 3.5], [palette.mark, 1.5]]) {
    context.strokeStyle = color;
    context.lineWidth = width;
    context.strokeRect(x, y, size, size);
  }
}

