//! No modules of a crate depend on each other in a circle: each can be read after those that it uses. A
//! module and the modules inside it count as one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Without `bindings`, where `Envs.render` draws with a `Renderer`, which can be made of `Envs`.
const CRATES: &str = "units scenarios pool/engine pool pool/view pool/playground ipc bindings/recorder \
     bindings/learn bindings/cli benches tests";

type Module = Vec<String>;

#[test]
fn no_crate_has_a_cycle_of_modules() {
    for name in CRATES.split_whitespace() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("src");
        let mut sources = BTreeMap::new();
        read_modules(&root, &mut vec![], &mut sources);
        assert!(!sources.is_empty(), "{name} has no modules");
        let uses: BTreeMap<&Module, BTreeSet<Module>> =
            sources.iter().map(|(module, source)| (module, used_modules(module, source, &sources))).collect();
        for module in sources.keys() {
            let (mut reached, mut next) = (BTreeSet::new(), vec![module]);
            while let Some(used) = next.pop().and_then(|module| uses.get(module)) {
                next.extend(used.iter().filter(|module| reached.insert(*module)));
            }
            assert!(
                !reached.contains(module),
                "{name}: {module:?} uses itself by way of some of {reached:?}"
            );
        }
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

/// The modules that paths from `crate` or `super` lead to, without those around and inside of the module.
/// Braces end a path, as rustfmt's output has them.
fn used_modules(module: &Module, source: &str, all: &BTreeMap<Module, String>) -> BTreeSet<Module> {
    let mut used = BTreeSet::new();
    for start in ["crate::", "super::"] {
        for (at, _) in source.match_indices(start).filter(|(at, _)| !source[..*at].ends_with("::")) {
            let text = &source[at..];
            let end = text.find(|c: char| !c.is_alphanumeric() && !['_', ':'].contains(&c));
            let (path, rest) = text.split_at(end.unwrap_or(text.len()));
            let names = rest.strip_prefix('{').and_then(|rest| rest.split('}').next()).unwrap_or_default();
            used.extend(
                names.split(',').map(|name| resolve(module.clone(), &format!("{path}::{name}"), all)),
            );
        }
    }
    used.retain(|used| !used.starts_with(module) && !module.starts_with(used));
    used
}

/// Follows a path as long as it names modules.
fn resolve(mut module: Module, path: &str, all: &BTreeMap<Module, String>) -> Module {
    for name in path.split("::").map(str::trim).filter(|name| !name.is_empty()) {
        match name {
            "crate" => module.clear(),
            "super" => drop(module.pop()),
            _ => {
                module.push(name.to_owned());
                if !all.contains_key(&module) {
                    module.pop();
                    break;
                }
            }
        }
    }
    module
}
