// SPDX-License-Identifier: BSD-3-Clause
// Headless Chromium as Debian has it, drawing in software, and what it must not do.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { inflateSync } from "node:zlib";
import { chromium } from "playwright-core";

const kExecutable = process.env.CHROMIUM ?? "/usr/bin/chromium";

export async function launch() {
  assert(existsSync(kExecutable), `no ${kExecutable}: install Debian's chromium, or set CHROMIUM`);
  return chromium.launch({
    executablePath: kExecutable,
    args: [
      "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
      "--disable-background-networking", "--disable-component-update", "--disable-sync",
    ],
  });
}

/** Opens a file, or what a server has, and watches over it: only that server may be asked. `guard.check()` asserts that nothing went wrong up to then. */
export async function open(browser, file, options = {}) {
  const served = file.startsWith("http://127.0.0.1");
  const context = await browser.newContext({ viewport: { width: 1360, height: 860 }, acceptDownloads: true, reducedMotion: "reduce", ...options });
  const page = await context.newPage();
  const wrong = [];
  page.on("console", (message) => message.type() === "error" && wrong.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => wrong.push(`error: ${error.stack}`));
  page.on("dialog", (dialog) => {
    wrong.push(`dialog: ${dialog.message()}`);
    void dialog.dismiss();
  });
  page.on("request", (request) => {
    if (!/^(file|blob|data):/.test(request.url()) && !request.url().startsWith(served ? file : "file:")) wrong.push(`request: ${request.url()}`);
  });
  page.on("websocket", (socket) => wrong.push(`socket: ${socket.url()}`));
  await page.addInitScript(() => {
    window.violations = [];
    document.addEventListener("securitypolicyviolation", (e) => window.violations.push(`${e.violatedDirective} ${e.blockedURI}`));
  });
  await page.goto(served ? file : `file://${file}`);
  await page.waitForSelector("html[data-ready], [role=alert]", { timeout: 120000 });
  const guard = {
    async check() {
      assert.deepEqual(wrong, []);
      assert.deepEqual(await page.evaluate(() => window.violations), [], "content security policy");
    },
    close: () => context.close(),
  };
  return { page, guard };
}

/** Waits until everything is drawn, and nothing more is to come. */
export async function settled(page) {
  await page.evaluate(() => (window.lastDraws = undefined));  // two looks, whatever an earlier wait saw
  await page.waitForFunction(() => {
    const canvas = document.querySelector("canvas.graph");
    if (!canvas || canvas.closest("[hidden]")) return true;
    const before = window.lastDraws;
    window.lastDraws = canvas.dataset.draws;
    return canvas.dataset.still === "true" && before === canvas.dataset.draws;
  }, null, { polling: 220, timeout: 60000 });
}

/** Waits until the map of an exploration is drawn: it is at the next frame. */
async function drawn(page) {
  if ((await page.locator("canvas.floor:visible").count()) === 0) return;
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}

/** The pixels of a PNG of 8 bits a channel, as Chromium writes them. */
export function decodePng(png) {
  let at = 8, width = 0, height = 0, channels = 3;
  const parts = [];
  while (at < png.length) {
    const length = png.readUInt32BE(at);
    const type = png.toString("latin1", at + 4, at + 8);
    const data = png.subarray(at + 8, at + 8 + length);
    if (type === "IHDR") {
      width = data.readUInt32BE(0);
      height = data.readUInt32BE(4);
      channels = data[9] === 6 ? 4 : 3;
      assert.equal(data[8], 8);
    }
    if (type === "IDAT") parts.push(data);
    at += length + 12;
  }
  const raw = inflateSync(Buffer.concat(parts));
  const stride = width * channels;
  const pixels = Buffer.alloc(stride * height);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (stride + 1)];
    for (let x = 0; x < stride; ++x) {
      const left = x >= channels ? pixels[y * stride + x - channels] : 0;
      const up = y > 0 ? pixels[(y - 1) * stride + x] : 0;
      const corner = x >= channels && y > 0 ? pixels[(y - 1) * stride + x - channels] : 0;
      const p = left + up - corner;
      const [pl, pu, pc] = [Math.abs(p - left), Math.abs(p - up), Math.abs(p - corner)];
      const paeth = pl <= pu && pl <= pc ? left : pu <= pc ? up : corner;
      const guess = [0, left, up, (left + up) >> 1, paeth][filter];
      pixels[y * stride + x] = (raw[y * (stride + 1) + 1 + x] + guess) & 255;
    }
  }
  return { width, height, channels, pixels };
}

/** A screenshot of the map's canvas with what lies over it, decoded. */
export async function picture(page, file) {
  await settled(page);
  await drawn(page);
  return decodePng(await page.locator(".canvas-host:visible").screenshot(file ? { path: file } : {}));
}

/** Share of pixels that are not the most frequent colour. */
export function inkShare({ pixels, channels }) {
  const counts = new Map();
  for (let i = 0; i < pixels.length; i += channels) {
    const colour = (pixels[i] << 16) | (pixels[i + 1] << 8) | pixels[i + 2];
    counts.set(colour, (counts.get(colour) ?? 0) + 1);
  }
  return 1 - Math.max(...counts.values()) / (pixels.length / channels);
}

/** Share of pixels that differ between two pictures. */
export function differing(a, b) {
  assert.equal(a.pixels.length, b.pixels.length);
  let n = 0;
  for (let i = 0; i < a.pixels.length; i += a.channels) {
    const d = Math.abs(a.pixels[i] - b.pixels[i]) + Math.abs(a.pixels[i + 1] - b.pixels[i + 1]) + Math.abs(a.pixels[i + 2] - b.pixels[i + 2]);
    if (d > 24) ++n;
  }
  return n / (a.pixels.length / a.channels);
}
