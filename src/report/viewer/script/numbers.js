// Numbers as people read them; as `axis.rs` writes them.

/** Writes a number with three digits that count. */
function number(value) {
  const size = Math.abs(value);
  if (size < 1e-12) return "0";
  if (size < 1e-4 || size >= 1e6) return value.toExponential(0);
  const digits = size >= 100 ? 0 : Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(size))));
  const text = value.toFixed(digits);
  return (text.includes(".") ? text.replace(/\.?0+$/, "") : text).replace("-", "−");
}

/** Returns 1, 2 or 5 times a power of ten that is at least so large. */
function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= least * 0.999);
}

/** Returns round numbers between two ends, about so many. */
function roundNumbers(low, high, count) {
  const step = roundStep((high - low) / count);
  const marks = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= Math.floor(high / step + 1e-9); i++) marks.push(i * step);
  return marks;
}

/** Returns powers of ten between two ends, with their multiples by 2 and 5, or by 3, where there are few. */
function roundLogarithms(low, high, count) {
  for (const factors of [[1, 2, 5], [1, 3], [1]]) {
    const marks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const factor of factors) {
        const mark = factor * 10 ** power;
        if (mark >= low * 0.999 && mark <= high * 1.001) marks.push(mark);
      }
    }
    if (marks.length > 1 && marks.length <= count + 1) return marks;
  }
  return [low, high];
}

/** Keeps a number between two ends. */
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

