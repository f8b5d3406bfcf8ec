// A replayed recording: its time line with contacts, trips and markers, pause, speed, and seek.
import { replayControl, type Outgoing } from "../wire";
import type { ReplayState } from "../state_types";
import { byId, el, setText } from "./dom";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
/** A position that the user chose is shown until the server reports it. */
const SETTLE_MS = 1000;

export class ReplayBar {
  private readonly bar = byId("replay");
  private readonly pause = el("button", { type: "button" });
  private readonly time = el("output", { ariaLive: "off" });
  private readonly slider = el("input", { type: "range", min: "0", step: "0.01", ariaLabel: "Position in the recording, seconds" });
  private readonly marks = el("canvas", { height: 16 });
  private readonly speed = el("select", { ariaLabel: "Speed of the replay" });
  private state: ReplayState | undefined;
  private chosenUntil_ms = 0;
  private drawn = "";

  constructor(private readonly send: (...messages: Outgoing[]) => void) {
    this.marks.setAttribute("aria-hidden", "true");
    this.pause.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek());
    this.speed.addEventListener("change", () =>
      this.send(replayControl(this.state?.paused ?? false, Number(this.speed.value))),
    );
    const track = el("div", { className: "track" }, this.marks, this.slider);
    this.bar.append(el("strong", { className: "badge" }, "REPLAY"), this.pause, track, this.time, this.speed);
  }

  update(state: ReplayState | null): void {
    this.state = state ?? undefined;
    this.bar.hidden = !state;
    document.body.classList.toggle("replay", state !== null);
    if (!state) return;
    this.bar.title = state.file;
    setText(this.pause, state.ended ? "Again" : state.paused ? "Play" : "Pause");
    const end = state.duration_s ?? Math.max(state.position_s, 1);
    this.slider.max = String(end);
    if (performance.now() > this.chosenUntil_ms) this.slider.value = String(state.position_s);
    const s = state.ended ? end : state.position_s;
    setText(this.time, `${s.toFixed(1)} / ${state.duration_s === null ? "…" : end.toFixed(1)} s`);
    this.slider.setAttribute("aria-valuetext", `${s.toFixed(1)} of ${end.toFixed(1)} seconds`);
    this.showSpeed(state.speed);
    this.draw(state, end);
  }

  private toggle(): void {
    const s = this.state;
    if (!s) return;
    this.send(s.ended ? replayControl(false, 0, 0) : replayControl(!s.paused));
    this.state = { ...s, paused: !s.ended && !s.paused, ended: false }; // for what follows before the next state
  }

  private seek(): void {
    this.chosenUntil_ms = performance.now() + SETTLE_MS;
    this.send(replayControl(this.state?.paused ?? false, 0, this.slider.valueAsNumber));
  }

  private showSpeed(speed: number): void {
    const all = SPEEDS.includes(speed) ? SPEEDS : [...SPEEDS, speed].sort((a, b) => a - b);
    if ([...this.speed.options].map((o) => o.value).join() !== all.join())
      this.speed.replaceChildren(...all.map((s) => new Option(`${Number(s.toPrecision(3))} ×`, String(s))));
    if (document.activeElement !== this.speed) this.speed.value = String(speed);
  }

  // Contacts as bars, trips and markers as lines.
  private draw(state: ReplayState, end: number): void {
    const width = this.marks.clientWidth;
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string): string => style.getPropertyValue(name).trim();
    const key = [width, end, state.contacts.length, state.trips.length, state.markers.length, colour("--proxy")].join();
    if (width === 0 || key === this.drawn) return;
    this.drawn = key;
    this.marks.width = width;
    const c = this.marks.getContext("2d")!;
    const x = (s: number): number => (s / end) * width;
    c.fillStyle = colour("--proxy");
    for (const [from, to] of state.contacts) c.fillRect(x(from), 5, Math.max(1, x(to) - x(from)), 6);
    c.fillStyle = colour("--stop");
    for (const [at] of state.trips) c.fillRect(x(at), 0, 2, 16);
    c.fillStyle = colour("--second");
    for (const [at] of state.markers) c.fillRect(x(at), 0, 2, 16);
    this.marks.title = [
      ...state.trips.map(([at, name]) => `${at.toFixed(1)} s: ${name}`),
      ...state.markers.map(([at, text]) => `${at.toFixed(1)} s: ${text}`),
    ]
      .slice(0, 30)
      .join("\n");
  }
}
