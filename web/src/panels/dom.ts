// Small DOM helpers: elements in one expression, and text that is written only when it changes.

type Props<K extends keyof HTMLElementTagNameMap> = Partial<
  Omit<HTMLElementTagNameMap[K], "dataset" | "style">
> & { data?: Record<string, string> };

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props<K> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const { data, ...rest } = props;
  const element = document.createElement(tag);
  Object.assign(element, rest);
  Object.assign(element.dataset, data);
  element.append(...children);
  return element;
}

/** The element with this id; throws when there is none. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no #${id}`);
  return element as T;
}

export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** A number of the server in an input, rounded for people: what nobody typed keeps all its digits. */
export class NumberField {
  private exact = NaN;
  private shown = "";

  constructor(
    readonly input: HTMLInputElement,
    private readonly digits: number,
  ) {}

  /** Leaves the text of a field that is being edited. */
  show(value: number): void {
    this.exact = value;
    if (document.activeElement === this.input) return;
    const text = String(Number(value.toPrecision(this.digits)) + 0);
    if (this.input.value !== text) this.input.value = text;
    this.shown = this.input.value;
  }

  /** What was typed, NaN when that is no number; else what the server has. */
  get value(): number {
    return this.input.value === this.shown ? this.exact : this.input.valueAsNumber;
  }
}

/** One row per item: created once, updated in place, removed with its item. */
export class Rows<Item, Row extends { root: HTMLElement; update(item: Item): void }> {
  private readonly rows = new Map<string, Row>();

  constructor(
    private readonly parent: HTMLElement,
    private readonly keyOf: (item: Item) => string,
    private readonly make: (item: Item) => Row,
    private readonly most = 200,
  ) {}

  update(items: Item[]): void {
    const shown = items.slice(0, this.most);
    const keys = new Set(shown.map(this.keyOf));
    for (const [key, row] of this.rows) {
      if (keys.has(key)) continue;
      row.root.remove();
      this.rows.delete(key);
    }
    shown.forEach((item, i) => {
      const key = this.keyOf(item);
      let row = this.rows.get(key);
      if (!row) this.rows.set(key, (row = this.make(item)));
      if (this.parent.children[i] !== row.root)
        this.parent.insertBefore(row.root, this.parent.children[i] ?? null);
      row.update(item);
    });
  }
}

export function bytesText(bytes: number): string {
  if (bytes < 1000) return `${bytes} B`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(0)} kB`;
  return `${(bytes / 1e6).toFixed(1)} MB`;
}

export const countText = (count: number): string => count.toLocaleString("en-US");
