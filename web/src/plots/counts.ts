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
