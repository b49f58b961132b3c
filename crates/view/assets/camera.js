// The camera of the page: orbit, pan and zoom as changes of origin, target, up and width.

const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const length = (a) => Math.sqrt(dot(a, a));
const scaled = (a, s) => a.map((x) => x * s);
const unit = (a) => scaled(a, 1 / (length(a) || 1));
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** A vector turned about an axis of length 1. */
function turned(v, axis, angle) {
  const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  return add(add(scaled(v, cos), cross(axis, v), sin), axis, dot(axis, v) * (1 - cos));
}

/** The camera of a scene's table. */
export function cameraOf(table) {
  return {
    kind: table.kind || "orthographic",
    origin: table.origin_mm,
    target: table.target_mm,
    up: table.up || [0, 1, 0],
    width: table.width_mm,
    fov: table.fov_deg,
    focus: table.focus_mm,
    resolution: table.resolution || [512, 512],
  };
}

/** The changes that make a scene's camera this one. */
export function editsOf(camera) {
  const set = (name, value) => ({ op: "scene", key: ["camera", name], value });
  const edits = [
    set("origin_mm", camera.origin),
    set("target_mm", camera.target),
    set("up", camera.up),
  ];
  if (camera.kind === "orthographic") edits.push(set("width_mm", camera.width));
  if (camera.focus !== undefined) edits.push(set("focus_mm", camera.focus));
  return edits;
}

/** Width of what is seen at the target, mm. */
export function widthOf(camera) {
  if (camera.kind === "orthographic") return camera.width;
  const distance = length(add(camera.origin, camera.target, -1));
  return 2 * distance * Math.tan((camera.fov * Math.PI) / 360);
}

function frame(camera) {
  const forward = unit(add(camera.target, camera.origin, -1));
  let right = cross(forward, camera.up);
  if (length(right) < 1e-6) right = cross(forward, [1, 0, 0]);
  right = unit(right);
  return { forward, right, up: cross(right, forward) };
}

/** Turned about the target: by `across` about the normal of the cloth, by `along` about the
    axis to the right; radians. It never passes the poles. */
export function orbited(camera, across, along) {
  const arm = add(camera.origin, camera.target, -1);
  const { right, up } = frame(camera);
  // Seen straight from above, up lies in the cloth and turns with the camera.
  const height = dot(unit(arm), [0, 0, 1]);
  const elevation = Math.asin(Math.max(-1, Math.min(1, height)));
  const limit = Math.PI / 2 - 1e-3;
  const wanted = Math.max(-limit, Math.min(limit, elevation + along));
  let turnedArm = turned(arm, right, elevation - wanted);
  let turnedUp = turned(up, right, elevation - wanted);
  turnedArm = turned(turnedArm, [0, 0, 1], across);
  turnedUp = turned(turnedUp, [0, 0, 1], across);
  return { ...camera, origin: add(camera.target, turnedArm), up: unit(turnedUp) };
}

/** Moved by shares of the picture's width to the right and up; the target stays in the cloth. */
export function panned(camera, right, up) {
  const axes = frame(camera);
  const width = widthOf(camera);
  const inCloth = (v) => {
    const flat = [v[0], v[1], 0];
    return length(flat) > 0.05 ? unit(flat) : v;
  };
  const foreshortened = Math.max(0.25, length([axes.up[0], axes.up[1], 0]));
  const move = add(
    scaled(inCloth(axes.right), right * width),
    scaled(inCloth(axes.up), (up * width) / foreshortened),
  );
  return { ...camera, origin: add(camera.origin, move), target: add(camera.target, move) };
}

/** Seen `factor` times as wide. */
export function zoomed(camera, factor) {
  const width = widthOf(camera);
  const wanted = Math.max(0.02, Math.min(2000, width * factor));
  const s = wanted / width;
  if (camera.kind === "orthographic") return { ...camera, width: wanted };
  const arm = scaled(add(camera.origin, camera.target, -1), s);
  const focus = camera.focus === undefined ? undefined : camera.focus * s;
  return { ...camera, origin: add(camera.target, arm), focus };
}

/** Seen at a width in mm. */
export const atWidth = (camera, width) => zoomed(camera, width / widthOf(camera));

/** Seen straight from above, the warp upright. */
export function straight(camera) {
  const distance = length(add(camera.origin, camera.target, -1));
  const side = camera.origin[2] >= camera.target[2] ? 1 : -1;
  return { ...camera, origin: add(camera.target, [0, 0, side * distance]), up: [0, 1, 0] };
}
