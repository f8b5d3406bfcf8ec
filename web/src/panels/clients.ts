// The connected clients: report rate, dropped reports, queued bytes.
import type { ClientState } from "../state_types";
import { bytesText, countText, el, Rows, setText } from "./dom";

class ClientRow {
  readonly root = el("tr");
  private readonly id = this.root.appendChild(el("td"));
  private readonly mode = this.root.appendChild(el("td"));
  private readonly rate = this.root.appendChild(el("td"));
  private readonly dropped = this.root.appendChild(el("td"));
  private readonly queued = this.root.appendChild(el("td"));

  update(c: ClientState): void {
    setText(this.id, `${c.id}`);
    this.root.title = `${c.address}, ${c.devices.join(", ") || "no device yet"}, for ${c.connected_s.toFixed(0)} s; in ${bytesText(c.bytes_in)}, out ${bytesText(c.bytes_out)}${c.commands ? "" : "; may not send commands"}`;
    setText(this.mode, `${c.mode} ${c.address}`);
    setText(this.rate, `${c.rate_Hz.toFixed(0)} Hz`);
    setText(this.dropped, countText(c.dropped));
    this.dropped.dataset["level"] = c.dropped > 0 ? "warn" : "";
    setText(this.queued, bytesText(c.queued_bytes));
  }
}

export class ClientsPanel {
  private readonly body = el("tbody");
  private readonly rows = new Rows<ClientState, ClientRow>(
    this.body,
    (c) => String(c.id),
    () => new ClientRow(),
    30,
  );
  private readonly more = el("p", { className: "quiet" });

  constructor(parent: HTMLElement) {
    const head = el(
      "tr",
      {},
      ...["Id", "Connection", "Rate", "Dropped", "Queued"].map((name) => el("th", { scope: "col" }, name)),
    );
    parent.append(el("table", {}, el("thead", {}, head), this.body), this.more);
  }

  update(clients: ClientState[]): void {
    this.rows.update(clients);
    setText(this.more, clients.length > 30 ? `and ${clients.length - 30} more` : "");
  }
}
