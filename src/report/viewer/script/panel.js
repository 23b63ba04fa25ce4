// The panel beside the map: what lies on it, what its colors mean, and what a cell holds.

/** Makes an element; children that are strings are text and nothing else. */
function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made) made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

/** Makes an input with its label behind it. */
function choice(type, name, text, checked, change, swatch = null) {
  const input = element("input", { type, name, checked, onchange: () => change(input.checked) });
  return element("label", { className: "tv-choice" }, input, swatch, element("span", {}, text));
}

function group(title, ...children) {
  return element("fieldset", { className: "tv-group" }, element("legend", {}, title), ...children);
}

function swatch(color) {
  const made = element("i", { className: "tv-swatch" });
  made.style.background = color;
  return made;
}

/** Tells whether most values lie so far below the largest that only their logarithms tell them apart. */
function isSkewed({ free }, raster) {
  if (raster.coding.as === "class") return false;
  const values = [];
  const step = Math.max(1, Math.floor(free.length / 4096));
  for (let i = 0; i < free.length; i += step) if (free[i] && raster.codes[i] > 1) values.push(valueOf(raster, raster.codes[i]));
  values.sort((a, b) => a - b);
  return values.length > 0 && values[values.length >> 1] < raster.coding.high / 8;
}

/** Makes the panel; it changes `view.shown` and has the view drawn. */
function makePanel(view, changed) {
  const { scene, shown, id } = view;
  const { frame } = scene;
  const size = [frame.cols, frame.rows].map((cells) => number(cells * frame.resolution)).join(" × ");
  const title = view.embedded ? null : element("h1", { className: "tv-title" }, scene.title);
  const about = `${size} m, ${frame.cols} × ${frame.rows} cells of ${number(frame.resolution)} m`;
  const legend = element("div", { className: "tv-legend" });
  const explain = () => legend.replaceChildren(...legendOf(view, changed));
  const lay = (index) => () => {
    shown.raster = index;
    explain();
    changed();
  };
  const layers = [["map only", -1], ...scene.rasters.map((raster, i) => [raster.name, i])].map(([name, index]) =>
    choice("radio", `tv-layer-${id}`, name, shown.raster === index, lay(index)));
  // The bare map last: it is asked for least.
  layers.push(layers.shift());
  const opacity = element("input", {
    type: "range", min: 0, max: 100, value: 100, ariaLabel: "opacity of the layer",
    oninput: () => { shown.opacity = opacity.value / 100; changed(); },
  });
  const readout = element("div", { className: "tv-readout" });
  const over = overlays(view, changed);
  view.panel = element("aside", { className: "tv-panel", ariaLabel: "layers and values" },
    element("header", {}, title, element("p", { className: "tv-about" }, about)),
    group("Layer", ...layers),
    legend,
    element("label", { className: "tv-slider" }, element("span", {}, "opacity"), opacity),
    group("Over it", ...over),
    group("Cell", readout),
    element("p", { className: "tv-help" }, HELP));
  explain();
  view.tell = (cell) => {
    readout.replaceChildren(...rowsOf(view, cell));
    const now = legend.querySelector(".tv-now");
    if (now) now.style.cssText = cell ? pointer(view, cell) : "display:none";
  };
  view.tell(null);
}

const HELP = "Drag to move, scroll or pinch to zoom, click to keep a cell. Keys: arrows, + −, 0 for all of it; shift and "
  + "arrows go from cell to cell.";

/** Makes what can be laid over a layer, each to be switched. */
function overlays(view, changed) {
  const { scene, shown } = view;
  const made = [];
  const add = (text, of, key, mark = null) => made.push(choice("checkbox", "", text, of[key], (checked) => {
    of[key] = checked;
    changed();
  }, mark));
  scene.flows.forEach((flow, i) => add(`arrows: ${flow.name}`, shown.flows, i));
  scene.lines.forEach((line, i) => add(line.name, shown.lines, i, swatch(line.color)));
  if (scene.episodes.length > 0) {
    add("people of the episode", shown, "people");
    view.peopleBox = made.at(-1).querySelector("input");
    add("tracks of the episode", shown, "tracks");
  }
  add("grid in meters", shown, "grid");
  return made;
}

/** Explains the colors of the layer. */
function legendOf(view, changed) {
  const { scene, shown, palette } = view;
  const raster = scene.rasters[shown.raster];
  const names = (pairs) => element("div", { className: "tv-names" },
    ...pairs.map(([name, color]) => element("span", {}, swatch(color), name)));
  const solid = ["blocked", palette.wall];
  if (!raster) return [names([["free", palette.free], solid])];
  const empty = raster.codes.some((code, i) => code === 0 && scene.free[i]) ? [[raster.empty, palette.empty]] : [];
  if (raster.coding.as === "class") return [names([...raster.classes, ...empty, solid])];
  const log = shown.logs[shown.raster];
  const stops = Array.from({ length: 33 }, (_, i) => `rgb(${scaleColor(scene.colors, i / 32)})`);
  const bar = element("div", { className: "tv-bar" }, element("i", { className: "tv-now" }));
  bar.style.background = `linear-gradient(to right, ${stops})`;
  const { high } = raster.coding;
  const marks = log ? roundLogarithms(raster.least, high, 5) : roundNumbers(0, high, 5);
  const ticks = element("div", { className: "tv-ticks" }, ...marks.map((mark) => {
    const tick = element("span", {}, number(mark));
    tick.style.left = `${100 * shareOf(raster, mark, log)}%`;
    return tick;
  }));
  const scale = (text, value) => choice("radio", `tv-scale-${view.id}`, text, log === value, () => {
    shown.logs[shown.raster] = value;
    view.legendChanged();
    changed();
  });
  view.legendChanged = () => view.panel.querySelector(".tv-legend").replaceChildren(...legendOf(view, changed));
  const scales = element("div", { className: "tv-scales", role: "radiogroup", ariaLabel: "scale" },
    scale("linear", false), scale("log", true));
  const unit = element("p", { className: "tv-unit" }, raster.unit);
  return [unit, bar, ticks, element("div", { className: "tv-line" }, names([...empty, solid]), scales)];
}

/** Says where on the color bar a cell is. */
function pointer({ scene, shown }, { row, col }) {
  const raster = scene.rasters[shown.raster], at = row * scene.frame.cols + col;
  if (!raster || !scene.free[at] || raster.codes[at] === 0) return "display:none";
  return `left:${100 * shareOf(raster, valueOf(raster, raster.codes[at]), shown.logs[shown.raster])}%`;
}

/** Says what a layer holds at a cell. */
function told(scene, raster, at) {
  if (!scene.free[at]) return "blocked";
  const code = raster.codes[at];
  if (code === 0) return raster.empty;
  return raster.coding.as === "class" ? raster.classes[code - 1][0] : number(valueOf(raster, code));
}

/** Says into which directions people go at a cell, the most taken ones first. */
function directions({ levels: [{ block, cols, sums }] }, { row, col }) {
  const at = SUMS * (Math.floor(row / block) * cols + Math.floor(col / block)), whole = sums[at + 8];
  if (whole === 0) return "none";
  const shares = Array.from({ length: 8 }, (_, d) => [sums[at + d] / whole, "→↗↑↖←↙↓↘"[d]]);
  const most = shares.sort((a, b) => b[0] - a[0]).slice(0, 2).filter(([share]) => share > GUESS);
  return most.map(([share, sign]) => `${sign} ${Math.round(100 * share)} %`).join("  ") || "all alike";
}

/** Says where a cell is and what lies there. */
function rowsOf({ scene }, cell) {
  const row = (name, value) => element("div", {}, element("span", {}, name), element("b", {}, value));
  if (!cell) return [...["x, y", "row, column"], ...scene.rasters.map(({ name }) => name)].map((name) => row(name, "–"));
  const { frame } = scene;
  const at = cell.row * frame.cols + cell.col;
  const digits = frame.resolution < 0.1 ? 3 : 2;
  const place = mapPoint(frame, cell.col + 0.5, cell.row + 0.5).map((meters) => meters.toFixed(digits).replace("-", "−"));
  const flows = scene.flows.filter(() => scene.free[at]).map((flow) => row(flow.name, directions(flow, cell)));
  return [
    row("x, y", `${place.join(", ")} m`),
    row("row, column", `${cell.row}, ${cell.col}`),
    ...scene.rasters.map((raster) => row(raster.name, told(scene, raster, at))),
    ...flows,
  ];
}

