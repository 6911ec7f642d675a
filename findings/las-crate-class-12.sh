#!/usr/bin/env bash
# las 0.9.11 (Rust) on files of laspy 2.7.0: class 12 is read as class 1 with a flag, in format 6
# without the flag.
#
# Expected: a reader reports the class that is stored, or, translating to LAS 1.4, makes of class
# 12 of formats 0 to 5 the flag "overlap"; a class 12 of format 6 (reserved there) stays 12 or is
# an error.
# Seen: format 3: Unclassified with is_overlap, so `points.filter(classification == 12)` finds
# nothing that laspy finds. Format 6: Unclassified and no flag: the mark is gone. (laspy reads 12
# in both, and so writes files that lose it here.)
# So: ask for "class 12 or overlap" in every tool; classes read by the two libraries cannot be
# compared one to one; the Rust crate cannot write class 12.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import laspy
import numpy as np

for number, version in ((3, "1.2"), (6, "1.4")):
    las = laspy.LasData(laspy.LasHeader(point_format=number, version=version))
    las.x = las.y = las.z = np.arange(3.0)
    las.classification = np.array([2, 12, 7])
    las.write(f"{sys.argv[1]}/{number}.las")
    print("laspy, format", number, np.array(laspy.read(f"{sys.argv[1]}/{number}.las").classification).tolist())
PY
mkdir -p "$dir/read/src"
cat > "$dir/read/Cargo.toml" <<'TOML'
[package]
name = "read"
version = "0.1.0"
edition = "2021"

[dependencies]
las = { version = "=0.9.11", default-features = false }
TOML
cat > "$dir/read/src/main.rs" <<'RS'
fn main() {
    for path in std::env::args().skip(1) {
        let mut reader = las::Reader::from_path(&path).unwrap();
        let points: Vec<String> = reader
            .points()
            .map(|point| point.unwrap())
            .map(|point| format!("{}{}", u8::from(point.classification), if point.is_overlap { "+overlap" } else { "" }))
            .collect();
        println!("{}", points.join(" "));
    }
}
RS
cd "$dir/read"
cargo build -q
./target/debug/read "$dir/3.las" "$dir/6.las" | tee "$dir/out" | sed 's/^/las crate: /'
[ "$(cat "$dir/out")" = "2 1+overlap 7
2 1 7" ] || { echo "changed: the crate reads other classes" >&2; exit 1; }
