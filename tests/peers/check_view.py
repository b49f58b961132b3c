"""Checks the live page of `organza view` in headless Chromium, as a person uses it.

    tests/peers/run view

CHROMIUM names the browser; without it the system's `chromium` is taken.
"""

import argparse
import contextlib
import http.server
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 90


@contextlib.contextmanager
def served(organza, file):
    """A page of a file: its address and its process."""
    process = subprocess.Popen(
        [organza, "view", str(file)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        yield process.stdout.readline().strip(), process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0, "Ctrl-C ends it with status 0"


class Page:
    """A tab, with what went wrong in it."""

    def __init__(self, context, address):
        self.tab = context.new_page()
        self.wrong = []
        self.foreign = []
        self.tab.on("pageerror", lambda e: self.wrong.append(str(e)))
        self.tab.on("console", self._console)
        self.tab.on("request", lambda r: self._request(r.url, address))
        self.began = time.monotonic()
        self.tab.goto(address)

    def _console(self, message):
        # A refused change is a 422, which Chromium reports as well.
        if message.type == "error" and "422" not in message.text and "ERR_" not in message.text:
            self.wrong.append(message.text)

    def _request(self, url, address):
        if not url.startswith(address) and not url.startswith("blob:"):
            self.foreign.append(url)

    def canvas(self, name):
        return self.tab.eval_on_selector("#picture", f"c => c.dataset.{name}")

    def until(self, what, expression, patience_s=PATIENCE_S):
        try:
            self.tab.wait_for_function(expression, timeout=1000 * patience_s)
        except Exception as e:
            notices = self.tab.inner_text("#notices")
            raise AssertionError(f"{what}; the page says {notices!r}: {e}") from None

    def until_full(self):
        self.until(
            "a full picture",
            "() => document.querySelector('#picture').dataset.coarseness === '1' "
            "&& /refining|finished/.test(document.querySelector('#cost').innerText)",
        )

    def brightness(self):
        return self.tab.evaluate(
            "() => { const c = document.querySelector('#picture');"
            "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
            "let s = 0; for (let i = 0; i < d.length; i += 4) s += d[i] + d[i + 1] + d[i + 2];"
            "return s / (0.75 * d.length); }"
        )

    def figure(self, name):
        text = self.tab.evaluate(
            "name => [...document.querySelectorAll('#cost > div')]"
            ".filter(d => d.firstChild.textContent === name)"
            ".map(d => d.lastChild.textContent)[0]",
            name,
        )
        return text or ""

    def field(self, label):
        return self.tab.get_by_label(label, exact=True)

    def session(self):
        return self.tab.evaluate("async () => (await fetch('news?after=0&known=0')).json()")

    def set(self, label, value, role="spinbutton"):
        field = self.tab.get_by_role(role, name=label, exact=True).first
        field.fill(str(value))
        field.press("Tab")


def stripe(path):
    """A picture of four pixels: red, white, red, white."""
    def chunk(name, data):
        body = name + data
        return len(data).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")

    head = (4).to_bytes(4, "big") + (1).to_bytes(4, "big") + bytes([8, 2, 0, 0, 0])
    row = b"\0" + 2 * (bytes([180, 20, 20]) + bytes(3 * [255]))
    parts = [chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(row)), chunk(b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def done(what):
    print(f"view: {what}", flush=True)


def check_first_picture(page, shots):
    page.until("a first picture", "() => document.querySelector('#picture').dataset.picture")
    first_s = time.monotonic() - page.began
    page.until_full()
    before = int(page.canvas("picture"))
    page.until("refinement", f"() => +document.querySelector('#picture').dataset.picture > {before + 1}")
    page.until("a noise", "() => /Noise\\s*[\\d.e+]+ %/.test(document.querySelector('#cost').innerText)")
    for name in ["Shown as", "Samples", "Noise", "Built in", "Traced for", "5 % noise in"]:
        assert page.figure(name), name
    page.tab.screenshot(path=shots / "first.png")
    done(f"loads, first picture after {first_s:.2f} s, then refines; shown as {page.figure('Shown as')}")


def check_controls(page):
    page.until_full()
    # The studio meters its exposure.
    page.tab.get_by_role("combobox", name="Expose", exact=True).first.select_option("stops")
    metered = float(page.tab.get_by_role("spinbutton", name="Exposure", exact=True).first.input_value())
    before = page.brightness()
    page.set("Exposure", metered + 1)
    page.until("more light", "() => true", 1)
    deadline = time.monotonic() + PATIENCE_S
    while page.brightness() < 1.2 * before:
        assert time.monotonic() < deadline, (before, page.brightness())
        time.sleep(0.05)
    page.set("Exposure", 0.5)
    page.set("Threads", 26)
    page.until("26 ends", "() => /changed/.test(document.querySelector('summary').innerText)")
    table = page.session()["document"]["fabrics"][0]["table"]
    assert table["warp"]["per_cm"] == 26, table
    page.set("Colours in runs", "8 red, 8 bleu", "combobox")
    page.until("a colour that is none is told", "() => [...document.querySelectorAll('.field .error')]"
               ".some(e => !e.hidden && /bleu.*blue/.test(e.innerText))")
    page.set("Colours in runs", "8 red, 8 blue", "combobox")
    page.until("runs in place of patches", "() => !document.querySelector('input[aria-label=\"Colours 2\"]') "
               "&& document.querySelectorAll('input[type=color][aria-label^=\"Colours\"]').length === 1")
    page.tab.click("#undo")
    page.tab.keyboard.press("Escape")
    page.tab.click("#undo")
    page.until("undone", "() => !document.querySelector('#redo').disabled")
    page.set("Threads", 900)
    page.until("a jam is told", "() => /jammed/.test(document.querySelector('#notices').innerText)")
    page.tab.click("#undo")
    page.until("the message goes", "() => !document.querySelector('#notices').innerText")
    page.set("Samples", 0)
    page.until("a message at the field", "() => [...document.querySelectorAll('.field .error')]"
               ".some(e => !e.hidden && /spp: expected a whole number from 1/.test(e.innerText))")
    done("fields change the picture; what is wrong is told where it was typed; undo")


def check_cloth(page):
    """Finishes, irregularity, pile, print and the exposure in use, as a person sets them."""
    fabric = lambda: page.session()["document"]["fabrics"][0]["table"]

    def choose(label, option):
        revision = page.session()["document"]["revision"]
        page.tab.get_by_role("combobox", name=label, exact=True).first.select_option(option)
        page.until(f"{label}: {option}", "async () => { const { document: d } = await (await fetch('news?after=0&known=0')).json();"
                   f"return d.revision > {revision}; }}")

    page.tab.evaluate("() => { for (const d of document.querySelectorAll('details')) d.open = true; }")
    yarn = page.session()["document"]["fabrics"][0]["table"]["warp"]["yarn"]
    choose("Irregularity", "ring-spun cotton")
    choose("Finish", "singed")
    choose("Finish 2", "mercerised")
    own = fabric()["yarn"][yarn]
    assert (own["irregularity"], own["finish"]) == ("ring-spun cotton", ["singed", "mercerised"]), own
    choose("Finish", "")
    choose("Finish", "")
    choose("Irregularity", "")
    assert not {"irregularity", "finish"} & set(fabric()["yarn"][yarn])
    choose("Pile", "cut")
    page.set("Pile height", 0.8)
    page.until("a pile", "async () => { const { document: d } = await (await fetch('news?after=0&known=0')).json();"
               "return d.fabrics[0].table.pile?.height_mm === 0.8; }")
    choose("Pile", "")
    choose("Print", "stripe.png")
    page.until_full()
    choose("Printed side", "both")
    assert fabric()["print"] == {"image": "stripe.png", "side": "both"}, fabric()["print"]
    choose("Print", "")
    assert not {"pile", "print"} & set(fabric())
    choose("Expose", "auto")
    page.until("the exposure in use", "() => /^[+\u2212]\\d+\\.\\d\\d stops$/.test(document.querySelector('#exposure-in-use').textContent)")
    shown = page.tab.inner_text("#exposure-in-use")
    choose("Expose", "stops")
    kept = page.session()["document"]["scene"]["render"]["exposure"]
    assert abs(kept - float(shown.removesuffix(" stops").replace("\u2212", "-"))) < 0.0051, (kept, shown)
    page.set("Exposure", 0.5)
    done(f"finishes, irregularity, pile and print have fields; automatic exposure shows {shown}")


def check_camera(page):
    camera = lambda: page.session()["document"]["scene"]["camera"]
    box = page.tab.locator("#picture").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before = camera()
    page.tab.mouse.move(*middle)
    page.tab.mouse.down()
    page.tab.mouse.move(middle[0] + 120, middle[1] + 40, steps=6)
    page.tab.mouse.up()
    time.sleep(0.5)
    after = camera()
    assert after["origin_mm"] != before["origin_mm"] and after["target_mm"] == before["target_mm"]
    page.tab.keyboard.down("Shift")
    page.tab.mouse.down()
    page.tab.mouse.move(middle[0], middle[1], steps=4)
    page.tab.mouse.up()
    page.tab.keyboard.up("Shift")
    time.sleep(0.5)
    panned = camera()
    assert panned["target_mm"] != after["target_mm"] and abs(panned["target_mm"][2]) < 1e-6
    seen = lambda: page.figure("Seen")
    far = seen()
    page.tab.mouse.wheel(0, -300)
    page.until("nearer", f"() => !document.querySelector('#cost').innerText.includes({json.dumps(far)})")
    page.tab.focus("#stage")
    page.tab.keyboard.press("0")
    page.tab.keyboard.press("-")
    time.sleep(0.5)
    straight = camera()
    assert straight["origin_mm"][:2] == straight["target_mm"][:2], straight
    shown = {}
    for name in ["Cloth", "Weave", "Yarn", "Fibres"]:
        revision = page.session()["news"]["revision"]
        page.tab.get_by_role("button", name=name, exact=True).click()
        page.until("a picture of it", "async () => { const { news } = await (await fetch('news?after=0&known=1')).json();"
                   f"return news.picture_revision > {revision} && news.coarseness === 1; }}")
        time.sleep(0.3)
        shown[name] = f"{page.figure('Seen')} as {page.figure('Shown as')}"
    page.tab.get_by_role("button", name="Weave", exact=True).click()
    done(f"orbit, pan, zoom by pointer and keyboard; {shown}")


def check_drafts(page, folder):
    bad = folder / "bad.wif"
    bad.write_text("[WIF]\nVersion=1.1\n[THREADING]\n1=cat\n")
    page.tab.set_input_files("#draft-file", bad)
    page.until("a bad draft is told", "() => /bad.wif: .*\\[/.test(document.querySelector('#notices').innerText)")
    message = page.tab.inner_text("#notices").split("\n")[0]
    cat = folder / "cat.png"
    cat.write_bytes(b"\x89PNG")
    page.tab.set_input_files("#draft-file", cat)
    page.until("another file is told", "() => /expected a draft/.test(document.querySelector('#notices').innerText)")
    wif = (ROOT / "scenes/drafts/first_light.wif").read_text()
    page.tab.evaluate(
        "text => { const data = new DataTransfer();"
        "data.items.add(new File([text], 'first light.wif'));"
        "for (const kind of ['dragenter', 'dragover', 'drop'])"
        "document.body.dispatchEvent(new DragEvent(kind, { dataTransfer: data, bubbles: true })); }",
        wif,
    )
    page.until("cloth of the draft", "() => document.querySelector('summary').innerText.includes('first_light_dropped.toml')")
    page.until_full()
    wrong = page.tab.locator(".notice:not(.odd)").all_inner_texts()
    assert not wrong, wrong
    done(f"a dropped draft shows cloth; a bad one says {message!r}")


def check_tabs(context, page, address):
    others = [Page(context, address) for _ in range(2)]
    for other in others:
        other.until("a picture in every tab", "() => document.querySelector('#picture').dataset.picture")
    page.set("Seed", 7)
    for other in others:
        other.until("the change in every tab", "() => [...document.querySelectorAll('.field')]"
                    ".some(f => f.innerText.includes('Seed') && f.querySelector('input').value === '7')")
        assert not other.wrong and not other.foreign, (other.wrong, other.foreign)
        other.tab.close()
    done("three tabs show one scene")


def check_connection(context, page):
    context.set_offline(True)
    page.until("a lost connection is told", "() => /connection to organza is lost/.test(document.querySelector('#notices').innerText)")
    context.set_offline(False)
    page.until("it goes on", "() => !/connection/.test(document.querySelector('#notices').innerText)")
    page.set("Seed", 8)
    page.until("a change after it", "() => /refining|finished/.test(document.querySelector('#cost').innerText)")
    done("a dropped connection is told, and the page goes on when it is back")


def check_saving(page, folder, organza):
    # Small enough to go without a cache, of which the page learns less than `render`.
    page.set("Size y", 200)
    page.set("Samples", 2)
    page.until("a finished picture", "async () => { const { news } = await (await fetch('news?after=0&known=1')).json();"
               "return news.phase === 'done' && news.spp === 2; }")
    page.tab.keyboard.press("Control+s")
    page.tab.fill("#save-name", "from_page")
    page.tab.click("#save-go")
    page.until("saved", "() => /^Saved /.test(document.querySelector('#save-answer').textContent)")
    page.tab.click("#save-cancel")
    again = folder / "again.png"
    subprocess.run([organza, "render", folder / "from_page.toml", "-o", again, "--quiet"], check=True)
    assert again.read_bytes() == (folder / "from_page.png").read_bytes()
    done("what is saved is what organza render makes of it, byte for byte")


def check_access(page):
    nameless = page.tab.evaluate(
        "() => [...document.querySelectorAll('input, select, button')].filter(e => !e.hidden"
        "&& !(e.getAttribute('aria-label') || e.labels?.length || e.textContent.trim())).map(e => e.outerHTML)"
    )
    assert not nameless, nameless
    page.tab.set_viewport_size({"width": 390, "height": 800})
    wide = page.tab.evaluate("() => document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0, f"{wide} pixels too wide on a narrow window"
    page.tab.set_viewport_size({"width": 1360, "height": 860})
    done("every field has a name; nothing is cut off in a narrow window")


def check_other_origin(context, page, address):
    """A page of another origin cannot change, read or frame the session."""
    html = (
        f"<img id=i src='{address}picture.png'><iframe id=f src='{address}'></iframe>"
        f"<script>fetch('{address}undo', {{method: 'POST', mode: 'no-cors', body: '{{}}'}})"
        f".catch(() => 0).then(() => fetch('{address}news?after=0&known=0')).then(r => r.json())"
        ".then(() => document.title = 'read', () => document.title = 'refused')</script>"
    )

    class Evil(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(html.encode())

        def log_message(self, *_):
            pass

    server = http.server.HTTPServer(("127.0.0.1", 0), Evil)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    revision = page.session()["document"]["revision"]
    evil = context.new_page()
    evil.goto(f"http://127.0.0.1:{server.server_port}/")
    evil.wait_for_function("() => document.title", timeout=20_000)
    assert evil.title() == "refused"
    assert evil.evaluate("() => document.querySelector('#i').naturalWidth") == 0
    assert not any(frame.query_selector("#stage") for frame in evil.frames[1:]), "framed"
    assert page.session()["document"]["revision"] == revision
    evil.close()
    server.shutdown()
    done("pages of other origins are refused")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--organza", required=True)
    parser.add_argument("--out", type=Path, help="folder for pictures of the page")
    arguments = parser.parse_args()
    organza = str(Path(arguments.organza).resolve())
    browser_path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if not browser_path:
        sys.exit("no chromium: install it (Debian: chromium), or name one by CHROMIUM")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        shots = arguments.out or folder
        shots.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "scenes/fabrics/denim.toml", folder)
        stripe(folder / "stripe.png")
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        print(f"Chromium {browser.version}")
        context = browser.new_context(viewport={"width": 1360, "height": 860})
        with served(organza, folder / "denim.toml") as (address, process):
            page = Page(context, address)
            page.tab.set_default_timeout(1000 * PATIENCE_S)
            check_first_picture(page, shots)
            # Small pictures, so that a busy machine keeps up.
            page.set("Size x", 320)
            page.set("Size y", 240)
            check_controls(page)
            check_cloth(page)
            check_camera(page)
            check_drafts(page, folder)
            check_tabs(context, page, address)
            check_connection(context, page)
            check_saving(page, folder, organza)
            check_access(page)
            check_other_origin(context, page, address)
            assert not page.wrong, page.wrong
            assert not page.foreign, page.foreign
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
            page.until("the end is told", "() => /connection to organza is lost/.test(document.querySelector('#notices').innerText)")
            done("Ctrl-C ends it, and the page says so")
        for file in ["scenes/first_light.toml", "scenes/drafts/first_light.wif"]:
            with served(organza, ROOT / file) as (address, _):
                page = Page(context, address)
                page.until_full()
                page.tab.screenshot(path=shots / (Path(file).suffix[1:] + ".png"))
                assert not page.wrong and not page.foreign, (page.wrong, page.foreign)
                done(f"{file}: shown as {page.figure('Shown as')}, built in {page.figure('Built in')}")
        browser.close()


if __name__ == "__main__":
    main()
