//! No modules of a crate depend on each other in a circle: each can be read after those that it uses. A
//! module and those inside it may use each other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const CRATES: &str = "units scenarios pool/engine pool pool/view pool/playground ipc bindings \
     bindings/recorder bindings/learn bindings/lab bindings/cli benches tests";

const DECLARES: [&str; 8] = ["struct", "enum", "trait", "fn", "type", "const", "static", "macro_rules"];

/// More modules pass on no name.
const MAX_HOPS: usize = 9;

type Module = Vec<String>;

#[test]
fn no_crate_has_a_cycle_of_modules() {
    for name in CRATES.split_whitespace() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("src");
        let mut sources = BTreeMap::new();
        read_modules(&root, &mut vec![], &mut sources);
        assert!(!sources.is_empty(), "{name} has no modules");
        let circle = Crate::new(sources).circle();
        assert!(circle.is_empty(), "{name}: these modules use each other in a circle: {circle:?}");
    }
}

/// The sources of all modules, without comments and inline tests. The root of the crate is `[]`.
fn read_modules(folder: &Path, parent: &mut Module, sources: &mut BTreeMap<Module, String>) {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    for path in entries.collect::<Vec<PathBuf>>() {
        let name = path.file_stem().expect("a name").to_str().expect("UTF-8").to_owned();
        let is_inside = !["lib", "main", "mod"].contains(&name.as_str());
        parent.extend(is_inside.then_some(name));
        if path.is_dir() {
            read_modules(&path, parent, sources);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(&path).expect("text");
            let code = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default().lines();
            let code = code.map(|line| line.split("//").next().unwrap_or_default());
            *sources.entry(parent.clone()).or_default() += &code.collect::<Vec<_>>().join("\n");
        }
        parent.truncate(parent.len() - usize::from(is_inside));
    }
}

/// The paths of a source that begin so. Braces end a path, as rustfmt's output has them.
fn paths<'a>(source: &'a str, start: &'a str) -> impl Iterator<Item = String> + 'a {
    let is_part = |c: char| c.is_alphanumeric() || ":_".contains(c);
    let begins = source.match_indices(start).map(|(at, _)| at);
    begins.filter(move |at| !source[..*at].ends_with(is_part)).flat_map(move |at| {
        let text = source[at..].strip_prefix("use ").unwrap_or(&source[at..]);
        let (path, rest) = text.split_at(text.find(|c| !is_part(c)).unwrap_or(text.len()));
        let names = match rest.strip_prefix('{') {
            Some(names) => names.split('}').next().unwrap_or_default(),
            // `*`, or another name for what is imported.
            None if rest.starts_with(['*', ' ']) => rest.split([';', '\n']).next().unwrap_or_default(),
            None => "",
        };
        names.split(',').map(move |name| format!("{path}{}", name.trim_end()))
    })
}

/// The name by which a module imports a path, and the path.
fn imported(path: String) -> (String, String) {
    let (path, name) = match path.split_once(" as ") {
        Some((path, name)) => (path, name),
        None => (&path[..], path.rsplit("::").next().unwrap_or_default()),
    };
    (name.trim().to_owned(), path.to_owned())
}

struct Crate {
    sources: BTreeMap<Module, String>,
    /// By module: the names that it imports, and so gives to others or to the modules inside it, with their
    /// paths.
    names: BTreeMap<Module, Vec<(String, String)>>,
}

impl Crate {
    fn new(sources: BTreeMap<Module, String>) -> Crate {
        let names = |source: &String| paths(source, "use ").map(imported).collect();
        let names = sources.iter().map(|(module, source)| (module.clone(), names(source))).collect();
        Crate { sources, names }
    }

    /// The modules that use themselves by way of others.
    fn circle(&self) -> Vec<Module> {
        let uses: BTreeMap<&Module, BTreeSet<Module>> =
            self.sources.keys().map(|module| (module, self.used_modules(module))).collect();
        let uses_itself = |module: &&Module| {
            let (mut reached, mut next) = (BTreeSet::new(), vec![*module]);
            while let Some(used) = next.pop().and_then(|module| uses.get(module)) {
                next.extend(used.iter().filter(|module| reached.insert(*module)));
            }
            reached.contains(module)
        };
        self.sources.keys().filter(uses_itself).cloned().collect()
    }

    /// The modules that paths from `crate` or `super` lead to, without those around and inside of the module.
    fn used_modules(&self, module: &Module) -> BTreeSet<Module> {
        let source = &self.sources[module];
        let paths = ["crate::", "super::"].into_iter().flat_map(|start| paths(source, start));
        let used = paths.map(|path| self.resolve(module.clone(), &imported(path).1));
        used.filter(|used| !used.starts_with(module) && !module.starts_with(used)).collect()
    }

    /// Follows a path to the module that declares what it names, also where others import that and pass it
    /// on.
    fn resolve(&self, module: Module, path: &str) -> Module {
        self.follow(module, path, 0)
    }

    fn follow(&self, mut module: Module, path: &str, hops: usize) -> Module {
        let mut segments = path.split("::").map(str::trim).filter(|name| !name.is_empty());
        while let Some(name) = segments.next() {
            match name {
                "crate" => module.clear(),
                "super" => drop(module.pop()),
                "self" => {}
                _ => {
                    module.push(name.to_owned());
                    if !self.sources.contains_key(&module) {
                        module.pop();
                        // The `super` of a module inside a file is that file, which here is taken for the one
                        // around it.
                        let path = self.passed_on(&module, name).filter(|_| hops < MAX_HOPS);
                        let Some(path) = path else { break };
                        let rest = segments.collect::<Vec<_>>().join("::");
                        return self.follow(module, &format!("{path}::{rest}"), hops + 1);
                    }
                }
            }
        }
        module
    }

    /// The path of a name in a module that does not declare it; `None` if it does, or has it from another
    /// crate.
    fn passed_on(&self, module: &Module, name: &str) -> Option<String> {
        let mut names = self.names.get(module)?.iter().filter(|(_, path)| {
            let first = path.split("::").next().unwrap_or_default();
            let child = [&module[..], &[first.to_owned()]].concat();
            ["crate", "super", "self"].contains(&first) || self.sources.contains_key(&child)
        });
        let all_of = |path: &str| {
            let from = self.resolve(module.clone(), path.trim_end_matches("::*"));
            self.sources.get(&from).is_some_and(|source| {
                let words = source.split(|c: char| !c.is_alphanumeric() && c != '_');
                words.clone().zip(words.skip(1)).any(|(kind, word)| DECLARES.contains(&kind) && word == name)
            })
        };
        let is_it =
            |(imported, path): &&(String, String)| imported == name || imported == "*" && all_of(path);
        names.find(is_it).map(|(_, path)| path.replace('*', name))
    }
}

/// The test once followed paths only as far as they named modules, so it saw no import of a name that another
/// module passes on, and missed five cycles.
#[test]
fn a_cycle_by_way_of_a_name_that_is_passed_on_is_seen() {
    let sources = [
        ("", "pub use front::{Other as Renamed, Thing};\npub use smaclite_units::Problem;"),
        ("front", "pub(crate) use inner::Thing;\npub use crate::other::Other;"),
        ("front inner", "use crate::{Problem, Renamed};\npub struct Thing;"),
        ("other", "use crate::Thing;\npub struct Other;"),
        ("all", "pub use deep::*;"),
        ("all deep", "pub struct Deep;"),
        ("last", "use crate::all::Deep;"),
    ];
    let module = |path: &str| -> Module { path.split_whitespace().map(str::to_owned).collect() };
    let sources: BTreeMap<_, _> = sources.map(|(path, source)| (module(path), source.to_owned())).into();
    let found = Crate::new(sources);
    for (from, to) in
        [("front inner", "other"), ("other", "front inner"), ("front", "other"), ("last", "all deep")]
    {
        assert_eq!(found.used_modules(&module(from)), BTreeSet::from([module(to)]), "{from}");
    }
}
