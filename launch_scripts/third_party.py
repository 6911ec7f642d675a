"""The licences of what a release is made of beside its own sources.

    python3 launch_scripts/third_party.py FILE

Reads Cargo.lock through `cargo metadata`, and viewer/package-lock.json; the sources must have been
fetched (a build has done so). Of the crates those that the binaries are linked with on this
platform, of the npm packages those that are part of the page. Needs no package of PyPI. Exit code 1
if a package has neither a licence text nor a known licence expression.
"""

import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BINARIES = ("maes", "sim_server", "agent_node")
TEXTS = ("licen", "copying", "notice", "unlicense", "copyright")


def crates():
    """Foreign crates that the binaries are linked with: dictionaries of `cargo metadata`, by name."""
    host = next(
        line.split()[1]
        for line in subprocess.run(["rustc", "-vV"], capture_output=True, text=True, check=True).stdout.splitlines()
        if line.startswith("host:")
    )
    features = ["--features=maes/embedded_page"]
    command = ["cargo", "metadata", "--format-version=1", "--locked", f"--filter-platform={host}", *features]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    members = set(metadata["workspace_members"])
    linked = set()
    open_ids = [id for id in members if packages[id]["name"] in BINARIES]
    while open_ids:
        id = open_ids.pop()
        if id in linked:
            continue
        linked.add(id)
        for dependency in nodes[id]["deps"]:
            # Neither what tests need nor what runs while building.
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                open_ids.append(dependency["pkg"])
    foreign = (packages[id] for id in linked - members)
    return sorted(foreign, key=lambda package: (package["name"], package["version"]))


def npm_packages():
    """Packages that are part of the page: (name, entry of the lock file, folder), by name."""
    lock = json.loads((ROOT / "viewer/package-lock.json").read_text())
    for path, entry in sorted(lock["packages"].items()):
        if path and not entry.get("dev") and not entry.get("optional"):
            yield path.split("node_modules/")[-1], entry, ROOT / "viewer" / path


def texts(folder):
    """The licence texts of a package, by name of the file."""
    found = []
    if folder.is_dir():
        for file in sorted(folder.iterdir()):
            if file.is_file() and any(file.name.lower().startswith(start) for start in TEXTS):
                found.append(file.read_text(errors="replace").strip())
    return found


def licences():
    """One text for each package, equal texts once."""
    packages = [
        (f"{package['name']} {package['version']}", package["license"], pathlib.Path(package["manifest_path"]).parent)
        for package in crates()
    ]
    packages += [(f"{name} {entry['version']}", entry.get("license"), folder) for name, entry, folder in npm_packages()]
    unknown = [name for name, licence, folder in packages if not licence and not texts(folder)]
    if unknown:
        sys.exit(f"error: no licence is known of: {', '.join(unknown)}")
    users = {}
    for name, licence, folder in packages:
        for text in texts(folder) or [f"(no text is in the package; its licence is {licence})"]:
            users.setdefault(text, []).append(name)
    lines = ["The programs and the page contain these packages:", ""]
    lines += [f"{name}: {licence or 'see its text'}" for name, licence, _ in packages]
    for text, names in users.items():
        lines += ["", "-" * 78, *(f"{name}" for name in names), "", text]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    pathlib.Path(sys.argv[1]).write_text(licences())
