#!/usr/bin/env python3
"""Builds the root file system of the container image without a container runtime, and uses it.

    launch_scripts/check_image.py PROGRAMS

Takes the last stage of launch_scripts/docker/Dockerfile step by step: `FROM debian` by debootstrap,
`COPY --from=build` from this checkout and, for what cargo builds, from the folder PROGRAMS (that of
the profile `dist`), `RUN` in a chroot. In it, as the user of the image and with its entry point:

- what README and docs/installing.md say of it: `maes run`, `maes verify`, `maes view`
- the services of compose.yaml, with an rclpy node of this machine (launch_scripts/ros_env.sh) that
  starts their run and receives its result
- the pods of a plan for Kubernetes

Containers of one network namespace are processes of this machine. Needs root, debootstrap, and a
Python with ruamel.yaml: that of `tests/python_env.sh recording`. Exit code 1 if a step fails.
"""

from __future__ import annotations

import contextlib
import http.cookiejar
import json
import os
import re
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parent.parent
DOCKER = ROOT / "launch_scripts/docker"

# Where the build stage has its sources, and within them what cargo builds.
SOURCES, BUILT = "/build/", "target/dist/"

OF_CONTAINERS = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C"}


def fail(reason: str) -> NoReturn:
    sys.exit(f"error: {reason}")


def instructions(dockerfile: str) -> list[tuple[str, str]]:
    """Those of the last stage."""
    text = "".join(line for line in dockerfile.splitlines(True) if not line.startswith("#"))
    steps = [line.split(maxsplit=1) for line in text.replace("\\\n", " ").splitlines() if line.strip()]
    first = max(number for number, (word, _) in enumerate(steps) if word == "FROM")
    return [(word, argument) for word, argument in steps[first:]]


class Image:
    """A root file system, with what a container of it runs by default."""

    def __init__(self, folder: Path, programs: Path) -> None:
        self.folder, self.programs = folder, programs
        self.user, self.working_folder = "root", "/"
        self.entry_point: list[str] = []
        self.command: list[str] = []
        for word, argument in instructions((DOCKER / "Dockerfile").read_text()):
            print(f"{word} {argument}", flush=True)
            getattr(self, f"_{word.lower()}", self._unknown)(argument)

    def user_id(self) -> int:
        for line in (self.folder / "etc/passwd").read_text().splitlines():
            name, _, number, *_ = line.split(":")
            if name == self.user:
                return int(number)
        fail(f"USER {self.user}: no such user in the image")

    def _unknown(self, argument: str) -> None:
        fail(f"Dockerfile: this script does not know the instruction before {argument!r}")

    def _from(self, argument: str) -> None:
        name = re.fullmatch(r"debian:(\w+)-slim", argument)
        if name is None:
            fail(f"FROM {argument}: expected debian:SUITE-slim")
        log = self.folder.with_suffix(".log")
        with open(log, "wb") as output:
            base = ["debootstrap", "--variant=minbase", name[1], str(self.folder)]
            if subprocess.call(base, stdout=output, stderr=output):
                fail(f"debootstrap: see {log}")
        subprocess.check_call(["mount", "--types", "proc", "proc", str(self.folder / "proc")])
        subprocess.check_call(["mount", "--bind", "/dev", str(self.folder / "dev")])

    def _copy(self, argument: str) -> None:
        stage, *sources, destination = argument.split()
        if stage != "--from=build":
            fail(f"COPY {argument}: expected --from=build")
        for name in sources:
            if not name.startswith(SOURCES):
                fail(f"COPY {argument}: expected paths in {SOURCES}")
            path = name.removeprefix(SOURCES)
            of_cargo = path.startswith(BUILT)
            source = self.programs / path.removeprefix(BUILT) if of_cargo else ROOT / path
            target = self.folder / destination.lstrip("/")
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target, dirs_exist_ok=True)
            else:
                shutil.copy2(source, target / source.name if destination.endswith("/") else target)

    def _run(self, argument: str) -> None:
        subprocess.check_call(["chroot", str(self.folder), "/bin/sh", "-c", argument])

    def _user(self, argument: str) -> None:
        self.user = argument

    def _workdir(self, argument: str) -> None:
        self.working_folder = argument

    def _entrypoint(self, argument: str) -> None:
        self.entry_point = json.loads(argument)

    def _cmd(self, argument: str) -> None:
        self.command = json.loads(argument)

    def start(
        self,
        command: Sequence[str] | None = None,
        *,
        entry_point: Sequence[str] | None = None,
        environment: Mapping[str, str] | None = None,
        stdout: int | None = None,
        stderr: int | None = None,
    ) -> subprocess.Popen[str]:
        """A container, with what the image runs by default or something else."""
        entry_point = self.entry_point if entry_point is None else entry_point
        command = self.command if command is None else command
        chroot = ["chroot", f"--userspec={self.user}", str(self.folder)]
        in_folder = ["/bin/sh", "-c", 'cd "$0" && exec "$@"', self.working_folder]
        variables = OF_CONTAINERS | {"HOME": self.working_folder} | dict(environment or {})
        started = [*chroot, *in_folder, *entry_point, *command]
        return subprocess.Popen(started, env=variables, text=True, stdout=stdout, stderr=stderr)

    def output(
        self,
        command: Sequence[str] | None = None,
        *,
        entry_point: Sequence[str] | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> str:
        """Standard output of a container that ends well."""
        given = {"entry_point": entry_point, "environment": environment}
        container = self.start(command, **given, stdout=subprocess.PIPE)
        output, _ = container.communicate()
        if container.returncode:
            fail(f"{command}: exit code {container.returncode}")
        return output


def page(url: str) -> str:
    """What a browser gets of an address with a token."""
    cookies = urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
    with urllib.request.build_opener(cookies).open(url) as answer:
        return answer.read().decode()


@contextlib.contextmanager
def running(container: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    try:
        yield container
    finally:
        container.terminate()
        container.wait()


def first_run(image: Image, expected: str) -> None:
    if "Usage: maes" not in image.output():
        fail("the command of the image prints no usage")
    printed = image.output(["run", "--agents", "5", "--record", "run.mcap"])
    if f"digest: {expected}\n" not in printed:
        fail(f"run: {printed}; expected the digest {expected}")
    image.output(["verify", "run.mcap"])
    view = ["view", "run.mcap", "--browser", "false", "--address", "127.0.0.1:0"]
    with running(image.start(view, stdout=subprocess.PIPE)) as viewer:
        if "<title>" not in page(viewer.stdout.readline().strip()):
            fail("the page of the recording is not served")
    print("run, verify, view: as on any machine", flush=True)


def compose(image: Image, expected: str) -> None:
    services = YAML(typ="safe").load((DOCKER / "compose.yaml").read_text())["services"]
    environment = {"MAES_JOIN_SECRET": secrets.token_hex(32)}
    with contextlib.ExitStack() as stack:
        containers = {}
        for name in ("server", "agents"):
            service = services[name]
            if service["image"] != "maes" or set(service["environment"]) != set(environment):
                fail(f"compose.yaml: {name}: expected the image maes, and {list(environment)}")
            container = image.start(
                shlex.split(service["command"]),
                environment=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            containers[name] = stack.enter_context(running(container))
        server = containers["server"].stdout
        address = next(found for line in server if (found := re.search(r":(\d+/\?token=\w+)", line)))
        (port,) = services["server"]["ports"]
        host = port.rpartition(":")[0].rpartition(":")[0]
        if "<title>" not in page(f"http://{host}:{address[1]}"):
            fail("compose.yaml: the page is not served where the port is published")
        observe = 'eval "$(launch_scripts/ros_env.sh)" && exec python3 tests/image_observer.py'
        if subprocess.call(["bash", "-c", observe], cwd=ROOT):
            fail("compose.yaml: the node outside of the containers")
        for name, container in containers.items():
            printed, _ = container.communicate()
            if container.returncode:
                fail(f"compose.yaml: {name}: exit code {container.returncode}: {printed}")
            if name == "server" and f"digest: {expected}\n" not in printed:
                fail(f"compose.yaml: {printed}; expected the digest {expected}")
    image.output(["verify", "run.mcap"])
    print("compose.yaml: server, agents and page, observed by a ROS 2 node", flush=True)


def kubernetes(image: Image) -> None:
    plan = image.folder / "plan"
    plan.mkdir()
    shutil.chown(plan, image.user_id())
    jobs = ["batch", "/usr/share/maes/experiments/plans/quick.toml", "--out", "/plan", "--emit", "k8s", "--parts", "2"]
    image.output(jobs)
    job = YAML(typ="safe").load(plan / "plan.k8s.yaml")["spec"]
    pod = job["template"]["spec"]
    if pod["securityContext"]["fsGroup"] != image.user_id():
        fail("plan.k8s.yaml: the volume is not that of the user of the image")
    pod = pod["containers"][0]
    if pod["image"] != "maes":
        fail(f"plan.k8s.yaml: {pod['image']}, expected the image maes")
    for index in range(job["completions"]):
        environment = {"JOB_COMPLETION_INDEX": str(index)}
        image.output([], entry_point=pod["command"], environment=environment)
    if not (plan / "runs.csv").is_file():
        fail("plan.k8s.yaml: its pods leave no tables")
    print(f"plan.k8s.yaml: {job['completions']} pods, and their tables", flush=True)


def main(arguments: list[str]) -> None:
    if os.geteuid() != 0:
        fail("a chroot needs root")
    if len(arguments) != 1 or not (Path(arguments[0]) / "maes").is_file():
        fail("usage: launch_scripts/check_image.py PROGRAMS, a folder with maes, sim_server, agent_node")
    found = re.search(r"^digest: (\w+)$", (ROOT / "README.md").read_text(), re.MULTILINE)
    folder = Path(tempfile.mkdtemp(prefix="maes-image-")) / "root"
    try:
        image = Image(folder, Path(arguments[0]))
        first_run(image, found[1])
        compose(image, found[1])
        kubernetes(image)
    finally:
        for at in ("proc", "dev"):
            if os.path.ismount(folder / at):
                subprocess.check_call(["umount", str(folder / at)])
        subprocess.call(["rm", "-rf", "--one-file-system", str(folder.parent)])


if __name__ == "__main__":
    main(sys.argv[1:])
