// What costs time in the number of cells: pictures of layers, one pixel a cell, painted once.

/** Returns a canvas for a picture of a map, with its pixels as numbers. */
function sheet(frame) {
  const canvas = document.createElement("canvas");
  canvas.width = frame.cols;
  canvas.height = frame.rows;
  const context = canvas.getContext("2d");
  const image = context.createImageData(frame.cols, frame.rows);
  return { canvas, pixels: new Uint32Array(image.data.buffer), done: () => context.putImageData(image, 0, 0) };
}

/** Returns a color as a pixel; all machines that browsers run on have the low byte first. */
const pixel = (red, green, blue) => ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;

/** Reads `#rrggbb`. */
function hexPixel(hex) {
  const rgb = parseInt(hex.slice(1), 16);
  return pixel(rgb >> 16, (rgb >> 8) & 255, rgb & 255);
}

/** Finds the blocked cells that face free floor: the walls, as opposed to what is solid or outside. */
function faces({ free, frame: { rows, cols, resolution } }) {
  const reach = Math.max(1, Math.round(0.15 / resolution));
  // Free cells within reach, first along the rows, then along the columns.
  const spread = (from, step, lines, length, line) => {
    const near = new Uint8Array(from.length);
    for (let i = 0; i < lines; i++) {
      for (let pass = 0; pass < 2; pass++) {
        let left = 0;
        for (let k = 0; k < length; k++) {
          const at = i * line + (pass ? length - 1 - k : k) * step;
          left = from[at] ? reach + 1 : left - 1;
          if (left > 0) near[at] = 1;
        }
      }
    }
    return near;
  };
  return spread(spread(free, 1, rows, cols, cols), cols, cols, rows, 1);
}

/** Paints the bare map. */
function paintMap(scene, palette) {
  const { canvas, pixels, done } = sheet(scene.frame);
  const near = (scene.faces ??= faces(scene));
  const [free, wall, solid] = [palette.free, palette.wall, palette.solid].map(hexPixel);
  for (let i = 0; i < pixels.length; i++) pixels[i] = scene.free[i] ? free : near[i] ? wall : solid;
  done();
  return canvas;
}

/** Returns where a value lies on the scale, 0 to 1. */
function shareOf(raster, value, log) {
  const { high } = raster.coding;
  if (!log) return clamp(value / high, 0, 1);
  return value <= raster.least ? 0 : clamp(Math.log(value / raster.least) / Math.log(high / raster.least), 0, 1);
}

/** Returns red, green and blue of a share of the scale. */
function scaleColor(colors, share) {
  const at = 3 * Math.round(share * 255);
  return [colors[at], colors[at + 1], colors[at + 2]];
}

/** Paints a layer; blocked cells stay clear. */
function paintRaster(scene, raster, log, palette) {
  const { canvas, pixels, done } = sheet(scene.frame);
  const last = raster.coding.as === "class" ? raster.classes.length : codeOf(raster, raster.coding.high);
  const inks = new Uint32Array(last + 1);
  inks[0] = hexPixel(palette.empty);
  for (let code = 1; code <= last; code++) {
    inks[code] = raster.coding.as === "class"
      ? hexPixel(raster.classes[code - 1][1])
      : pixel(...scaleColor(scene.colors, shareOf(raster, valueOf(raster, code), log)));
  }
  for (let i = 0; i < pixels.length; i++) if (scene.free[i]) pixels[i] = inks[raster.codes[i]];
  done();
  return canvas;
}

