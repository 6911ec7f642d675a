#!/usr/bin/env bash
# xacro 2.1.1 (PyPI): names that look like numbers become numbers: camera_12e4 is camera_120000.0,
# and wheels 01 and 1 are one.
#
# Expected: `<xacro:property name="id" value="007"/>` and `wheel_${id}` make wheel_007: a property
# is text until it is used in an expression.
# Seen: values that Python reads as int or float are turned into them, in properties and in
# parameters of macros: 007 is 7, 1.50 is 1.5, 12e4 is 120000.0 (a serial number of hexadecimal
# digits), true is True; 0x10 and 1_2 stay text.
# So: begin ids with a letter, put the whole name into the parameter, and look for duplicate links
# after expanding.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check xacro==2.1.1
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import xacro

ids = ("007", "01", "1", "1.50", "12e4", "true", "0x10", "1_2", "a1")
path = sys.argv[1] + "/a.xacro"
open(path, "w").write('<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="wheel" params="id">'
                      '<link name="wheel_${id}"/></xacro:macro>' + "".join(f'<xacro:wheel id="{i}"/>' for i in ids) + "</robot>")
links = [link.getAttribute("name") for link in xacro.process_file(path).getElementsByTagName("link")]
for name, link in zip(ids, links):
    print(f"id {name}: {link}")
expected = ["wheel_" + name for name in ("7", "1", "1", "1.5", "120000.0", "True", "0x10", "1_2", "a1")]
if links != expected:
    sys.exit("changed: links are %s" % links)
PY
