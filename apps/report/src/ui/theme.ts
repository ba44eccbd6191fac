// SPDX-License-Identifier: BSD-3-Clause
import type { Theme } from "../draw/colour";

const kDark = window.matchMedia("(prefers-color-scheme: dark)");
const kListeners = new Set<(theme: Theme) => void>();
let chosen: Theme | null = null;

/** What the reader chose, else what the system prefers. */
export function theme(): Theme {
  return chosen ?? (kDark.matches ? "dark" : "light");
}

function tell(): void {
  document.documentElement.dataset.theme = theme();
  for (const listener of kListeners) listener(theme());
}

export function toggleTheme(): void {
  chosen = theme() === "dark" ? "light" : "dark";
  tell();
}

export function onTheme(listener: (theme: Theme) => void): void {
  kListeners.add(listener);
}

kDark.addEventListener("change", tell);
document.documentElement.dataset.theme = theme();
