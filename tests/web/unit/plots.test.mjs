// Samples and counts of the plots.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { Window } = await bundled("plots/window.ts");
const { between, gaps, share } = await bundled("plots/counts.ts");

test("a window keeps the newest samples in order", () => {
  const window = new Window(2, 5);
  for (let i = 0; i < 123; ++i) {
    window.push(i, -i);
    const [time, value] = window.data();
    const first = Math.max(0, i - 4);
    assert.deepEqual(
      [...time],
      Array.from({ length: i - first + 1 }, (_, k) => first + k),
    );
    assert.deepEqual(
      [...value],
      [...time].map((t) => -t),
    );
  }
  window.clear();
  assert.equal(window.size, 0);
});

test("the difference of two histograms, and its quantiles", () => {
  const before = {
    bins: [
      [990, 10],
      [1000, 100],
    ],
  };
  const now = {
    bins: [
      [990, 10],
      [1000, 190],
      [1010, 9],
      [5000, 1],
    ],
  };
  const since = between(before, now);
  assert.deepEqual(since, [
    [1000, 90],
    [1010, 9],
    [5000, 1],
  ]);
  // Upper ends: the start of the next bin, even one without new counts, or an eighth further.
  assert.deepEqual(
    [0.5, 0.95, 1].map((part) => share(since, part, now.bins)),
    [1010, 1136.25, 5625],
  );
  assert.equal(share([[990, 4]], 0.5, now.bins), 1000);
  assert.equal(share([], 0.5), 0);
});

test("no line joins samples between which nobody measured", () => {
  assert.deepEqual(gaps(Float64Array.of(), 0.5), []);
  assert.deepEqual(gaps(Float64Array.of(1), 0.5), []);
  assert.deepEqual(gaps(Float64Array.of(1, 1.5, 1.508, 4, 4.008, 9), 0.5), [
    [1.508, 4],
    [4.008, 9],
  ]);
});
