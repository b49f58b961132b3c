// The picture, and moving the camera on it by pointer, wheel and keyboard.

import * as camera from "./camera.js";
import { element } from "./fields.js";
import { moveCamera, on, picture, state } from "./session.js";

const stage = document.getElementById("stage");
const canvas = document.getElementById("picture");
const progress = document.getElementById("progress");

/** The camera as the page has moved it, ahead of the session. */
let own = null;
let ownUntil = 0;

function current() {
  if (own) return own;
  const table = state.document?.scene.camera;
  return table ? camera.cameraOf(table) : null;
}

function move(next) {
  if (!next) return;
  own = next;
  ownUntil = performance.now() + 1000;
  moveCamera(camera.editsOf(next));
}

on("document", (document) => {
  // While the camera is moving, what comes back is older than what is shown.
  if (performance.now() > ownUntil) own = null;
  showViews(document);
});

// Distances.

function spacingMm(document) {
  const figures = state.news?.figures?.[0];
  const perCm = figures?.warp?.threads_per_cm || figures?.weft?.threads_per_cm
    || document?.fabrics?.[0]?.table?.warp?.per_cm;
  return perCm ? 10 / perCm : 0.5;
}

function fibreMm(document) {
  const yarns = Object.values(document?.fabrics?.[0]?.yarns || {});
  return yarns[0]?.fibre_radius_um ? (2 * yarns[0].fibre_radius_um) / 1000 : 0.016;
}

const views = [
  ["Cloth", "The whole cloth", () => 90],
  ["Weave", "Some repeats of the weave", (d) => 16 * spacingMm(d)],
  ["Yarn", "Two threads", (d) => 3 * spacingMm(d)],
  ["Fibres", "Single fibres", (d) => 14 * fibreMm(d)],
];
const viewButtons = views.map(([name, title, width]) => {
  const button = element("button", { type: "button", title }, name);
  button.addEventListener("click", () => move(current() && camera.atWidth(current(), width(state.document))));
  return button;
});
const from = element("button", { type: "button", title: "Look straight down (0)" }, "From above");
from.addEventListener("click", () => move(current() && camera.straight(current())));
document.getElementById("views").append(...viewButtons, from);

function showViews(document) {
  const seen = current();
  if (!seen) return;
  const width = camera.widthOf(seen);
  views.forEach(([, , of], i) => {
    viewButtons[i].setAttribute("aria-pressed", String(Math.abs(Math.log(width / of(document))) < 0.05));
  });
}

/** Width of the picture at the target, mm. */
export function seenWidthMm() {
  const seen = current();
  return seen && camera.widthOf(seen);
}

// Pointers: one orbits, or pans with Shift or another button; two pan and zoom.

const pointers = new Map();

stage.addEventListener("pointerdown", (event) => {
  if (event.target.closest("button")) return;
  stage.focus({ preventScroll: true });
  stage.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  stage.classList.add("moving");
  event.preventDefault();
});

function shares(dx, dy) {
  const box = canvas.getBoundingClientRect();
  const ratio = canvas.width / canvas.height;
  const width = Math.min(box.width, box.height * ratio) || 1;
  return [dx / width, dy / width];
}

stage.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId);
  if (!last) return;
  const seen = current();
  const before = [...pointers.values()].map((p) => [...p]);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  const [x, y] = shares(event.clientX - last[0], event.clientY - last[1]);
  if (!seen || (x === 0 && y === 0)) return;
  if (pointers.size === 2) {
    const after = [...pointers.values()];
    const apart = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    const moved = camera.panned(seen, -x / 2, y / 2);
    move(camera.zoomed(moved, apart(before) / apart(after)));
  } else if (event.shiftKey || event.buttons & 6) {
    move(camera.panned(seen, -x, y));
  } else {
    move(camera.orbited(seen, -3 * x, 3 * y));
  }
});

for (const kind of ["pointerup", "pointercancel"]) {
  stage.addEventListener(kind, (event) => {
    pointers.delete(event.pointerId);
    if (pointers.size === 0) stage.classList.remove("moving");
  });
}
stage.addEventListener("contextmenu", (event) => event.preventDefault());
stage.addEventListener("wheel", (event) => {
  event.preventDefault();
  const lines = event.deltaMode === 1 ? 16 : 1;
  const factor = Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY * lines * 0.0015)));
  move(current() && camera.zoomed(current(), factor));
}, { passive: false });

stage.addEventListener("keydown", (event) => {
  if (event.target !== stage || event.ctrlKey || event.metaKey || event.altKey) return;
  const seen = current();
  if (!seen) return;
  const turn = 5 * (Math.PI / 180);
  const step = 0.08;
  const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] || [];
  if (x !== undefined) {
    move(event.shiftKey ? camera.panned(seen, step * x, step * y) : camera.orbited(seen, turn * x, turn * y));
  } else if (event.key === "+" || event.key === "=") move(camera.zoomed(seen, 0.8));
  else if (event.key === "-" || event.key === "_") move(camera.zoomed(seen, 1.25));
  else if (event.key === "0") move(camera.straight(seen));
  else return;
  event.preventDefault();
});
stage.addEventListener("pointerenter", () => {
  stage.classList.add("shown-help");
  setTimeout(() => stage.classList.remove("shown-help"), 4000);
}, { once: true });

// The picture.

let fetched = 0;
let isFetching = false;

async function showNewest() {
  if (isFetching) return;
  isFetching = true;
  try {
    while (state.news && state.news.picture !== fetched && state.news.picture > 0) {
      const { picture: number, size, coarseness } = state.news;
      const bitmap = await picture(number);
      fetched = number;
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
      bitmap.close();
      canvas.dataset.picture = number;
      canvas.dataset.coarseness = coarseness;
      canvas.setAttribute("aria-label", `Rendered cloth, ${size.join(" by ")} pixels`);
    }
  } catch {
    // The next news brings another one.
  } finally {
    isFetching = false;
  }
}
canvas.setAttribute("role", "img");

on("news", (news) => {
  showNewest();
  const samples = news.cost.samples;
  const share = news.spp && news.picture_revision === news.revision ? samples / news.spp : 0;
  const isBusy = news.phase === "building" || news.phase === "waiting";
  progress.classList.toggle("busy", isBusy && news.share === null);
  const percent = Math.round(100 * (isBusy ? news.share || 0 : news.phase === "failed" ? 0 : share));
  progress.firstElementChild.style.width = isBusy && news.share === null ? "" : `${percent}%`;
  progress.setAttribute("aria-valuenow", percent);
  progress.setAttribute("aria-valuetext", news.task || `${samples} of ${news.spp} samples`);
});
