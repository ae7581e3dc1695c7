import js from "@eslint/js";
import globals from "globals";

export default [
  { ignores: ["target/", ".venv/", "docs/", "site/"] },
  js.configs.recommended,
  {
    files: ["pool/view/page/**/*.js", "pool/playground/page/**/*.js", "bindings/cli/src/web/pages/**/*.js"],
    languageOptions: { globals: globals.browser },
    rules: {
      "no-unused-vars": ["error", { argsIgnorePattern: "^_" }],
      "no-undef": "off",
      eqeqeq: "error",
      "prefer-const": "error",
    }, // tsc knows all names
  },
];
