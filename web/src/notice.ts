// Notices over the view while there is nothing to see, and the texts of the server as toasts.
import { byId, el, setText } from "./panels/dom";

export type Notice = "connecting" | "lost" | "no device" | "no WebGL" | "empty" | "";

const TEXTS: Record<Exclude<Notice, "">, [title: string, text: string]> = {
  connecting: ["Connecting …", "Waiting for the server."],
  lost: [
    "Connection lost",
    "Is “hapticd serve” still running? This page reconnects automatically. Until then it cannot stop the device: use the switch on the device.",
  ],
  "no device": [
    "No device",
    "The server has no device. Start it with one, for example “hapticd serve --device simulated”.",
  ],
  "no WebGL": [
    "No 3D view",
    "This browser offers no WebGL 2. Turn on hardware acceleration in its settings, update the graphics driver, or use another browser. STOP and everything else on this page work without it.",
  ],
  empty: [
    "The scene is empty",
    "Drop a mesh here (OBJ, STL, PLY or glTF), or run “hapticd touch FILE”.",
  ],
};

const TOAST_MS = 8000;
const MAX_TOASTS = 4;

let shown: Notice | undefined;
export function showNotice(notice: Notice): void {
  if (notice === shown) return;
  shown = notice;
  const box = byId("notice");
  box.hidden = notice === "";
  box.dataset["notice"] = notice;
  if (notice === "") return;
  setText(byId("notice-title"), TEXTS[notice][0]);
  setText(byId("notice-text"), TEXTS[notice][1]);
  byId("load-bunny").hidden = notice !== "empty";
}

/** Severity as in VRPN's text messages: 0 normal, 1 warning, 2 error. */
export function toast(text: string, severity: number): void {
  const box = byId("toasts");
  for (const old of [...box.children]) if (old.textContent === text) old.remove();
  const item = el("div", { data: { level: severity >= 2 ? "bad" : severity >= 1 ? "warn" : "" } }, text);
  box.append(item);
  while (box.children.length > MAX_TOASTS) box.firstElementChild!.remove();
  setTimeout(() => item.remove(), TOAST_MS);
}
