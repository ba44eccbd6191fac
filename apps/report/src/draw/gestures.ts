// SPDX-License-Identifier: BSD-3-Clause
// Pointer, wheel, fingers and keys on the canvas.
import type { Stage } from "./stage";

export interface GestureActions {
  hover(x: number, y: number, inside: boolean): void;
  click(x: number, y: number): void;
}

const kClick = 4;  // a pointer that moved less has clicked [px]

export function listen(stage: Stage, actions: GestureActions): void {
  const { canvas } = stage;
  const pointers = new Map<number, { x: number; y: number }>();
  let travelled = 0;
  let panning = false;
  const local = (event: PointerEvent | WheelEvent) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, local(event));
    travelled = 0;
    panning = event.button !== 0 || event.shiftKey || event.ctrlKey || stage.control.plan;
    canvas.classList.add("dragging");
  });

  canvas.addEventListener("pointermove", (event) => {
    const at = local(event);
    const before = pointers.get(event.pointerId);
    if (!before) return actions.hover(at.x, at.y, true);
    const dx = at.x - before.x, dy = at.y - before.y;
    travelled += Math.hypot(dx, dy);
    if (travelled < kClick) return;
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
      const was = Math.hypot(before.x - other.x, before.y - other.y);
      const is = Math.hypot(at.x - other.x, at.y - other.y);
      if (was > 0 && is > 0) stage.control.zoom(was / is, (at.x + other.x) / 2, (at.y + other.y) / 2);
      stage.control.pan(dx / 2, dy / 2);
    } else if (panning) {
      stage.control.pan(dx, dy);
    } else {
      stage.control.orbit(dx, dy);
    }
    pointers.set(event.pointerId, at);
    actions.hover(at.x, at.y, false);
    stage.moved();
  });

  const end = (event: PointerEvent) => {
    if (!pointers.delete(event.pointerId)) return;
    canvas.classList.remove("dragging");
    if (event.type === "pointerup" && travelled < kClick) actions.click(local(event).x, local(event).y);
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => actions.hover(0, 0, false));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());

  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 100 : 1;
    const { x, y } = local(event);
    stage.control.zoom(Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY * lines * 0.0015))), x, y);
    stage.moved();
  }, { passive: false });

  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = 40;
    const arrows: Record<string, [number, number]> = {
      ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step],
    };
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) stage.control.pan(...arrow);
    else if (arrow) stage.control.orbit(arrow[0] * (stage.control.plan ? 1 : 0.4), arrow[1] * (stage.control.plan ? 1 : 0.4));
    else if (event.key === "+" || event.key === "=") stage.control.zoom(1 / 1.2);
    else if (event.key === "-") stage.control.zoom(1.2);
    else return;
    event.preventDefault();
    stage.moved();
  });
}
