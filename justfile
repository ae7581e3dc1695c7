# Every command a developer needs; CI (.ci/run) uses the same ones.

venv := justfile_directory() / ".venv"
python := venv / "bin/python"

# The interpreter that lints of the extension module look at.
export PYO3_PYTHON := python

memcheck := "valgrind -q --error-exitcode=1 --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite --fair-sched=yes"

# List the commands
_list:
    @{{ just_executable() }} --list --unsorted --justfile {{ justfile() }}

# Make the virtual environment .venv if it is not there
_venv:
    @test -x {{ python }} || python3 -m venv {{ venv }}

# Build the Python package and install it into .venv, with what its tests need
install: _venv
    {{ python }} -m pip install '.[test]'

# All tests, Rust and Python
test: test-rust test-python

# Rust tests (one name as argument: only tests with it)
test-rust *args:
    cargo test --release {{ args }}

# Python tests over the installed package, the README's commands and code among them
test-python *args: install
    {{ python }} -m pytest tests/python {{ args }}

# Python tests with a framework that needs an environment of its own (`just test-face torch`; also jax, ray, rllib, torchrl)
test-face name *args:
    python3 -m venv .venv/faces/{{ name }}
    .venv/faces/{{ name }}/bin/pip install '.[test,{{ name }}]'
    .venv/faces/{{ name }}/bin/python -m pytest tests/python {{ args }}

# Recorded battles of the published environment, one line a file (SMACLITE_TRACES=folder for others)
conformance:
    cargo test --release -p smaclite-tests --test conformance -- --nocapture

# Battles side by side with the published environment (--help; SMACLITE_PYTHON=its interpreter)
differential *args:
    PYTHONPATH={{ justfile_directory() }}/tests "${SMACLITE_PYTHON:-{{ python }}}" -m differential {{ args }}

# A random policy on the embedded default: steps/s and returns
demo *args: install
    {{ python }} bindings/examples/random_policy.py {{ args }}

# Steps per second (`just bench --help` for the options)
bench *args:
    cargo run --release --quiet -p smaclite-ipc --bin smaclite-pool -- bench {{ args }}

# Figures of the pool beside their baselines, for benches/README.md (transport, efficiency, asynchronous, many, engine, instructions)
figures *args:
    cargo build --release --quiet -p smaclite-ipc
    cargo run --release --quiet -p smaclite-benches -- {{ args }}

# Kill, stop and restart the processes of pools at random for so long; exit status 0 if every invariant held
torture minutes seed:
    cargo run --release --quiet -p smaclite-tests --bin torture -- {{ minutes }} {{ seed }}

# The same for 15 minutes, long enough for what grows slowly to show
soak seed="1": (torture "15" seed)

# Every interleaving of the hand-off between threads, by loom
loom $RUSTFLAGS="--cfg loom":
    cargo test --release -p smaclite-pool --target-dir target/loom hand_off

# Fuzz everything that reads what others wrote, so many seconds for each target (installs cargo-fuzz; stable Rust will do)
fuzz seconds="60" $RUSTC_BOOTSTRAP="1":
    @command -v cargo-fuzz >/dev/null || RUSTC_BOOTSTRAP=0 cargo install --locked cargo-fuzz
    for target in scenario_file unit_file request frame; do \
        mkdir -p tests/fuzz/corpus/$target || exit; \
        cargo fuzz run --fuzz-dir tests/fuzz --release --debug-assertions $target \
            tests/fuzz/corpus/$target tests/fuzz/seeds/$target -- \
            -max_total_time={{ seconds }} -dict=tests/fuzz/json.dict -verbosity=0 -print_final_stats=1 || exit; \
    done

# Engine, layout and pool under valgrind: memory that is read uninitialised, out of bounds, or lost
valgrind $CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER=memcheck:
    cargo test --release -p smaclite-engine -p smaclite-pool

# The unsafe code of the pool by Miri's rules (needs `rustup toolchain install nightly --component miri`)
miri:
    cargo +nightly miri test --target-dir target/miri -p smaclite-pool --lib

# Everything in release mode, with the program in target/release/smaclite-pool
build:
    cargo build --release

# Format all code
fmt:
    cargo fmt --all

# Formatting and lints, warnings being errors
lint: _venv
    cargo fmt --all --check
    cargo clippy --workspace --all-targets -- -D warnings

# API documentation of all Rust crates, in target/doc
docs $RUSTDOCFLAGS="-D warnings":
    cargo doc --no-deps

# The documentation site, in site/
site: install
    {{ python }} -m pip install mkdocs-material 'mkdocstrings[python]'
    {{ python }} -m mkdocs build
