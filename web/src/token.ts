// The token that gives this page a role. It stays in this tab: no other tab, no cookie, nothing in the address.
import { toast } from "./notice";
import { byId } from "./panels/dom";
import { type Outgoing, identify } from "./wire";

const KEY = "hapticd token";

/** As the server has them; a longer one does not fit into the message. */
function isToken(text: string): boolean {
  const bytes = new TextEncoder().encode(text).length;
  return bytes >= 16 && bytes <= 128;
}

/** What a new connection sends first: the token, if one was entered. */
export function credentials(): Outgoing[] {
  const token = sessionStorage.getItem(KEY) ?? "";
  return isToken(token) ? [identify(token)] : [];
}

/** Binds the form; an empty token forgets the present one, which ends with the connection. */
export function bindToken(send: (...messages: Outgoing[]) => void): void {
  const field = byId<HTMLInputElement>("token-text");
  byId("token").addEventListener("submit", (e) => {
    e.preventDefault();
    const token = field.value.trim();
    field.value = "";
    sessionStorage.removeItem(KEY);
    if (token === "") return;
    if (!isToken(token)) return toast("Not a token: it has 16 to 128 characters.", 2);
    sessionStorage.setItem(KEY, token);
    send(...credentials());
  });
}
