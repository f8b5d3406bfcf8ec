// The servers of the network: what is shown of texts that other machines choose.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { factsOf, linkOf } = await bundled("servers.ts");

test("links lead to web pages only", () => {
  assert.equal(linkOf("http://10.0.0.9:8080/"), "http://10.0.0.9:8080/");
  assert.equal(linkOf("https://10.0.0.9:8080/"), "https://10.0.0.9:8080/");
  for (const page of ["", "/", "attic", "//10.0.0.9/", "javascript:alert(1)", " javascript:alert(1)", "JaVaScRiPt:alert(1)", "data:text/html,x", "file:///etc/passwd", "http://", "http://lab7@10.0.0.9/"])
    assert.equal(linkOf(page), undefined, page);
});

test("a server is described by its devices, or by its address", () => {
  const server = { name: "attic", address: "10.0.0.9", port: 3883, devices: [], page: "", tls: false, version: "", this_server: false };
  assert.equal(factsOf(server), "10.0.0.9:3883");
  const devices = ["Arm@10.0.0.9:3883", "Left@10.0.0.9:3883"];
  assert.equal(factsOf({ ...server, devices, tls: true, version: "1.2.3" }), "Arm@10.0.0.9:3883, Left@10.0.0.9:3883; version 1.2.3; TLS");
});
