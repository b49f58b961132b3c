// The line at the foot: what the picture is shown as, and what that costs.

import { element } from "./fields.js";
import { on } from "./session.js";
import { seenWidthMm } from "./stage.js";

const foot = document.getElementById("cost");

export function seconds(s) {
  if (s === null || s === undefined || !Number.isFinite(s)) return "\u2013";
  if (s < 0.1) return `${(1000 * s).toFixed(0)} ms`;
  if (s < 120) return `${s.toPrecision(2)} s`;
  if (s < 7200) return `${(s / 60).toFixed(0)} min`;
  return `${(s / 3600).toFixed(1)} h`;
}

const percent = (x) => (x === null || x === undefined ? "\u2013" : `${(100 * x).toPrecision(2)} %`);

function width(mm) {
  if (!mm) return "\u2013";
  return mm < 1 ? `${(1000 * mm).toPrecision(3)} \u00b5m` : `${mm.toPrecision(3)} mm`;
}

function entry(name, value, title = "", tone = "") {
  return element("div", { title }, element("span", { class: "name" }, name), element("span", { class: `figure ${tone}` }, value));
}

function doing(news) {
  if (news.phase === "failed") return "stopped";
  if (news.task) return news.task + (news.share !== null ? ` ${Math.round(100 * news.share)} %` : "");
  if (news.phase === "building") return "building";
  if (news.phase === "done") return "finished";
  if (news.phase === "waiting") return "starting";
  return "refining";
}

on("news", (news) => {
  const { cost, previous } = news;
  const entries = [
    entry("State", doing(news)),
    ...news.shown.map((s) => entry("Shown as", s.what, s.why || "")),
    entry("Seen", width(seenWidthMm()), "Width of the picture on the cloth"),
    entry("Samples", `${cost.samples} of ${news.spp}`, "Of every pixel"),
    entry("Noise", percent(cost.median_noise), `Standard error of the median pixel that shows cloth, over its own value; that of all pixels, root mean square, over the mean of the picture: ${percent(cost.noise)}`),
    entry("Built in", seconds(cost.build_s), "From the change to the first full picture: files, voxels, tables"),
    entry("Traced for", seconds(cost.render_s), `${Math.round(cost.paths_per_s / 1000)} thousand paths a second, by ${cost.engine || "nothing yet"}${cost.why_walk ? `: ${cost.why_walk}` : ""}`),
  ];
  const now = cost.seconds_to_5_percent;
  const then = previous?.seconds_to_5_percent;
  let tone = "";
  let compared = "";
  if (now && then) {
    const ratio = now / then;
    if (ratio > 1.15) [tone, compared] = ["worse", ` (before: ${seconds(then)})`];
    else if (ratio < 0.87) [tone, compared] = ["better", ` (before: ${seconds(then)})`];
  }
  entries.push(entry("5 % noise in", seconds(now) + compared, "Tracing time to a noise of 5 % at this setting, from what was measured so far; before the last change of settings in brackets", tone));
  if (news.memory_bytes) entries.push(entry("Memory", `${Math.round(news.memory_bytes / 1048576)} MiB`));
  foot.replaceChildren(...entries);
});
