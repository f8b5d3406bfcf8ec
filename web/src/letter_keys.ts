// Letters as commands can be switched off: who dictates, or rests a hand on the keys, types some without meaning them.
import { byId } from "./panels/dom";
import { keep, stored } from "./stored";

const KEY = "hapticd-letter-keys";

/** Binds the check box; returns whether letters act. */
export function bindLetterKeys(): () => boolean {
  const box = byId<HTMLInputElement>("letter-keys");
  const show = (): void => {
    document.body.classList.toggle("no-letters", !box.checked);
  };
  box.checked = stored("localStorage", KEY) !== "off";
  box.addEventListener("change", () => {
    keep("localStorage", KEY, box.checked ? "on" : "off");
    show();
  });
  show();
  return () => box.checked;
}
