// The panels: what can be changed of cloth, yarns, light and picture.

import { split } from "./colour.js";
import * as fields from "./fields.js";
import { act, change, on, state } from "./session.js";

const { element } = fields;
const form = document.getElementById("panels");
form.addEventListener("submit", (event) => event.preventDefault());

const scene = (...key) => (value) => change([{ op: "scene", key: key.map(String), value }]);
const fabric = (i, ...key) => (value) => change([{ op: "fabric", fabric: i, key, value }]);

/** Which panels are open, by name: kept while the panels are made anew. */
const open = new Map([["Cloth", true], ["Shown as", true], ["Light", true], ["Picture", true]]);

function panel(name, note, ...body) {
  const made = element("details", {}, element("summary", {}, name, element("span", { class: "note" }, note || "")), element("div", { class: "body" }, ...body));
  made.open = open.get(name) ?? false;
  made.addEventListener("toggle", () => open.set(name, made.open));
  return made;
}

const undyed = [[0.8, 0.8, 0.8]];

function draftName(table) {
  const draft = table.draft || {};
  return draft.weave ?? draft.wif ?? (draft.knit && `knit: ${draft.knit}`) ?? (draft.drawdown && "drawdown") ?? (draft.curves && `curves: ${draft.curves}`);
}

/** Finishes in their order: a field for each, and one for the next. */
function finishes(i, name, yarn, known) {
  const own = [].concat(yarn.finish ?? []);
  const send = (k, finish) => {
    const list = own.slice();
    list.splice(k, 1, ...(finish ? [finish] : []));
    return fabric(i, "yarn", name, "finish")(list.length ? list : null);
  };
  return [...own, ""].map((finish, k) => {
    const label = k === 0 ? "Finish" : `Finish ${k + 1}`;
    return fields.choice(label, finish, [["", k === 0 ? "none" : "no other"], ...known], (chosen) => send(k, chosen));
  });
}

function pile(document, i) {
  const table = document.fabrics[i].table.pile;
  const kinds = [["", "none"], ["cut", "cut: velvet"], ["loop", "loops: terry"], ["wale", "ridges: corduroy"]];
  const set = (key) => fabric(i, "pile", key);
  const number = (title, key, value, options) => fields.number(title, value, options, set(key));
  return [
    fields.choice("Pile", table?.kind ?? "", kinds, (kind) => change([{ op: "pile", fabric: i, kind }])),
    ...(table ? [
      number("Pile height", "height_mm", table.height_mm, { unit: "mm", range: [0.2, 6], log: true }),
      table.every ? fields.vector("Pile at every", table.every, "ends, picks", (value) => set("every")(value.map(Math.round))) : null,
      table.kind === "wale" ? number("Ridges", "wales_per_cm", table.wales_per_cm, { unit: "per cm", range: [1, 12], log: true }) : null,
      table.kind === "loop" ? number("Loops turn by", "turn_deg", table.turn_deg ?? 30, { unit: "\u00b0", range: [0, 90] }) : null,
      table.kind === "cut" ? number("Splay", "splay", table.splay ?? 1.2, { range: [0.05, 4] }) : null,
      number("Pile leans by", "lean_deg", table.lean_deg ?? 0, { unit: "\u00b0", range: [0, 70] }),
      number("Pile leans to", "lean_direction_deg", table.lean_direction_deg ?? 90, { unit: "\u00b0", range: [-180, 180] }),
      number("Lean varies by", "lean_deviation_deg", table.lean_deviation_deg ?? 0, { unit: "\u00b0", range: [0, 30] }),
      ...colours("Pile colours", table.colours, set("colours")),
    ] : []),
  ];
}

function print(document, i, figures) {
  const table = document.fabrics[i].table.print;
  const set = (key) => fabric(i, "print", key);
  return [
    fields.choice("Print", table?.image ?? table?.colour?.join() ?? "", [["", "none"], ...(table?.colour ? [[table.colour.join(), "one colour"]] : []), ...document.pictures], (image) => change([{ op: "print", fabric: i, image }])),
    ...(table ? [
      fields.choice("Print size", table.size_mm ? "own" : "tile", [["tile", "the tile"], ["own", "in mm"]], (how) => set("size_mm")(how === "tile" ? null : figures?.tile_mm?.slice(0, 2) ?? [10, 10])),
      table.size_mm ? fields.vector("Print measures", table.size_mm, "mm", set("size_mm")) : null,
      fields.choice("Printed side", table.side ?? "face", ["face", "back", "both"], set("side")),
      fields.choice("Print colours", table.mode ?? "multiply", [["multiply", "dye the fibres"], ["replace", "replace their colours"], ["discharge", "take their dye away"]], set("mode")),
    ] : []),
    document.pictures.length || table ? null : element("p", { class: "hint" }, "Pictures in the folder of the file can be printed."),
  ];
}

/** Colours of threads: patches, or runs by name where the file has these; runs may be typed in any case. */
function colours(label, values, apply) {
  const isText = typeof values === "string" || values?.some((value) => typeof value === "string");
  const runs = fields.word(`${label} in runs`, isText ? fields.runs(values) : "", ["8 red, 8 blue, 4 white", "B/24 R4 K24 Y/4"], apply);
  return isText ? [runs] : [fields.colours(label, values?.length ? values : undyed, true, apply), runs];
}

function threads(i, which, title, table, figures) {
  const set = table[which] || {};
  const own = set.per_cm ?? (set.spacing_mm ? 10 / set.spacing_mm : undefined);
  const woven = figures?.[which]?.threads_per_cm;
  return [
    element("h3", {}, title),
    fields.number("Threads", own ?? woven, { unit: "per cm", range: [4, 80], log: true }, fabric(i, which, "per_cm")),
    ...colours("Colours", set.colours, fabric(i, which, "colours")),
    set.colours?.length ? null : element("p", { class: "hint" }, table.draft?.wif ? "The draft gives the colours; a choice here replaces them." : "Undyed; choose a colour to dye it."),
  ];
}

function clothPanel(document, i, figures) {
  const { table, name, is_changed: isChanged } = document.fabrics[i];
  const isKnit = Boolean(table.draft?.knit);
  const isWoven = !isKnit && !table.draft?.curves;
  const suggestions = [...document.weaves, ...document.drafts];
  const dropped = document.fabrics[i].dropped;
  if (dropped) suggestions.push(dropped);
  return panel(i === 0 ? "Cloth" : `Cloth ${i + 1}`, name + (isChanged ? ", changed" : ""),
    fields.word("Draft", draftName(table), suggestions, (draft) => change([{ op: "draft", fabric: i, draft }])),
    ...(isWoven ? threads(i, "warp", "Warp", table, figures) : []),
    ...(isWoven || isKnit ? threads(i, "weft", isKnit ? "Courses" : "Weft", table, figures) : []),
    element("h3", {}, "Pile and print"),
    ...(isWoven ? pile(document, i) : []),
    ...print(document, i, figures),
    figures ? fields.figures([
      ["Weight", `${figures.areal_density_g_per_m2.toFixed(0)} g/m\u00b2`],
      ["Cover", `${(100 * figures.cover_factor).toFixed(1)} %`],
      ["Thickness", `${figures.thickness_mm.toFixed(3)} mm`],
      ["Crimp", figures.warp && figures.weft ? `${figures.warp.crimp_percent.toFixed(1)} % warp, ${figures.weft.crimp_percent.toFixed(1)} % weft` : null],
    ]) : null,
  );
}

function twist(i, name, key, title, value) {
  const byAngle = value?.turns_per_m === undefined && value?.angle_deg !== undefined;
  const amount = byAngle ? value.angle_deg : value?.turns_per_m;
  // Direction and amount go together: a table with one of them is refused.
  const send = (direction, x) => change([
    { op: "fabric", fabric: i, key: ["yarn", name, key, "direction"], value: direction },
    { op: "fabric", fabric: i, key: ["yarn", name, key, byAngle ? "angle_deg" : "turns_per_m"], value: x },
  ]);
  return [
    fields.number(title, amount ?? 0, { unit: byAngle ? "\u00b0" : "turns/m", range: byAngle ? [0, 45] : [0, 2000] }, (x) => send(value?.direction ?? "Z", x)),
    fields.choice(`${title}, way`, value?.direction ?? "Z", [["Z", "Z  /"], ["S", "S  \\"]], (d) => send(d, amount ?? 0)),
  ];
}

function yarnPanel(document, i, name) {
  const yarn = document.fabrics[i].yarns[name];
  const set = (...key) => fabric(i, "yarn", name, ...key);
  const title = document.fabrics.length > 1 ? `Yarn ${name} (${i + 1})` : `Yarn ${name}`;
  return panel(title, `${yarn.preset}, ${Number(yarn.tex?.toPrecision(4) ?? 0)} tex`,
    fields.choice("Fibre", yarn.preset, document.presets, set("preset")),
    fields.number("Count", yarn.tex, { unit: "tex", range: [1, 300], log: true }, set("tex")),
    fields.number("Plies", yarn.plies ?? 1, { whole: true, range: [1, 6] }, set("plies")),
    ...twist(i, name, "twist", "Twist", yarn.twist),
    ...((yarn.plies ?? 1) > 1 ? twist(i, name, "ply_twist", "Ply twist", yarn.ply_twist) : []),
    fields.number("Fibre radius", yarn.fibre_radius_um, { unit: "\u00b5m", range: [3, 40], log: true }, set("fibre_radius_um")),
    fields.choice("Irregularity", yarn.irregularity ?? "", [["", "none"], ...document.irregularities], (kind) => set("irregularity")(kind || null)),
    ...finishes(i, name, yarn, document.finishes),
    fields.number("Flatness", yarn.aspect, { unit: "width / height", range: [1, 4] }, set("aspect")),
  );
}

function shownPanel(document) {
  const rows = (document.scene.object || []).flatMap((object, i) => {
    if (object.kind !== "cloth") return [];
    const options = [["auto", "auto"], ...document.models.map((m) => [m.name, m.name])];
    const own = object.model === undefined ? [["", "the fabric\u2019s own"]] : [];
    const label = document.fabrics.length > 1 ? `Model ${i + 1}` : "Model";
    const about = document.models.find((m) => m.name === object.model)?.about;
    return [
      fields.choice(label, object.model ?? "", [...own, ...options], (model) => model && change([{ op: "model", object: i, model }])),
      object.model === "auto"
        ? fields.number("Tolerance", object.tolerance ?? 0.1, { range: [0.01, 1], log: true }, scene("object", i, "tolerance"))
        : null,
      element("p", { class: "hint" }, object.model === "auto" ? "The fastest that was measured to be within the tolerance at this distance." : about ?? ""),
    ];
  });
  return panel("Shown as", "", ...rows);
}

function lightRows(light, i, isOnly) {
  const set = (key) => scene("light", i, key);
  const remove = element("button", { type: "button", title: `Remove light ${i + 1}`, "aria-label": `Remove light ${i + 1}` }, "Remove");
  remove.addEventListener("click", () => act([{ op: "remove-light", light: i }]));
  const rows = [element("h3", {}, `${i + 1}. ${light.kind}`, isOnly ? null : remove)];
  const colour = (label, key, unit) => light[key] && rows.push(fields.light(label, split(light[key]), unit, set(key)));
  colour("Irradiance", "irradiance", "");
  colour("Radiance", "radiance", "");
  colour("Intensity", "intensity", "");
  if (light.direction) rows.push(...direction(light, i));
  if (light.centre_mm) rows.push(fields.vector("Middle", light.centre_mm, "mm", set("centre_mm")), fields.number("Radius", light.radius_mm, { unit: "mm", range: [1, 200], log: true }, set("radius_mm")));
  if (light.position_mm) rows.push(fields.vector("Position", light.position_mm, "mm", set("position_mm")));
  if (light.half_angle_deg !== undefined) rows.push(fields.number("Half angle", light.half_angle_deg, { unit: "\u00b0", range: [1, 90] }, set("half_angle_deg")));
  if (light.corner_mm) rows.push(fields.vector("Corner", light.corner_mm, "mm", set("corner_mm")), fields.vector("Edge u", light.edge_u_mm, "mm", set("edge_u_mm")), fields.vector("Edge v", light.edge_v_mm, "mm", set("edge_v_mm")));
  if (light.kind === "environment" && !light.file) rows.push(fields.choice("From", light.hemisphere ?? "all", [["all", "all around"], ["front", "the front"], ["back", "the back"]], set("hemisphere")));
  if (light.file) {
    rows.push(fields.number("Scale", light.scale ?? 1, { range: [0.01, 100], log: true }, set("scale")));
    rows.push(fields.number("Turned", light.rotation_deg ?? 0, { unit: "\u00b0", range: [-180, 180] }, set("rotation_deg")));
  }
  return rows;
}

/** The direction of a light as angles of where it comes from: a person thinks of a lamp. */
function direction(light, i) {
  const [x, y, z] = light.direction.map((v) => -v);
  const length = Math.hypot(x, y, z) || 1;
  const height = (Math.asin(z / length) * 180) / Math.PI;
  const around = (Math.atan2(y, x) * 180) / Math.PI;
  const send = (a, h) => {
    const [sa, ca, sh, ch] = [Math.sin(a), Math.cos(a), Math.sin(h), Math.cos(h)];
    const from = [ca * ch, sa * ch, sh];
    return scene("light", i, "direction")(from.map((v) => Number((-v).toFixed(5))));
  };
  const rad = Math.PI / 180;
  return [
    fields.number("Around", Number(around.toFixed(2)), { unit: "\u00b0", range: [-180, 180] }, (a) => send(a * rad, height * rad)),
    fields.number("Height", Number(height.toFixed(2)), { unit: "\u00b0", range: [-90, 90] }, (h) => send(around * rad, h * rad)),
  ];
}

function lightPanel(document) {
  const lights = document.scene.light || [];
  const add = fields.choice("Add a light", "", [["", "choose\u2026"], ...document.lights], (kind) => kind && change([{ op: "add-light", kind }]));
  return panel("Light", `${lights.length}`, ...lights.flatMap((light, i) => lightRows(light, i, false)), add);
}

function whiteBalance(value) {
  const lights = [["off", "off (D65)"], ["auto", "mean of the picture"], ["3000", "warm lamp, 3000 K"], ["4000", "white lamp, 4000 K"], ["5000", "daylight, 5000 K"], ["7500", "shade, 7500 K"]];
  const set = scene("render", "white_balance");
  return fields.choice("White", `${value}`, lights, (name) => set(Number(name) ? Number(name) : name));
}

/** What `auto` makes of the exposure: its text follows the pictures. */
function exposureInUse() {
  return element("output", { id: "exposure-in-use", "aria-label": "Exposure in use" }, stops(state.news?.exposure_stops));
}

function stops(value) {
  return value === null || value === undefined ? "\u2013" : `${value < 0 ? "\u2212" : "+"}${Math.abs(value).toFixed(2)} stops`;
}

on("news", (news) => {
  const shown = window.document.getElementById("exposure-in-use");
  if (shown) shown.textContent = stops(news.exposure_stops);
});

function picturePanel(document) {
  const render = document.scene.render || {};
  const camera = document.scene.camera || {};
  const [w, h] = camera.resolution || [512, 512];
  const size = fields.vector("Size", [w, h], "pixels", (value) => scene("camera", "resolution")(value.map(Math.round)));
  return panel("Picture", `${w} \u00d7 ${h}`,
    fields.choice("Expose", render.exposure === "auto" ? "auto" : "stops", [["stops", "by stops"], ["auto", "automatically"]], (how) => scene("render", "exposure")(how === "auto" ? "auto" : state.news?.exposure_stops ?? 0)),
    render.exposure === "auto" ? fields.figures([["Exposure in use", exposureInUse()]]) : fields.number("Exposure", render.exposure ?? 0, { unit: "stops", range: [-6, 6] }, scene("render", "exposure")),
    fields.choice("Tone mapping", render.tone_mapping ?? "plain", ["plain", ["agx", "AgX"], ["aces", "ACES"]], scene("render", "tone_mapping")),
    whiteBalance(render.white_balance ?? "off"),
    fields.number("Samples", render.spp ?? 64, { whole: true, range: [1, 4096], log: true }, scene("render", "spp")),
    size,
    camera.fov_deg !== undefined ? fields.number("Angle of view", camera.fov_deg, { unit: "\u00b0", range: [2, 90] }, scene("camera", "fov_deg")) : null,
    camera.f_number !== undefined ? fields.number("f-number", camera.f_number, { range: [1, 32], log: true }, scene("camera", "f_number")) : null,
    camera.aperture_mm !== undefined ? fields.number("Aperture", camera.aperture_mm, { unit: "mm", range: [0, 10] }, scene("camera", "aperture_mm")) : null,
    fields.number("Seed", render.seed ?? 0, { whole: true }, scene("render", "seed")),
  );
}

/** What the panels were made from: camera moves do not make them anew. */
let madeFrom = "";

function make() {
  const { document: shown, news } = state;
  if (!shown) return;
  const { origin_mm, target_mm, up, width_mm, focus_mm, ...camera } = shown.scene.camera || {};
  const parts = { ...shown, revision: 0, scene: { ...shown.scene, camera }, figures: news?.figures };
  const from = JSON.stringify(parts);
  if (from === madeFrom) return;
  madeFrom = from;
  const scrolled = form.parentElement.scrollTop;
  const focused = form.contains(document.activeElement) ? document.activeElement : null;
  const label = focused?.getAttribute("aria-label") || focused?.labels?.[0]?.textContent;
  const inPanel = focused?.closest("details")?.querySelector("summary")?.firstChild?.textContent;
  form.replaceChildren(
    ...shown.fabrics.map((_, i) => clothPanel(shown, i, news?.figures?.[i])),
    ...shown.fabrics.flatMap((f, i) => Object.keys(f.yarns).map((name) => yarnPanel(shown, i, name))),
    shownPanel(shown),
    lightPanel(shown),
    picturePanel(shown),
  );
  form.parentElement.scrollTop = scrolled;
  if (label) refocus(inPanel, label, focused.type);
}

/** Puts the focus back into the field that had it. */
function refocus(inPanel, label, type) {
  const panels = [...form.querySelectorAll("details")];
  const home = panels.find((p) => p.querySelector("summary").firstChild.textContent === inPanel) || form;
  const same = [...home.querySelectorAll("input, select, button")].filter((field) => field.getAttribute("aria-label") === label || field.labels?.[0]?.textContent === label);
  (same.find((field) => field.type === type) || same[0])?.focus({ preventScroll: true });
}

on("document", make);
on("news", make);
