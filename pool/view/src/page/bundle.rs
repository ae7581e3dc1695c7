//! Modules of JavaScript as one script, and style sheets as one, for pages that load no other file.
//!
//! The modules share one scope, in which the names at their top level are those that their authors wrote: an
//! import disappears, and `export` becomes the declaration behind it. So the names must be different, and
//! neither `import * as`, `as` nor `export default` is possible; a page with a mistake is a script that does
//! not run, which the tests of the pages find.

/// A module of JavaScript.
#[derive(Clone, Copy, Debug)]
pub struct Module {
    /// The path by which others import it, such as `view/track.js`. `#view/track.js` is `view/track.js`, from
    /// everywhere; `./track.js` is another module of the same folder.
    pub path: &'static str,
    /// The text.
    pub text: &'static str,
}

/// The text of a module and of those that it imports, each once and after those that it imports itself.
pub(super) fn bundle(entry: &str, modules: &[&[Module]]) -> String {
    let mut bundle = Bundle { modules, done: Vec::new(), script: String::new() };
    bundle.add(entry.to_owned());
    bundle.script
}

/// The texts of style sheets as one, without comments.
pub(super) fn styles(sheets: &[&str]) -> String {
    sheets.iter().map(|sheet| without(sheet, "/*")).collect()
}

/// A text without its comments that begin so and end with `*/`. No string of it may contain what begins one.
fn without(text: &str, begin: &str) -> String {
    let mut parts = text.split(begin);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once("*/").map_or("", |(_comment, after)| after))
}

struct Bundle<'a> {
    modules: &'a [&'a [Module]],
    done: Vec<String>,
    script: String,
}

impl Bundle<'_> {
    fn add(&mut self, path: String) {
        if self.done.contains(&path) {
            return;
        }
        let module =
            self.modules.iter().flat_map(|modules| modules.iter()).find(|module| module.path == path);
        let Some(module) = module else {
            debug_assert!(false, "there is no module {path}");
            return;
        };
        self.done.push(path);
        let parts = parts(module.text);
        for import in parts.imports {
            self.add(resolved(module.path, import));
        }
        self.script.push_str(&parts.body);
    }
}

struct Parts<'a> {
    /// What is imported, as it is written.
    imports: Vec<&'a str>,
    /// The rest, without `export`, comments and indentation: no string goes over several lines.
    body: String,
}

fn parts(text: &str) -> Parts<'_> {
    let mut parts = Parts { imports: Vec::new(), body: String::with_capacity(text.len()) };
    let (mut is_import, mut is_comment) = (false, false);
    for line in text.split_inclusive('\n') {
        is_import |= line.starts_with("import ");
        // A third of the text is comments on lines of their own, or types before expressions.
        let code = line.trim();
        is_comment |= code.starts_with("/**") && (code.ends_with("*/") || !code.contains("*/"));
        if is_comment || code.starts_with("//") {
            is_comment &= !code.ends_with("*/");
            continue;
        }
        if is_import {
            // The names may take several lines; the last one ends with `from "path";`.
            parts.imports.extend(line.split('"').nth(1));
            is_import = !line.trim_end().ends_with(';');
        } else {
            let line = line.strip_prefix("export ").unwrap_or(line).trim_start();
            parts.body.push_str(&without(line, "/** @type "));
        }
    }
    parts
}

/// The path of a module that another one imports.
fn resolved(importer: &str, import: &str) -> String {
    if let Some(path) = import.strip_prefix('#') {
        return path.to_owned();
    }
    let mut path: Vec<&str> = importer.split('/').collect();
    path.pop();
    for part in import.split('/') {
        match part {
            "." => {}
            ".." => drop(path.pop()),
            part => path.push(part),
        }
    }
    path.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bundle_has_each_module_once_after_what_it_imports() {
        let page = [
            Module {
                path: "watch/page.js",
                text: "import { A } from \"#view/a.js\";\nimport {\n  B,\n  C,\n} from \"../b.js\";\nA(B);\n",
            },
            Module {
                path: "b.js",
                text: "import { A } from \"#view/a.js\";\nexport const B = A(\"import x\");\n",
            },
        ];
        let view = [Module { path: "view/a.js", text: "export function A() {}\nexport class C {}\n" }];
        let expected = "function A() {}\nclass C {}\nconst B = A(\"import x\");\nA(B);\n";
        assert_eq!(bundle("watch/page.js", &[&page, &view]), expected);
    }

    #[test]
    fn comments_and_indentation_are_left_out() {
        let text = "// @ts-check\n/** @typedef {A} B */\n/**\n * A.\n */\nexport const a =\n  \
             /** @type {B} */ (1); // one\n";
        let modules = [Module { path: "a.js", text }];
        assert_eq!(bundle("a.js", &[&modules]), "const a =\n (1); // one\n");
    }

    #[test]
    fn comments_of_styles_are_left_out() {
        let sheets = ["/* a */\nb { c: d; } /* e\nf */\n", "g { h: i; }\n"];
        assert_eq!(styles(&sheets), "\nb { c: d; } \ng { h: i; }\n");
    }

    #[test]
    fn modules_that_import_each_other_are_added_once() {
        let modules = [
            Module { path: "a.js", text: "import { b } from \"./b.js\";\nexport const a = () => b;\n" },
            Module { path: "b.js", text: "import { a } from \"./a.js\";\nexport const b = () => a;\n" },
        ];
        assert_eq!(bundle("a.js", &[&modules]), "const b = () => a;\nconst a = () => b;\n");
    }
}
