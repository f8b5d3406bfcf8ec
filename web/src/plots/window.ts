// A sliding window of samples: time and several values. Appending moves the old samples only once per window length.

export class Window {
  private readonly columns: Float64Array[];
  private start = 0;
  private end = 0;

  /** `columns`: 1 for the time plus the number of values; `most`: number of samples kept. */
  constructor(
    columns: number,
    private readonly most: number,
  ) {
    this.columns = Array.from({ length: columns }, () => new Float64Array(2 * most));
  }

  push(...sample: number[]): void {
    if (this.end === 2 * this.most) {
      for (const column of this.columns) column.copyWithin(0, this.start);
      this.end -= this.start;
      this.start = 0;
    }
    this.columns.forEach((column, i) => (column[this.end] = sample[i]!));
    ++this.end;
    this.start = Math.max(this.start, this.end - this.most);
  }

  clear(): void {
    this.start = this.end = 0;
  }

  /** Views of the kept samples, oldest first; valid until the next push. */
  data(): Float64Array[] {
    return this.columns.map((column) => column.subarray(this.start, this.end));
  }

  get size(): number {
    return this.end - this.start;
  }
}
