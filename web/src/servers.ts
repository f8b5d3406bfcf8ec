// The servers that announce themselves on the network.
import type { NetworkServer } from "./state_types";

/** Each search sends packets to the whole network. */
const EVERY_MS = 30_000;
/** A search takes some seconds, more when the Avahi daemon hangs. */
const PATIENCE_MS = 20_000;

/** Where a link to another server's page may lead: the address comes from another machine. */
export function linkOf(page: string): string | undefined {
  try {
    const { protocol, href, username } = new URL(page);
    return (protocol === "http:" || protocol === "https:") && username === "" ? href : undefined;
  } catch {
    return undefined;
  }
}

/** What a row shows below the name. */
export function factsOf(s: NetworkServer): string {
  const where = s.devices.length > 0 ? s.devices.join(", ") : `${s.address}:${s.port}`;
  return [where, s.version && `version ${s.version}`, s.tls && "TLS"].filter(Boolean).join("; ");
}

/** Calls back twice a minute while the page is visible; the last list stays when the server does not respond. */
export function pollServers(onServers: (servers: NetworkServer[]) => void): void {
  const poll = async (): Promise<void> => {
    try {
      const response = document.hidden
        ? undefined
        : await fetch("/api/servers", { signal: AbortSignal.timeout(PATIENCE_MS) });
      if (response?.ok) onServers(((await response.json()) as { servers: NetworkServer[] }).servers);
    } catch {
      // pollState() reports that the server does not respond.
    }
    window.setTimeout(() => void poll(), EVERY_MS);
  };
  void poll();
}
