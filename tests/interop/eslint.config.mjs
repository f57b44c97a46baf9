// Rules for the scripts of the explorer's page. They are one script there, so that names are checked on all of them together.
import { createRequire } from "node:module";

const require = createRequire(process.env.ESLINT_MODULES);
const js = require("@eslint/js");

const browser = [
  "addEventListener", "atob", "Blob", "cancelAnimationFrame", "clearInterval", "clearTimeout", "DecompressionStream", "document", "history", "location",
  "matchMedia", "navigator", "Option", "performance", "requestAnimationFrame", "ResizeObserver", "Response", "setInterval", "setTimeout", "URL", "URLSearchParams",
];

export default [
  js.configs.recommended,
  {
    languageOptions: { sourceType: "script", globals: Object.fromEntries(browser.map((name) => [name, "readonly"])) },
    rules: {
      "array-callback-return": "error",
      curly: ["error", "multi-line"],
      eqeqeq: "error",
      "no-implicit-globals": "off",
      "no-shadow": "error",
      "no-unused-vars": ["error", { argsIgnorePattern: "^_" }],
      "no-var": "error",
      "prefer-const": "error",
    },
  },
];
