// Small helpers over the DOM: elements in one line, and text that is only written when it has changed.

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

/** The element of the page with this id. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no #${id}`);
  return element as T;
}

export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** One row for each item, made once, updated in place, gone with its item. */
export class Rows<Item, Row extends { root: HTMLElement; update(item: Item): void }> {
  private readonly rows = new Map<number, Row>();

  constructor(
    private readonly parent: HTMLElement,
    private readonly idOf: (item: Item) => number,
    private readonly make: (item: Item) => Row,
    private readonly most = 200,
  ) {}

  update(items: Item[]): void {
    const shown = items.slice(0, this.most);
    const ids = new Set(shown.map(this.idOf));
    for (const [id, row] of this.rows) {
      if (ids.has(id)) continue;
      row.root.remove();
      this.rows.delete(id);
    }
    shown.forEach((item, i) => {
      const id = this.idOf(item);
      let row = this.rows.get(id);
      if (!row) this.rows.set(id, (row = this.make(item)));
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
