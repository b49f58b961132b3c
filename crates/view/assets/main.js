// The page: notices, dropped drafts, saving, undo.

import { element } from "./fields.js";
import "./stage.js";
import "./panels.js";
import "./figures.js";
import { follow, on, openDraft, redo, save, state, undo } from "./session.js";

const byId = (id) => document.getElementById(id);

// Notices: one of each kind at a time.

const notices = new Map();

function notice(kind, text, isOdd = false) {
  const old = notices.get(kind);
  if (old?.text === text) return;
  old?.made.remove();
  notices.delete(kind);
  if (!text) return;
  const close = element("button", { type: "button", "aria-label": "Dismiss" }, "\u00d7");
  const made = element("div", { class: isOdd ? "notice odd" : "notice" }, element("p", {}, text), close);
  close.addEventListener("click", () => made.remove());
  notices.set(kind, { text, made });
  byId("notices").append(made);
}

on("connection", (isConnected) => {
  notice("connection", isConnected ? "" : "The connection to organza is lost: is the command still running? Trying again\u2026");
});
on("failure", (error) => notice("failure", error.message));
on("news", (news) => {
  notice("error", news.phase === "failed" ? news.error : "");
  notice("warnings", news.warnings.join("\n"), true);
});
on("document", (shown) => {
  byId("title").textContent = shown.title;
  document.title = `${shown.title} \u2013 organza`;
  byId("undo").disabled = shown.undo === 0;
  byId("redo").disabled = shown.redo === 0;
  notice("failure", "");
});

// Drafts.

async function drop(file) {
  if (!file) return;
  notice("draft", "");
  if (!/\.wif$/i.test(file.name)) {
    notice("draft", `${file.name}: expected a draft in the WIF format, a file that ends in .wif`);
    return;
  }
  if (file.size > 2 * 1024 * 1024) {
    notice("draft", `${file.name}: expected a draft of at most 2 MiB`);
    return;
  }
  try {
    await openDraft(file, 0);
  } catch (error) {
    notice("draft", error.message.startsWith(file.name) ? error.message : `${file.name}: ${error.message}`);
  }
}

byId("draft-file").addEventListener("change", (event) => {
  drop(event.target.files[0]);
  event.target.value = "";
});
let depth = 0;
const hint = byId("drop-hint");
addEventListener("dragenter", (event) => {
  event.preventDefault();
  depth += 1;
  hint.hidden = false;
});
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("dragleave", () => {
  depth = Math.max(0, depth - 1);
  hint.hidden = depth === 0;
});
addEventListener("drop", (event) => {
  event.preventDefault();
  depth = 0;
  hint.hidden = true;
  drop(event.dataTransfer.files[0]);
});

// Saving.

const dialog = byId("save-dialog");

function openSave() {
  if (dialog.open) return;
  byId("save-answer").textContent = "";
  const name = byId("save-name");
  if (!name.value && state.document) {
    name.value = "my_" + state.document.title.replace(/(_scene)?\.toml$/, "").replace(/[^A-Za-z0-9_-]/g, "_");
  }
  dialog.showModal();
  name.select();
}

byId("save").addEventListener("click", openSave);
byId("save-cancel").addEventListener("click", () => dialog.close());
dialog.querySelector("form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const answer = byId("save-answer");
  const go = byId("save-go");
  go.disabled = true;
  answer.className = "";
  answer.textContent = "Saving\u2026";
  try {
    const { files } = await save(byId("save-name").value);
    answer.textContent = `Saved ${files.join(", ")}`;
  } catch (error) {
    answer.className = "wrong";
    answer.textContent = error.message;
  } finally {
    go.disabled = false;
  }
});

// Undo.

byId("undo").addEventListener("click", undo);
byId("redo").addEventListener("click", redo);
addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
  const key = event.key.toLowerCase();
  const isText = event.target.matches?.("input[type=text], input[type=number], input:not([type])");
  if (key === "s") openSave();
  else if (key === "z" && !isText) event.shiftKey ? redo() : undo();
  else if (key === "y" && !isText) redo();
  else return;
  event.preventDefault();
});

follow();
