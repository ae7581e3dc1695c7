//! Modules of JavaScript as one script, for pages that load no other file.
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
    /// The rest, without `export` and without comments.
    body: String,
}

fn parts(text: &str) -> Parts<'_> {
    let mut parts = Parts { imports: Vec::new(), body: String::with_capacity(text.len()) };
    let (mut is_import, mut is_comment) = (false, false);
    for line in text.split_inclusive('\n') {
        is_import |= line.starts_with("import ");
        // A third of the text is comments on lines of their own. A type before an expression stays.
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
            parts.body.push_str(line.strip_prefix("export ").unwrap_or(line));
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
    fn comments_are_left_out() {
        let text = "// @ts-check\n/** @typedef {A} B */\n/**\n * A.\n */\nexport const a =\n  \
             /** @type {B} */ (1); // one\n";
        let modules = [Module { path: "a.js", text }];
        assert_eq!(bundle("a.js", &[&modules]), "const a =\n  /** @type {B} */ (1); // one\n");
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
