// The plots of the page and their data.
import { between, share } from "./plots/counts";
import { LoopHistogram } from "./plots/histogram";
import { css, type Mark, Plot } from "./plots/plot";
import { TRIPS } from "./server_tables";
import type { DeviceState, Histogram } from "./state_types";
import type { Tick } from "./wire";
import { byId, countText, setText } from "./panels/dom";

const SECONDS = 10;
const LOOP_SECONDS = 60;
/** States come more often while meshes deform. */
const LEAST_PERIOD_S = 0.2;
/** 10 s of ticks at 125 Hz, with a margin. */
const MAX_SAMPLES = 1400;

/** Marks older than the window are dropped beyond this number. */
const MOST_MARKS = 100;
const TRIP_COLOUR = "--bad";

type LoopTime = "period_us" | "wakeup_us" | "compute_us";

export class LivePlots {
  private readonly force: Plot;
  private readonly depth: Plot;
  private readonly latency: Plot;
  private readonly period: Plot;
  private readonly histogram = new LoopHistogram(byId("histogram"));
  private readonly choice = byId<HTMLSelectElement>("loop-of");
  private readonly summary = byId("loop-summary");
  private before: Histogram | undefined;
  private newest: Tick | undefined;
  private meanSince: Tick | undefined;
  private periodAt_s = -Infinity;
  private turn = 0;
  private paused = false;
  private readonly marks: Mark[] = [];
  /** Of the newest tick; those of the first one began before. */
  private trips: number | undefined;

  constructor() {
    this.bindTools();
    const parent = byId("plots");
    const one = (
      title: string,
      unit: string,
      label: string,
      least: number,
      decimals: number,
      colour: string,
    ): Plot =>
      new Plot(parent, {
        title,
        unit,
        least,
        decimals,
        curves: [{ label, colour }],
        seconds: SECONDS,
        most: MAX_SAMPLES,
      }, this.marks);
    this.force = one("Force", "N", "force", 0.5, 2, "--force");
    this.depth = one("Depth", "mm", "depth", 1, 2, "--proxy");
    this.latency = one("Latency", "ms", "latency", 2, 1, "--second");
    const curves = [
      { label: "mean", colour: "--third" },
      { label: "p99", colour: "--second" },
      { label: "max", colour: "--force" },
    ];
    this.period = new Plot(parent, {
      title: "Period",
      unit: "µs",
      least: 1200,
      decimals: 0,
      curves,
      seconds: LOOP_SECONDS,
      most: 300,
    });
  }

  tick(tick: Tick, force_N: number, depth_mm: number, latency_ms: number): void {
    if (this.newest && tick.time_ns < this.newest.time_ns) this.restart();
    this.newest = tick;
    const time_s = tick.time_ns / 1e9;
    this.force.push(time_s, force_N);
    this.depth.push(time_s, depth_mm);
    this.latency.push(time_s, latency_ms);
    this.markTrips(tick, time_s);
  }

  /** A marker of a client, on the server's clock. */
  marker(time_s: number, label: string): void {
    this.mark({ time_s, label, colour: "--second" });
  }

  /** Another device: its samples and trips follow. Markers are of all devices. */
  clear(): void {
    for (const plot of this.timed) plot.clear();
    this.marks.splice(0, Infinity, ...this.marks.filter((mark) => mark.colour !== TRIP_COLOUR));
    this.periodAt_s = -Infinity;
    this.trips = this.before = this.newest = this.meanSince = undefined;
  }

  /** The server's machine started anew: all times of before lie in the future. */
  private restart(): void {
    this.clear();
    this.marks.length = 0;
  }

  /** Nothing is known any more. */
  lost(): void {
    for (const plot of this.timed) plot.lost();
    setText(this.summary, "–");
  }

  private mark(mark: Mark): void {
    this.marks.push(mark);
    if (this.marks.length > MOST_MARKS) this.marks.shift();
  }

  // Trips that remove the force; clamps are part of normal rendering.
  private markTrips(tick: Tick, time_s: number): void {
    const now = tick.guardActive | tick.guardLatched;
    const begun = now & ~(this.trips ?? now);
    this.trips = now;
    if (begun === 0) return;
    for (const [name, trip] of Object.entries(TRIPS))
      if ((begun & (1 << trip.bit)) !== 0 && trip.action !== "clamp")
        this.mark({ time_s, label: name, colour: TRIP_COLOUR });
  }

  private get timed(): Plot[] {
    return [this.force, this.depth, this.latency, this.period];
  }

  private bindTools(): void {
    const pause = byId("plots-pause");
    pause.addEventListener("click", () => {
      const on = pause.ariaPressed !== "true";
      pause.ariaPressed = String(on);
      this.paused = on;
      for (const plot of this.timed) plot.paused = on;
    });
    byId("plots-csv").addEventListener("click", () => save(new Blob([this.csv()], { type: "text/csv" }), "csv"));
    byId("plots-png").addEventListener("click", () =>
      this.png().toBlob((blob) => blob && save(blob, "png"), "image/png"),
    );
  }

  /** Force, depth and latency of the shown samples, with marks as comments. */
  csv(): string {
    const [time, force] = this.force.data();
    const depth = this.depth.data()[1]!;
    const latency = this.latency.data()[1]!;
    const rows = Array.from(time!, (t, i) => `${t.toFixed(6)},${force![i]!},${depth[i]!},${latency[i]!}`);
    const marks = this.marks
      .filter((m) => m.time_s >= (time![0] ?? Infinity) && (!this.paused || m.time_s <= time!.at(-1)!))
      .map((m) => `# ${m.time_s.toFixed(6)} ${m.label.replaceAll(/[\r\n]/g, " ")}`);
    return [...marks, "time_s,force_N,depth_mm,latency_ms", ...rows].join("\n") + "\n";
  }

  private png(): HTMLCanvasElement {
    const plots = this.timed.filter((p) => p.canvas);
    const head = 22 * devicePixelRatio;
    const all = document.createElement("canvas");
    all.width = Math.max(1, ...plots.map((p) => p.canvas!.width));
    all.height = plots.reduce((sum, p) => sum + p.canvas!.height + head, 0);
    const context = all.getContext("2d")!;
    context.fillStyle = css("--panel");
    context.fillRect(0, 0, all.width, all.height);
    context.font = `${13 * devicePixelRatio}px system-ui, sans-serif`;
    let y = 0;
    for (const plot of plots) {
      context.fillStyle = css("--ink");
      context.fillText(`${plot.title}, ${plot.unit}`, 6 * devicePixelRatio, y + 0.75 * head);
      context.drawImage(plot.canvas!, 0, y + head);
      y += plot.canvas!.height + head;
    }
    return all;
  }

  state(device: DeviceState, time_s: number): void {
    if (time_s - this.periodAt_s < LEAST_PERIOD_S) return;
    this.periodAt_s = time_s;
    const now = device.loop.period_us;
    const since = between(this.before, now);
    const mean_us = this.mean_us();
    if (since.length > 0 && this.before && mean_us > 0) {
      this.period.push(time_s, mean_us, share(since, 0.99, now.bins), share(since, 1, now.bins));
    }
    this.before = now;
    const shown = device.loop[this.choice.value as LoopTime];
    this.histogram.update(shown);
    setText(
      this.summary,
      `p50 ≤ ${us(shown.p50)}, p99 ≤ ${us(shown.p99)}, p99.9 ≤ ${us(shown.p999)}, max ${us(shown.max)} of ${countText(device.loop.ticks)} ticks; ${countText(device.loop.overruns)} overruns, ${countText(device.loop.dropped_reports)} reports dropped`,
    );
  }

  /** Mean period of the ticks since the last call; 0 when unknown. */
  private mean_us(): number {
    const [from, to] = [this.meanSince, this.newest];
    this.meanSince = to;
    return from && to && to.tick > from.tick ? (to.time_ns - from.time_ns) / 1000 / (to.tick - from.tick) : 0;
  }

  /** Draws one plot per frame, in turn, so that no frame takes long. */
  draw(): void {
    const plots = [this.force, this.depth, this.latency, this.period, this.histogram];
    this.turn = (this.turn + 1) % plots.length;
    plots[this.turn]!.draw();
  }

  restyle(): void {
    for (const plot of [this.force, this.depth, this.latency, this.period, this.histogram]) plot.restyle();
  }
}

const us = (value: number): string => `${value < 10 ? value.toFixed(1) : value.toFixed(0)} µs`;

function save(blob: Blob, extension: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `hapticd-${new Date().toISOString().slice(0, 19).replaceAll(":", "")}.${extension}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
