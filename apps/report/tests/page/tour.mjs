// SPDX-License-Identifier: BSD-3-Clause
// What any page must stand, whatever is in it: every control is used, the slider moved, an edge pointed at.
import assert from "node:assert/strict";
import { differing, inkShare, picture, settled } from "./browser.mjs";

const kControls = "button, input, select, [tabindex='0']";

/** Visible, enabled controls with a name for each that outlives its being built anew. */
async function visibleControls(page, within) {
  const seen = new Map();
  const all = [];
  for (const control of await page.locator(within).locator(kControls).elementHandles()) {
    const what = await control.evaluate((e) => ({
      usable: e.checkVisibility() && !e.disabled, tag: e.tagName, type: e.getAttribute("type") ?? "", role: e.getAttribute("role") ?? "",
      label: e.getAttribute("aria-label") || e.title || e.closest("label")?.textContent || e.textContent || "",
      options: e.tagName === "SELECT" ? e.options.length : 0, index: e.tagName === "SELECT" ? e.selectedIndex : 0,
    }));
    if (!what.usable) continue;
    const name = [what.tag, what.type, what.label].join("|");
    seen.set(name, (seen.get(name) ?? 0) + 1);
    all.push({ ...what, name: `${name}|${seen.get(name)}`, control });
  }
  return all;
}

async function use(page, what) {
  const { control } = what;
  if (what.tag === "SELECT") {
    for (let k = 0; k < what.options; ++k) await control.selectOption({ index: k });
    await control.selectOption({ index: what.index });
  } else if (what.type === "checkbox") {
    await control.click();
    await control.click();
  } else if (what.type === "radio") {
    await control.click();  // not check(), which looks at it again: it may have been built anew
  } else if (what.type === "range") {
    await control.focus();
    for (const key of ["Home", "ArrowRight", "PageDown", "ArrowRight", "End"]) await page.keyboard.press(key);
  } else if (what.type === "search") {
    for (const text of ["0", "no such id", "0 1", ""]) {
      await control.fill(text);
      await control.press("Enter");
    }
  } else if (what.label.startsWith("Save the picture")) {
    const [download] = await Promise.all([page.waitForEvent("download"), control.click()]);
    assert.match(download.suggestedFilename(), /^[\w.-]+\.png$/);
    await download.delete();
  } else if (what.label === "Legend and switches") {
    await control.click();
    await control.click();
  } else if (what.tag === "BUTTON" && what.role !== "tab") {
    await control.click();
  }
}

export async function useEveryControl(page) {
  let count = 0;
  for (const tab of await page.getByRole("tab").all()) {
    await tab.click();
    const used = new Set();
    for (;;) {
      // Asked for each time, since using a control may build others anew.
      const next = (await visibleControls(page, "[role=tabpanel]:not([hidden])")).find((what) => !used.has(what.name));
      if (!next) break;
      used.add(next.name);
      await use(page, next);
    }
    count += used.size;
    await settled(page);
  }
  await page.getByRole("tab").first().click();
  return count;
}

/** Pressing Tab reaches every control that is to be seen. In a group of radio buttons it reaches one, and arrows the others. */
export async function reachByKeyboard(page) {
  for (const tab of await page.getByRole("tab").all()) {
    await tab.click();
    const expected = await page.evaluate((selector) => {
      document.activeElement?.blur();
      const groups = new Set();
      return [...document.querySelectorAll(selector)].filter((e) => {
        if (!e.checkVisibility() || e.disabled || e.tabIndex < 0) return false;
        if (e.type !== "radio") return true;
        if (groups.has(e.name)) return false;
        groups.add(e.name);
        return true;
      }).length;
    }, kControls);
    const reached = new Set();
    for (let k = 0; k < expected + 40; ++k) {
      await page.keyboard.press("Tab");
      reached.add(await page.evaluate(() => {
        const e = document.activeElement;
        if (!e || e === document.body) return "";
        window.marked ??= 0;
        e.dataset.reached ??= String(++window.marked);
        const name = e.getAttribute("aria-label") || e.title || e.textContent || e.closest("label")?.textContent || "";
        return name.trim() === "" ? `unnamed ${e.outerHTML.slice(0, 120)}` : e.dataset.reached;
      }));
    }
    reached.delete("");
    const unnamed = [...reached].filter((r) => r.startsWith("unnamed"));
    assert.deepEqual(unnamed, [], "every control has a name");
    assert(reached.size >= expected, `${await tab.textContent()}: Tab reached ${reached.size} of ${expected} controls`);
    await page.evaluate(() => document.querySelectorAll("[data-reached]").forEach((e) => delete e.dataset.reached));
  }
  await page.getByRole("tab").first().click();
}

/** Moves the pointer over the map until it is on an edge; what is then said. */
export async function hoverAnEdge(page) {
  await settled(page);
  const box = await page.locator("canvas.graph").boundingBox();
  for (let k = 0; k < 1500; ++k) {
    // A spiral from the middle.
    const r = 2 + 0.24 * k, angle = 0.61 * k;
    const x = box.x + box.width / 2 + r * Math.cos(angle), y = box.y + box.height / 2 + 0.8 * r * Math.sin(angle);
    await page.mouse.move(x, y);
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    const hovered = await page.locator("canvas.graph").getAttribute("data-hovered");
    if (hovered?.startsWith("edge")) return page.locator(".tooltip").innerText();
  }
  throw new Error("no edge was found under the pointer");
}

export async function tour(page, guard) {
  const hasMap = (await page.locator("canvas.graph").count()) > 0;
  await page.getByRole("tab").first().click();
  if (hasMap) {
    const first = await picture(page);
    assert(inkShare(first) > 0.005, "the picture is not blank");
    const said = await hoverAnEdge(page);
    assert.match(said, /class/);
    assert(differing(first, await picture(page)) > 0, "the edge under the pointer is marked");
    await page.mouse.move(2, 2);
  }
  if ((await page.locator("canvas.floor:visible").count()) > 0) assert(inkShare(await picture(page)) > 0.005, "the map is not blank");
  const used = await useEveryControl(page);
  await reachByKeyboard(page);
  await guard.check();
  return used;
}
