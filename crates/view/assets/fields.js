// Fields of the panels: each has a label, and shows what is wrong with what was typed beside it.

import { colourOf, hexOf } from "./colour.js";

let count = 0;

export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === "class") made.className = value;
    else if (name.startsWith("aria-") || name === "role" || name === "for" || name === "list") made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

/** A row of a label and what stands beside it. `apply` gets the value and may reject. */
function row(label, parts, unit, apply) {
  const id = `field-${++count}`;
  const error = element("p", { class: "error", id: `${id}-error`, role: "alert", hidden: true });
  parts[0].id = id;
  const body = element("div", { class: "value" }, ...parts);
  if (unit) body.append(element("span", { class: "unit" }, unit));
  const made = element("div", { class: "field" }, element("label", { for: id }, label), body, error);
  const send = async (value) => {
    try {
      error.hidden = true;
      for (const part of parts) part.removeAttribute("aria-invalid");
      await apply(value);
    } catch (reason) {
      error.textContent = reason.message || String(reason);
      error.hidden = false;
      parts[0].setAttribute("aria-invalid", "true");
      parts[0].setAttribute("aria-describedby", error.id);
    }
  };
  return { made, send };
}

const shown = (value) => (value === undefined || value === null ? "" : Number(Number(value).toPrecision(6)).toString());

/** A number, with a slider where `range` is given; `log` makes its steps equal ratios. */
export function number(label, value, { unit = "", range, log = false, step = "any", whole = false, placeholder = "" }, apply) {
  const typed = element("input", { type: "number", step: whole ? 1 : step, value: shown(value), placeholder, inputMode: "decimal" });
  const parts = [typed];
  const { made, send } = row(label, parts, unit, apply);
  const read = () => {
    if (typed.value === "" || !Number.isFinite(typed.valueAsNumber)) return;
    send(whole ? Math.round(typed.valueAsNumber) : typed.valueAsNumber);
  };
  typed.addEventListener("change", read);
  if (range) {
    const [low, high] = log ? range.map(Math.log) : range;
    const place = (x) => (log ? Math.log(Math.max(x, range[0])) : x);
    const slider = element("input", { type: "range", min: low, max: high, step: "any", "aria-label": label });
    slider.value = place(value ?? range[0]);
    slider.addEventListener("input", () => {
      const x = log ? Math.exp(slider.valueAsNumber) : slider.valueAsNumber;
      typed.value = shown(whole ? Math.round(x) : Number(x.toPrecision(3)));
    });
    slider.addEventListener("change", read);
    typed.addEventListener("change", () => { slider.value = place(typed.valueAsNumber || 0); });
    typed.before(slider);
  }
  return made;
}

/** One of several; an option is a name or `[name, title]`. */
export function choice(label, value, options, apply) {
  const list = options.map((option) => (Array.isArray(option) ? option : [option, option]));
  if (value !== undefined && !list.some(([name]) => name === value)) list.unshift([value, value]);
  const select = element("select", {}, ...list.map(([name, title]) => element("option", { value: name }, title)));
  select.value = value ?? list[0][0];
  const { made, send } = row(label, [select], "", apply);
  select.addEventListener("change", () => send(select.value));
  return made;
}

/** A word that may be typed, with suggestions. */
export function word(label, value, suggestions, apply) {
  const list = `list-${++count}`;
  const typed = element("input", { type: "text", value: value ?? "", spellcheck: false, list });
  const { made, send } = row(label, [typed], "", apply);
  made.append(element("datalist", { id: list }, ...suggestions.map((s) => element("option", { value: s }))));
  typed.addEventListener("change", () => typed.value.trim() && send(typed.value.trim()));
  return made;
}

/** Numbers of a vector. */
export function vector(label, values, unit, apply) {
  const parts = values.map((x, i) => element("input", { type: "number", step: "any", value: shown(x), "aria-label": `${label} ${"xyz"[i] ?? i}` }));
  const { made, send } = row(label, parts, unit, apply);
  for (const part of parts) {
    part.addEventListener("change", () => {
      const read = parts.map((p) => p.valueAsNumber);
      if (read.every(Number.isFinite)) send(read);
    });
  }
  return made;
}

/** A list of colours as text. */
export const runs = (values) => (typeof values === "string" ? values : values.map((value) => (typeof value === "string" ? value : hexOf(value))).join(", "));

/** A list of colours, linear; colours can be added and removed where `isList`. */
export function colours(label, values, isList, apply) {
  const inputs = values.map((colour, i) => element("input", { type: "color", value: hexOf(colour), "aria-label": `${label} ${i + 1}` }));
  const { made, send } = row(label, inputs, "", apply);
  const read = () => inputs.map((input, i) => (input.value === hexOf(values[i]) ? values[i] : colourOf(input.value)));
  for (const input of inputs) input.addEventListener("change", () => send(read()));
  if (isList) {
    const body = made.querySelector(".value");
    const more = element("button", { type: "button", title: "Add a colour to the stripe", "aria-label": `${label}: add a colour` }, "+");
    more.addEventListener("click", () => send([...read(), values[values.length - 1]]));
    body.append(more);
    if (values.length > 1) {
      const less = element("button", { type: "button", title: "Remove the last colour", "aria-label": `${label}: remove the last colour` }, "\u2212");
      less.addEventListener("click", () => send(read().slice(0, -1)));
      body.append(less);
    }
  }
  return made;
}

/** A colour with a brightness, of a light. */
export function light(label, { hue, brightness }, unit, apply) {
  const colour = element("input", { type: "color", value: hexOf(hue), "aria-label": `${label}: colour` });
  const typed = element("input", { type: "number", step: "any", min: 0, value: shown(brightness), "aria-label": `${label}: brightness` });
  const { made, send } = row(label, [typed, colour], unit, apply);
  const read = () => {
    if (!Number.isFinite(typed.valueAsNumber)) return;
    const base = colour.value === hexOf(hue) ? hue : colourOf(colour.value);
    const top = Math.max(...base, 1e-6);
    send(base.map((x) => Number(((x / top) * typed.valueAsNumber).toPrecision(5))));
  };
  colour.addEventListener("change", read);
  typed.addEventListener("change", read);
  return made;
}

/** Figures that cannot be changed. */
export function figures(list) {
  const rows = list.filter(([, value]) => value !== undefined && value !== null);
  return element("dl", { class: "figures" }, ...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
}
