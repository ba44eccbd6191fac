// SPDX-License-Identifier: BSD-3-Clause
import { el } from "./dom";

export interface TableColumn {
  title: string;
  /** Said when pointed at. */
  about?: string;
  left?: boolean;
}

export type Cell = string | { text: string; class?: string; about?: string };

export function table(caption: string, columns: TableColumn[], rows: Cell[][], head = 1): HTMLElement {
  const cell = (content: Cell, k: number) => {
    const { text, class: kind, about } = typeof content === "string" ? { text: content, class: undefined, about: undefined } : content;
    const classes = [columns[k].left ? "left" : "", kind ?? ""].filter(Boolean).join(" ") || null;
    return k < head ? el("th", { scope: "row", class: classes, title: about }, text) : el("td", { class: classes, title: about }, text);
  };
  return el("div", { class: "table-scroll", tabindex: 0, role: "region", "aria-label": caption },
    el("table", {},
      el("caption", {}, caption),
      el("thead", {}, el("tr", {}, ...columns.map((column) =>
        el("th", { scope: "col", class: column.left ? "left" : null, title: column.about }, column.title)))),
      el("tbody", {}, ...rows.map((row) => el("tr", {}, ...row.map(cell))))));
}
