// SPDX-License-Identifier: BSD-3-Clause
// Elements without markup: text from files only ever becomes text.

type Child = Node | string | null | undefined | false;
type Attributes = Record<string, string | number | boolean | null | undefined | ((event: Event) => void)>;

/** Attributes by name; `onclick` and the like are listeners; false, null: left out; true: present. */
function apply(element: Element, attributes: Attributes, children: Child[]): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, String(value));
  }
  for (const child of children) if (child) element.append(child);
}

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  apply(element, attributes, children);
  return element;
}

export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]
): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  apply(element, attributes, children);
  return element;
}

let serial = 0;
export function freshId(what: string): string {
  return `${what}-${++serial}`;
}

export function checkbox(checked: boolean, changed: (on: boolean) => void, attributes: Attributes = {}): HTMLInputElement {
  const box = el("input", { type: "checkbox", ...attributes });
  box.checked = checked;
  box.addEventListener("change", () => changed(box.checked));
  return box;
}

export function choice<T extends string | number>(
  label: string, options: [T, string][], value: T, changed: (value: T) => void,
): HTMLSelectElement {
  const select = el("select", { "aria-label": label }, ...options.map(([v, text]) => el("option", { value: v }, text)));
  select.value = String(value);
  select.addEventListener("change", () => changed(options[select.selectedIndex][0]));
  return select;
}

/** Radio buttons that look like one control. */
export function segments<T extends string>(
  label: string, options: [T, string][], value: T, changed: (value: T) => void,
): HTMLElement {
  const name = freshId("segments");
  return el("div", { class: "segments", role: "radiogroup", "aria-label": label },
    ...options.map(([v, text]) => {
      const input = el("input", { type: "radio", name, value: v });
      input.checked = v === value;
      input.addEventListener("change", () => input.checked && changed(v));
      return el("label", {}, input, el("span", {}, text));
    }));
}

const kIcons: Record<string, string> = {
  play: "M5 3.5v9l7.5-4.5z",
  pause: "M4.5 3.5h2.6v9H4.5zM8.9 3.5h2.6v9H8.9z",
  close: "M4 4l8 8M12 4l-8 8",
  fit: "M2.5 6V2.5H6M10 2.5h3.5V6M13.5 10v3.5H10M6 13.5H2.5V10",
  plus: "M8 3v10M3 8h10",
  minus: "M3 8h10",
  back: "M10 3.5L5 8l5 4.5",
  forward: "M6 3.5L11 8l-5 4.5",
  moon: "M12.8 9.6A5.3 5.3 0 0 1 6.4 3.2a5.3 5.3 0 1 0 6.4 6.4z",
  picture: "M2.5 3.5h11v9h-11zM2.5 11l3-3.2 2.4 2.3 2.3-2.6 3.3 3.6",
  panel: "M2.5 3h11v10h-11zM9.8 3v10",
};
const kFilled = new Set(["play", "pause"]);

export function icon(name: keyof typeof kIcons): SVGSVGElement {
  return svg("svg", { viewBox: "0 0 16 16", class: kFilled.has(name) ? "icon filled" : "icon", "aria-hidden": "true" },
    svg("path", { d: kIcons[name] }));
}

export function iconButton(name: string, label: string, clicked: () => void, attributes: Attributes = {}): HTMLButtonElement {
  return el("button", { type: "button", class: "icon-button", title: label, "aria-label": label, onclick: clicked, ...attributes }, icon(name));
}
