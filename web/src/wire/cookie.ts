// The 24 bytes that either side of a VRPN connection sends first.

export const COOKIE_BYTES = 24;
const VERSION = "vrpn: ver. 07.38";
const MAJOR = "vrpn: ver. 07.";

/** Our cookie; asks the peer to log nothing. */
export function encodeCookie(): Uint8Array {
  const bytes = new Uint8Array(COOKIE_BYTES);
  bytes.set(new TextEncoder().encode(`${VERSION}  0`));
  return bytes;
}

/** The version of the peer, such as "07.38"; throws when it is no VRPN 07. */
export function decodeCookie(bytes: Uint8Array): string {
  const text = new TextDecoder("latin1").decode(bytes.subarray(0, VERSION.length));
  if (!text.startsWith(MAJOR)) throw new Error(`the server opened with "${text}", expected "${MAJOR}xx"`);
  return text.slice("vrpn: ver. ".length);
}
