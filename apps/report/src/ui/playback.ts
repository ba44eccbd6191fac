// SPDX-License-Identifier: BSD-3-Clause
// The slider through a recording.
import type { Graph } from "../data/graph";
import type { Frame, Recording } from "../data/recording";
import type { ViewState } from "../draw/state";
import { choice, el, icon, iconButton, svg } from "./dom";
import { count, number, seconds } from "./format";

const kSpeeds: [number, string][] = [[0.5, "½ ×"], [1, "1 ×"], [2, "2 ×"], [8, "8 ×"], [32, "32 ×"]];
const kFramesASecond = 2.5;

export class Playback {
  readonly element = el("div", { class: "playback", role: "group", "aria-label": "Recording" });
  private recording: Recording | null = null;
  private state: ViewState | null = null;
  private playing = false;
  private last = 0;
  private speed = 1;
  private readonly slider = el("input", { type: "range", min: 0, step: "any", "aria-label": "Frame of the recording" });
  private readonly text = el("output", { class: "frame-text" });
  private readonly playButton = iconButton("play", "Play", () => this.toggle(), { class: "icon-button prominent" });
  private readonly close = iconButton("close", "Back to the result", () => this.leave());
  private readonly curve = svg("svg", { class: "curve", preserveAspectRatio: "none", "aria-hidden": "true" });

  constructor(private readonly changed: (moving: boolean) => void) {
    this.slider.addEventListener("input", () => {
      this.playing = false;
      this.go(Math.round(Number(this.slider.value)));
    });
    this.slider.addEventListener("keydown", (event) => {
      const by: Record<string, number> = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 };
      if (!(event.key in by)) return;
      event.preventDefault();
      this.step(by[event.key]);
    });
  }

  build(graph: Graph, state: ViewState): void {
    this.playing = false;
    this.state = state;
    this.recording = graph.recordings[0] ?? null;
    this.element.hidden = this.recording === null;
    if (!this.recording) return;
    const names = graph.recordings.map((r, k) => [k, r.name] as [number, string]);
    const which = names.length > 1 ? choice("Recording", names, 0, (k) => {
      this.recording = graph.recordings[k];
      this.chosen = k;
      this.outline();
      this.go(0);
    }) : el("span", { class: "recording-name" }, names[0][1]);
    this.chosen = 0;
    this.element.replaceChildren(
      this.playButton,
      iconButton("back", "One frame back", () => this.step(-1)),
      iconButton("forward", "One frame on", () => this.step(1)),
      el("div", { class: "track" }, this.curve, this.slider),
      this.text,
      choice("Speed", kSpeeds, this.speed, (speed) => (this.speed = speed)),
      which, this.close);
    this.outline();
    this.refresh();
  }
  private chosen = 0;

  /** chi2 of the frames as a line behind the slider, logarithmic. */
  private outline(): void {
    const { frames } = this.recording!;
    this.slider.max = String(frames.length - 1);
    this.slider.value = String(frames.length - 1);
    const logs = frames.map((f) => (f.chi2 !== null && f.chi2 > 0 ? Math.log(f.chi2) : NaN));
    const known = logs.filter(Number.isFinite);
    const [low, high] = [Math.min(...known), Math.max(...known)];
    this.curve.setAttribute("viewBox", `0 0 ${Math.max(1, frames.length - 1)} 1`);
    this.curve.replaceChildren();
    if (known.length < 2 || !(high > low)) return;
    const d = logs.map((v, k) => (Number.isFinite(v) ? `${k} ${(0.95 - (0.9 * (v - low)) / (high - low)).toFixed(4)}` : ""))
      .filter(Boolean).join("L");
    this.curve.append(svg("path", { d: `M${d}`, "vector-effect": "non-scaling-stroke" }));
  }

  private frameText(frame: Frame): string {
    const parts: string[] = [];
    if (frame.iteration !== null) parts.push(`iteration ${count(frame.iteration)}`);
    if (frame.time !== null && this.recording!.kind === "time") parts.push(seconds(frame.time));
    if (frame.label && !parts.includes(frame.label)) parts.push(frame.label);
    if (this.recording!.kind === "time") parts.push(`${count(frame.variables)} variables, ${count(frame.edges)} edges`);
    if (frame.chi2 !== null) parts.push(`χ² ${number(frame.chi2, 5)}`);
    if (frame.seconds !== null) parts.push(`took ${seconds(frame.seconds)}`);
    return parts.join(" · ");
  }

  /** Shows what is, after the state was changed elsewhere. */
  refresh(): void {
    const { recording, state } = this;
    if (!recording || !state) return;
    const active = state.recording >= 0;
    if (!active) this.playing = false;
    this.close.disabled = !active;
    this.element.classList.toggle("active", active);
    const frame = recording.frames[active ? Math.round(state.frame) : recording.frames.length - 1];
    if (active) this.slider.value = String(state.frame);
    this.text.textContent = active ? this.frameText(frame) : `${count(recording.frames.length)} frames recorded`;
    this.slider.setAttribute("aria-valuetext", this.text.textContent);
    this.playButton.replaceChildren(icon(this.playing ? "pause" : "play"));
    this.playButton.title = this.playing ? "Pause" : "Play";
    this.playButton.setAttribute("aria-label", this.playButton.title);
  }

  private go(frame: number): void {
    const { recording, state } = this;
    if (!recording || !state) return;
    state.recording = this.chosen;
    state.frame = Math.max(0, Math.min(recording.frames.length - 1, frame));
    this.refresh();
    this.changed(true);
  }

  step(by: number): void {
    if (!this.recording || !this.state) return;
    this.playing = false;
    const at = this.state.recording >= 0 ? this.state.frame : this.recording.frames.length - 1;
    this.go(by > 0 ? Math.floor(at + 1e-6) + by : Math.ceil(at - 1e-6) + by);
  }

  toggle(): void {
    const { recording, state } = this;
    if (!recording || !state) return;
    this.playing = !this.playing;
    if (this.playing) {
      if (state.recording < 0 || state.frame >= recording.frames.length - 1) this.go(0);
      this.last = performance.now();
      requestAnimationFrame((now) => this.advance(now));
    } else {
      this.go(Math.round(state.frame));
    }
    this.refresh();
  }

  private advance(now: number): void {
    if (!this.playing || !this.state || !this.recording) return;
    const step = (Math.max(0, now - this.last) / 1000) * kFramesASecond * this.speed;
    this.last = now;
    const end = this.recording.frames.length - 1;
    // An online run grows by jumps; only iterations glide.
    const next = Math.min(end, this.state.frame + step);
    if (next >= end) this.playing = false;
    this.go(next);
    if (this.playing) requestAnimationFrame((later) => this.advance(later));
  }

  private leave(): void {
    if (!this.state) return;
    this.playing = false;
    this.state.recording = -1;
    this.slider.value = this.slider.max;
    this.refresh();
    this.changed(false);
  }
}
