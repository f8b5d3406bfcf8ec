// The page's modules for tests in node: bundled by esbuild, packages found where web/ has them.
import { createRequire } from "node:module";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

export const sourceDir = join(dirname(fileURLToPath(import.meta.url)), "..", "..");
/** Where `npm ci` has run: a copy of web/ in the build folder, or web/ itself. */
export const webDir = process.env.HAPTICD_WEB_DIR || join(sourceDir, "web");
const require = createRequire(join(webDir, "package.json"));

export const packageNamed = (name) => require(name);

/** Imports a TypeScript module of web/src. */
export async function bundled(path) {
  const folder = await mkdtemp(join(tmpdir(), "hapticd-web-test-"));
  try {
    const outfile = join(folder, "module.mjs");
    await packageNamed("esbuild").build({
      entryPoints: [join(webDir, "src", path)],
      nodePaths: [join(webDir, "node_modules")],
      outfile,
      bundle: true,
      format: "esm",
      platform: "neutral",
      mainFields: ["module", "main"],
      target: "es2022",
      logLevel: "warning",
    });
    return await import(pathToFileURL(outfile).href);
  } finally {
    await rm(folder, { recursive: true });
  }
}
