// What the browser keeps for the page. Where its user keeps sites from storing anything, even the name of a store throws.

type Store = "localStorage" | "sessionStorage";

export function stored(store: Store, key: string): string | null {
  try {
    return globalThis[store].getItem(key);
  } catch {
    return null;
  }
}

/** Whether it is kept. */
export function keep(store: Store, key: string, value: string): boolean {
  try {
    globalThis[store].setItem(key, value);
    return true;
  } catch {
    return false;
  }
}

export function forget(store: Store, key: string): void {
  try {
    globalThis[store].removeItem(key);
  } catch {
    // There is nothing.
  }
}
