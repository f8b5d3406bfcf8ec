// Differences and quantiles of histograms whose counts only grow.
import type { Histogram } from "../state_types";

/** The counts added between two states of a histogram. */
export function between(before: Histogram | undefined, now: Histogram): [from_us: number, count: number][] {
  const old = new Map(before?.bins);
  return now.bins
    .map(([from, count]): [number, number] => [from, count - (old.get(from) ?? 0)])
    .filter(([, count]) => count > 0);
}

/**
 * An upper bound of the quantile `part`: the upper end of its bin; 0 without counts. `all` lists the existing bins; a bin
 * without a known neighbour counts as an eighth of its start wide.
 */
export function share(bins: [from_us: number, count: number][], part: number, all = bins): number {
  const total = bins.reduce((sum, [, count]) => sum + count, 0);
  let seen = 0;
  for (const [from, count] of bins) {
    seen += count;
    if (seen < part * total) continue;
    const next = all.find(([other]) => other > from)?.[0] ?? Infinity;
    return Math.min(next, 1.125 * from);
  }
  return 0;
}

/** Centres of bins from their lower ends; a bin without a known neighbour counts as an eighth of its start wide. */
export function centres(from: number[]): number[] {
  return from.map((start, i) => (start + Math.min(from[i + 1] ?? Infinity, 1.125 * start)) / 2);
}

/** The largest value, unless few values lie far above all others: a single peak must not hide the rest. */
export function usualEnd(columns: Float64Array[]): number {
  let end = 0;
  for (const column of columns) {
    const sorted = column.filter(Number.isFinite).sort();
    const largest = sorted.at(-1) ?? 0;
    const usual = sorted[Math.floor(0.98 * (sorted.length - 1))] ?? 0;
    end = Math.max(end, largest > 3 * usual && usual > 0 ? 1.5 * usual : largest);
  }
  return end;
}

/** Between which neighbours so much time passed that nobody measured in it: no line joins them. */
export function gaps(times: ArrayLike<number>, longest: number): [from: number, to: number][] {
  const found: [number, number][] = [];
  for (let i = 1; i < times.length; ++i)
    if (times[i]! - times[i - 1]! > longest) found.push([times[i - 1]!, times[i]!]);
  return found;
}
