// Light or dark theme: the preference of the system until the user chooses.
import { byId, setText } from "./panels/dom";
import { keep, stored } from "./stored";

type Theme = "light" | "dark";
const KEY = "hapticd-theme";

export function startTheme(onChange: () => void): void {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = byId("theme");
  let here: Theme | null = null; // where nothing can be stored
  const chosen = (): Theme | null => (stored("localStorage", KEY) as Theme | null) ?? here;
  const apply = (): void => {
    const theme = chosen() ?? (system.matches ? "dark" : "light");
    document.documentElement.dataset["theme"] = theme;
    setText(button, theme === "dark" ? "Light" : "Dark");
    onChange();
  };
  button.addEventListener("click", () => {
    here = document.documentElement.dataset["theme"] === "dark" ? "light" : "dark";
    keep("localStorage", KEY, here);
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
