// What this page is to the server: a token that gives it a role, and the key by which the server knows that its connections are one
// program, which may undo its own stop. Both stay in this tab: no other tab, no cookie, nothing in the address.
import { toast } from "./notice";
import { byId } from "./panels/dom";
import { forget, keep, stored } from "./stored";
import { type Outgoing, identify } from "./wire";

const KEY = "hapticd token";
const PROGRAM_KEY = "hapticd key";

/** As the server has them; a longer one does not fit into the message. */
function isToken(text: string): boolean {
  const bytes = new TextEncoder().encode(text).length;
  return bytes >= 16 && bytes <= 128;
}

/** A whole number from 1 to 2^53 - 1, which nobody guesses. */
function randomKey(): number {
  const [high = 0, low = 0] = crypto.getRandomValues(new Uint32Array(2));
  return (high & 0x1fffff) * 2 ** 32 + low || 1;
}

let keyOfPage = 0;
/** The token where the browser stores nothing. */
let tokenHere = "";

/** That of the tab: a page that was loaded again is the program that it was. */
function programKey(): number {
  if (keyOfPage !== 0) return keyOfPage;
  const before = Number(stored("sessionStorage", PROGRAM_KEY));
  keyOfPage = Number.isSafeInteger(before) && before > 0 ? before : randomKey();
  forget("sessionStorage", PROGRAM_KEY);
  window.addEventListener("pagehide", storeKey);
  window.addEventListener("pageshow", () => forget("sessionStorage", PROGRAM_KEY));
  return keyOfPage;
}

/** Only from one page of the tab to the next: a browser that duplicates a tab copies what the tab stores, and a copy beside this page
 * is another program. */
function storeKey(): void {
  keep("sessionStorage", PROGRAM_KEY, String(keyOfPage)); // or the next page of this tab is another program
}

/** What a new connection sends first. */
export function credentials(): Outgoing[] {
  const token = stored("sessionStorage", KEY) ?? tokenHere;
  return [identify(isToken(token) ? token : "", programKey())];
}

/** Binds the form; an empty token forgets the present one, which ends with the connection. */
export function bindToken(send: (...messages: Outgoing[]) => void): void {
  const field = byId<HTMLInputElement>("token-text");
  byId("token").addEventListener("submit", (e) => {
    e.preventDefault();
    const token = field.value.trim();
    field.value = "";
    forget("sessionStorage", KEY);
    tokenHere = "";
    if (token === "") return;
    if (!isToken(token)) return toast("Not a token: it has 16 to 128 characters.", 2);
    if (!keep("sessionStorage", KEY, token)) tokenHere = token;
    send(...credentials());
  });
}
