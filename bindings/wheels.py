"""Builds the wheels of a release, and the source distribution, in dist/: `just wheels`.

The same commit and the same compilers make the same files, byte for byte, in whatever folder: what a wheel
holds of the machine that built it is replaced. So anyone can check that a published wheel is made of the
published source.

The linker is zig, but for Windows: there maturin exports a name that only GNU's linker takes, which is
Debian's gcc-mingw-w64-x86-64-posix.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST = ROOT / "dist"
ZIG = ["--zig"]
LINUX = [*ZIG, "--compatibility", "manylinux2014"]
# The target of each system, the libraries that it needs, and the options of maturin.
SYSTEMS = {
    "x86_64": ("x86_64-unknown-linux-gnu", ["x86_64-unknown-linux-gnu"], LINUX),
    "aarch64": ("aarch64-unknown-linux-gnu", ["aarch64-unknown-linux-gnu"], LINUX),
    "macos": ("universal2-apple-darwin", ["aarch64-apple-darwin", "x86_64-apple-darwin"], ZIG),
    "windows": ("x86_64-pc-windows-gnu", ["x86_64-pc-windows-gnu"], []),
}
# The interfaces of CPython that wheels use: the stable one of all versions since 3.10, and that of
# free-threaded 3.14, which has none that is stable.
INTERPRETERS: tuple[list[str], ...] = ([], ["--interpreter", "python3.14t"])

# Where shells look for the completions of programs, in the folder `share`.
COMPLETIONS = {
    "bash": "bash-completion/completions/smaclite-pool",
    "zsh": "zsh/site-functions/_smaclite-pool",
    "fish": "fish/vendor_completions.d/smaclite-pool.fish",
}


def output(*command: str) -> str:
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def run(*command: str) -> None:
    subprocess.run(command, cwd=ROOT, check=True)


def maturin(*args: str) -> None:
    run(sys.executable, "-m", "maturin", *args)


def neutral_paths() -> list[str]:
    """Options of maturin by which panic messages name no folder of this machine."""
    cargo = os.environ.get("CARGO_HOME") or str(Path.home() / ".cargo")
    # What is compiled of the standard library has its path in the compiler's own build, or that of the
    # library's sources, where they are installed.
    compiler = output(os.environ.get("RUSTC", "rustc"), "-vV")
    (commit,) = (line.split()[1] for line in compiler.splitlines() if line.startswith("commit-hash"))
    library = f"{rust('sysroot')}/lib/rustlib/src/rust"
    # Of several that fit, the last one holds.
    folders = {str(ROOT): ".", cargo: "cargo", library: f"/rustc/{commit}"}
    flags = [f"--remap-path-prefix={folder}={name}" for folder, name in folders.items()]
    # Added to those of .cargo/config.toml, which the variable RUSTFLAGS would replace.
    return ["--config", f"target.'cfg(all())'.rustflags={flags!r}"]


def rust(what: str, *args: str) -> str:
    return output(os.environ.get("RUSTC", "rustc"), "--print", what, *args)


def write_share(share: Path) -> None:
    """Writes the man pages and the completions of shells, as the program of this machine prints them."""
    run("cargo", "build", "--locked", "--release", "--bin", "smaclite-pool")
    program = ROOT / "target/release/smaclite-pool"
    run(str(program), "man", "--out", str(share / "man/man1"))
    for shell, file in COMPLETIONS.items():
        # The script runs the program by the name by which it was run itself.
        command = ["smaclite-pool", "completions", shell]
        script = subprocess.run(command, executable=program, check=True, capture_output=True).stdout
        (share / file).parent.mkdir(parents=True)
        (share / file).write_bytes(script)


def build(system: str, share: Path) -> None:
    target, libraries, options = SYSTEMS[system]
    for library in libraries:
        if not Path(rust("target-libdir", "--target", library)).is_dir():
            run("rustup", "target", "add", library)
    for interpreter in INTERPRETERS:
        with tempfile.TemporaryDirectory(dir=DIST) as folder:
            maturin(
                *["build", "--release", "--target", target, *interpreter, *options, "--target-dir", "target"],
                *["--out", folder, *neutral_paths()],
            )
            finish(Path(folder), share)


def finish(folder: Path, share: Path) -> None:
    """Adds the files of `share` to the wheel in a folder, and moves it to `DIST`."""
    (wheel,) = folder.glob("*.whl")
    run(sys.executable, "-m", "wheel", "unpack", "--dest", str(folder), str(wheel))
    # The list of crates (SBOM) names those of this repository by their folder.
    (unpacked,) = (path for path in folder.iterdir() if path.is_dir())
    for sbom in unpacked.glob("*.dist-info/sboms/*"):
        sbom.write_text(sbom.read_text().replace(f"{ROOT.as_uri()}/", "file:///"))
    shutil.copytree(share, unpacked / f"{unpacked.name}.data/data/share")
    run(sys.executable, "-m", "wheel", "pack", "--dest-dir", str(DIST), str(unpacked))


def main() -> None:
    unknown = [system for system in sys.argv[1:] if system not in SYSTEMS]
    if unknown:
        sys.exit(f"error: no wheel is built for {unknown[0]}: name some of {', '.join(SYSTEMS)}")
    # The time that archives and the list of crates state; that of the last commit.
    if "SOURCE_DATE_EPOCH" not in os.environ:
        os.environ["SOURCE_DATE_EPOCH"] = output("git", "log", "-1", "--format=%ct")
    DIST.mkdir(exist_ok=True)
    # Not `build --sdist`, which builds from the distribution: its files are as old as in every other one, so
    # cargo takes what it built of an earlier version for up to date.
    maturin("sdist", "--out", str(DIST))
    with tempfile.TemporaryDirectory() as folder:
        write_share(Path(folder))
        for system in sys.argv[1:] or SYSTEMS:
            build(system, Path(folder))


if __name__ == "__main__":
    main()
