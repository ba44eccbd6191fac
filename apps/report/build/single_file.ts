// SPDX-License-Identifier: BSD-3-Clause
// Puts script and style into the page and allows them, by their SHA-256, and nothing else.
import { createHash } from "node:crypto";
import type { Plugin } from "vite";

const sha256 = (text: string) =>
  `'sha256-${createHash("sha256").update(text, "utf8").digest("base64")}'`;

function policy(script: string, style: string): string {
  return [
    "default-src 'none'",
    `script-src ${sha256(script)}`,
    `style-src ${sha256(style)}`,
    "img-src data: blob:",
    "base-uri 'none'",
    "form-action 'none'",
  ].join("; ");
}

export function singleFile(): Plugin {
  return {
    name: "cairn-single-file",
    enforce: "post",
    generateBundle(_, bundle) {
      const files = Object.values(bundle);
      const page = files.find((f) => f.fileName.endsWith(".html"));
      if (!page || page.type !== "asset") this.error("no page in the bundle");
      const scripts = files.filter((f) => f.type === "chunk");
      const styles = files.filter((f) => f.fileName.endsWith(".css"));
      if (scripts.length !== 1 || styles.length !== 1) this.error("expected one script and one style");
      const script = scripts[0].type === "chunk" ? scripts[0].code.trim() : "";
      const style = styles[0].type === "asset" ? String(styles[0].source).trim() : "";
      // Either would end its element early; then the hash would not match and the page stay empty.
      if (/<\/script|<!--/i.test(script) || /<\/style/i.test(style)) this.error("script or style ends its element");
      // Functions as replacements: "$&" in the script is no pattern.
      const html = String(page.source)
        .replace(/\s*<script[^>]*type="module"[^>]*><\/script>/, "")
        .replace(/\s*<link[^>]*rel="stylesheet"[^>]*>/, "")
        .replace("@POLICY@", () => policy(script, style))
        .replace("</head>", () => `<style>${style}</style>\n</head>`)
        .replace("</body>", () => `<script type="module">${script}</script>\n</body>`);
      if (html.split("@CAIRN_DATA@").length !== 2) this.error("the placeholder must stand in the page exactly once");
      if (html.includes("@POLICY@")) this.error("the policy did not get into the page");
      for (const file of files) delete bundle[file.fileName];
      this.emitFile({ type: "asset", fileName: "report.html", source: html });
    },
  };
}
