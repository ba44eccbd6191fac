// SPDX-License-Identifier: BSD-3-Clause
// The page in a browser: node tests/page/run.mjs [PAGE.html …]
// With pages that the program wrote, only what any page must stand; without, everything, on made-up data.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { fileURLToPath } from "node:url";
import { resolve } from "node:path";
import { differing, inkShare, launch, open, picture, settled } from "./browser.mjs";
import * as made from "./synthetic.mjs";
import { hoverAnEdge, tour } from "./tour.mjs";

const kFolder = fileURLToPath(new URL(".", import.meta.url));
const kOut = `${kFolder}out`;
mkdirSync(kOut, { recursive: true });

let template = "";
function write(name, payload) {
  const file = `${kOut}/${name}.html`;
  writeFileSync(file, payload === null ? template : made.embed(template, payload));
  return file;
}

/** Pixels of the colour of the worst residual in the light theme, which nothing else has. */
function worstPixels({ pixels, channels }) {
  let n = 0;
  for (let i = 0; i < pixels.length; i += channels) {
    if (pixels[i] > 70 && pixels[i] < 125 && pixels[i + 1] < 60 && pixels[i + 2] < 65) ++n;
  }
  return n;
}

const tests = {
  async "every control works, on graphs in 2D and 3D and on a comparison"(browser) {
    const file = write("demo", made.report({ graphs: [made.manhattan().graph, made.sphere()], bench: made.bench(), notes: ["A note."] }));
    const { page, guard } = await open(browser, file);
    assert.equal(await page.title(), "demo – cairn");
    const used = await tour(page, guard);
    assert(used > 60, `only ${used} controls`);
    await page.getByLabel("Graph", { exact: true }).selectOption({ index: 1 });
    await page.getByRole("button", { name: "Show all (F)" }).click();
    await tour(page, guard);
    await guard.close();
  },

  async "every switch changes the picture, and back"(browser) {
    const { page, guard } = await open(browser, write("switches", made.report({ graphs: [made.manhattan(1200).graph] })));
    const before = await picture(page, `${kOut}/plan-light.png`);
    for (const name of [/ground truth/, /ceres/, /odometry/, /loop closure/, /landmark/, /prior/, /Poses as dots/, /Landmarks/, /Headings/, /Covariance ellipses/, /Grid and axes/]) {
      const box = page.getByRole("checkbox", { name });
      const was = await picture(page);
      await box.click();
      assert(differing(was, await picture(page)) > 0, `${name} changes the picture`);
      await box.click();
      assert.equal(differing(was, await picture(page)), 0, `${name} and back`);
    }
    await page.getByLabel("How much larger").selectOption({ label: "10 × larger" });
    assert(differing(before, await picture(page)) > 0.001, "larger ellipses");
    await guard.check();
    await guard.close();
  },

  async "a wrong loop closure stands out and is first in the list"(browser) {
    const { graph, wrong } = made.manhattan();
    const { page, guard } = await open(browser, write("wrong", made.report({ graphs: [graph] })));
    const before = await picture(page);
    await page.getByRole("radio", { name: "residual", exact: true }).check();
    const after = await picture(page, `${kOut}/residuals.png`);
    assert(differing(before, after) > 0.01);
    assert(worstPixels(after) > 500 && worstPixels(before) < 20, `${worstPixels(before)} → ${worstPixels(after)} pixels of the worst colour`);
    const first = page.locator(".worst").first();
    assert.equal(await first.getAttribute("data-edge"), String(wrong));
    await first.click();
    assert.match(await page.locator(".card").innerText(), /385 → 2905[\s\S]*loop closure[\s\S]*5230/);
    assert(differing(after, await picture(page, `${kOut}/worst.png`)) > 0.05, "flew there");
    await page.keyboard.press("Escape");
    await guard.check();
    await guard.close();
  },

  async "the slider steps through iterations and through time"(browser) {
    const { page, guard } = await open(browser, write("recording", made.report({ graphs: [made.manhattan(1200).graph] })));
    const result = await picture(page);
    const slider = page.getByLabel("Frame of the recording");
    await slider.focus();
    await page.keyboard.press("Home");
    const frames = [await picture(page)];
    assert.match(await page.locator(".frame-text").innerText(), /iteration 0 · start · χ² 6.40/);
    for (let k = 1; k < 4; ++k) {
      await page.keyboard.press("ArrowRight");
      frames.push(await picture(page));
      assert(differing(frames[k - 1], frames[k]) > 0.002, `frame ${k}`);
    }
    await page.keyboard.press("ArrowLeft");
    assert.equal(differing(frames[2], await picture(page)), 0, "and back");
    await page.getByRole("button", { name: "Play" }).click();
    await page.getByRole("button", { name: "Play" }).waitFor({ timeout: 60000 });  // played to the end
    assert.match(await page.locator(".frame-text").innerText(), /iteration 8/);
    await page.getByLabel("Recording", { exact: true }).nth(1).selectOption({ label: "incremental" });
    assert.match(await page.locator(".frame-text").innerText(), /0 s · 50 variables/);
    const early = await picture(page);
    assert(inkShare(early) < inkShare(result), "few have arrived");
    await page.getByRole("button", { name: "Back to the result" }).click();
    assert.equal(differing(result, await picture(page)), 0, "the result is as it was");
    await guard.check();
    await guard.close();
  },

  async "a run that goes on is followed, unless the slider was moved"(browser) {
    const whole = made.exploration();
    const lines = whole.lines.map((line) => `${JSON.stringify(line)}\n`);
    let there = 4;
    const html = made.embed(template, made.report({ explorations: [{ ...whole, lines: [], complete: false, live: "lines" }] }))
      .replace('Content-Security-Policy" content="', (start) => `${start}connect-src 'self'; `);
    const server = createServer((request, response) => {
      const from = new URL(request.url, "http://localhost").searchParams.get("from");
      if (from === null) return response.writeHead(200, { "Content-Type": "text/html" }).end(html);
      setTimeout(() => response.end(lines.slice(Number(from) - 1, there).join("")), 20);
    });
    await new Promise((done) => server.listen(0, "127.0.0.1", done));
    const { page, guard } = await open(browser, `http://127.0.0.1:${server.address().port}/`);
    const motions = (count) => lines.slice(0, count).filter((line) => line.includes('"step"') || line.includes('"end"')).length;
    const shows = (moment) => page.waitForFunction((k) => document.querySelector("canvas.floor").dataset.moment === String(k), moment, { timeout: 30000 });
    await shows(motions(4) - 1);
    there = 20;
    await shows(motions(20) - 1);
    assert.equal(await page.getByRole("slider").getAttribute("max"), String(motions(20) - 1));
    const before = await picture(page);
    await page.getByRole("button", { name: "One motion back" }).click();
    await shows(motions(20) - 2);
    there = 30;
    await page.waitForFunction((k) => document.querySelector("input[type=range]").max === String(k), motions(30) - 1, { timeout: 30000 });
    await shows(motions(20) - 2);
    await page.getByRole("tab", { name: "Curves" }).click();
    await page.getByRole("tab", { name: "Decisions" }).click();
    const rows = await page.locator(".decisions tbody tr").count();
    there = lines.length;
    await page.waitForSelector("html[data-ended]", { timeout: 30000, state: "attached" });
    assert(await page.locator(".decisions tbody tr").count() > rows, "decisions that were made since");
    await page.getByRole("tab", { name: "Exploration" }).click();
    await page.getByRole("slider").press("End");
    await shows(motions(lines.length) - 1);
    assert(differing(before, await picture(page)) > 0.01, "the end is another picture");
    await guard.check();
    await guard.close();
    server.close();
  },

  async "an exploration: every control works, and every switch and motion changes the picture"(browser) {
    const file = write("exploration", made.report({ explorations: [made.exploration(), { ...made.exploration(20, 40, 5), name: "other.jsonl" }] }));
    const { page, guard } = await open(browser, file);
    const used = await tour(page, guard);
    assert(used > 25, `only ${used} controls`);
    const slider = page.getByLabel("Motion of the run");
    await slider.focus();
    await page.keyboard.press("Home");
    await page.keyboard.press("End");  // where no candidate is marked
    const end = await picture(page, `${kOut}/exploration.png`);
    for (const [key, words] of [["Home", /^start · 0\.0 m/], ["ArrowRight", /^motion 1 ·/], ["End", /^end · 12\.6 m/]]) {
      await page.keyboard.press(key);
      assert.match(await page.locator(".frame-text").innerText(), words);
    }
    assert.equal(differing(end, await picture(page)), 0, "the end again");
    await page.getByRole("button", { name: "Decision before" }).click();
    assert.match(await page.locator(".panel").innerText(), /to the frontier of 56 m/);
    const then = await picture(page, `${kOut}/exploration-decision.png`);
    assert(differing(end, then) > 0.001, "another motion is another picture");
    for (const name of [/^Map/, /Scan/, /Graph/, /estimated/, /True/, /ellipse/, /Candidates/, /Tree/]) {
      const box = page.getByRole("checkbox", { name });
      await box.click();
      assert(differing(then, await picture(page)) > 0, `${name} changes the picture`);
      await box.click();
      assert.equal(differing(then, await picture(page)), 0, `${name} and back`);
    }
    await page.getByRole("button", { name: /^frontier 3/ }).click();
    assert(differing(then, await picture(page)) > 0, "a candidate is marked");
    const canvas = page.locator("canvas.floor");
    for (const key of ["ArrowLeft", "+", "-", "f", "["]) {
      const was = await picture(page);
      await canvas.focus();
      await page.keyboard.press(key);
      assert(differing(was, await picture(page)) > 0.001, `${key} changes the picture`);
    }
    await page.getByRole("tab", { name: "Decisions" }).click();
    await page.getByRole("row", { name: /to the frontier of 16 m/ }).click();
    assert.match(await page.locator(".frame-text").innerText(), /^motion 16 ·/);
    await page.getByLabel("Run of a robot").selectOption({ index: 1 });
    assert.match(await page.locator(".panel").innerText(), /motion|end/);
    await page.getByRole("button", { name: "Play" }).click();
    await page.waitForFunction(() => /^motion [2-9]/.test(document.querySelector(".frame-text").textContent));
    await guard.check();
    await guard.close();
  },

  async "ids are found, and what is under the pointer is named"(browser) {
    const { page, guard } = await open(browser, write("find", made.report({ graphs: [made.manhattan().graph] })));
    const find = async (text) => {
      await page.getByRole("searchbox").fill(text);
      await page.getByRole("button", { name: "Find" }).click();
    };
    await find("17");
    const card = page.locator(".card");
    assert.match(await card.innerText(), /^17[\s\S]*VERTEX_SE2[\s\S]*position[\s\S]*m/);
    await find("385 → 2905");
    assert.match(await card.innerText(), /EDGE_SE2/);
    await find("nobody");
    assert.match(await page.locator(".find").innerText(), /There is no variable “nobody”/);
    await page.getByRole("button", { name: "Show all (F)" }).click();
    const said = await hoverAnEdge(page);
    assert.match(said, /EDGE_SE2[\s\S]*class[\s\S]*length[\s\S]*distance measured/);
    await guard.check();
    await guard.close();
  },

  async "arrow keys go from estimate to estimate, and the panel from class to residual"(browser) {
    const { page, guard } = await open(browser, write("keys", made.report({ graphs: [made.sphere(20, 20)] })));
    const before = await picture(page);
    await page.getByRole("radio", { name: "Edges and residuals of block_cholesky" }).focus();
    await page.keyboard.press("ArrowDown");
    assert(await page.getByRole("radio", { name: "Edges and residuals of cholmod" }).isChecked());
    assert.match(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), /cholmod/);
    assert(differing(before, await picture(page)) > 0.001);
    await page.keyboard.press("ArrowUp");
    assert.equal(differing(before, await picture(page)), 0);
    await page.locator("canvas.graph").focus();
    for (const key of ["ArrowLeft", "Shift+ArrowUp", "+", "-", "f"]) {
      const was = await picture(page);
      await page.keyboard.press(key);
      assert(differing(was, await picture(page)) > 0.001, `${key} changes the picture`);
    }
    for (let k = 0; k < 10; ++k) await page.keyboard.press("[");
    assert.match(await page.locator(".frame-text").innerText(), /^iteration 1 ·/);
    const early = await picture(page);
    await page.keyboard.press("]");
    assert.match(await page.locator(".frame-text").innerText(), /^iteration 2 ·/);
    assert(differing(early, await picture(page)) > 0.001);
    await guard.check();
    await guard.close();
  },

  async "light and dark follow the system, and the button"(browser) {
    const file = write("dark", made.report({ graphs: [made.sphere(20, 20)], bench: made.bench() }));
    const { page, guard } = await open(browser, file, { colorScheme: "dark" });
    const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    assert.equal(await paper(), "rgb(20, 23, 27)");
    const dark = await picture(page, `${kOut}/space-dark.png`);
    assert.deepEqual([...dark.pixels.subarray(0, 3)], [20, 23, 27], "the canvas has the same paper");
    await page.getByRole("button", { name: "Light or dark" }).click();
    assert.equal(await paper(), "rgb(252, 252, 251)");
    assert(differing(dark, await picture(page, `${kOut}/space-light.png`)) > 0.9);
    await page.getByRole("tab", { name: "Comparison" }).click();
    await page.screenshot({ path: `${kOut}/comparison.png` });
    await guard.check();
    await guard.close();
  },

  async "text from files does no harm"(browser) {
    const evil = `</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2"><!--<b>&amp;"'\u2028`;
    const { graph } = made.manhattan(300);
    const bench = made.bench();
    Object.assign(graph, { name: evil, comment: evil });
    graph.variables.ids = Array.from({ length: graph.variables.count }, (_, i) => `${evil}${i}`);
    graph.variables.types[0].name = graph.edges.types[0].name = graph.edges.columns[0].name = graph.edges.columns[0].unit = evil;
    for (const estimate of graph.estimates) estimate.name = estimate.file = evil;
    for (const run of graph.runs) Object.assign(run, { name: evil, status: evil, notes: [evil] });
    for (const recording of graph.recordings) {
      recording.name = evil;
      for (const frame of recording.frames) frame.label = evil;
    }
    bench.graphs[0].graph.file = evil;
    Object.assign(bench.graphs[0].configurations[0], { optimizer: evil, linear_solver: evil, error: evil, notes: [evil] });
    Object.assign(bench.machine, { cpu: evil });
    const explored = made.exploration(9, 20);
    Object.assign(explored, { name: evil, header: { floor: evil, parts: { [evil]: evil } } });
    for (const line of explored.lines) {
      if (line.why) Object.assign(line, { why: evil, notes: [evil], kind: line.kind ? evil : undefined });
      for (const candidate of line.candidates ?? []) candidate.what = evil;
    }
    const file = write("hostile", made.report({ graphs: [graph], explorations: [explored], bench, title: evil, command: evil, notes: [evil] }));
    const { page, guard } = await open(browser, file);
    await tour(page, guard);
    assert.equal(await page.evaluate(() => window.hacked), undefined);
    assert.equal(await page.locator("script").count(), 2, "the page's own script and its data");
    assert.equal(await page.locator("img, iframe, object, embed, #app b").count(), 0);
    assert((await page.title()).startsWith("</script><script>window.hacked = 1</script>"), "the title is the text");
    await guard.close();
  },

  async "a script that is not the page's own does not run"(browser) {
    const file = `${kOut}/policy.html`;
    writeFileSync(file, made.embed(template, made.report({ graphs: [made.sphere(4, 5)] })).replace("</body>", "<script>window.hacked = 1</script></body>"));
    const { page, guard } = await open(browser, file);
    assert.equal(await page.evaluate(() => window.hacked), undefined);
    assert.equal((await page.evaluate(() => window.violations)).length, 1);
    await guard.close();
  },

  async "what cannot be shown is said"(browser) {
    const bad = made.report({ graphs: [made.sphere(4, 5)] });
    bad.graphs[0].estimates[1].positions.count = 3;
    for (const [payload, words] of [
      [null, /holds no data/],
      [made.report({ version: 7, graphs: [] }), /version 7/],
      [made.report({ graphs: [] }), /neither a graph nor a comparison/],
      [bad, /graph 1, estimate 2, positions/],
    ]) {
      const { page, guard } = await open(browser, write("bad", payload));
      assert.match(await page.getByRole("alert").innerText(), words);
      await guard.check();
      await guard.close();
    }
  },

  async "a phone's screen holds it"(browser) {
    const file = write("narrow", made.report({ graphs: [made.sphere(20, 20)], explorations: [made.exploration(12)], bench: made.bench() }));
    const { page, guard } = await open(browser, file, { viewport: { width: 390, height: 780 } });
    await settled(page);
    for (const tab of await page.getByRole("tab").all()) {
      await tab.click();
      assert(await page.evaluate(() => document.documentElement.scrollWidth <= 390), `${await tab.textContent()} is no wider than the screen`);
    }
    await guard.check();
    await guard.close();
  },

  /** Prints figures and asserts none of them but the size. */
  async "100,000 poses and 300,000 edges"(browser) {
    const file = write("large", made.report({ graphs: [made.large(100000, 3, 12)] }));
    const megabytes = statSync(file).size / 1e6;
    assert(megabytes < 30, `${megabytes} MB`);
    const start = Date.now();
    const { page, guard } = await open(browser, file);
    const ready = Date.now() - start;
    await settled(page);
    const drawn = Date.now() - start;
    assert(inkShare(await picture(page, `${kOut}/large.png`)) > 0.1);
    const orbit = async () => page.evaluate(orbitFor, 4000);
    await orbit();
    const { fps, p95 } = await orbit();
    await settled(page);
    const pointing = await page.evaluate(pointFor, 30);
    console.log(`    page ${megabytes.toFixed(1)} MB with 12 recorded frames; read in ${ready} ms, all drawn after ${drawn} ms; orbiting ${fps.toFixed(1)} frames a second, ` +
      `95 % within ${p95.toFixed(0)} ms; pointing ${pointing.toFixed(1)} ms; drawn by ${await rendererOf(page)}`);
    await page.getByRole("radio", { name: "residual", exact: true }).check();
    await page.mouse.move(2, 2);
    assert(worstPixels(await picture(page, `${kOut}/large-residuals.png`)) > 25, "one wrong edge of 300,000 is seen");
    await page.getByLabel("Frame of the recording").focus();
    await page.keyboard.press("Home");
    assert(inkShare(await picture(page)) > 0.1);
    await guard.check();
    await guard.close();
  },
};

/** In the page: drags round and round; frames drawn a second. */
async function orbitFor(milliseconds) {
  const canvas = document.querySelector("canvas.graph");
  const box = canvas.getBoundingClientRect();
  canvas.setPointerCapture = () => {};
  const fire = (type, x, y) => canvas.dispatchEvent(new PointerEvent(type, {
    pointerId: 1, clientX: box.left + x, clientY: box.top + y, button: 0, buttons: 1, bubbles: true,
  }));
  fire("pointerdown", 300, 300);
  const start = performance.now(), drawsBefore = Number(canvas.dataset.draws);
  const intervals = [];
  let last = start, n = 0;
  await new Promise((done) => {
    const tick = (now) => {
      intervals.push(now - last);
      last = now;
      fire("pointermove", 300 + 3 * n++, 300 + 50 * Math.sin(n / 20));
      if (now - start > milliseconds) done();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  });
  const seconds = (performance.now() - start) / 1000;
  const draws = Number(canvas.dataset.draws) - drawsBefore;
  fire("pointerup", 300, 300);
  intervals.sort((a, b) => a - b);
  return { fps: draws / seconds, p95: intervals[Math.floor(0.95 * intervals.length)] };
}

/** In the page: what finding what is under the pointer costs [ms], the median of `times`. */
async function pointFor(times) {
  const canvas = document.querySelector("canvas.graph");
  const box = canvas.getBoundingClientRect();
  const took = [];
  const request = window.requestAnimationFrame;
  for (let k = 0; k < times; ++k) {
    let run = null;
    window.requestAnimationFrame = (f) => ((run = f), 1);
    canvas.dispatchEvent(new PointerEvent("pointermove", { pointerId: 1, clientX: box.left + 400 + 5 * k, clientY: box.top + 420, bubbles: true }));
    window.requestAnimationFrame = request;
    const start = performance.now();
    if (!run) throw new Error("pointing asked for no frame");
    run(start);
    took.push(performance.now() - start);
  }
  return took.sort((a, b) => a - b)[times >> 1];
}

async function rendererOf(page) {
  return page.evaluate(() => [...document.querySelectorAll("dt")].find((dt) => dt.textContent === "drawn by")?.nextElementSibling?.textContent ?? "");
}

const pages = process.argv.slice(2).filter((argument) => !argument.startsWith("-"));
const only = process.argv.find((argument) => argument.startsWith("--only="))?.slice(7);
const browser = await launch();
let failed = 0;
async function attempt(name, test) {
  try {
    await test();
    console.log(`ok   ${name}`);
  } catch (error) {
    ++failed;
    console.log(`FAIL ${name}\n${error.stack}`);
  }
}
if (pages.length > 0) {
  for (const name of pages) {
    await attempt(name, async () => {
      const { page, guard } = await open(browser, resolve(name));
      assert.equal(await page.getByRole("alert").count(), 0, "the page can be shown");
      await tour(page, guard);
      await guard.close();
    });
  }
} else {
  template = readFileSync(`${kFolder}../../dist/report.html`, "utf8");
  for (const [name, test] of Object.entries(tests)) if (!only || name.includes(only)) await attempt(name, () => test(browser));
}
await browser.close();
process.exitCode = failed > 0 ? 1 : 0;
