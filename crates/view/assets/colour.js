// Colours: files hold linear values, the browser's fields sRGB.

const toSrgb = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * Math.pow(x, 1 / 2.4) - 0.055);
const toLinear = (x) => (x <= 0.04045 ? x / 12.92 : Math.pow((x + 0.055) / 1.055, 2.4));

/** `#rrggbb` of a linear colour. */
export function hexOf(colour) {
  const byte = (x) => Math.round(255 * Math.max(0, Math.min(1, toSrgb(Math.max(0, x)))));
  return "#" + colour.map((x) => byte(x).toString(16).padStart(2, "0")).join("");
}

/** The linear colour of `#rrggbb`, to four digits. */
export function colourOf(hex) {
  const byte = (i) => parseInt(hex.slice(i, i + 2), 16) / 255;
  return [1, 3, 5].map((i) => Number(toLinear(byte(i)).toFixed(4)));
}

/** A light's colour of brightness 1, and its brightness. */
export function split(colour) {
  const brightness = Math.max(...colour, 0);
  const hue = brightness > 0 ? colour.map((x) => x / brightness) : [1, 1, 1];
  return { hue, brightness };
}
