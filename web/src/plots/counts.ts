// Counting in histograms that only grow.
import type { Histogram } from "../state_types";

/** What came between two states of a growing histogram. */
export function between(before: Histogram | undefined, now: Histogram): [from_us: number, count: number][] {
  const old = new Map(before?.bins);
  return now.bins
    .map(([from, count]): [number, number] => [from, count - (old.get(from) ?? 0)])
    .filter(([, count]) => count > 0);
}

/**
 * What this share of all counts is at most: the upper end of its bin, 0 when there are none. `all` names the bins that there
 * are; one without a known neighbour is taken as an eighth wide.
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
