// The plots of the page and their data.
import { between, share } from "./plots/counts";
import { LoopHistogram } from "./plots/histogram";
import { Plot } from "./plots/plot";
import type { DeviceState, Histogram } from "./state_types";
import type { Tick } from "./wire";
import { byId, countText, setText } from "./panels/dom";

const SECONDS = 10;
const LOOP_SECONDS = 60;
/** 10 s of ticks at 125 Hz, with a margin. */
const MAX_SAMPLES = 1400;

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
  private device = "";
  private turn = 0;

  constructor() {
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
      });
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
    this.newest = tick;
    const time_s = tick.time_ns / 1e9;
    this.force.push(time_s, force_N);
    this.depth.push(time_s, depth_mm);
    this.latency.push(time_s, latency_ms);
  }

  state(device: DeviceState, time_s: number): void {
    if (device.name !== this.device) {
      for (const plot of [this.force, this.depth, this.latency, this.period]) plot.clear();
      this.device = device.name;
      this.before = undefined;
    }
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
      `p50 ${us(shown.p50)}, p99 ${us(shown.p99)}, p99.9 ${us(shown.p999)}, max ${us(shown.max)} of ${countText(device.loop.ticks)} ticks; ${countText(device.loop.overruns)} overruns, ${countText(device.loop.dropped_reports)} reports dropped`,
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
