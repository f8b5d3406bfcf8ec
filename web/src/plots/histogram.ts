// The histogram of the servo loop since the server started, on logarithmic scales.
import uPlot from "uplot";
import type { Histogram } from "../state_types";
import { centres } from "./counts";
import { axis, css } from "./plot";

/** Shorter times are drawn here. */
const LEAST_US = 0.1;

export class LoopHistogram {
  private plot: uPlot | undefined;
  private last: Histogram | undefined;
  private shown = -1;

  constructor(private readonly body: HTMLElement) {
    new ResizeObserver(() => this.resize()).observe(body);
  }

  update(histogram: Histogram): void {
    this.last = histogram;
  }

  restyle(): void {
    this.plot?.destroy();
    this.plot = undefined;
    this.shown = -1;
    this.resize();
  }

  draw(): void {
    const total = this.last?.bins.reduce((sum, [, count]) => sum + count, 0) ?? 0;
    if (!this.plot || total === this.shown) return;
    this.shown = total;
    this.plot.setData(this.data());
  }

  private data(): uPlot.AlignedData {
    const bins = this.last?.bins.filter(([, count]) => count > 0) ?? [];
    return [
      centres(bins.map(([from]) => from)).map((time) => Math.log10(Math.max(time, LEAST_US))),
      bins.map(([, count]) => Math.log10(count) + 0.3),
    ];
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.body;
    if (width < 40 || height < 30) return;
    if (this.plot) return this.plot.setSize({ width, height });
    const options: uPlot.Options = {
      width,
      height,
      padding: [6, 10, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: (_, min, max) => around(min, max) },
        y: { range: (_, __, max) => [0, Math.ceil(max ?? 1)] },
      },
      axes: [
        {
          ...axis(),
          size: 21,
          gap: 5,
          splits: (_, __, min, max) => roundTimes(min, max),
          values: (_, splits) => splits.map((s) => timeText(10 ** s)),
        },
        {
          ...axis(),
          size: 38,
          gap: 2,
          space: 20,
          values: (_, splits) => splits.map((s) => (Number.isInteger(s) ? powerText(s) : "")),
        },
      ],
      series: [
        {},
        {
          stroke: css("--force"),
          fill: css("--force"),
          paths: uPlot.paths.bars!({ size: [0.9, 12, 2], align: 0 }),
          points: { show: false },
        },
      ],
    };
    this.plot = new uPlot(options, this.data(), this.body);
  }
}

/** The range of the logarithmic axis, with a margin. */
function around(min: number | null, max: number | null): [number, number] {
  return [(min ?? 0) - 0.03, (max ?? 1) + 0.07];
}

/** At most six round times between two logarithms. */
function roundTimes(min: number, max: number): number[] {
  const times = (steps: number[]): number[] => {
    const found: number[] = [];
    for (let power = Math.floor(min); power <= max; ++power) {
      found.push(...steps.map((step) => power + Math.log10(step)).filter((t) => t >= min && t <= max));
    }
    return found;
  };
  const choices = [[1, 1.5, 2, 3, 5, 7], [1, 2, 5], [1, 3], [1]].map(times);
  return choices.find((choice) => choice.length <= 6) ?? choices.at(-1)!;
}

const timeText = (us: number): string =>
  us < 999 ? `${Number(us.toPrecision(2))} µs` : `${Number((us / 1000).toPrecision(2))} ms`;
const powerText = (power: number): string => (power < 4 ? String(10 ** power) : `10${"⁰¹²³⁴⁵⁶⁷⁸⁹"[power]}`);
