// The view: a window onto the map that can be moved, and the beginning of everything.

/** Pixels of the page along the edge of a cell at most, and of the whole map at least. */
const LARGEST_CELL = 72, SMALLEST_MAP = 120;
const calm = matchMedia("(prefers-reduced-motion: reduce)");

/** Reads the colors of the page, which follow its light. */
function paletteOf(root) {
  const style = getComputedStyle(root);
  const names = ["free", "wall", "solid", "empty", "ink", "halo", "grid", "mark", "rim", "arrow", "arrow-rim", "person", "robot"];
  const palette = Object.fromEntries(names.map((name) =>
    [name.replace(/-./, (letters) => letters[1].toUpperCase()), style.getPropertyValue(`--tv-${name}`).trim()]));
  return { ...palette, font: `11px ${style.fontFamily}` };
}

/** Draws what is shown, in the order in which it lies. */
function draw(view) {
  const { context, scene, shown, pictures, zoom, left, top, width, height, ratio } = view;
  const { rows, cols } = scene.frame;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  // Only the cells in the window: a browser may else scale the whole map.
  const col0 = clamp(Math.floor(-left / zoom), 0, cols), col1 = clamp(Math.ceil((width - left) / zoom), 0, cols);
  const row0 = clamp(Math.floor(-top / zoom), 0, rows), row1 = clamp(Math.ceil((height - top) / zoom), 0, rows);
  const [wide, high] = [col1 - col0, row1 - row0];
  context.imageSmoothingEnabled = zoom * ratio < 1;
  const lay = (picture) => {
    if (wide > 0 && high > 0) {
      context.drawImage(picture, col0, row0, wide, high, left + col0 * zoom, top + row0 * zoom, wide * zoom, high * zoom);
    }
  };
  lay((pictures.map ??= paintMap(scene, view.palette)));
  const raster = scene.rasters[shown.raster];
  if (raster && shown.opacity > 0) {
    const log = shown.logs[shown.raster], name = `${shown.raster} ${log}`;
    if (pictures.name !== name) {
      pictures.raster = paintRaster(scene, raster, log, view.palette);
      pictures.name = name;
    }
    context.globalAlpha = shown.opacity;
    lay(pictures.raster);
    context.globalAlpha = 1;
  }
  if (shown.grid) drawGrid(view);
  scene.flows.forEach((flow, i) => shown.flows[i] && drawFlow(view, flow));
  const episode = scene.episodes[shown.episode];
  if (episode && shown.tracks) drawTracks(view, episode);
  scene.lines.forEach((line, i) => shown.lines[i] && drawLine(view, line));
  if (episode && shown.people) drawPeople(view, episode, shown.seconds);
  if (view.kept) drawMark(view, view.kept);
  drawScale(view);
}

/** Returns the cell under a place of the window, or nothing. */
function cellAt({ scene: { frame }, zoom, left, top }, x, y) {
  const row = Math.floor((y - top) / zoom), col = Math.floor((x - left) / zoom);
  return row >= 0 && col >= 0 && row < frame.rows && col < frame.cols ? { row, col } : null;
}

/** Shows all of the map in the middle of the window. */
function fit(view) {
  const { scene: { frame }, width, height } = view;
  view.zoom = Math.min((width - 24) / frame.cols, (height - 24) / frame.rows, LARGEST_CELL);
  view.left = (width - frame.cols * view.zoom) / 2;
  view.top = (height - frame.rows * view.zoom) / 2;
  view.fitted = true;
}

/** Makes the map larger or smaller; the place under a point of the window stays there. */
function zoomBy(view, factor, x, y) {
  const { scene: { frame } } = view;
  const least = Math.min(SMALLEST_MAP / Math.max(frame.rows, frame.cols), LARGEST_CELL);
  const zoom = clamp(view.zoom * factor, least, LARGEST_CELL);
  view.left = x - ((x - view.left) * zoom) / view.zoom;
  view.top = y - ((y - view.top) * zoom) / view.zoom;
  view.zoom = zoom;
  keepInside(view);
}

/** Moves the map, but never out of sight. */
function moveBy(view, dx, dy) {
  view.left += dx;
  view.top += dy;
  keepInside(view);
}

function keepInside(view) {
  const { scene: { frame }, zoom, width, height } = view;
  const margin = 60;
  view.left = clamp(view.left, margin - frame.cols * zoom, width - margin);
  view.top = clamp(view.top, margin - frame.rows * zoom, height - margin);
  view.fitted = false;
}

/** Goes to a larger or smaller map in a few steps, unless the reader wants no motion. */
function glide(view, factor, changed) {
  const [x, y] = [view.width / 2, view.height / 2];
  const steps = calm.matches ? 1 : 9;
  const step = (left) => {
    zoomBy(view, factor ** (1 / steps), x, y);
    changed();
    if (left > 1) requestAnimationFrame(() => step(left - 1));
  };
  step(steps);
}

/** Listens to wheel, mouse, pen and fingers. */
function listenToPointers(view, changed) {
  const { canvas } = view;
  const down = new Map();
  let moved = 0;
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("wheel", (event) => {
    // In a long page the wheel is the page's until somebody has taken hold of the map.
    if (view.embedded && !event.ctrlKey && !event.metaKey && document.activeElement !== canvas) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    view.at = place(event);
    zoomBy(view, Math.exp(-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.0016)), ...view.at);
    changed();
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    down.set(event.pointerId, place(event));
    if (down.size === 1) moved = 0;
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch {
      // A pointer that is gone by now needs no capturing.
    }
  });
  canvas.addEventListener("pointermove", (event) => {
    const here = place(event), before = down.get(event.pointerId);
    view.hovered = event.pointerType === "touch" ? null : cellAt(view, ...here);
    if (before) {
      const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
      moved += Math.abs(here[0] - before[0]) + Math.abs(here[1] - before[1]);
      if (other) {
        const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]);
        zoomBy(view, apart(here) / Math.max(apart(before), 1), (here[0] + other[0]) / 2, (here[1] + other[1]) / 2);
        moveBy(view, (here[0] - before[0]) / 2, (here[1] - before[1]) / 2);
      } else if (moved > 4) {
        moveBy(view, here[0] - before[0], here[1] - before[1]);
      }
      down.set(event.pointerId, here);
    }
    view.at = here;
    changed();
  });
  canvas.addEventListener("pointerup", (event) => {
    if (down.delete(event.pointerId) && moved <= 4) {
      const cell = cellAt(view, ...place(event)), { kept } = view;
      view.kept = cell && kept && cell.row === kept.row && cell.col === kept.col ? null : cell;
      changed();
    }
  });
  canvas.addEventListener("pointercancel", (event) => down.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => {
    view.hovered = null;
    changed();
  });
}

/** Listens to keys. */
function listenToKeys(view, changed) {
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  view.canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) walkCell(view, ...arrow);
    else if (arrow) moveBy(view, -60 * arrow[0], -60 * arrow[1]);
    else if (event.key === "+" || event.key === "=") glide(view, 1.5, changed);
    else if (event.key === "-" || event.key === "−") glide(view, 1 / 1.5, changed);
    else if (event.key === "0") fit(view);
    else if (event.key === "Escape") view.kept = null;
    else if (event.key === " " && view.togglePlay) view.togglePlay();
    else return;
    event.preventDefault();
    changed();
  });
}

/** Goes to the next cell, from the one in the middle if none is kept, and has it said aloud. */
function walkCell(view, dx, dy) {
  const { frame } = view.scene;
  const from = view.kept ?? cellAt(view, view.width / 2, view.height / 2) ?? { row: frame.rows >> 1, col: frame.cols >> 1 };
  view.kept = { row: clamp(from.row + dy, 0, frame.rows - 1), col: clamp(from.col + dx, 0, frame.cols - 1) };
  view.hovered = null;
  view.spoken.textContent = rowsOf(view, view.kept).map((row) => [...row.children].map((part) => part.textContent).join(" ")).join("; ");
}

/** Says beside the pointer what is under it. */
function showTip(view) {
  const { tip, hovered, scene, shown, at, width } = view;
  tip.hidden = !hovered;
  if (!hovered) return;
  const raster = scene.rasters[shown.raster], index = hovered.row * scene.frame.cols + hovered.col;
  const here = raster ? told(scene, raster, index) : scene.free[index] ? "free" : "blocked";
  tip.textContent = here;
  const right = at[0] > width - 120;
  tip.style.cssText = `top:${at[1] + 14}px;${right ? `right:${width - at[0] + 10}px` : `left:${at[0] + 14}px`}`;
}

/** Returns the episode with the most tracks. */
function liveliest({ episodes }) {
  return episodes.reduce((most, { tracks }, i) => (tracks.length > episodes[most].tracks.length ? i : most), 0);
}

/** Opens the view of an element. */
async function open(root, id) {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old to unpack it");
  const embedded = root.hasAttribute("data-embedded");
  const scene = await readScene(root);
  const canvas = element("canvas", { tabIndex: 0, role: "img", className: "tv-canvas" });
  const lines = scene.lines.map(() => true), flows = scene.flows.map(() => false);
  const logs = scene.rasters.map((raster) => isSkewed(scene, raster));
  const shown = {
    raster: scene.rasters.length > 0 ? 0 : -1, logs, opacity: 1, lines, flows,
    people: false, tracks: false, grid: false, episode: liveliest(scene), seconds: 0,
  };
  const view = { root, id, embedded, scene, canvas, shown, context: canvas.getContext("2d"), pictures: {}, palette: paletteOf(root) };
  let asked = false;
  const changed = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      // The map may have moved away under a pointer that rests.
      if (view.hovered) view.hovered = cellAt(view, ...view.at);
      draw(view);
      view.tell(view.hovered ?? view.kept ?? null);
      showTip(view);
    });
  };
  assemble(view, changed);
  listenToPointers(view, changed);
  listenToKeys(view, changed);
  new ResizeObserver(() => resize(view, changed)).observe(canvas.parentElement);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    view.palette = paletteOf(root);
    view.pictures = {};
    view.legendChanged?.();
    changed();
  });
  resize(view, changed);
  root.dataset.ready = "";
}

/** Puts the parts of a view in their places. */
function assemble(view, changed) {
  const { root, canvas, scene } = view;
  const button = (text, label, onclick) => element("button", { type: "button", ariaLabel: label, title: label, onclick }, text);
  const tools = element("div", { className: "tv-tools" },
    button("+", "larger", () => glide(view, 1.5, changed)),
    button("−", "smaller", () => glide(view, 1 / 1.5, changed)),
    button(element("i", { className: "tv-fit" }), "all of the map", () => { fit(view); changed(); }));
  if (view.embedded && root.requestFullscreen) {
    tools.append(button(element("i", { className: "tv-corners" }), "full screen", () => (document.fullscreenElement ? document.exitFullscreen() : root.requestFullscreen())));
  }
  view.tip = element("div", { className: "tv-tip", hidden: true, ariaHidden: "true" });
  view.spoken = element("div", { className: "tv-spoken", role: "status" });
  makePanel(view, changed);
  const player = makePlayer(view, changed);
  canvas.setAttribute("aria-label", `map ${scene.title}, with ${scene.rasters.map(({ name }) => name).join(", ") || "nothing on it"}`);
  const stage = element("div", { className: "tv-stage" }, canvas, tools, view.tip, view.spoken);
  root.replaceChildren(element("div", { className: "tv-frame" }, stage, ...(player ? [player] : []), view.panel));
}

/** Fits the canvas to its place; all of the map stays in sight if it was. */
function resize(view, changed) {
  const { canvas } = view;
  const box = canvas.parentElement.getBoundingClientRect();
  if (box.width === 0 || box.height === 0) return;
  const first = view.width === undefined;
  view.ratio = devicePixelRatio || 1;
  const [dx, dy] = first ? [0, 0] : [(box.width - view.width) / 2, (box.height - view.height) / 2];
  view.width = box.width;
  view.height = box.height;
  canvas.width = Math.round(box.width * view.ratio);
  canvas.height = Math.round(box.height * view.ratio);
  if (first || view.fitted) fit(view);
  else moveBy(view, dx, dy);
  changed();
}

/** Opens a view, or says why it cannot be. */
function begin(root, id) {
  if (root.dataset.begun) return;
  root.dataset.begun = "true";
  open(root, id).catch((error) => {
    const why = `This view cannot be shown (${error.message ?? error}). ${root.dataset.besides}`;
    root.replaceChildren(element("p", { className: "tv-trouble", role: "alert" }, why));
  });
}

document.querySelectorAll(".trodden-view").forEach((root, id) => {
  const fold = root.closest("details");
  if (!fold || fold.open) begin(root, id);
  else fold.addEventListener("toggle", () => begin(root, id), { once: true });
});
