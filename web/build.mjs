// Bundles the page into the folder $HAPTICD_WEB_OUT (default dist/ beside this file): index.html, viewer.js, read_worker.js,
// viewer.css, viewer.svg, bunny.obj (which the build copies from testdata/meshes).
import { copyFile, mkdir } from "node:fs/promises";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const out = resolve(process.env.HAPTICD_WEB_OUT || join(here, "dist"));

await mkdir(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: { viewer: "src/main.ts", read_worker: "src/mesh/read_worker.ts" },
  outdir: out,
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "none",
  logLevel: "warning",
});
for (const name of ["index.html", "viewer.svg", "bunny.obj"]) await copyFile(join(here, "static", name), join(out, name));
