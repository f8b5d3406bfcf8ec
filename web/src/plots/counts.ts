// Counting in histograms that only grow.
import type { Histogram } from "../state_types";

/** What came between two states of a growing histogram. */
export function between(before: Histogram | undefined, now: Histogram): [from_us: number, count: number][] {
  const old = new Map(before?.bins);
  return now.bins
    .map(([from, count]): [number, number] => [from, count - (old.get(from) ?? 0)])
    .filter(([, count]) => count > 0);
}

/** The bin that holds this share of all counts: its lower end; 0 when there are none. */
export function share(bins: [number, number][], part: number): number {
  const all = bins.reduce((sum, [, count]) => sum + count, 0);
  let seen = 0;
  for (const [from, count] of bins) {
    seen += count;
    if (seen >= part * all) return from;
  }
  return 0;
}
