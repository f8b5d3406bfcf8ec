// One live plot: uPlot over a sliding window of samples, in the colours of the page.
import uPlot from "uplot";
import { gaps, usualEnd } from "./counts";
import { Window } from "./window";

export interface Curve {
  label: string;
  /** Name of a CSS variable. */
  colour: string;
}

export interface PlotOptions {
  title: string;
  unit: string;
  curves: Curve[];
  /** Length of the window, and the maximum number of samples in it. */
  seconds: number;
  most: number;
  /** Smallest upper end of the y axis. */
  least: number;
  decimals: number;
}

export const css = (name: string): string =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export function axis(): uPlot.Axis {
  return {
    stroke: css("--quiet"),
    grid: { stroke: css("--line"), width: 1 },
    ticks: { show: false },
    font: "11px system-ui, sans-serif",
  };
}

const LABEL_PX = 45;

/** A moment on the time axis. */
export interface Mark {
  time_s: number;
  label: string;
  /** Name of a CSS variable. */
  colour: string;
}

export class Plot {
  readonly window: Window;
  /** While set, the plot shows these samples instead of the newest. */
  private held: Float64Array[] | undefined;
  private plot: uPlot | undefined;
  private readonly value: HTMLElement;
  private readonly body: HTMLElement;
  private changed = false;

  constructor(
    parent: HTMLElement,
    private readonly options: PlotOptions,
    private readonly marks: Mark[] = [],
  ) {
    this.window = new Window(1 + options.curves.length, options.most);
    const figure = document.createElement("figure");
    figure.className = "plot";
    figure.dataset["plot"] = options.title;
    const caption = figure.appendChild(document.createElement("figcaption"));
    caption.append(options.title, " ");
    this.value = caption.appendChild(document.createElement("output"));
    this.value.ariaLive = "off"; // it changes ten times a second
    if (options.curves.length > 1) caption.append(legend(options.curves));
    this.body = figure.appendChild(document.createElement("div"));
    parent.append(figure);
    new ResizeObserver(() => this.resize()).observe(this.body);
  }

  push(time_s: number, ...values: number[]): void {
    this.window.push(time_s, ...values);
    this.changed = true;
  }

  clear(): void {
    this.window.clear();
    this.changed = true;
  }

  /** Rebuilds the plot after a change of colours. */
  restyle(): void {
    this.plot?.destroy();
    this.plot = undefined;
    this.resize();
  }

  get title(): string {
    return this.options.title;
  }
  get unit(): string {
    return this.options.unit;
  }
  get canvas(): HTMLCanvasElement | null {
    return this.body.querySelector("canvas");
  }

  /** Holds the picture, or goes on. */
  set paused(on: boolean) {
    this.held = on ? this.window.data().map((column) => column.slice()) : undefined;
    this.changed = true;
  }

  /** The samples that are shown: time and values. */
  data(): Float64Array[] {
    return this.held ?? this.window.data();
  }

  /** The present value is not known. */
  lost(): void {
    this.value.textContent = `– ${this.options.unit}`;
  }

  draw(): void {
    if (!this.changed || !this.plot || this.window.size === 0) return;
    this.changed = false;
    const data = this.data();
    this.plot.setData(data as unknown as uPlot.AlignedData);
    const last = data[1]!.at(-1)!;
    this.value.textContent = `${last.toFixed(this.options.decimals)} ${this.options.unit}`;
  }

  private drawMarks(u: uPlot): void {
    const { min, max } = u.scales["x"]!;
    const { left, top, width, height } = u.bbox;
    const context = u.ctx;
    context.save();
    let before = -Infinity;
    for (const { time_s, label, colour } of this.marks) {
      if (time_s < min! || time_s > max!) continue;
      const x = left + ((time_s - min!) / (max! - min!)) * width;
      context.strokeStyle = context.fillStyle = css(colour);
      context.lineWidth = devicePixelRatio;
      context.beginPath();
      context.moveTo(x, top);
      context.lineTo(x, top + height);
      context.stroke();
      if (Math.abs(x - before) < LABEL_PX * devicePixelRatio) continue; // its text would cover the other one
      before = x;
      context.font = `${10 * devicePixelRatio}px system-ui, sans-serif`;
      context.textAlign = x > left + width / 2 ? "right" : "left";
      context.fillText(label, x + (x > left + width / 2 ? -3 : 3) * devicePixelRatio, top + 10 * devicePixelRatio);
    }
    context.restore();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.body;
    if (width < 40 || height < 30) return;
    if (this.plot) return this.plot.setSize({ width, height });
    this.plot = new uPlot(
      this.uplotOptions(width, height),
      this.data() as unknown as uPlot.AlignedData,
      this.body,
    );
  }

  private uplotOptions(width: number, height: number): uPlot.Options {
    const { curves, seconds, least } = this.options;
    return {
      width,
      height,
      padding: [6, 14, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: (_, __, max) => [(max ?? 0) - seconds, max ?? seconds] },
        y: { range: () => [0, niceEnd(Math.max(usualEnd(this.data().slice(1)), least))] },
      },
      axes: [
        {
          ...axis(),
          size: 18,
          gap: 2,
          splits: (u) => ago(u, seconds),
          values: (u, splits) => splits.map((s) => agoText(s - u.scales["x"]!.max!)),
        },
        { ...axis(), size: 38, gap: 2, space: 24, values: (_, splits) => splits.map(shortText) },
      ],
      hooks: { draw: [(u) => this.drawMarks(u)] },
      series: [
        {},
        ...curves.map((c): uPlot.Series => ({
          label: c.label,
          stroke: css(c.colour),
          width: 1.5,
          points: { show: false },
          gaps: (u) => gaps(u.data[0], seconds / 20).map((gap) => gap.map((t) => u.valToPos(t, "x", true)) as uPlot.Series.Gap),
        })),
      ],
    };
  }
}

const ago = (u: uPlot, seconds: number): number[] =>
  [-0.8, -0.4, 0].map((part) => u.scales["x"]!.max! + part * seconds);
const agoText = (seconds: number): string => (seconds > -0.05 ? "now" : `${seconds.toFixed(0)} s`);

const shortText = (value: number): string =>
  value < 10_000 ? String(Number(value.toPrecision(6))) : `${value / 1000}k`;

/** A round number at or above the value, so that the axis changes seldom. */
function niceEnd(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 5, 7.5, 10].find((m) => m * power >= value)! * power;
}

function legend(curves: Curve[]): HTMLElement {
  const names = document.createElement("span");
  names.className = "curves";
  for (const curve of curves) {
    const name = names.appendChild(document.createElement("span"));
    name.textContent = curve.label;
    name.style.setProperty("--colour", `var(${curve.colour})`);
  }
  return names;
}
