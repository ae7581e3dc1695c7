#!/usr/bin/env bash
# Builds the pages of the playground and of the editor, battle.html and editor.html in target/playground: the engine
# for WebAssembly, and the documents around it. `just playground` runs this; `build.sh --check` only says whether it can.
#
# With the sources of the standard library that is built too, for size (a tenth less). Otherwise the target must be
# installed. Debian's compiler is used if the usual one has neither. wasm-opt (Debian: binaryen) makes the engine
# another tenth smaller, if it is there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

target=wasm32-unknown-unknown
cargo=${CARGO:-cargo}
can_build() {
    library=$("$1" --print sysroot 2>/dev/null)/lib/rustlib
    [ -e "$library/src/rust/library/std/Cargo.toml" ] || [ -d "$library/$target" ]
}
if can_build "${RUSTC:-rustc}"; then
    compiler=("${RUSTC:-rustc}" "$cargo")
elif can_build /usr/bin/rustc; then
    compiler=(/usr/bin/rustc /usr/bin/cargo)
else
    echo "no playground: Rust has no target $target (rustup target add $target, or Debian's rustc-web," \
        "cargo-web, rust-web-src and lld; see CONTRIBUTING.md)" >&2
    exit 3
fi
linker=() std=()
# rustup's compiler has a linker for WebAssembly, Debian's needs that of the package lld.
test -n "$(find "$library" -name rust-lld -print -quit 2>/dev/null)" ||
    linker=(-C "linker=$(command -v wasm-ld || command -v wasm-ld-14 || echo wasm-ld)")
test ! -e "$library/src/rust/library/std/Cargo.toml" ||
    std=("-Zbuild-std=std,panic_abort" -Zbuild-std-features=optimize_for_size)
test "${1:-}" != --check || exit 0

# The standard library of stable compilers is built, and positions in the source are left out of panics, with flags
# that only differ from stable ones in that they may change.
RUSTC=${compiler[0]} RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zlocation-detail=none ${linker[*]}" \
    "${compiler[1]}" rustc --quiet --package smaclite-playground --lib --crate-type cdylib \
    --profile playground --target $target --target-dir target/playground "${std[@]}"
built=target/playground/$target/playground/smaclite_playground.wasm
optimised=target/playground/optimised.wasm
if ! command -v wasm-opt >/dev/null; then
    optimised=$built
elif ! cmp --silent "$built" $optimised.of || ! [ $optimised -nt pool/playground/build.sh ]; then # a quarter of a minute
    # Functions that are called most have the shortest numbers.
    wasm-opt --flatten --rereloop -Oz --converge --dae-optimizing --reorder-functions -Oz \
        --enable-bulk-memory --enable-sign-ext --enable-nontrapping-float-to-int --enable-mutable-globals \
        "$built" -o $optimised.part
    mv $optimised.part $optimised
    cp "$built" $optimised.of
fi
engine=target/playground/engine.wasm
cp "$optimised" $engine
# With the team of the zoo that plays every map. Named without its package, the program shares the builds of all others.
"$cargo" run --release --quiet --bin smaclite-playground -- \
    $engine target/playground bindings/learn/zoo/all-maps
