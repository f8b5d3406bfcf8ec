// Payloads are big endian, their fields follow each other without alignment.

export class Writer {
  private readonly view: DataView;
  private at = 0;

  /** A payload of exactly this many bytes. */
  constructor(bytes: number) {
    this.view = new DataView(new ArrayBuffer(bytes));
  }

  i16(value: number): this {
    this.view.setInt16(this.at, value);
    this.at += 2;
    return this;
  }
  i32(value: number): this {
    this.view.setInt32(this.at, value);
    this.at += 4;
    return this;
  }
  u32(value: number): this {
    this.view.setUint32(this.at, value);
    this.at += 4;
    return this;
  }
  f32(value: number): this {
    this.view.setFloat32(this.at, value);
    this.at += 4;
    return this;
  }
  f64(value: number): this {
    this.view.setFloat64(this.at, value);
    this.at += 8;
    return this;
  }
  f64s(values: ArrayLike<number>): this {
    for (let i = 0; i < values.length; ++i) this.f64(values[i]!);
    return this;
  }
  /** Text in a field of fixed size, the rest NULs. */
  text(value: string, size: number): this {
    const bytes = new TextEncoder().encode(value);
    if (bytes.length > size) throw new Error(`"${value}" is longer than ${size} bytes`);
    new Uint8Array(this.view.buffer).set(bytes, this.at);
    this.at += size;
    return this;
  }
  bytes(): Uint8Array {
    if (this.at !== this.view.byteLength)
      throw new Error(`payload of ${this.view.byteLength} bytes, wrote ${this.at}`);
    return new Uint8Array(this.view.buffer);
  }
}

export class Reader {
  private at = 0;
  constructor(private readonly view: DataView) {}

  i16(): number {
    this.at += 2;
    return this.view.getInt16(this.at - 2);
  }
  i32(): number {
    this.at += 4;
    return this.view.getInt32(this.at - 4);
  }
  u32(): number {
    this.at += 4;
    return this.view.getUint32(this.at - 4);
  }
  f64(): number {
    this.at += 8;
    return this.view.getFloat64(this.at - 8);
  }
  /** 64 bits as a number: exact up to 2^53. */
  u64(): number {
    return this.u32() * 2 ** 32 + this.u32();
  }
  i64(): number {
    return this.i32() * 2 ** 32 + this.u32();
  }
  f64x3(): [number, number, number] {
    return [this.f64(), this.f64(), this.f64()];
  }
  f64x4(): [number, number, number, number] {
    return [this.f64(), this.f64(), this.f64(), this.f64()];
  }
  /** Text of a field of fixed size, up to its first NUL. */
  text(size: number): string {
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + this.at, size);
    this.at += size;
    const end = bytes.indexOf(0);
    return new TextDecoder().decode(end < 0 ? bytes : bytes.subarray(0, end));
  }
}
