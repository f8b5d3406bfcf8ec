// The servers of the network: links to their pages. Names come from other machines: text nodes only, each with its own direction of writing.
import type { NetworkServer } from "../state_types";
import { factsOf, linkOf } from "../servers";
import { el, Rows } from "./dom";

class ServerRow {
  readonly root: HTMLElement;

  constructor(s: NetworkServer) {
    const name = el("bdi", {}, s.name || s.address);
    const href = s.this_server ? undefined : linkOf(s.page);
    const row = el("div", { className: "row" }, el("strong", {}, href ? link(href, name) : name));
    if (s.this_server) row.append(el("span", { className: "quiet" }, "this server"));
    this.root = el("li", { title: s.name }, row, el("p", { className: "quiet" }, el("bdi", {}, factsOf(s))));
    if (s.this_server) this.root.ariaCurrent = "true";
  }

  // A server that announces something else has another row.
  update(): void {}
}

// In a tab of its own: the STOP of this page stays at hand.
function link(href: string, name: HTMLElement): HTMLElement {
  return el("a", { href, target: "_blank", rel: "noopener noreferrer", title: "Opens its page in a new tab" }, name);
}

export class ServersPanel {
  private readonly list = el("ul", { className: "cards" });
  private readonly rows = new Rows<NetworkServer, ServerRow>(
    this.list,
    (s) => JSON.stringify(s),
    (s) => new ServerRow(s),
    100,
  );

  /** `part` is hidden while there is no server. */
  constructor(private readonly part: HTMLElement) {
    part.append(this.list);
  }

  update(servers: NetworkServer[]): void {
    this.part.hidden = servers.length === 0;
    this.rows.update(servers);
  }
}
