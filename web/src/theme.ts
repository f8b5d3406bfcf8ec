// Light or dark theme: the preference of the system until the user chooses.
import { byId, setText } from "./panels/dom";

type Theme = "light" | "dark";
const KEY = "hapticd-theme";

export function startTheme(onChange: () => void): void {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = byId("theme");
  const chosen = (): Theme | null => localStorage.getItem(KEY) as Theme | null;
  const apply = (): void => {
    const theme = chosen() ?? (system.matches ? "dark" : "light");
    document.documentElement.dataset["theme"] = theme;
    setText(button, theme === "dark" ? "Light" : "Dark");
    onChange();
  };
  button.addEventListener("click", () => {
    localStorage.setItem(KEY, document.documentElement.dataset["theme"] === "dark" ? "light" : "dark");
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
