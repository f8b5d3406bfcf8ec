// The token that gives this page a role. It stays in this tab: no other tab, no cookie, nothing in the address.
import { byId } from "./panels/dom";
import { type Outgoing, identify } from "./wire";

const KEY = "hapticd token";

/** What a new connection sends first: the token, if one was entered. */
export function credentials(): Outgoing[] {
  const token = sessionStorage.getItem(KEY) ?? "";
  return token === "" ? [] : [identify(token)];
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
    sessionStorage.setItem(KEY, token);
    send(...credentials());
  });
}
