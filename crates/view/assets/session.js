// What the page knows of the session, and how it talks to it. One request waits for news;
// changes are sent one after the other, and camera moves of which a newer one waits are left out.

const listeners = { document: [], news: [], connection: [], failure: [] };

export const state = { document: null, news: null, isConnected: true };

export function on(kind, listener) {
  listeners[kind].push(listener);
}

function emit(kind, value) {
  for (const listener of listeners[kind]) {
    try {
      listener(value);
    } catch (error) {
      // A part of the page that fails is no lost connection, and stops no other.
      reportError(error);
    }
  }
}

/** An answer that says why not. */
export class Refused extends Error {}

async function ask(path, options = {}) {
  const answer = await fetch(path, { cache: "no-store", ...options });
  const type = answer.headers.get("content-type") || "";
  if (type.startsWith("application/json")) {
    const value = await answer.json();
    if (!answer.ok) throw new Refused(value.error || answer.statusText);
    return value;
  }
  if (!answer.ok) throw new Refused(answer.statusText);
  return answer;
}

function post(path, value) {
  const headers = { "content-type": "application/json" };
  return ask(path, { method: "POST", headers, body: value === undefined ? "{}" : JSON.stringify(value) });
}

let queue = Promise.resolve();
let waitingCamera = null;

/** Makes changes, all or none. Throws `Refused` with what is wrong. */
export function change(edits) {
  const sent = queue.then(() => post("edit", { edits }));
  queue = sent.catch(() => {});
  return sent;
}

/** Makes changes that no field stands for: what is wrong is told at the top. */
export function act(edits) {
  return change(edits).catch((error) => emit("failure", error));
}

/** Moves the camera; of moves that wait only the newest is sent. */
export function moveCamera(edits) {
  const isQueued = waitingCamera !== null;
  waitingCamera = edits;
  if (isQueued) return;
  queue = queue.then(async () => {
    const newest = waitingCamera;
    waitingCamera = null;
    try {
      await post("edit", { edits: newest });
    } catch (error) {
      emit("failure", error);
    }
  });
}

export const undo = () => post("undo").catch((error) => emit("failure", error));
export const redo = () => post("redo").catch((error) => emit("failure", error));
export const save = (name) => post("save", { name });

/** Shows a draft in the place of a fabric. */
export async function openDraft(file, fabric) {
  const stem = file.name.replace(/\.[^.]*$/, "").replace(/[^A-Za-z0-9_-]+/g, "_").replace(/^-+/, "").slice(0, 60);
  return ask(`draft?fabric=${fabric}&name=${stem || "draft"}`, { method: "POST", body: file });
}

function setConnected(isConnected) {
  if (isConnected === state.isConnected) return;
  state.isConnected = isConnected;
  emit("connection", isConnected);
}

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

/** Resolves when the page is seen: tabs in the background ask for nothing. */
function seen() {
  if (!document.hidden) return Promise.resolve();
  return new Promise((done) => {
    document.addEventListener("visibilitychange", function now() {
      if (document.hidden) return;
      document.removeEventListener("visibilitychange", now);
      done();
    });
  });
}

/** Follows the session for as long as the page is open. */
export async function follow() {
  let serial = 0;
  let known = 0;
  let wait = 250;
  for (;;) {
    await seen();
    try {
      const answer = await ask(`news?after=${serial}&known=${known}`);
      wait = 250;
      // The numbers of another session begin anew.
      serial = answer.serial;
      setConnected(true);
      if (answer.document) {
        known = answer.document.revision;
        state.document = answer.document;
        emit("document", answer.document);
      }
      state.news = answer.news;
      emit("news", answer.news);
    } catch (error) {
      if (!(error instanceof Refused)) setConnected(false);
      else emit("failure", error);
      serial = 0;
      await pause(wait);
      wait = Math.min(2 * wait, 4000);
    }
  }
}

/** The newest picture. */
export async function picture(number) {
  const answer = await ask(`picture.png?n=${number}`);
  return createImageBitmap(await answer.blob());
}
